"""The symbols of a scene: its parameters and the entries of its state, as a textbook writes them.

A parameter called `length` becomes l, one called `frequency` Omega; if two effects have a
stiffness, these are k_1 and k_2. Coordinates keep their labels, and velocities are their
derivatives.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from jaxdyn.scene import Scene
from jaxdyn.symbolic.algebra import Expression, Symbol, as_expression, number
from jaxdyn.symbolic.parameters import Description, Leaf, descriptions, leaves

GREEK = (
    *("alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa"),
    *("lambda", "mu", "nu", "xi", "pi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega"),
    *("Gamma", "Delta", "Theta", "Lambda", "Xi", "Pi", "Sigma", "Phi", "Psi", "Omega"),
)

#: Names of fields, with the stem and the index of their symbols.
_SPELLED = {
    "length": ("l", ""),
    "inertia": ("I", ""),
    "radius": ("r", ""),
    "amplitude": ("a", ""),
    "frequency": ("Omega", ""),
    "frequencies": ("Omega", ""),
    "phase": ("phi", "0"),
    "wind": ("w", ""),
    "belt": ("u", ""),
    "anchor": ("a", ""),
    "restitution": ("e", ""),
    "slope": ("gamma", ""),
    "normal": ("N", ""),
    "creep": ("epsilon", ""),
    "force": ("F", ""),
    "headings": ("delta", ""),
    "at": ("a", ""),
    "end": ("e", ""),
    "pull": ("alpha", ""),
    "m_table": ("M", ""),
    "weld": ("b", ""),
    "centre": ("a", ""),
    "swings": ("A", ""),
    "reach": ("b", ""),
    "spin": ("omega", ""),
    "turning": ("omega", ""),
    "load": ("N", ""),
    "ahead": ("b", ""),
}
#: The same for effects: a spring has a rest length.
_OF_EFFECTS = {"length": ("l", "0")}
#: Fields whose entries are components along the axes.
_VECTORS = frozenset({"anchor", "wind", "belt", "F", "end", "at"})
#: Fields that are matrices, whose entries have the numbers of a row and a column.
_MATRICES = frozenset({"M", "C", "K", "N"})
#: Fields that are points; equal ones share a symbol.
_FIXED_POINTS = frozenset({"anchor"})
#: Order in a product, by stem: m g l, k x, G m_1 m_2.
_RANKS = {
    **dict.fromkeys(("G",), 0),
    **dict.fromkeys(("k", "c", "mu"), 1),
    **dict.fromkeys(("m", "M"), 2),
    **dict.fromkeys(("I", "F", "N"), 3),
    **dict.fromkeys(("g",), 5),
    **dict.fromkeys(("l", "r", "R", "a", "d", "e"), 6),
    **dict.fromkeys(("omega", "Omega"), 7),
}
_OTHERS = 4


class Symbols(NamedTuple):
    """The symbols of a scene.

    Attributes:
      time: t.
      state: (k) symbols of the entries of the state.
      rates: (k) symbols of their derivatives; if one is another entry, the symbol of that entry.
      parameters: (n) symbols of the parameters; 0 for one that is 0 in the scene.
      values: values of the parameters that are not 0.
      names: names of these, see `parameters`.
      described: their units and meanings.
    """

    time: Symbol
    state: tuple[Symbol, ...]
    rates: tuple[Symbol, ...]
    parameters: tuple[Expression, ...]
    values: dict[Symbol, float]
    names: dict[Symbol, str]
    described: dict[Symbol, Description]

    @property
    def unknowns(self) -> tuple[Symbol, ...]:
        """The derivatives that are not entries of the state."""
        return tuple(s for s in self.rates if s not in self.state)

    @property
    def coordinates(self) -> tuple[Symbol, ...]:
        """The entries whose derivatives are entries too."""
        return tuple(
            s for s, rate in zip(self.state, self.rates, strict=True) if rate in self.state
        )


def symbols(scene: Scene, velocities: Mapping[int, int]) -> Symbols:
    """The symbols of a scene.

    Args:
      scene: any.
      velocities: for each entry of the state that is a derivative, its index and that of the
        entry whose derivative it is.
    """
    labels = [name for name, _ in scene.labels()]
    state: list[Symbol] = [_entry(name, i)[0] for i, name in enumerate(labels)]
    rates: list[Symbol] = [_entry(name, i)[1] for i, name in enumerate(labels)]
    for v, q in velocities.items():
        state[q], state[v], rates[v] = moving_coordinate(labels[q], q)
        rates[q] = state[v]
    taken = {"t", *(s.name for s in (*state, *rates))}
    return Symbols(Symbol("t", "time"), tuple(state), tuple(rates), *_parameters(scene, taken))


def halves(scene: Scene) -> dict[int, int]:
    """The indices of the velocities in a state [q, v], with those of their coordinates."""
    n = len(scene.labels()) // 2
    return {n + i: i for i in range(n)}


def moving_coordinate(name: str, rank: float) -> tuple[Symbol, Symbol, Symbol]:
    """A coordinate, its velocity and its acceleration."""
    stem, index = split_name(name)
    given = {"stem": stem, "index": index, "rank": rank}
    kinds = ("coordinate", "velocity", "acceleration")
    q, v, a = (Symbol(name + "'" * i, kind, dots=i, **given) for i, kind in enumerate(kinds))
    return q, v, a


def _entry(name: str, rank: float) -> tuple[Symbol, Symbol]:
    stem, index = split_name(name)
    given = {"stem": stem, "index": index, "rank": rank}
    kind = "velocity" if stem == "omega" and index else "coordinate"
    return Symbol(name, kind, **given), Symbol(f"{name}'", "rate", dots=1, **given)


def split_name(name: str) -> tuple[str, str]:
    """The stem and the index of a name: theta1, m_table, x_Earth, omega3, qx."""
    if len(name) == 2 and name[0] in "qv" and name[1] in "wxyz":
        return name[0], name[1]
    stem, _, index = name.partition("_")
    if stem and index:
        return stem, index.replace("_", " ")
    stem = name.rstrip("0123456789")
    return (stem, name[len(stem) :]) if stem else (name, "")


def _parameters(
    scene: Scene, taken: set[str]
) -> tuple[
    tuple[Expression, ...], dict[Symbol, float], dict[Symbol, str], dict[Symbol, Description]
]:
    from_scene = leaves(scene.field)
    spelling = [_spelling(leaf) for leaf in from_scene]
    same = [_same_place(from_scene, i) for i in range(len(from_scene))]
    counts = Counter(
        stem + index for (stem, index), k in zip(spelling, same, strict=True) if k is None
    )
    seen: Counter[str] = Counter()
    found: list[Expression] = []
    values: dict[Symbol, float] = {}
    names: dict[Symbol, str] = {}
    described: dict[Symbol, Description] = {}
    for leaf, (stem, index), earlier in zip(from_scene, spelling, same, strict=True):
        if earlier is not None:
            start = from_scene[earlier].start
            found += found[start : start + leaf.value.size]
            continue
        several = counts[stem + index] > 1
        seen[stem + index] += 1
        order = str(seen[stem + index]) if several else ""
        each = zip(
            places(leaf), leaf.value.ravel().tolist(), descriptions(scene, leaf), strict=True
        )
        for place, value, description in each:
            if value == 0 or leaf.is_fixed:
                found.append(number(value))
                continue
            mine = (order if several else index) + place
            field = leaf.path[-1]
            choices = ((stem, mine), (stem, f"{mine}0"), (field, mine), (field, f"{mine}_"))
            stem_, mine = next((s, i) for s, i in choices if s + i not in taken)
            taken.add(stem_ + mine)
            rank = _RANKS.get(stem_, _OTHERS) + len(found) * 1e-6
            symbol = Symbol(
                stem_ + mine, "parameter", stem=stem_, index=mine, rank=rank, positive=value > 0
            )
            found.append(as_expression(symbol))
            values[symbol] = value
            names[symbol] = f"{'.'.join(leaf.path)}{place}"
            described[symbol] = description
    return tuple(found), values, names, described


def _same_place(all_: list[Leaf], i: int) -> int | None:
    """The earlier array for the same point, as for a spring and a dashpot with one anchor."""
    leaf = all_[i]
    return next(
        (
            k
            for k, other in enumerate(all_[:i])
            if leaf.path[-1] == other.path[-1] in _FIXED_POINTS
            and np.array_equal(leaf.value, other.value)
            and leaf.value.any()
        ),
        None,
    )


def _spelling(leaf: Leaf) -> tuple[str, str]:
    """The stem and the index of an array of parameters."""
    field = next(part for part in reversed(leaf.path) if not part.startswith("["))
    if is_of_user(leaf):
        (stem, index), after = split_name(field), leaf.path[::-1].index(field)
        inside = [part.strip("[]") for part in leaf.path[len(leaf.path) - after :]]
        numbered = ",".join([*([index] if index else []), *inside])
        return stem, f"{numbered}," if numbered and leaf.value.ndim else numbered
    if leaf.path[0] == "effects" and field in _OF_EFFECTS:
        return _OF_EFFECTS[field]
    return _SPELLED.get(field) or split_name(field)


def is_of_user(leaf: Leaf) -> bool:
    """Whether numbers are in the `params` of a user's functions, who indexes them from 0."""
    return "params" in leaf.path


def places(leaf: Leaf) -> Iterable[str]:
    """The indices of the entries of an array: numbers from 1, or axes; from 0 in `params`."""
    shape = leaf.value.shape
    if is_of_user(leaf):
        return [",".join(map(str, at)) for at in np.ndindex(shape)]
    field = next(part for part in reversed(leaf.path) if not part.startswith("["))
    axes = "xyz" if field in _VECTORS or len(shape) == 2 else ""
    if not shape or shape == (1,):
        return [""]
    if len(shape) == 1:
        return [axes[i] if axes else str(i + 1) for i in range(shape[0])]
    if len(shape) > 2 or field in _MATRICES:
        comma = "," if max(shape) > 9 or len(shape) > 2 else ""
        return [comma.join(str(i + 1) for i in at) for at in np.ndindex(*shape)]
    count, width = map(int, shape)
    rows = [str(i + 1) if count > 1 else "" for i in range(count)]
    return [f"{row}{axes[j] if width <= 3 else j + 1}" for row in rows for j in range(width)]
