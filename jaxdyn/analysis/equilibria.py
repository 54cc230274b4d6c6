"""The equilibria of a scene in a box, each with its stability, and whether the list is complete.

An equilibrium is a state with rate(y) = 0 that satisfies the constraints. Interval bisection
(`equilibrium_search.completeness`) proves where in the box there is exactly one and where there is
none; a search (`equilibrium_search.search`) starts from the former places and from the points of a
low-discrepancy grid. Duplicates are dropped, and the two results are compared:
`Equilibria.complete` says whether the list is proved to be complete, `Equilibria.certainty` why, or
why not.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn._numerics import nan_unless
from jaxdyn._text import number_of
from jaxdyn.analysis.equilibrium_search.completeness import bisect, judge
from jaxdyn.analysis.equilibrium_search.proof import EquilibriaProof
from jaxdyn.analysis.equilibrium_search.search import (
    Box,
    SearchEnds,
    jumps,
    low_discrepancy,
    search,
)
from jaxdyn.analysis.linearize import Linearization, complete_state, linearize_near
from jaxdyn.scales import groups
from jaxdyn.scene import Field, Scene, System, check_scene
from jaxdyn.system import differences

_MOST_STARTS = 1_000_000  # processed at once
_MERGE_DISTANCE = 1e-6  # part of the box: equilibria nearer than this are merged
#: Part of the box: distance at which a curve of equilibria is probed for another one.
_STEP_ALONG_CURVE = 1e-3
_NEWTON_STEPS = 30  # steps of Newton's method to an equilibrium
_POLISHING_STEPS = 2  # further steps: they make derivatives correct up to the third
#: Largest size of the last of these steps, relative to the sizes of the entries. At a singular
#: Jacobian it is larger, since each step is half as long as the one before.
_MAX_LAST_STEP = 1e-10
_SQUARINGS = 4  # of |A|, for its spectral radius
_SINGULAR = 1e-12  # reciprocal condition number of a Jacobian that counts as singular


@dataclasses.dataclass(frozen=True)
class Equilibria:
    """The equilibria of a scene in a box.

    Attributes:
      states: (e, k) equilibria, ordered by their first coordinates.
      linearizations: the linearization at each, in the same order.
      kinds: kind of each: "isolated"; "continuum" for one of a curve or surface of equilibria, of
        which only samples are listed; or "degenerate" where the Jacobian is singular to rounding
        though no neighbour was found: it may be about to split or to vanish.
      complete: whether it is proved that the box holds no other equilibrium.
      certainty: why, or why not, as text.
      found_by: (e,) number of starts that led to each.
      residuals: (e,) largest entry of the rate there.
      starts: number of starts.
      lost: number of starts that led to no equilibrium in the box.
      proof: the list as a theorem, if that was asked for.
    """

    states: np.ndarray
    linearizations: tuple[Linearization, ...]
    kinds: tuple[str, ...]
    complete: bool
    certainty: str
    found_by: np.ndarray
    residuals: np.ndarray
    starts: int
    lost: int
    proof: EquilibriaProof | None = None

    @_text.never_raising
    def __repr__(self) -> str:
        described = zip(self.states, self.kinds, self.linearizations, strict=True)
        rows = [
            (f"{i + 1}", f"{_text.brief(state)}: {kind}, {near.verdict}, {near.portrait}")
            for i, (state, kind, near) in enumerate(described)
        ]
        rows = [*_text.shorten(rows), ("certainty", self.certainty)]
        if self.proof is not None:
            rows.append(("proof", self.proof.reason))
        return _text.table(f"Equilibria: {number_of(len(self), 'equilibrium', 'equilibria')}", rows)

    _repr_html_ = _text.html

    def __len__(self) -> int:
        return len(self.states)


@check_first
def equilibria(
    scene: Scene, low, high, *, t=0.0, starts: int = 1024, prove: bool = False
) -> Equilibria:
    """The equilibria of a scene in a box, with their stability; host only.

    Args:
      scene: an autonomous scene, or one that is frozen at time t.
      low: lower corner of the box, (k,) for all entries of the state; or (k/2,) for the
        coordinates of a state [q, v] with dq/dt = v, with velocities of 0.
      high: upper corner, of the same shape.
      t: () time [s] at which the scene is frozen.
      starts: number of starting points of the search.
      prove: whether to prove the list in ball arithmetic, as `Equilibria.proof` says; needs
        python-flint, ``pip install 'jaxdyn[proof]'``.
    Returns:
      Verified equilibria without duplicates, and whether there may be others.
    Raises:
      ValueError: `high` is not above `low`, their shape does not fit the state, `starts` or `t`
        is out of range, or numbers are traced (`equilibrium` is differentiable); with `prove`, the
        rate is not made of elementary functions, or the states satisfy constraints.
    Limits: completeness can be proved for rates made of elementary formulas, without
      constraints, with about four unknowns at most. A point at which the rate is 0 but
      discontinuous is not an equilibrium; `certainty` names it. Dry friction holds a body at rest
      in whole intervals of states; only those that need no friction are listed.
      Angles are taken modulo a turn.
    Example:
      >>> from jaxdyn.scenes.springs import two_springs
      >>> found = equilibria(two_springs(g=0.0), [-3, -3], [3, 3])
      >>> len(found), found.complete
      (5, True)
    """
    remedy = (
        "Find the equilibria outside of jit, grad and vmap; `equilibria.equilibrium(scene, y)` "
        "carries their derivatives."
    )
    _checks.check_on_host("equilibria", (scene, low, high, t), remedy)
    box = _box(low, high, check_scene(scene))
    starts, t = _checks.whole("starts", starts, most=_MOST_STARTS), _checks.array("t", t, ())
    field = scene.field
    theorem = _prove(scene, float(t), box) if prove else None
    proof = bisect(field, t, box)
    box, middles = proof.box, proof.middles[:starts]
    spread = box.states(low_discrepancy(starts - len(middles), len(box.free)))
    ends = search(field, t, box, np.concatenate([middles, spread]))
    kept = np.flatnonzero(ends.passed & box.holds(ends.ys, _MERGE_DISTANCE))
    groups = _groups(ends, kept[np.argsort(ends.steps[kept], kind="stable")], box)
    heads = ends.ys[[group[0] for group in groups]]
    sharp = jumps(field, t, box, heads)
    complete, certainty = judge(proof, field, t, heads[~sharp], heads[sharp])
    smooth = [group for group, jump in zip(groups, sharp, strict=True) if not jump]
    listed = _list_groups(
        scene, t, box, ends, _merge(scene, box, ends, smooth), (complete, certainty)
    )
    return dataclasses.replace(listed, proof=theorem)


def _prove(scene: Scene, t: float, box: Box) -> EquilibriaProof:
    if type(scene.system).project is not System.project:
        raise _checks.fail(
            "scene",
            "coordinates without constraints, for a proof",
            f"{type(scene.system).__name__}, whose states satisfy some",
            "Leave prove out.",
        )
    # Imported here, since it needs python-flint, which is optional.
    from jaxdyn.analysis.equilibrium_search.proving import prove

    return prove(scene, t, box)


@check_first
def equilibrium(scene: Scene, y, t=0.0) -> Array:
    """The isolated equilibrium (k,) near a state, differentiable in the scene's numbers.

    Newton's method finds it from y, and is not differentiated: derivatives of the equilibrium, up
    to the third, follow from the implicit function theorem.

    Args:
      scene: any scene whose state has no redundant entries, under `jax.grad`, `jit`, `vmap` too.
      y: (k,) state near the equilibrium, such as one that `equilibria` found.
      t: () time [s] at which the scene is frozen.
    Returns:
      The equilibrium; NaN if there is none near y, or if the Jacobian is singular there, as on a
      curve of equilibria.
    Example:
      >>> import jax
      >>> from jaxdyn.scenes.springs import spring_mass
      >>> def sag(g):
      ...     return -equilibrium(spring_mass(k=10.0, length=0.5, g=g), [0.0, -1.5, 0, 0])[1]
      >>> print(jax.grad(sag)(10.0))  # m / k
      0.1
    """
    field = check_scene(scene).field
    y = _checks.array("y", y, scene.y0.shape)
    return _equilibrium(field, y, _checks.array("t", t, ()))


@eqx.filter_jit
def _equilibrium(field: Field, y: Array, t: Array) -> Array:
    def newton(y):
        rate, a = field.rate(t, y), jax.jacfwd(lambda y: field.rate(t, y))(y)
        step = jnp.linalg.solve(a, rate)
        return y - step, step, a

    start = jax.lax.stop_gradient(y)
    y = jax.lax.fori_loop(0, _NEWTON_STEPS, lambda _, y: newton(y)[0], start)
    y, step, a = newton(jax.lax.stop_gradient(y))
    for _ in range(_POLISHING_STEPS - 1):
        y, step, a = newton(y)
    a, step, end = jax.lax.stop_gradient((a, step, y))
    # |A^-1| |A| bounds the effect of relative errors; its trace does not depend on units.
    spread = jnp.abs(jnp.linalg.inv(a)) @ jnp.abs(a)
    regular = jnp.trace(spread) * _SINGULAR < 1.0
    sizes = _coupled_sizes(field, a, jnp.maximum(jnp.abs(end), jnp.abs(end - start)))
    settled = jnp.all(jnp.abs(step) <= _MAX_LAST_STEP * (spread @ sizes))
    return nan_unless(settled & regular, y)


def _coupled_sizes(field: Field, a: Array, sizes: Array) -> Array:
    """(k,) sizes, each at least the change that other entries cause in it in the time 1 / r.

    Here r is the spectral radius of |A|: up to a factor of k^(1/16), the 16th root of the trace of
    |A|^16.
    """
    alike, power, scale = groups(field.system).sizes, jnp.abs(a), 1.0
    for i in range(1, _SQUARINGS + 1):
        power = power @ power
        trace = jnp.trace(power)
        power = power / jnp.where(trace > 0, trace, 1.0)
        scale = scale * trace ** (0.5**i)
    gain = jnp.abs(a) / jnp.where(scale > 0, scale, jnp.inf)
    sizes = alike(sizes)
    return jax.lax.fori_loop(0, len(sizes), lambda _, x: jnp.maximum(x, alike(gain @ x)), sizes)


def _box(low, high, scene: Scene) -> Box:
    low = np.asarray(_checks.array("low", low, (None,)))
    high = np.asarray(_checks.array("high", high, low.shape))
    if (low > high).any() or (low == high).all():
        raise _checks.fail("high", f"above low = {low.tolist()}", high.tolist())
    return Box(complete_state("low", low, scene), complete_state("high", high, scene))


def _groups(ends: SearchEnds, order: np.ndarray, box: Box) -> list[list[int]]:
    """Indices in groups of equal states, the best of each group first."""
    groups: list[list[int]] = []
    units = box.units(ends.ys)
    heads = np.zeros((len(order), units.shape[1]))
    for i in order:
        near = np.abs(heads[: len(groups)] - units[i]).max(axis=1, initial=0.0) <= _MERGE_DISTANCE
        if near.any():
            groups[int(np.argmax(near))].append(int(i))
        else:
            heads[len(groups)] = units[i]
            groups.append([int(i)])
    return groups


def _merge(scene: Scene, box: Box, ends: SearchEnds, groups: list[list[int]]) -> list[list[int]]:
    """Groups merged by the system's measure of differences, as for angles a whole turn apart."""
    if not groups:
        return []
    heads = jnp.asarray(ends.ys[[group[0] for group in groups]])
    slack = _MERGE_DISTANCE * (box.high - box.low)
    first: dict[int, list[int]] = {}
    for n, group in enumerate(groups):
        same = np.all(np.abs(differences(scene.system, heads[n], heads)) <= slack, axis=1)
        earlier = [m for m in first if same[m]]
        if earlier:
            first[earlier[0]] += group
        else:
            first[n] = list(group)
    return list(first.values())


def _kinds(field: Field, t: Array, box: Box, ends: SearchEnds, best: list[int]) -> tuple[str, ...]:
    flat = [i for i in best if ends.flat[i]]
    kinds = dict.fromkeys(best, "isolated")
    if flat:
        # As many states as in the first search, so that its program is used again.
        beside = np.resize(ends.ys[flat] + _STEP_ALONG_CURVE * ends.along[flat], ends.ys.shape)
        found = search(field, t, box, beside)
        gone = np.linalg.norm(box.units(found.ys[: len(flat)] - ends.ys[flat] + box.low), axis=1)
        curve = found.passed[: len(flat)] & (gone > _STEP_ALONG_CURVE / 2)
        kinds |= {i: "continuum" if c else "degenerate" for i, c in zip(flat, curve, strict=True)}
    return tuple(kinds.values())


def _list_groups(
    scene: Scene, t, box: Box, ends: SearchEnds, groups: list[list[int]], sure
) -> Equilibria:
    places = np.round(box.units(ends.ys) / _MERGE_DISTANCE)
    groups = sorted(groups, key=lambda group: tuple(places[group[0]]))
    best = [group[0] for group in groups]
    count = [len(group) for group in groups]
    sizes = np.abs(ends.ys) + box.high - box.low
    return Equilibria(
        states=ends.ys[best],
        linearizations=tuple(linearize_near(scene.field, ends.ys[i], t, sizes[i]) for i in best),
        kinds=_kinds(scene.field, t, box, ends, best),
        complete=sure[0],
        certainty=sure[1],
        found_by=np.array(count, dtype=int),
        residuals=ends.rates[best],
        starts=len(ends.ys),
        lost=len(ends.ys) - sum(count),
    )
