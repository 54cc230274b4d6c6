"""Square closing equations posed for an orbit: what is held, and which equations are spared."""

import dataclasses
import itertools
import math
from collections.abc import Iterator
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import fail
from jaxdyn.analysis import energy as energies
from jaxdyn.ball_arithmetic.arithmetic import arb, float_matrix, precision
from jaxdyn.ball_arithmetic.field import ball_field, scene_formulas
from jaxdyn.solvers.formulas.formulas import Formulas, topological_order
from jaxdyn.solvers.formulas.graph import Node, Number
from jaxdyn.system import System
from orbits.closing.closings import Closing, Return, Reversal, Symmetry
from orbits.closing.given import is_driven
from orbits.closing.sizes import sizes, sizes_along
from orbits.motion import sample
from orbits.orbit import Orbit, SearchError
from orbits.proof.closing_equations import ClosingEquations, power_of_2

# ---- Integrals of the two central laws whose bounded motions all close (Bertrand's theorem)
#
# For one point at r with velocity v and acceleration a = -w(r) r,
#
#     Laplace's vector   v x (r x v) + (a . r) r     is conserved if a = -k r / |r|^3,
#     Fradkin's tensor   v v^T + w r r^T             is conserved if a = -k r,
#
# the first of which is usually divided by k. Both are written with the acceleration itself, so the
# strength k is not needed; the functions below and `theorems` decide which of them is conserved.
# Under these laws every start is on an orbit, and these integrals make the closing equations depend
# on each other.
#
# Reference: Goldstein, Poole, Safko (2002), Classical Mechanics, section 3.9; Fradkin (1965),
# American Journal of Physics 33, 207.

_STATES = (4, 6)  # lengths of [r, v] of one point in a plane or in space


def hidden_integrals(scene: Scene, t, y: Array) -> dict[str, Array]:
    """The entries of both integrals, each (), by name, if a state may be [r, v]; else {}.

    Example:
      >>> from jaxdyn.effects import PowerLaw
      >>> from orbits.targets import loops
      >>> scene = loops.closed(PowerLaw(1.0, -2.0), 1, 1).scene
      >>> found = hidden_integrals(scene, 0.0, scene.y0)
      >>> list(found)[:2], abs(float(found["Laplace's vector y"])) < 1e-30
      (["Laplace's vector x", "Laplace's vector y"], True)
    """
    if len(y) not in _STATES or not scene.second_order:
        return {}
    r, v = jnp.split(y, 2)
    a = scene.rate(t, y)[len(r) :]
    falls = jnp.dot(a, r)
    # v x (r x v) = (v . v) r - (r . v) v
    laplace = jnp.dot(v, v) * r - jnp.dot(r, v) * v + falls * r
    weight = -falls / jnp.dot(r, r)
    axes = "xyz"[: len(r)]
    vector = {f"Laplace's vector {axes[i]}": x for i, x in enumerate(laplace)}
    pairs = itertools.combinations_with_replacement(range(len(r)), 2)
    tensor = {
        f"Fradkin's tensor {axes[i]}{axes[j]}": v[i] * v[j] + weight * r[i] * r[j] for i, j in pairs
    }
    return vector | tensor


# ---- The exact period of a drive by sines and cosines of w t + c

_REMEDY = "The rate may depend on time t by sines and cosines of w t + c with one number w."


def drive_period(formulas: Formulas, period: float) -> tuple[float, int]:
    """(w, n) such that 2 pi n / w is exactly a period of the rate, and close to the given float.

    Raises:
      ValueError: time occurs other than in sines and cosines of w t + c with a known float w, or
        `period` is not a multiple of the common period.
    """
    frequencies = {abs(w) for w in _frequencies(formulas)}
    if not frequencies:
        raise fail("scene", "a drive by sines and cosines", "another", _REMEDY)
    slowest = min(frequencies)
    turns = round(period * slowest / (2 * math.pi))
    for w in frequencies:
        cycles = turns * Fraction(w) / Fraction(slowest)
        if turns < 1 or cycles.denominator != 1:
            raise fail("period", f"a multiple of that of cos({w} t)", period, _REMEDY)
    if abs(2 * math.pi * turns / slowest - period) > 1e-8 * period:
        raise fail("period", f"a multiple of {2 * math.pi / slowest}", period, _REMEDY)
    return slowest, turns


def _frequencies(formulas: Formulas) -> list[float]:
    time, found = formulas.time, []
    inside: dict[Node, float] = {time: 1.0}
    for node in topological_order(formulas.graph, formulas.rates):
        slopes = [inside.get(a) for a in node.args if isinstance(a, Node)]
        if all(slope is None for slope in slopes):
            continue
        slope = _slope(node, inside)
        if node.op in ("sin", "cos"):
            found.append(inside[node.args[0]])
        elif slope is None:
            raise fail("scene", "a drive by sines and cosines of w t + c", node.op, _REMEDY)
        else:
            inside[node] = slope
    return found


def _slope(node: Node, inside: dict[Node, float]) -> float | None:
    """The known w of a node w t + c; None for other nodes."""
    if node.op == "scale" and isinstance(node.args[0], float):
        found = Fraction(node.args[0]) * Fraction(inside[node.args[1]])
        return float(found) if Fraction(float(found)) == found else None
    if node.op == "sum":
        pairs = list(zip(node.args[::2], node.args[1::2], strict=True))
        ours = [(c, m) for c, m in pairs if m in inside]
        steady = all(m is None or m in inside for _, m in pairs)
        if steady and len(ours) == 1 and ours[0][0] == 1.0:
            return inside[ours[0][1]]
    return None


# ---- Square closing equations posed for an orbit: what is held, and which equations are spared

#: Digits of the motion from which Jacobians in doubles, and their rank, are computed.
ROUGH_DIGITS = 16.0
#: Singular values below this part of the largest are 0. They belong to multipliers of 1, which are
#: known to the square root of the rounding of the orbit in doubles.
_RANK = 1e-6
#: Weight of the period, which is held only where holding entries of the start selects no orbit.
_RELUCTANCE = 1e-3
#: A candidate is an integral if its relative rate of change at points near the orbit is below this.
_CONSERVED = 1e-11
_POINTS = 3
_NEAR = 0.01  # spread of the points, relative to the size of each entry
_ROUNDING = 1e-8  # an entry below this share of its size is 0, as at starts on an axis


class Unposed(SearchError):
    """Raised where closing equations cannot be made square; says why."""


def equations_of(orbit: Orbit) -> ClosingEquations:
    """The square system of an orbit that `find` returned.

    Raises:
      Unposed: the equations depend on each other, and known integrals do not explain it.
      ValueError: it is not an orbit; the rate has no formulas; the states satisfy constraints; the
        closing condition is neither a return nor a reversal.
    """
    _check(orbit)
    scene, closing = orbit.scene, orbit.closing
    formulas, (candidates,) = scene_formulas(scene, _integrals)
    names = [name for name, _ in scene.labels()]
    embed, end, goal = _maps(closing, len(names))
    free = closing.free(len(names))
    labels = [*(names[i] for i in free), "period"]
    values = [*np.asarray(scene.y0)[free].tolist(), orbit.period]
    generator = _generator(scene, closing)
    if generator is not None:
        labels.append("angle")
        values.append(float(orbit.angle))
    whole = ClosingEquations(
        field=ball_field(formulas),
        formulas=formulas,
        integrals={},
        parts=closing.parts,
        embed=embed,
        end=end,
        goal=goal,
        generator=generator,
        names=tuple(labels),
        values=tuple(values),
        held=(),
        spared=(),
        sizes=tuple(sizes_of(scene).tolist()),
        drive=drive_period(formulas, orbit.period) if is_driven(scene) else None,
        candidates=tuple(candidates),
        reversals=_reversals(closing, len(names)),
    )
    return _square(whole, _conserved_candidates(whole, integrals_of(whole, scene)))


def sizes_of(scene: Scene) -> np.ndarray:
    """(k,) the sizes of entries along the motion of a scene, as powers of 2."""
    ys = sample(scene, float(scene.t1))[1]
    return power_of_2(sizes_along(scene, ys, sizes(scene)))


def _check(orbit: Orbit) -> None:
    system = type(orbit.scene.system)
    refused = "Digits and proofs are for"
    if not orbit.ok:
        raise fail("orbit", "one that closes", orbit.outcome.name, orbit.message)
    if system.project is not System.project:
        raise fail(
            "scene",
            "coordinates without constraints",
            f"{system.__name__}, whose states satisfy some",
            f"{refused} scenes in as many coordinates as there are degrees of freedom.",
        )


def _maps(closing: Closing, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The matrices `embed`, `end` and `goal` of a closing condition."""
    unit = np.eye(k, dtype=int)
    if isinstance(closing, Return):
        return unit, unit, table(closing.symmetry, unit)
    if isinstance(closing, Reversal):
        free = closing.free(k)
        here, there = table(closing.here, unit), table(closing.there, unit)
        # The fixed set of `here` is the image of 1 + here.
        embed = (unit + here)[:, free]
        embed = embed // np.abs(embed[free, np.arange(len(free))])
        off = unit - there
        # Two entries that are exchanged give equal or opposite rows: one of them is sufficient.
        signed = np.concatenate([off, -off])
        first = [(signed == row).all(1).nonzero()[0] % k for row in off]
        rows = [i for i in range(k) if off[i].any() and first[i].min() == i]
        return embed, off[rows], np.zeros((len(rows), k), int)
    raise fail("closing", "a return or a reversal", type(closing).__name__)


def integrals_of(system: ClosingEquations, scene: Scene) -> dict[str, Number]:
    """Candidates for integrals, by name, in the formulas of the rate."""
    return dict(zip(_integral_names(scene), system.candidates, strict=True))


def _reversals(closing: Closing, k: int) -> tuple[np.ndarray, np.ndarray] | None:
    if not isinstance(closing, Reversal):
        return None
    unit = np.eye(k, dtype=int)
    return table(closing.here, unit), table(closing.there, unit)


def table(symmetry: Symmetry, unit: np.ndarray) -> np.ndarray:
    """(k, k) the matrix of a symmetry; `unit` is that of the identity."""
    rows = unit if symmetry.places is None else unit[np.array(symmetry.places)]
    return rows if symmetry.signs is None else np.array(symmetry.signs)[:, None] * rows


def _generator(scene: Scene, closing: Closing) -> np.ndarray | None:
    if not closing.turns:
        return None
    turn = closing.turn
    unit = jnp.eye(len(scene.y0))
    columns = [np.asarray(scene.system.generators(e)[turn]) for e in unit]
    offset = np.asarray(scene.system.generators(jnp.zeros(len(scene.y0)))[turn])
    found = np.array(columns).T
    if offset.any() or not np.isin(found, (-1.0, 0.0, 1.0)).all():
        raise fail("turn", "a rotation about the origin", repr(turn), "Use other coordinates.")
    return found.astype(int)


def _candidates(scene: Scene, t, y) -> dict:
    return energies.integrals(scene, t, y) | hidden_integrals(scene, t, y)


def _integrals(scene: Scene, t, y):
    found = _candidates(scene, t, y).values()
    return jnp.concatenate([jnp.zeros(0), *(jnp.ravel(x) for x in found)])


def _integral_names(scene: Scene) -> list[str]:
    found = _candidates(scene, jnp.zeros(()), scene.y0)
    return [
        f"{name} {axis}" if np.ndim(value) else name
        for name, value in found.items()
        for axis in "xyz"[: np.size(value)]
    ]


def _conserved_candidates(
    whole: ClosingEquations, candidates: dict[str, Number]
) -> dict[str, Number]:
    """The candidates whose rates of change vanish near the orbit, in floats."""
    worst, each = np.zeros(len(candidates)), np.array(whole.sizes)
    with precision(128):
        for t, y in points_near(whole, _NEAR, _POINTS if candidates else 0):
            rates = np.array([float(x) for x in whole.field.rate(arb(t), y)]) / each
            gradients = _floats(whole.gradients(list(candidates.values()), y)) * each
            most = np.linalg.norm(gradients, axis=1) * np.linalg.norm(rates)
            worst = np.maximum(worst, np.abs(gradients @ rates) / np.where(most, most, np.inf))
            worst = np.where(most > 0, worst, np.inf)
    kept = (name for name, leak in zip(candidates, worst, strict=True) if leak < _CONSERVED)
    return {name: candidates[name] for name in kept}


def points_near(
    system: ClosingEquations, spread: float, count: int
) -> Iterator[tuple[float, list[arb]]]:
    """Times and states near the start, which are the same in each call.

    Args:
      system: the closing equations.
      spread: standard deviation of each entry, relative to its size.
      count: number of points.
    """
    random = np.random.default_rng(0)
    values = system.embed @ np.array(system.values[: system.embed.shape[1]])
    # Entries that are 0 or rounding must vary as well: on an axis of symmetry more is conserved.
    each = np.where(abs(values) > _ROUNDING * np.array(system.sizes), abs(values), system.sizes)
    period = system.values[system.embed.shape[1]]
    for _ in range(count):
        moved = values + spread * each * random.standard_normal(len(values))
        yield period * float(random.uniform()), [arb(x) for x in moved.tolist()]


def _floats(rows: list[list]) -> np.ndarray:
    return np.array([[float(x) for x in row] for row in rows])


def _square(whole: ClosingEquations, integrals: dict[str, Number]) -> ClosingEquations:
    """The equations made square: some numbers are held, some equations are spared."""
    with precision(128):
        numbers = whole.centre()
        run = whole.motion(numbers, ROUGH_DIGITS, slopes=True)
        jacobian = float_matrix(whole.jacobian(run.y, run.slopes, numbers))
        gradients = np.zeros((0, whole.field.k))
        if integrals:
            gradients = _floats(whole.gradients(list(integrals.values()), run.y))
    known = [whole.embed.shape[1]] if whole.drive is not None else []
    free = [i for i in range(len(whole.names)) if i not in known]
    own = jacobian[:, free] * whole.units[free] / whole.residual_units[:, None]
    left, s, right = np.linalg.svd(own)
    rank = int((s > _RANK * s[0]).sum())
    dependent, count = left[:, rank:].T, len(own) - rank
    # Changes of each integral, relative to those by the sizes of the entries: its unit cancels.
    changes = gradients * np.array(whole.sizes)
    most = np.linalg.norm(changes, axis=1, keepdims=True)
    changes = (gradients @ whole.spread()) * whole.residual_units / np.where(most > 0, most, 1.0)
    chosen = pivots(dependent @ changes.T, count)
    spared = pivots(dependent, count)
    if chosen is None or spared is None:
        raise Unposed(
            f"{count} of the closing equations depend on the others, and the integrals "
            f"{list(integrals)} do not explain it. Name integrals (jaxdyn.ode(..., energy=, "
            "integrals=)), or impose a symmetry, closing=orbits.reversal(...)."
        )
    null = right[rank:]
    scale = np.array([_RELUCTANCE if whole.names[i] == "period" else 1.0 for i in free])
    held = pivots(null * scale, len(null)) or []
    kept = [list(integrals)[i] for i in sorted(chosen)]
    return dataclasses.replace(
        whole,
        integrals={name: integrals[name] for name in kept},
        held=tuple(sorted([*known, *(free[i] for i in held)])),
        spared=tuple(sorted(spared)),
    )


def pivots(rows: np.ndarray, count: int) -> list[int] | None:
    """Indices of `count` columns of rows (r, n) that are as independent as possible; else None."""
    rows, chosen = rows.copy(), []
    largest = np.linalg.norm(rows, axis=0).max(initial=0.0)
    for _ in range(count):
        sizes = np.linalg.norm(rows, axis=0)
        sizes[chosen] = 0.0
        if not sizes.size or not sizes.max() > _RANK * largest:
            return None
        best = int(np.argmax(sizes))
        direction = rows[:, best] / sizes[best]
        rows = rows - np.outer(direction, direction @ rows)
        chosen.append(best)
    return chosen
