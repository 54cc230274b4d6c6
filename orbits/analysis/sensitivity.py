"""Derivatives of an orbit with respect to the numbers of its scene, by implicit differentiation.

The closing equations F(x, scene) = 0 hold along the family of orbits that belongs to a change
of the scene, so dx = -F_x^+ F_scene dscene: one solve with the available Jacobian, not a
differentiation of the finder's iterations. Of all orbits that close, F_x^+ selects the nearest one,
so where orbits come in families (conservative scenes) the derivative is unique only at fixed
conditions: hold the energy, or the period.

All that depends only on the known orbit is computed on the host immediately, even under `jax.jit`.

Multipliers are differentiated as simple eigenvalues, d lambda = w dM v / (w v). Those that are
1 by an integral or a symmetry stay 1; nothing is differentiated through their defective block.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import check_first, check_kind, fail, is_traced
from jaxdyn._numerics import first_only, nan_unless
from jaxdyn.integrate.phase import Phase
from jaxdyn.integrate.simulation import solve
from jaxdyn.plan import plan_of
from orbits.analysis.chain import differentiable_return_map
from orbits.analysis.monodromy import return_map, tangents
from orbits.analysis.quantities import extremes_in_time
from orbits.analysis.stability import Stability, stability
from orbits.closing.closings import Condition, Hold, Section, conditions
from orbits.closing.sizes import sizes
from orbits.hybrid.equations import ChainEquations, residuals
from orbits.hybrid.legs import HybridOrbit, Leg
from orbits.hybrid.phases import legs_of
from orbits.orbit import Orbit
from orbits.shooting import newton
from orbits.shooting.equations import Equations, InUnits, errors, pieces
from orbits.shooting.segment import end_of
from orbits.shooting.segmentation import cut_into_segments

#: Multipliers closer to each other than this many of their error bars may coincide.
_APART = 3.0
#: An orbit belongs to a scene if it closes with the scene's numbers up to this many units of the
#: equations, or if Newton's method would move it by at most this many units of the unknowns: very
#: unstable orbits satisfy only the second condition, those next to a fold only the first.
_CLOSES = 1e-8
#: Largest relative difference, beyond a few error bars, of the multipliers of one and the same map.
_SAME_MAP = 1e-6
#: How long before and after a corner the states beside it are taken, as a share of the period.
_BESIDE = 1e-6


class DifferentiableOrbit(eqx.Module):
    """An orbit as a differentiable function of its scene.

    Attributes:
      scene: the scene with the start and the period of the orbit.
      angle: () angle of a relative orbit.
      known: the orbit on which it is based.
    """

    scene: Scene
    angle: Array
    known: Orbit

    @property
    def y0(self) -> Array:
        """(k,) start."""
        return self.scene.y0

    @property
    def period(self) -> Array:
        """() full period [time of the scene]."""
        return self.scene.t1

    def multipliers(self) -> Array:
        """(p,) the non-trivial Floquet multipliers, complex.

        A multiplier that coincides with another one has no derivative and is NaN here;
        `orbits.stability` has its value.

        Raises:
          IntegrationError: the variational equations cannot be integrated over the period.
        """
        with jax.ensure_compile_time_eval():
            basis = tangents(self.known.scene, np.asarray(self.known.y0))
            known = stability(self.known)
        return _multipliers(known, basis, self.return_map())

    def return_map(self) -> Array:
        """(k, k) the derivative of the return map, whose eigenvalues are the multipliers.

        Raises:
          IntegrationError: the variational equations cannot be integrated over the period.
        """
        orbit = eqx.tree_at(lambda o: (o.scene, o.angle), self.known, (self.scene, self.angle))
        return return_map(orbit, self.known.rtol)[0]

    def exponents(self) -> Array:
        """(p,) Floquet exponents [1/time], the logarithms of the multipliers over the period."""
        logs = jnp.log(self.multipliers())
        return logs / self.period.astype(logs.dtype)

    def extremes(self, entry: str) -> Array:
        """(2,) the least and the largest value of an entry of the state over a period.

        Args:
          entry: its name; see `orbits.analysis.quantities.extremes`.
        """
        names = [name for name, _ in self.known.scene.labels()]
        i = names.index(entry)
        with jax.ensure_compile_time_eval():
            values, times = extremes_in_time(self.known, entry)
        found = jnp.stack([_extreme(self.scene, self.known, i, t) for t in times])
        return jnp.asarray(values) + found - jax.lax.stop_gradient(found)

    def amplitude(self, entry: str) -> Array:
        """() half of the distance between the extremes of an entry of the state."""
        low, high = self.extremes(entry)
        return 0.5 * (high - low)


class DifferentiableChain(eqx.Module):
    """A chain of legs as a differentiable function of its legs.

    Attributes:
      legs: the legs; their scenes' starts and spans are not used.
      y0: (k,) start of the first leg.
      spans: (n,) duration of each leg [time of the scene].
      known: the chain on which it is based.
    """

    legs: tuple[Leg, ...]
    y0: Array
    spans: Array
    known: HybridOrbit

    @property
    def period(self) -> Array:
        """() duration of all legs [time of the scene]."""
        return jnp.sum(self.spans)

    def multipliers(self) -> Array:
        """(p,) the non-trivial Floquet multipliers, complex.

        A multiplier that coincides with another one has no derivative and is NaN here;
        `orbits.stability` has its value.

        Raises:
          ValueError: the chain has no return map; see `orbits.stability`.
        """
        with jax.ensure_compile_time_eval():
            known = stability(self.known)
        m = self.return_map()
        return _multipliers(known, np.eye(len(m)), m)

    def return_map(self) -> Array:
        """(d, d) the derivative of the return map, saltation matrices included.

        It acts on the directions that the closing compares, in units of the sizes of the known
        chain. Its eigenvalues are the multipliers.
        """
        return differentiable_return_map(self.legs, self.y0, self.spans, self.known)


@check_first
def differentiable_orbit(
    scene: Scene | Sequence[Leg] | Mapping[str, Phase], orbit: Orbit | HybridOrbit, hold: Hold
) -> Any:
    """An orbit or a chain of legs with its derivatives; see `orbits.differentiable`."""
    check_kind("orbit", orbit, (Orbit, HybridOrbit))
    if not orbit.ok:
        raise fail("orbit", "an orbit that closes", orbit.message, "find() one first.")
    if isinstance(orbit, HybridOrbit) == isinstance(scene, Scene):
        wanted = "legs or phases" if isinstance(orbit, HybridOrbit) else "a scene"
        raise fail("scene", f"{wanted} for such an orbit", type(scene).__name__)
    if isinstance(orbit, HybridOrbit):
        if hold:
            raise fail("hold", "none for a chain of legs", "conditions", "Leave it out.")
        return _of_these_numbers(_chain(legs_of(scene, orbit.path), orbit))
    if orbit.mesh is not None:
        again = "orbits.find(orbit.scene, period=orbit.period, strategy=orbits.Shooting())"
        remedy = f"{again} mostly finds it by shooting; else give `segments`, as 20."
        raise fail("orbit", "an orbit found by shooting", "one by collocation", remedy)
    with jax.ensure_compile_time_eval():
        posed = pose(orbit, hold)
        linear = _linearize(jax.lax.stop_gradient(posed.equations), posed.x, orbit.rtol)
        near = _CLOSES * np.asarray(sizes(orbit.scene))
    equations = posed.of(scene)
    held = _from_start(equations.conditions, hold, jnp.asarray(scene.y0), near)
    equations = dataclasses.replace(equations, conditions=held)
    y0, period, angle = _implicit(equations, posed.x, linear, orbit.rtol)
    return _of_these_numbers(DifferentiableOrbit(scene.starting(y0, period), angle, orbit))


def _from_start(
    held: tuple[Condition, ...], hold: Hold, y0: Array, near: np.ndarray
) -> tuple[Condition, ...]:
    """The conditions, in which a name stands for the value at the start y0 (k,) of the scene.

    If the orbit has this value, up to `near` (k,), the condition has the derivatives of y0. If not,
    the value that is held is a number that does not depend on the scene.
    """
    given = tuple(hold) if isinstance(hold, list | tuple) else (hold,)
    found = []
    for one, name in zip(held, given, strict=True):
        if isinstance(one, Section) and isinstance(name, str):
            value = jax.lax.stop_gradient(y0[one.entry])
            same = jnp.abs(value - one.level) <= near[one.entry]
            change = first_only(y0[one.entry] - value)
            one = Section(one.entry, one.level + jnp.where(same, change, 0.0))
        found.append(one)
    return tuple(found)


def with_held_entries(
    guess: np.ndarray, orbit: Orbit, hold: Hold, before: Scene, scene: Scene
) -> np.ndarray:
    """(k,) the guess of an orbit of another scene, with the entries that names hold set to theirs.

    As in `differentiable`, a name stands for the value at the start of the other scene if the known
    orbit has the value at the start of its own scene.

    Args:
      guess: (k,) the guess.
      orbit: the known orbit.
      hold: conditions.
      before: the scene for which the orbit is known, with its own start.
      scene: the other one.
    """
    given = tuple(hold) if isinstance(hold, list | tuple) else (hold,)
    held = conditions(orbit.scene, hold, (orbit.closing,))
    near = _CLOSES * np.asarray(sizes(orbit.scene))
    same = np.abs(np.asarray(before.y0) - np.asarray(orbit.y0)) <= near
    y0 = np.array(guess)
    for one, name in zip(held, given, strict=True):
        if isinstance(one, Section) and isinstance(name, str) and same[one.entry]:
            y0[one.entry] = scene.y0[one.entry]
    return y0


def _of_these_numbers(found):
    """The result; ValueError if it is known to be NaN, since the scene has other numbers."""
    if not is_traced(found.y0) and np.isnan(found.y0).any():
        raise fail(
            "scene",
            "the numbers with which the orbit was found",
            "others, with which it does not close",
            "find() it again with these, from the known one.",
        )
    return found


class Linearization(NamedTuple):
    """The equations of an orbit, linearised.

    Attributes:
      inverse: (n, m) the pseudo-inverse of their Jacobian.
      units: (n,) units of the unknowns.
      rows: (m,) units of the equations.
    """

    inverse: np.ndarray
    units: np.ndarray
    rows: np.ndarray

    def solution(self, x, miss: Array, within: float = _CLOSES) -> Array:
        """(n,) x, with derivatives by the implicit function theorem from the residual (m,) there.

        It is NaN if both the residual and the step that would remove it are larger than `within`
        units: x is then not a solution.
        """
        value = jax.lax.stop_gradient(miss)
        step = jnp.abs(self.inverse @ value) / self.units
        closes = jnp.minimum(jnp.max(jnp.abs(value) / self.rows), jnp.max(step)) <= within
        return x - nan_unless(closes, self.inverse @ first_only(miss - value))


def _extreme(scene: Scene, known: Orbit, entry: int, t: float) -> Array:
    """() an extreme of an entry of the state, which a known orbit has at a time t.

    Where the slope is 0, the derivative is that at a fixed time. A corner moves in time.
    """
    rtol, period = known.rtol, known.period
    beside = _BESIDE * period if plan_of(scene.field, len(scene.y0)).size else 0.0
    with jax.ensure_compile_time_eval():
        level, ahead = _level(known.scene, entry, max(t - beside, 0.0), rtol)
        if not beside or abs(ahead) <= 3 * beside:
            return solve(scene, level, rtol=rtol).y1[entry]
        (x, slope), (next_x, next_slope) = _about_corner(known.scene, known, entry, t)
        same = abs(x - next_x) <= _CLOSES * np.asarray(sizes(known.scene))[entry]
    if slope * next_slope > 0 or not same:  # no corner, but an end of the period of a full turn
        return solve(scene, t, rtol=rtol).y1[entry]
    (x, _), (next_x, _) = _about_corner(scene, known, entry, t)
    return x + slope * first_only(x - next_x) / (next_slope - slope)


def _about_corner(scene: Scene, known: Orbit, entry: int, t: float):
    """An entry of the state and its slope at a corner, from the motions before it and after it.

    A corner at the start of the orbit is also at the end of the period, which may change.
    """
    beside = _BESIDE * known.period
    end = scene.t1 if t < beside else t
    start = 0.0 if t > known.period - beside else t
    return (
        _continued(scene, entry, end - beside, beside, known.rtol),
        _continued(scene, entry, start + beside, -beside, known.rtol),
    )


def _continued(scene: Scene, entry: int, t, h: float, rtol: float) -> tuple[Array, Array]:
    """() an entry of the state, and its slope, a short time h after t, by a Taylor series.

    The series continues the motion smoothly beyond a switch of the rate within h.
    """
    now = jnp.asarray(t, float)
    y = solve(scene, now, rtol=rtol).y1
    rate, change = jax.jvp(scene.rate, (now, y), (jnp.ones(()), scene.rate(now, y)))
    return (y + h * rate + 0.5 * h * h * change)[entry], (rate + h * change)[entry]


def _level(scene: Scene, entry: int, t: float, rtol: float) -> tuple[Array, Array]:
    """() the time at which an entry of the state has slope 0, by a Newton step, and () the step."""
    now, y = jnp.asarray(t), solve(scene, t, rtol=rtol).y1
    rate, change = jax.jvp(scene.rate, (now, y), (jnp.ones(()), scene.rate(now, y)))
    ahead = -jnp.where(change[entry] != 0, rate[entry] / change[entry], 0.0)
    return now + ahead, ahead


class Posed(NamedTuple):
    """The closing equations of an orbit.

    Attributes:
      equations: the equations.
      x: (n,) the unknowns that solve them.
    """

    equations: Equations
    x: np.ndarray

    def of(self, scene: Scene) -> Equations:
        """The equations of a scene with other numbers, or with the same ones traced."""
        known = self.equations.scene
        return eqx.tree_at(lambda e: e.scene, self.equations, scene.starting(known.y0, known.t1))


def pose(orbit: Orbit, hold: Hold) -> Posed:
    """The closing equations of an orbit, in as many segments as its growth of errors requires."""
    guess = np.append(np.asarray(orbit.y0), orbit.period)
    held = conditions(orbit.scene, hold, (orbit.closing,))
    # Conditions may be traced by derivatives; the segments do not depend on these.
    values = jax.lax.stop_gradient(held)
    if is_traced(values):
        wanted = "numbers that are known, or traced by derivatives alone"
        raise fail("hold", wanted, "numbers traced by jit or vmap", "Take derivatives outside.")
    fixed = Equations.of(orbit, values)
    equations = cut_into_segments(fixed, guess, orbit.rtol, None, orbit.angle)
    x = equations.spread(guess[:-1], guess[-1], orbit.rtol, orbit.angle)
    return Posed(dataclasses.replace(equations, conditions=held), x)


def _chain(legs: tuple[Leg, ...], orbit: HybridOrbit) -> DifferentiableChain:
    """The chain with its derivatives by the implicit function theorem."""
    chain, start, spans = ChainEquations.of(orbit), np.asarray(orbit.y0), orbit.spans
    with jax.ensure_compile_time_eval():
        found = chain.linearize(chain.pack(start, spans), orbit.rtol)
        leg_sizes = chain.sizes(found, spans)
        units, rows = chain.pack(leg_sizes[0], spans), chain.residual_units(found, spans, leg_sizes)
    linear = linearization(found.jacobian * units / rows[:, None], units, rows)
    miss = residuals(legs, orbit.closes, jnp.asarray(start), jnp.asarray(spans), orbit.rtol)
    x, k = linear.solution(np.concatenate([start, spans]), miss), len(start)
    return DifferentiableChain(legs, x[:k], x[k:], orbit)


def residual(equations: Equations, x: Array, rtol) -> Array:
    """(m,) the residual at x, differentiable in every number of the equations."""
    here = pieces(equations, x)
    inputs = [jax.tree.map(lambda leaf, i=i: leaf[i], here) for i in range(equations.segments)]
    ends = [end_of(equations.scene, equations.make, piece, rtol).y1 for piece in inputs]
    return errors(equations, x, here.start, jnp.stack(ends))


@jax.jit
def _implicit(equations: Equations, x, linear: Linearization, rtol) -> tuple[Array, Array, Array]:
    """Start, period and angle at x, with their derivatives by the implicit function theorem."""
    x = linear.solution(x, residual(equations, x, rtol))
    unknowns = equations.unpack(x)
    return equations.start(x), unknowns.period, unknowns.angle


def _linearize(equations: Equations, x: np.ndarray, rtol: float) -> Linearization:
    """The equations, linearised at x; the pseudo-inverse selects the nearest orbit in its units."""
    closed = InUnits(equations, x, rtol)
    return linearization(closed(x)[1], closed.units.x, closed.units.residual)


def linearization(jacobian: np.ndarray, units: np.ndarray, rows: np.ndarray) -> Linearization:
    """The linearised equations, from a Jacobian in units of unknowns (n,) and equations (m,)."""
    inverse = np.linalg.pinv(jacobian, rcond=newton.RANK_TOLERANCE)
    return Linearization(units[:, None] * inverse / rows, units, rows)


def _multipliers(linear: Stability, basis: np.ndarray, m: Array) -> Array:
    """(p,) the non-trivial multipliers, with their derivatives from those of the return map.

    Args:
      linear: the known stability.
      basis: (k, d) the basis of its monodromy matrix.
      m: (k, k) the return map, equal to the known one but for its derivatives. Where it is not,
        as for a state of rest with other numbers, multipliers are NaN.
    """
    values, right, left = _eigenvectors(linear, basis)
    fixed = jax.lax.stop_gradient(m)
    off = jnp.abs(jnp.sum(left * (fixed.astype(right.dtype) @ right).T, axis=1) - values)
    same = off <= _APART * linear.bars + _SAME_MAP * np.maximum(np.abs(values), 1.0)
    change = nan_unless(same[:, None], left)
    return jnp.asarray(values) + jnp.sum(
        change * (first_only(m - fixed).astype(right.dtype) @ right).T, axis=1
    )


def _eigenvectors(
    linear: Stability, basis: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Non-trivial multipliers (p,), right (k, p) and left (p, k) eigenvectors, left @ right = 1.

    A multiplier that is not simple and its left eigenvector are NaN.
    """
    simple = _simple(linear)
    values, vectors = np.linalg.eig(linear.monodromy)
    others, duals = np.linalg.eig(linear.monodromy.T)
    known, right, left = [], [], []
    for value, alone in zip(linear.nontrivial, simple, strict=True):
        v = vectors[:, np.argmin(np.abs(values - value))]
        w = duals[:, np.argmin(np.abs(others - value))]
        size = w @ v
        known.append(value if alone else np.nan)
        right.append(basis @ v)
        left.append(basis @ w / size if alone else np.full(len(basis), np.nan))
    p, k = len(right), len(basis)
    return (
        np.array(known, complex),
        np.array(right, complex).reshape(p, k).T,
        np.array(left, complex).reshape(p, k),
    )


def _simple(linear: Stability) -> np.ndarray:
    """(p,) whether each multiplier differs from all others, including those that are forced."""
    forced = len(linear.multipliers) - len(linear.nontrivial)
    bars = np.append(linear.bars, np.zeros(forced))
    distance = np.abs(linear.nontrivial[:, None] - linear.multipliers)
    apart = distance > _APART * (linear.bars[:, None] + bars)
    return np.asarray((apart | np.eye(*apart.shape, dtype=bool)).all(axis=1))
