"""Connections of equilibria: from a strand that passes the second one, the ends move closer."""

import math
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, _checks
from jaxdyn._records import with_captures
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.analysis.equilibria import equilibrium
from jaxdyn.analysis.linearize import linearize
from jaxdyn.scene import check_scene
from jaxdyn.system import differences
from orbits.closing.given import is_driven, refuse_constraints
from orbits.closing.sizes import sizes_at_rest
from orbits.manifolds.connection import Connection, ConnectionOutcome, no_connection
from orbits.manifolds.directions import of_equilibrium
from orbits.manifolds.links import Links, Solution, sample, solve
from orbits.motion import quick_solve

# ---- An equilibrium and the subspaces of its linear flow as functions of a parameter of the scene
#
# Projectors follow from the matrix sign function, whose Newton iteration is differentiable;
# eigenvectors would need a phase, and have no derivative where two eigenvalues meet.

#: Newton steps for the sign function: each halves a large or doubles a small eigenvalue; the last
#: six converge quadratically.
_SIGN_STEPS = 40


class SpectralSplit(NamedTuple):
    """An equilibrium (k,), the Jacobian (k, k), and the projector (k, k) on the upper subspace."""

    y: Array
    jacobian: Array
    projector: Array


def split(scene: Scene, near: Array, cut: Array, each: Array) -> SpectralSplit:
    """The equilibrium near a state, with the subspace of eigenvalues of real part above `cut`.

    The iteration is in units of the sizes `each` (k,) of the entries.
    """
    y = equilibrium(scene, near)
    jacobian = jax.jacfwd(lambda y: scene.rate(jnp.zeros(()), y))(y)
    one = jnp.eye(len(y))
    units = each[None, :] / each[:, None]
    shifted = jacobian * units - cut * one
    sign = jax.lax.fori_loop(
        0, _SIGN_STEPS, lambda _, s: 0.5 * (s + jnp.linalg.inv(s)), shifted / jnp.max(abs(shifted))
    )
    return SpectralSplit(y, jacobian, 0.5 * (one + sign / units))


# ---- The closing equations: multiple shooting with projection boundary conditions
#
# The unknowns are the travel time, the parameter if there is one, and the states between
# segments. The chain begins at a given distance from the first equilibrium along its unstable
# eigenvector, its links meet, and it ends at a given distance from the second equilibrium, on the
# stable subspace there. These linear ends are off the manifolds by terms of second order. Single
# shooting fails here: an error at the passage of an equilibrium at a distance d grows as a power
# of 1/d, in the Lorenz system as d^(-2.7).
#
# Reference: Beyn (1990), IMA J. Numer. Anal. 10, 379; Doedel & Friedman (1989), J. Comput. Appl.
# Math. 26, 155.

Make = Callable[[Array], Scene]


class ConnectionEquations(Links):
    """The chain of segments that is to connect two equilibria.

    Attributes:
      base: the scene, or any of those that `make` gives.
      make: the scene for each value of the parameter; None without one.
      near: (2, k) states near the two equilibria.
      along: (k,) unstable direction at the first equilibrium, with the sense of its branch.
      across: (k, c) basis, in sizes, of the subspace at the second equilibrium that is not stable.
      each: (k,) sizes of the entries.
      cuts: (2,) real parts that separate the eigenvalues of these subspaces from the others.
      segments: number of links.
      rtol: tolerance of the integrations.
    """

    base: Scene
    make: Make | None = eqx.field(static=True)
    near: Array
    along: Array
    across: Array
    each: Array
    cuts: Array
    segments: int = eqx.field(static=True)
    rtol: float

    def scene_at(self, parameter) -> Scene:
        """The scene at a value of the parameter, or the one scene if there is no parameter."""
        return self.base if self.make is None else self.make(parameter)

    def unpack(self, x: Array) -> tuple[Array, Array | None, Array]:
        """The travel time, the parameter, and the states (segments - 1, k) between links."""
        return x[0], None if self.make is None else x[1], self.states(x)

    def pack(self, time, parameter, states) -> np.ndarray:
        """The inverse of `unpack`."""
        extra = [] if self.make is None else [parameter]
        return np.concatenate([[time], extra, np.ravel(states)])

    def ends(self, scene: Scene) -> tuple[SpectralSplit, Array, SpectralSplit]:
        """The first equilibrium, its unstable direction of length 1, and the second equilibrium."""
        first = split(scene, self.near[0], self.cuts[0], self.each)
        v = first.projector @ self.along
        v = v / jnp.linalg.norm(v / self.each)
        return first, v, split(scene, self.near[1], self.cuts[1], self.each)

    def open(self, x: Array, steps: Array) -> tuple[Scene, Array, Array]:
        time, parameter, states = self.unpack(x)
        scene = self.scene_at(parameter)
        first, v, _ = self.ends(scene)
        return scene, jnp.concatenate([(first.y + steps[0] * v)[None], states]), time

    def gaps(self, x: Array, steps: Array) -> Array:
        """The errors of the links, of the end across the stable subspace, and of its distance.

        `steps` (2,) are the distances of the ends from the equilibria.
        """
        scene, starts, time = self.open(x, steps)
        _, _, second = self.ends(scene)
        states = starts[1:]
        ends = jax.vmap(
            lambda y: quick_solve(scene.starting(y), time / self.segments, rtol=self.rtol).y1
        )(starts)
        off = scene.system.difference(ends[-1], second.y)
        across = self.across.T @ (second.projector @ off / self.each)
        distance = jnp.linalg.norm(off / self.each) - steps[1]
        links = (ends[:-1] - states) / self.each[None]
        return jnp.concatenate([links.ravel(), across, distance[None]])


@eqx.filter_jit
def state_at(chain: ConnectionEquations, x, steps, t) -> tuple[Array, Array]:
    """(k,) state of the chain at a time, and the rate there."""
    scene, starts, time = chain.open(x, steps)
    each = time / chain.segments
    i = jnp.clip(jnp.floor(t / each), 0, chain.segments - 1)
    y = quick_solve(scene.starting(starts[i.astype(int)]), t - i * each, rtol=chain.rtol).y1
    return y, scene.rate(jnp.zeros(()), y)


@eqx.filter_jit
def ends_at(chain: ConnectionEquations, x) -> tuple[SpectralSplit, Array, SpectralSplit]:
    """`ConnectionEquations.ends` at the unknowns."""
    return chain.ends(chain.scene_at(chain.unpack(x)[1]))


# ---- The search: from a strand that passes the second equilibrium, the ends are moved closer

_FIRST = 1e-2  # first distance of the ends; all distances are in the sizes of the entries
_SHORTER = 4.0  # ratio of successive distances
_LEVELS = 14  # most distances that are tried
_STRAND = 4000  # samples of the strand in which the approach is sought
_LONGEST = 10.0  # default time of a strand after leaving, in slowest e-folding times
_SAMPLES = 16  # samples of each link
_BRANCHES = {"+": 1.0, "-": -1.0}


def connect_equilibria(
    a: Scene,
    b,
    make: Make | None,
    parameter: float | None,
    branch: str,
    time: float | None,
    error: float,
    segments: int,
    rtol: float,
) -> Connection:
    """A connection of two equilibria; see `orbits.connect`."""
    _checks.choice("branch", branch, _BRANCHES)
    if (make is None) != (parameter is None):
        raise _checks.fail("parameter", "given together with `make`", parameter)
    p = np.nan if parameter is None else float(_checks.array("parameter", parameter, ()))
    make = None if make is None else with_captures(make, "parameter")
    posed, rates = _pose(check_scene(a), b, make, p, branch, segments, rtol)
    longest = np.log(1 / 1e-6) / rates[0] + _LONGEST / rates.min() if time is None else time
    longest = float(_checks.positive("time", longest, "It is the length of a strand."))
    guess = _approach(posed, p, longest)
    if isinstance(guess, ConnectionOutcome):
        return no_connection(posed, posed.near, guess, np.nan, 0)
    return _shorten(posed, guess, error, rates)


def _pose(
    a: Scene, b, make: Make | None, p: float, branch: str, segments: int, rtol: float
) -> tuple[ConnectionEquations, np.ndarray]:
    """The chain that is to connect the equilibria, and the rates of leaving and slowest arrival."""
    refuse_constraints("a", a)
    if is_driven(a):
        remedy = "It has no equilibria."
        raise _checks.fail("a", "an autonomous scene", "one that depends on time", remedy)
    scene = a if make is None else check_scene(make(jnp.asarray(p)))
    b = _checks.array("b", b, a.y0.shape, "It is a state.")
    near = np.stack([np.asarray(equilibrium(scene, y)) for y in (a.y0, b)])
    for name, y in zip(("a", "b"), near, strict=True):
        if not np.isfinite(y).all():
            remedy = "jaxdyn.equilibria finds those in a box."
            raise _checks.fail(name, "a state near an isolated equilibrium", "none there", remedy)
    leaving, arriving = linearize(scene, near[0]), linearize(scene, near[1])
    up = leaving.eigenvalues.real > leaving.bars
    if up.sum() != 1:
        got = int(up.sum())
        raise _checks.fail("a", "an equilibrium with one unstable eigenvalue", got)
    down = arriving.eigenvalues.real < -arriving.bars
    if not down.any():
        raise _checks.fail("b", "an equilibrium with a stable eigenvalue", "none")
    if make is not None and down.all():
        remedy = "Leave out `make`."
        raise _checks.fail("b", "an equilibrium that is not stable", "one at each value", remedy)
    fast, slow = leaving.eigenvalues.real[up][0], arriving.eigenvalues.real[down].max()
    cuts = np.array(
        [
            0.5 * (fast + leaving.eigenvalues.real[~up].max(initial=-fast)),
            0.5 * (slow + arriving.eigenvalues.real[~down].min(initial=-slow)),
        ]
    )
    each = np.maximum(*(sizes_at_rest(scene, y) for y in near))
    along = of_equilibrium(scene, near[0], "unstable", 1, None).tangent[0]
    along = along / np.linalg.norm(along / each) * _BRANCHES[branch]
    projector = np.asarray(split(scene, near[1], cuts[1], jnp.asarray(each)).projector)
    u, _, _ = np.linalg.svd(map_in_units(projector, each))
    across = u[:, : int((~down).sum())]
    posed = ConnectionEquations(
        scene, make, near, along, across, jnp.asarray(each), cuts, segments, rtol
    )
    return posed, np.array([fast, -slow])


def _approach(posed: ConnectionEquations, p: float, longest: float) -> tuple | ConnectionOutcome:
    """Unknowns and distances of the ends where the strand passes the second equilibrium.

    An outcome if the strand does not pass it.
    """
    scene, (a, b) = posed.base, posed.near
    start = scene.starting(a + _FIRST * posed.along)
    ts = np.linspace(0.0, longest, _STRAND)
    ys = np.asarray(quick_solve(start, ts[-1], ts=ts, rtol=posed.rtol).ys)
    apart = np.asarray(differences(scene.system, ys, b)) / np.asarray(posed.each)
    known = np.isfinite(ys).all(axis=1)
    off = np.where(known, np.linalg.norm(apart, axis=1), np.inf)
    # The strand may begin at the equilibrium itself, and may go to infinity after it has passed.
    passed = 1 + np.flatnonzero((off[1:] < off[:-1]) & (off[1:] <= np.append(off[2:], np.inf)))
    m = int(passed[np.argmin(off[passed])]) if len(passed) else 0
    d = max(2 * off[m], _FIRST)
    before = np.flatnonzero(off[:m] >= d)
    if not len(before):
        return ConnectionOutcome.NO_APPROACH if known.all() else ConnectionOutcome.MOTION_ENDS
    end = int(before[-1])
    nodes = ts[end] * np.arange(1, posed.segments) / posed.segments
    return posed.pack(ts[end], p, _interpolate(nodes, ts[:m], ys[:m])), np.array([_FIRST, d])


def _shorten(posed: ConnectionEquations, guess: tuple, wanted: float, rates) -> Connection:
    """The connection with its ends brought closer to the equilibria until their error is small."""
    x, steps = guess
    total, last, residual = 0, None, np.inf
    for _ in range(_LEVELS):
        found = solve(posed, x, steps)
        total, residual = total + found.iterations, found.residual
        if not found.converged:
            late = last is not None
            outcome = ConnectionOutcome.ERROR_LIMIT if late else ConnectionOutcome.NO_CONVERGENCE
            return no_connection(posed, posed.near, outcome, residual, total)
        if not found.independent:
            return no_connection(posed, posed.near, ConnectionOutcome.DEPENDENT, residual, total)
        if last is not None:
            error = _ends_error(posed, last, (found, steps), rates)
            if error <= wanted:
                return _result(posed, found, steps, last[0], error, total)
        last = found, steps
        new = np.minimum(steps, steps.min()) / _SHORTER
        x, steps = _longer(posed, found, steps, new, rates), new
    return no_connection(posed, posed.near, ConnectionOutcome.ERROR_LIMIT, residual, total)


def _longer(posed: ConnectionEquations, found: Solution, old, new, rates: np.ndarray) -> np.ndarray:
    """Unknowns of the chain extended by the linear flows, so that its ends are closer."""
    ts, ys = (np.asarray(z) for z in sample(posed, found.x, old, _SAMPLES))
    first, v, second = ends_at(posed, found.x)
    before, after = np.log(old / new) / rates
    off = np.asarray(posed.base.system.difference(jnp.asarray(ys[-1]), second.y))
    arriving = np.asarray(second.projector) @ off
    time, parameter, _ = posed.unpack(found.x)
    nodes = np.linspace(-before, time + after, posed.segments + 1)[1:-1]
    states = _interpolate(nodes, ts, ys)
    grown = old[0] * np.exp(rates[0] * nodes)[:, None] * np.asarray(v)
    states = np.where(nodes[:, None] < 0, np.asarray(first.y) + grown, states)
    each = np.asarray(posed.each)
    slope = map_in_units(second.jacobian, each)
    for i in np.flatnonzero(nodes > time):
        flow = np.asarray(jax.scipy.linalg.expm(slope * (nodes[i] - time)))
        states[i] = ys[-1] - off + each * (flow @ ((off - arriving) / each))
    return posed.pack(float(time) + before + after, parameter, states)


def _ends_error(posed: ConnectionEquations, last: tuple, now: tuple, rates: np.ndarray) -> float:
    """Distance, across the motion, of a chain's ends from the chain whose ends are closer."""
    (coarse, old), (fine, new) = last, now
    ts, ys = (np.asarray(z) for z in sample(posed, coarse.x, old, _SAMPLES))
    before = math.log(old[0] / new[0]) / rates[0]
    apart = []
    for t, y in ((0.0, ys[0]), (ts[-1], ys[-1])):
        there, rate = (np.asarray(z) for z in state_at(posed, fine.x, new, before + t))
        gap, rate = (x / np.asarray(posed.each) for x in (y - there, rate))
        apart.append(np.linalg.norm(gap - rate * (rate @ gap) / (rate @ rate)))
    return float(max(apart))


def _result(posed: ConnectionEquations, found, steps, last, error, iterations: int) -> Connection:
    """The connection that was found."""
    time, p, _ = posed.unpack(found.x)
    ts, ys = (np.asarray(z) for z in sample(posed, found.x, steps, _SAMPLES))
    scene = posed.scene_at(p)
    first, _, second = ends_at(posed, found.x)
    alone = posed.make is None
    change = abs(float(found.x[1] - last.x[1])) + float(found.uncertainty[1])
    return Connection(
        scene=scene.starting(jnp.asarray(ys[0]), float(time)),
        parameter=np.nan if alone else float(p),
        parameter_error=np.nan if alone else change,
        limits=np.stack([np.asarray(first.y), np.asarray(second.y)]),
        time=float(time),
        step_off=(float(steps[0]), float(steps[1])),
        error=error,
        residual=found.residual,
        ts=ts,
        states=ys,
        outcome=ConnectionOutcome.FOUND,
        iterations=iterations,
        rtol=float(posed.rtol),
    )


def _interpolate(t: np.ndarray, ts: np.ndarray, ys: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(t, ts, column) for column in ys.T], axis=1)
