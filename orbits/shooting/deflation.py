"""Newton's method away from known orbits: deflation.

The closing equations F(x) = 0 are multiplied by m(x), the product of 1 / d^2 + 1 over the known
orbits, with d the distance of x from each. The product has all zeros of F but the known orbits.
Its Jacobian is m (J + F g^T) with g the gradient of log m, so that by the Sherman-Morrison formula
the Newton step is that of F itself times 1 / (1 - g . step): it costs no more than a plain one.

Distances are taken modulo the transformations that leave an orbit the same (`orbits.same_orbit`).
The start may lie anywhere on the known orbit, run through once or twice. Several free points are
compared by the dot products of their positions and velocities, which rotations, reflections and
translations preserve, for each order of equal bodies and both directions of time; those that only
attract each other are scaled to the known period first.

Steps have a largest length and need not decrease the residual: m F has minima beside the known
orbits, where a descent would end.

Reference: P. Farrell, A. Birkisson, S. Funke, SIAM J. Sci. Comput. 37 (2015) A2026.
"""

import dataclasses
import functools
import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, System
from jaxdyn._checks import fail
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.system import differences
from orbits.closing.given import Problem, is_driven, repeats
from orbits.closing.sizes import alike, coupled_sizes, sizes
from orbits.motion import gravitates, has_several_points, quick_solve
from orbits.orbit import Orbit, Outcome
from orbits.shooting import newton
from orbits.shooting.equations import Equations, InUnits
from orbits.shooting.multiple import Shooting
from orbits.shooting.outcomes import Trouble, orbit_at
from orbits.shooting.segmentation import cut_into_segments
from orbits.shooting.strategy import Effort, Search, Strategy

#: Distance from a known orbit, relative to its size, below which an orbit is the same.
SAME = 1e-4
_SAMPLES = 512  # samples of a known orbit; straight lines between them are off by 1e-5 of its size
_RTOL = 1e-10  # tolerance of the samples
_RESTING = 1e-6  # a range below this share of an entry's size is rounding
_TIMES = (1, 2)  # numbers of periods of a known orbit that are deflated
_PARTS = 12  # most periods of the drive in one period of a known orbit
_MOST_ORDERED = 4  # most bodies that are permuted; of more, each is compared only with itself
#: A guess nearer to a known orbit than this, relative to its size, is moved by about this distance,
#: in one random direction after another.
_BESIDE = 0.1
#: Dampings used in turn by successive iterations: with much damping iterates may alternate between
#: two points, with little they jump. Averaged over eight seeds, 0.03 alone finds 7 of 8 other
#: motions of Duffing's oscillator and 2.9 cycles of Lorenz's system, 0.3 alone none and 5.8; 0.03
#: and 1 in turn find 7 of 8 and 5.4.
_DAMPINGS = (0.03, 1.0)
_TRIES = 3  # limit of the steps of all iterations together, in multiples of the limit of one
_LONGEST = 0.1  # longest step, relative to the known orbits' size and to the guessed period
_NEAR = 1e-6  # closing error from which Newton's method without deflation finds the same orbit
_HALVINGS = 5  # most halvings of a step into a singularity
_LOOSE = 1e-11  # tolerance of the integrations
_MAX_STEPS = 5000  # steps of an integration; a near collision takes many times more
_SHORTEST = 0.1  # shortest period, relative to the guessed one
_HELD = 3  # steps in a row to the shortest period after which an iteration is abandoned


class KnownOrbit(eqx.Module):
    """A known orbit as straight lines between samples.

    There is one set of lines for each of its equivalent images: permutations of equal bodies and
    the two directions of time.

    Attributes:
      points: (c, s, q) where the lines begin: states (k,), or their dot products (`_dots`).
      sides: (c, s, q) the vectors along the lines, divided by the scales.
      period: () its period.
      scales: (k,) the largest range of the entries of each group (`jaxdyn.scales`), and at least
        the effect of the other entries (`coupled_sizes`).
      scaled: whether Kepler's third law scales it.
    """

    points: Array
    sides: Array
    period: Array
    scales: Array
    scaled: bool = eqx.field(static=True)


class DeflationResult(NamedTuple):
    """Where a deflated iteration ended.

    Attributes:
      x: (n,) the unknowns.
      residual: largest entry of the closing error.
      near: whether an orbit unlike the known ones is near.
      iterations: number of steps that were taken.
    """

    x: np.ndarray
    residual: float
    near: bool
    iterations: int = 0


@dataclasses.dataclass(frozen=True)
class Deflated(Strategy):
    """Newton's method away from known orbits of the scene: another one from the same guess.

    The orbits of a family are unlike each other: hold the energy of a conservative scene.

    Attributes:
      known: the known orbits; for `orbits.find_hybrid`, chains of legs.
    """

    known: Sequence[Any]

    def orbit(self, search: Search) -> Orbit:
        """An orbit unlike the known ones, or the best iterate and the reason.

        Raises:
          ValueError: a known orbit does not close, or is of another system.
        """
        problem, effort, equations = search.problem, search.effort, search.equations
        known = known_orbits(self.known, problem.scene)
        guess = problem.guess
        cuts = cut_into_segments(
            equations,
            guess,
            effort.rtol,
            search.segments,
            search.angle,
            limits=effort.limits(),
        )
        effort.begin("Newton's method with the known orbits deflated")
        x = cuts.spread(guess[:-1], guess[-1], effort.rtol, angle=search.angle)
        found = deflate(problem, cuts, x, known, effort)
        if found.near:
            orbit = Shooting().orbit(search.at(cuts, found.x))
            at = equations.pack(orbit.y0, (), orbit.angle, 0.0, orbit.period)
            if not orbit.ok or distance(equations, at, known) > SAME:
                return orbit
        return orbit_at(cuts, found.x, found.residual, Outcome.NO_OTHER, rtol=effort.rtol)


def _named(scene: Scene) -> str:
    entries = ", ".join(name for name, _ in scene.labels())
    return f"{scene.name or type(scene.system).__name__}, of {entries}"[:80]


def known_orbits(orbits: Sequence[Orbit], scene: Scene) -> list[KnownOrbit]:
    """The known orbits in the form in which they are deflated.

    Raises:
      ValueError: one of the orbits does not close, or is of another system.
    """
    for orbit in orbits:
        if not (isinstance(orbit, Orbit) and orbit.ok):
            got = getattr(orbit, "message", type(orbit).__name__)
            raise fail("Deflated", "known orbits that close", got)
        if type(orbit.scene.system) is not type(scene.system) or orbit.y0.shape != scene.y0.shape:
            wanted, got = map(_named, (scene, orbit.scene))
            raise fail("Deflated", f"known orbits of {wanted}", got)
    return [_known_orbit(orbit) for orbit in orbits]


def distance(equations: Equations, x: np.ndarray, known: Sequence[KnownOrbit]) -> float:
    """Distance of a start and a period from the nearest known orbit, relative to its size."""
    return min(float(np.sqrt(square)) for square, _ in _squares(equations, x, known))


def deflate(
    problem: Problem,
    equations: Equations,
    x: np.ndarray,
    known: Sequence[KnownOrbit],
    effort: Effort,
) -> DeflationResult:
    """A point near an orbit unlike the known ones, or the last iterate.

    Args:
      problem: bounds of the start and the period.
      equations: the closing equations.
      x: (n,) a guess.
      known: the known orbits.
      effort: limits of steps and time, and the function that is called after each step.
    """
    lower, upper = equations.bounds(problem.lower, problem.upper)
    lower[-1] = max(lower[-1], min(_SHORTEST * x[-1], upper[-1]))
    if equations.driven:  # the period is that of the drive
        lower[-1] = upper[-1] = x[-1]
    closed = InUnits(equations, x, _LOOSE, effort.limits(_MAX_STEPS))
    trouble = Trouble(equations, x)
    iteration = DeflatedNewton(
        closed=closed,
        units=closed.units.x,
        squares=lambda x: _squares(equations, x, known),
        sizes=_sizes(equations, x, known),
        bounds=(lower, upper),
        lost=lambda x: trouble(equations, x) is not None,
        effort=effort,
    )
    return iteration.solve(x)


class DeflatedNewton(NamedTuple):
    """Newton's method on deflated equations.

    Attributes:
      closed: x (n,) -> residual and Jacobian in units.
      units: (n,) units of the unknowns.
      squares: x -> the square of its distance from each known motion, and that square's gradient.
      sizes: (n,) sizes of the unknowns; the longest step is measured in them.
      bounds: lower and upper bounds (n,) of the unknowns, the last of which is a time.
      lost: x -> whether an iteration that reaches x should be abandoned.
      effort: limits of steps and time, and the function that is called after each step.
    """

    closed: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    units: np.ndarray
    squares: Callable[[np.ndarray], list]
    sizes: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray]
    lost: Callable[[np.ndarray], bool]
    effort: Effort

    def distance(self, x: np.ndarray) -> float:
        """Distance of x (n,) from the nearest known motion, relative to its size."""
        return min(float(np.sqrt(square)) for square, _ in self.squares(x))

    def solve(self, x: np.ndarray) -> DeflationResult:
        """Where iterations from a guess x (n,) end.

        If the guess is near a known motion, they start at random points beside it.
        """
        effort, (lower, upper) = self.effort, self.bounds
        if self.distance(x) > _BESIDE:
            return self._iterate(x, effort.max_iterations, _DAMPINGS[0])
        random, result = np.random.default_rng(0), DeflationResult(x, np.inf, near=False)
        left = _TRIES * effort.max_iterations
        for damping in itertools.cycle(_DAMPINGS):
            beside = x + _BESIDE * self.sizes * random.standard_normal(len(x))
            most = min(effort.max_iterations, left)
            result = self._iterate(np.clip(beside, lower, upper), most, damping)
            left -= result.iterations + 1
            if result.near or left <= 0 or effort.over:
                break
        return result

    def _iterate(self, x: np.ndarray, most: int, damping: float) -> DeflationResult:
        """Where the iteration from x (n,) ends, after at most `most` steps."""
        closed, units = self.closed, self.units
        step, size, index, held = np.zeros(len(x)), np.inf, 0, 0
        for index in range(most + 1):
            residual, jacobian = closed(x)
            for _ in range(_HALVINGS):
                if np.isfinite(jacobian).all():
                    break
                step = 0.5 * step
                x = x - step
                residual, jacobian = closed(x)
            size = float(np.abs(residual).max())
            length = float(np.linalg.norm(step / units))
            self.effort.report(newton.Iteration(index, size, float(x[-1]), length))
            lost = not np.isfinite(jacobian).all() or self.lost(x)
            # An iteration can stick at the shortest period, where the equations change little.
            held = held + 1 if x[-1] <= self.bounds[0][-1] < self.bounds[1][-1] else 0
            lost |= held >= _HELD
            if size <= _NEAR and not lost:
                return DeflationResult(x, size, near=self.distance(x) > SAME)
            if lost or index == most or self.effort.over:
                break
            plain = newton.first_step(x, residual, jacobian, *self.bounds, units, damping)
            step = plain / (1 - _slope(self.squares(x)) @ plain)
            step = step / max(1.0, float(np.max(np.abs(step) / self.sizes)) / _LONGEST)
            new = np.clip(x + step, *self.bounds)
            step, x = new - x, new
        return DeflationResult(x, size, near=False, iterations=index)


def _slope(squares: list) -> np.ndarray:
    """(n,) the gradient of log m.

    The gradient of log(1 / q + 1), where q is the square of a distance, is minus that of q divided
    by q (1 + q).
    """
    return -np.sum([np.asarray(slope) / (q * (1 + q)) for q, slope in squares], axis=0)


def _squares(equations: Equations, x: np.ndarray, known: Sequence[KnownOrbit]) -> list:
    """The squares of the distances from known orbits, and their gradients."""
    return [_square(equations, x, one) for one in known]


@jax.jit
@functools.partial(jax.value_and_grad, argnums=1)
def _square(equations: Equations, x: Array, one: KnownOrbit) -> Array:
    """() the square of the distance of a start and a period from a known orbit."""
    system, y0 = equations.scene.system, equations.start(x)
    return jnp.stack([_square_over(system, y0, x[-1] / times, one) for times in _TIMES]).min()


def _square_over(system: System, y0: Array, period: Array, one: KnownOrbit) -> Array:
    """() that square, with `period` the time that corresponds to one period of the known orbit."""
    longer = period / one.period
    if one.scaled:
        lengths = longer ** (2 / 3)
        half = len(y0) // 2
        y0 = jnp.concatenate([y0[:half] / lengths, y0[half:] * jnp.sqrt(lengths)])
    if has_several_points(system):
        off = jax.vmap(jax.vmap(lambda y: _dots(system, y0 / one.scales) - y))(one.points)
    else:
        off = jax.vmap(jax.vmap(lambda y: system.difference(y0, y) / one.scales))(one.points)
    square = jnp.sum(one.sides * one.sides, axis=-1)
    along = jnp.sum(off * one.sides, axis=-1) / jnp.where(square > 0, square, 1.0)
    along = jax.lax.stop_gradient(jnp.clip(along, 0.0, 1.0))
    nearest = jnp.sum((off - along[..., None] * one.sides) ** 2, axis=-1).min()
    # On the orbit the gradient is zero: it has no direction there, and steps are zero anyway.
    late = 0.0 if one.scaled else (longer - 1.0) ** 2
    return jnp.maximum(nearest + late, jnp.finfo(float).tiny)


def _dots(system: System, y: Array) -> Array:
    """(q,) dot products of all positions and velocities relative to the centre of mass."""
    assert isinstance(system, FreePoints)
    share = system.m / system.m.sum()
    x = y.reshape(2, len(system.m), -1)
    x = (x - jnp.einsum("n,and->ad", share, x)[:, None]).reshape(2 * len(system.m), -1)
    return (x @ x.T)[np.triu_indices(2 * len(system.m))]


def _known_orbit(orbit: Orbit) -> KnownOrbit:
    scene, period = orbit.scene, orbit.period
    ts = np.linspace(0.0, period, _SAMPLES + 1)
    ys = quick_solve(scene, period, ts=ts, rtol=_RTOL, solver=orbit.solver).ys
    scales = _scales(scene, np.asarray(ys))
    if has_several_points(scene.system):
        curves = _images(scene.system, np.asarray(ys) / scales)
        points, sides = curves[:, :-1], jnp.diff(curves, axis=1)
    elif is_driven(scene):  # only those points at which a period may begin, by the drive's phase
        parts = next((n for n in range(_PARTS, 1, -1) if repeats(scene, period / n)), 1)
        at = np.arange(parts) * period / parts
        points = quick_solve(scene, period, ts=at, rtol=_RTOL, solver=orbit.solver).ys[None]
        sides = jnp.zeros_like(points)
    else:
        points = ys[None, :-1]
        sides = np.asarray(differences(scene.system, ys[1:], ys[:-1]))[None] / scales
    return KnownOrbit(
        points=jnp.asarray(points),
        sides=jnp.asarray(sides),
        period=jnp.asarray(period),
        scales=jnp.asarray(scales),
        scaled=gravitates(scene),
    )


def _images(system: System, ys: np.ndarray) -> Array:
    """(c, s, q) `_dots` of scaled states (s, k), for each order of equal bodies and of time."""
    assert isinstance(system, FreePoints)
    m = np.asarray(system.m)
    bodies = range(len(m))
    orders = itertools.permutations(bodies) if len(m) <= _MOST_ORDERED else [tuple(bodies)]
    images = []
    for order in (list(order) for order in orders):
        if np.allclose(m[order], m, rtol=1e-12):
            seen = ys.reshape(len(ys), 2, len(m), -1)[:, :, order]
            for back in (1.0, -1.0):
                y = (seen * np.array([1.0, back])[:, None, None]).reshape(len(ys), -1)
                images.append(jax.vmap(functools.partial(_dots, system))(jnp.asarray(y)))
    return jnp.stack(images)


def _scales(scene: Scene, ys: np.ndarray) -> np.ndarray:
    """(k,) the scales of a known orbit from its states (s, k); for entries at rest, the sizes."""
    known = sizes(scene)
    ranges = alike(scene, np.ptp(ys, axis=0))
    return coupled_sizes(scene, np.where(ranges > _RESTING * known, ranges, known))


def _sizes(equations: Equations, x: np.ndarray, known: Sequence[KnownOrbit]) -> np.ndarray:
    """(n,) the size of each unknown: the scales of the known orbits, and the guessed period."""
    scales = np.max([one.scales for one in known], axis=0)
    between = np.tile(scales, (equations.segments - 1, 1))
    return equations.pack(scales, between, angle=1.0, parameter=1.0, period=x[-1])
