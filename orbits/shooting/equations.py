"""The closing equations of an orbit and their Jacobian, as functions of one vector x of unknowns.

The unknowns are the start (the entries of it that the closing condition leaves free) and the
period; with several segments, which are integrated independently so that errors of an unstable
orbit do not grow over a whole period, also the states between them; the angle of a relative orbit;
the parameter of a family. They form the vector x, with the period as its last entry.

Each segment is integrated once with its variational equations. The residual is then a cheap
function of the ends and of x; automatic differentiation takes its Jacobian with the ends made
linear in x.
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status
from jaxdyn._checks import as_float
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.solvers import RADAU9
from orbits.closing.closings import Closing, Condition
from orbits.closing.given import beside, drive
from orbits.closing.sizes import PHASES, sizes
from orbits.motion import advance
from orbits.orbit import Orbit
from orbits.shooting import gauss_steps
from orbits.shooting.segment import (
    UNTIMED,
    Limits,
    LinearizedEnd,
    Make,
    Piece,
    linearize_end,
    map_segments,
    scene_of,
)


class Unknowns(NamedTuple):
    """The unknowns, by name."""

    start: Array  # (p,) free entries of the start
    between: Array  # (segments - 1, k) states between segments
    angle: Array  # () angle of a relative orbit, else 0
    parameter: Array  # () parameter of a family, else 0
    period: Array  # ()


class Evaluation(NamedTuple):
    """The closing equations at a point x.

    Attributes:
      residual: (m,) zero at an orbit.
      jacobian: (m, n) its derivatives with respect to x (n,).
      transitions: (segments, k, k) derivatives of each segment's end with respect to its start.
      status: () the worst `Status` code of the integrations.
      steps: () number of accepted steps of all segments; 0 by collocation.
    """

    residual: Array
    jacobian: Array
    transitions: Array
    status: Array
    steps: Array


class Equations(eqx.Module):
    """The closing equations of a scene: x -> residual and Jacobian.

    Attributes:
      scene: the scene; its start satisfies what the closing condition requires of a start.
      closing: the closing condition.
      conditions: further conditions besides closing.
      make: (parameter of a family) -> scene; None without a parameter.
      shares: (segments,) fractions of the time to integrate; their sum is 1.
      s_spans: (segments,) spans of logarithmic time; None in plain time.
      beside: (k,) offset from the start to the state at which the rate is compared with that one
        period later; None where the rate does not depend on time.
      collocated: whether a segment is one step of Gauss collocation instead of an integration.
      stiff: whether a stiff method integrates motions, for first guesses.
    """

    scene: Scene
    closing: Closing
    conditions: tuple[Condition, ...] = ()
    make: Make | None = eqx.field(static=True, default=None)
    shares: tuple[float, ...] = (1.0,)
    s_spans: tuple[float, ...] | None = None
    beside: np.ndarray | None = None
    collocated: bool = eqx.field(static=True, default=False)
    stiff: bool = eqx.field(static=True, default=False)

    @classmethod
    def of(cls, orbit: Orbit, conditions: tuple[Condition, ...] = (), make: Make | None = None):
        """The equations of a known orbit, on its mesh or in one segment."""
        spans = None if orbit.s_period is None else (orbit.s_period / orbit.closing.parts,)
        collocated = orbit.mesh is not None
        return cls(
            shares=orbit.mesh if collocated else (1.0,),
            collocated=collocated,
            stiff=orbit.stiff,
            scene=orbit.scene,
            closing=orbit.closing,
            conditions=conditions,
            make=make,
            s_spans=spans,
            beside=beside(orbit.scene),
        )

    @property
    def driven(self) -> bool:
        """Whether the rate depends on time; then each segment starts at its own time."""
        return self.beside is not None

    @property
    def s_period(self) -> float | None:
        """The logarithmic time of a whole period; None in plain time."""
        return None if self.s_spans is None else self.closing.parts * sum(self.s_spans)

    @property
    def segments(self) -> int:
        """Number of segments."""
        return len(self.shares)

    def unpack(self, x: Array | np.ndarray) -> Unknowns:
        """The unknowns that x consists of."""
        k = len(self.scene.y0)
        p = len(self.closing.free(k))
        middle = p + (self.segments - 1) * k
        angle, parameter = self.closing.turns, self.make is not None
        zero = 0.0 * x[-1]
        return Unknowns(
            start=x[:p],
            between=x[p:middle].reshape(self.segments - 1, k),
            angle=x[middle] if angle else zero,
            parameter=x[middle + angle] if parameter else zero,
            period=x[-1],
        )

    def pack(self, y0, between, angle, parameter, period) -> np.ndarray:
        """x (n,) of these unknowns; the entries of y0 (k,) that are not free are not used."""
        start = np.asarray(y0)[self.closing.free(len(self.scene.y0))]
        more = [angle] * self.closing.turns + [parameter] * (self.make is not None)
        return np.concatenate([start, np.ravel(between), more, [period]]).astype(float)

    def place(self, x: np.ndarray) -> np.ndarray:
        """(p,) the unknowns without the states between segments: the same for any segmentation."""
        start, between = self.unpack(x)[:2]
        return np.delete(x, slice(start.size, start.size + between.size))

    def scene_at(self, parameter) -> Scene:
        """The scene at a value of the family's parameter."""
        return scene_of(self.scene, self.make, parameter)

    def start(self, x) -> Array:
        """(k,) the start at x."""
        unknowns = self.unpack(x)
        system = self.scene_at(unknowns.parameter).system
        return self.closing.start(system, unknowns.start, self.scene.y0)

    def start_at(self, x: np.ndarray) -> np.ndarray:
        """`start` on the host, by the same compiled program as evaluations."""
        return np.asarray(pieces(self, x).start)[0]

    def spread(self, y0, period, rtol, angle=0.0, parameter=0.0) -> np.ndarray:
        """x of a motion; the states between segments are those through which it passes."""
        between = self._states_between([(0.0, 0.0, y0)], period, parameter, rtol)
        return self.pack(y0, between, angle=angle, parameter=parameter, period=period)

    def move_to(self, x: np.ndarray, cuts: "Equations", rtol) -> np.ndarray:
        """x of the same motion for the same equations in other segments."""
        unknowns = self.unpack(x)
        angle, parameter, period = (float(number) for number in unknowns[2:])
        starts = np.asarray(pieces(self, x).start)
        if self.collocated:
            between = self.states_at(x, np.cumsum(cuts.shares[:-1]))
        else:
            known = [(*joint, y) for joint, y in zip(self._joints, starts, strict=True)]
            between = cuts._states_between(known, period, parameter, rtol)
        return cuts.pack(starts[0], between, angle=angle, parameter=parameter, period=period)

    def states_at(self, x: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """(n, k) states of a motion by collocation, from its polynomials at shares (n,) of time."""
        here = pieces(self, x)
        nodes = np.asarray(gauss_steps.steps(self.scene, here, make=self.make).nodes)
        ends = np.append(0.0, np.cumsum(self.shares))
        interval = np.clip(np.searchsorted(ends, shares, side="right") - 1, 0, len(ends) - 2)
        inside = (shares - ends[interval]) / np.diff(ends)[interval]
        return gauss_steps.interpolate(np.asarray(here.start)[interval], nodes[interval], inside)

    def _states_between(self, known: list, period, parameter, rtol) -> list[np.ndarray]:
        """The states between segments of a motion that passes through known states.

        Each known state is given with its share of the time and its logarithmic time.
        """
        scene, part = self.scene_at(as_float(parameter)), period / self.closing.parts
        solver = RADAU9 if self.stiff else None
        between, (at, s_at, y), left = [], known[0], known[1:]
        # One after the other: a program for all of them would be compiled for each number.
        for share, s in self._joints[1:]:
            while left and left[0][0] <= share:
                (at, s_at, y), left = left[0], left[1:]
            t0 = at * part if self.driven else 0.0
            further = None if s is None or s_at is None else s - s_at
            span = (share - at) * part
            end = advance(scene.starting(y), span, further, t0=t0, rtol=rtol, solver=solver)
            at, s_at, y = share, s, end.y1
            between.append(np.asarray(y))
        return between

    def transitions(self, y0, period, rtol) -> np.ndarray:
        """(segments, k, k) derivatives of segments' ends with respect to their starts."""
        if self.collocated:
            return np.asarray(self(self.spread(y0, period, rtol), rtol).transitions)
        y, t, maps = jnp.asarray(y0, float), 0.0, []
        for share, s in zip(self.shares, self._spans, strict=True):
            span = share * period / self.closing.parts
            piece = Piece(start=y, t0=t * self.driven, span=span, parameter=0.0, s=s)
            found = linearize_end(self.scene, piece, rtol, make=self.make)
            y = found.y1
            maps.append(np.asarray(found.slopes.start))
            t += span
        return np.stack(maps)

    @property
    def _joints(self) -> list[tuple[float, float | None]]:
        """Where each segment starts: the share of the time, and the logarithmic time."""
        shares = np.cumsum([0.0, *self.shares[:-1]]).tolist()
        if self.s_spans is None:
            return [(share, None) for share in shares]
        return list(zip(shares, np.cumsum([0.0, *self.s_spans[:-1]]).tolist(), strict=True))

    @property
    def _spans(self) -> tuple[float | None, ...]:
        return (None,) * self.segments if self.s_spans is None else self.s_spans

    def over_periods(self, times: int) -> "Equations":
        """The equations of the same motions, with `times` periods counted as one."""
        scene = self.scene.starting(self.scene.y0, times * self.scene.t1)
        shares = tuple(share / times for share in self.shares) * times
        spans = None if self.s_spans is None else self.s_spans * times
        return dataclasses.replace(self, scene=scene, shares=shares, s_spans=spans)

    def repeat(self, x: np.ndarray, times: int, rtol) -> np.ndarray:
        """x of the same motion for the equations `over_periods`."""
        unknowns = self.unpack(x)
        angle, period = (times * float(n) for n in (unknowns.angle, unknowns.period))
        parameter = float(unknowns.parameter)
        return self.over_periods(times).spread(
            self.start_at(x), period, rtol, angle=angle, parameter=parameter
        )

    def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bounds on x from those (k + 1,) on the start and the period; all else is unbounded."""

        def on_x(b: np.ndarray, free: float) -> np.ndarray:
            between = np.full((self.segments - 1, len(b) - 1), free)
            return self.pack(b[:-1], between, angle=free, parameter=free, period=b[-1])

        return on_x(lower, -np.inf), on_x(upper, np.inf)

    def __call__(self, x: np.ndarray, rtol: float, limits: Limits = UNTIMED) -> Evaluation:
        """The residual and the Jacobian at x; NaN where the motion of a segment ends early."""
        if not x[-1] > 0:  # the period must be positive
            x = np.where(np.arange(len(x)) == len(x) - 1, np.nan, x)
        here = jax.tree.map(np.asarray, pieces(self, x))
        found = self.pass_segments(here, rtol, limits)
        residual, jacobian = map(np.asarray, linearize(self, x, here, found.y1, found.slopes))
        return Evaluation(
            residual=residual,
            jacobian=jacobian,
            transitions=found.slopes.start,
            status=found.status.max(),
            steps=found.steps.sum(),
        )

    def pass_segments(self, here: Piece, rtol: float, limits: Limits = UNTIMED) -> LinearizedEnd:
        """The ends of all segments with their derivatives."""
        if self.collocated:
            found, slopes = gauss_steps.linearize_steps(self.scene, here, make=self.make)
            none = np.zeros(self.segments, int)
            return LinearizedEnd(found.end, found.status, none, slopes)

        def integrate(piece: Piece):
            if limits.over():
                return _unfinished(len(piece.start))
            found = linearize_end(self.scene, piece, rtol, limits=limits, make=self.make)
            return jax.block_until_ready(found)

        # One compiled program for any number of segments.
        return map_segments(integrate, here)

    def residual(self, x: np.ndarray, here: Piece, ends: np.ndarray) -> np.ndarray:
        """(m,) the residual at x from the segments and their ends (n, k), however obtained."""
        n, k = ends.shape
        none = Piece(np.zeros((n, k, k)), *np.zeros((3, n, k)))
        return np.asarray(linearize(self, x, here, ends, none)[0])


def _unfinished(k: int) -> LinearizedEnd:
    """The result of `linearize_end` for a segment that is not integrated: NaN."""
    slopes = Piece(np.full((k, k), np.nan), *np.full((3, k), np.nan))
    return LinearizedEnd(np.full(k, np.nan), np.asarray(Status.STEP_LIMIT), np.asarray(0), slopes)


@jax.jit
def pieces(equations: Equations, x: Array) -> Piece:
    """The segments at x."""
    unknowns = equations.unpack(x)
    scene = equations.scene_at(unknowns.parameter)
    spans = unknowns.period / equations.closing.parts * jnp.asarray(equations.shares)
    first = equations.start(x)
    # Not cumsum(spans) - spans, whose first entry would be zero only up to rounding.
    times = jnp.where(equations.driven, jnp.append(0.0, jnp.cumsum(spans)[:-1]), 0.0)
    between = jax.vmap(scene.system.project)(times[1:], unknowns.between)
    starts = jnp.concatenate([first[None], between])
    s = None if equations.s_spans is None else jnp.asarray(equations.s_spans, float)
    parameters = jnp.full_like(spans, unknowns.parameter)
    return Piece(start=starts, t0=times, span=spans, parameter=parameters, s=s)


@jax.jit
def linearize(equations: Equations, x: Array, here: Piece, ends: Array, slopes: Piece):
    """The residual and the Jacobian at x from the segments' ends and their derivatives."""

    def residual(x):
        change = jax.tree.map(jnp.subtract, pieces(equations, x), here)
        by_x = jnp.sum(slopes.start * change.start[:, None, :], axis=-1)
        by_x = by_x + slopes.span * change.span[:, None] + slopes.t0 * change.t0[:, None]
        by_x = by_x + slopes.parameter * change.parameter[:, None]
        return errors(equations, x, here.start + change.start, ends + by_x)

    return value_and_jacfwd(residual)(x)


def errors(equations: Equations, x: Array, starts: Array, ends: Array) -> Array:
    """(m,) the residual at x from the starts and ends (n, k) of the segments."""
    unknowns = equations.unpack(x)
    scene = equations.scene_at(unknowns.parameter)
    system = scene.system
    joints = jax.vmap(system.difference)(ends[:-1], starts[1:])
    return jnp.append(joints, boundary(equations, x, starts[0], ends[-1]))


@jax.jit
def boundary(equations: Equations, x: Array, start: Array, end: Array) -> Array:
    """(m,) the equations other than the joints: closing, conditions, and the period of a drive."""
    unknowns = equations.unpack(x)
    scene = equations.scene_at(unknowns.parameter)
    miss = equations.closing.residual(scene.system, end, start, unknowns.angle)
    more = [c.value(scene, start, unknowns.period) for c in equations.conditions]
    if equations.beside is not None:
        more.append(drive(scene, start, unknowns.period, equations.beside))
    return jnp.concatenate([miss, *(jnp.reshape(c, -1) for c in more)])


# ---- Closing equations in the units of a motion: dimensionless unknowns, residual and Jacobian
#
# Norms, ranks, dampings and goals are meaningful only for dimensionless numbers. So an iteration
# works with the unknowns divided by their sizes, and with each equation divided by its own unit: a
# closing error by the size of its entry, a condition by the norm of its changes when each unknown
# changes by its size.

#: A value below this share of an entry's size is rounding.
_ROUNDING = 1e-9


class UnknownSizes(NamedTuple):
    """The sizes from which the units of unknowns follow.

    Attributes:
      sizes: (k,) sizes of the entries of the state.
      parameter: the unit of a family's parameter.
    """

    sizes: np.ndarray
    parameter: float = 1.0


class Units(NamedTuple):
    """Units of the unknowns and of the residual.

    Attributes:
      x: (n,) units of the unknowns.
      residual: (m,) units of the residual.
    """

    x: np.ndarray
    residual: np.ndarray

    def jacobian(self, jacobian: np.ndarray) -> np.ndarray:
        """(m, n) a Jacobian in these units."""
        return np.asarray(jacobian) * self.x / self.residual[:, None]


def units_at(
    equations: Equations, x: np.ndarray, jacobian: np.ndarray, known: UnknownSizes
) -> Units:
    """The units of the motion at x, where the Jacobian is known."""
    entry_sizes, x_units = known.sizes, units_of_unknowns(equations, x, known)
    changes = np.abs(np.where(np.isfinite(jacobian), jacobian, 0.0)) * x_units
    between = np.tile(entry_sizes, equations.segments - 1)
    rows = np.concatenate([between, equations.closing.residual_units(entry_sizes)])
    return Units(x_units, equation_units(equations, rows, changes))


def units_of_unknowns(equations: Equations, x: np.ndarray, known: UnknownSizes) -> np.ndarray:
    """(n,) the units of unknowns x (n,); the unit of time is a radian of the period."""
    # The states of all segments together count as much as one.
    entry_sizes = np.sqrt(equations.segments) * known.sizes
    between = np.tile(entry_sizes, (equations.segments - 1, 1))
    radian = x[-1] / (2 * np.pi)
    return equations.pack(entry_sizes, between, angle=1.0, parameter=known.parameter, period=radian)


def equation_units(equations: Equations, states: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """(m,) the units of equations that begin with errors of states, whose sizes are `states`.

    The unit of a condition is the norm of its changes (m, n) when each unknown changes by its unit;
    the equations of a drive, which are the last ones, have unit 1.
    """
    rows = np.linalg.norm(changes, axis=1)
    rows = np.where(rows > 0, rows, 1.0)
    rows[: len(states)] = states
    if equations.driven:
        rows[len(rows) - PHASES * len(equations.scene.y0) :] = 1.0
    return rows


def sizes_at(equations: Equations, x: np.ndarray) -> np.ndarray:
    """(k,) the sizes of the state's entries along the motion at x."""
    unknowns, start = equations.unpack(x), equations.start_at(x)
    known = sizes(equations.scene)
    guess = np.append(equations.scene.y0, equations.scene.t1)
    if equations.make is None and np.array_equal(np.append(start, unknowns.period), guess):
        return known
    scene = equations.scene_at(unknowns.parameter)
    # An entry that rests at 0 in the equations' own scene may be rounding here.
    start = np.where(np.abs(start) > _ROUNDING * known, start, 0.0)
    found = sizes(scene.starting(start, unknowns.period))
    return np.where(found > _ROUNDING * known, found, known)


class InUnits:
    """The closing equations in the units of the motion at a first point, at a tolerance.

    The units follow from the start of that motion, or from sizes that are known.

    Attributes:
      equations: the equations.
      rtol: tolerance of the integrations.
      sizes: (k,) sizes of the entries of the state along that motion.
      units: the units.
    """

    def __init__(
        self,
        equations: Equations,
        x: np.ndarray,
        rtol: float,
        limits: Limits = UNTIMED,
        known: UnknownSizes | None = None,
    ):
        self.equations, self.rtol, self._limits = equations, rtol, limits
        self._last = x, equations(x, rtol, limits)
        known = known or UnknownSizes(sizes_at(equations, x))
        self.sizes = known.sizes
        self.units = units_at(equations, x, np.asarray(self._last[1].jacobian), known)

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residual (m,) and the Jacobian (m, n), in the units, at x (n,) without units.

        The last evaluation is kept and not repeated.
        """
        found = self._at(x)
        return np.asarray(found.residual) / self.units.residual, self.units.jacobian(found.jacobian)

    def transitions(self, x: np.ndarray) -> np.ndarray:
        """(segments, k, k) derivatives of segments' ends with respect to starts, in the sizes."""
        return map_in_units(np.asarray(self._at(x).transitions), self.sizes)

    def steps(self, x: np.ndarray) -> int:
        """The number of steps of the integrations at x."""
        return int(self._at(x).steps)

    def status(self, x: np.ndarray) -> int:
        """The worst `Status` code of the integrations at x."""
        return int(self._at(x).status)

    def _at(self, x: np.ndarray) -> Evaluation:
        if not np.array_equal(x, self._last[0]):
            self._last = x, self.equations(x, self.rtol, self._limits)
        return self._last[1]
