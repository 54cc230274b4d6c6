"""The search for connections of two orbits: where strands of their manifolds cross on a section."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, _checks
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.analysis.energy import change, energy
from jaxdyn.integrate.events import Event
from jaxdyn.system import differences
from orbits.analysis.stability import stability
from orbits.closing.given import is_driven, refuse_constraints
from orbits.closing.sizes import sizes
from orbits.manifolds.connection import Connection, ConnectionOutcome, no_connection
from orbits.manifolds.links import Links, Solution, sample, solve
from orbits.manifolds.manifold import Manifold, manifold
from orbits.motion import quick_solve
from orbits.orbit import Orbit

# ---- The closing equations of a connection of two orbits
#
# The chain begins beside one orbit on its linear unstable manifold, and ends beside the other on
# its linear stable one. The phases of both ends are unknown, with the time between them. If there
# is an energy, the linear ends differ in it by a term of second order, and the equations depend
# on each other only to that order: one more unknown, a shift of the first state along the
# gradient of the energy, makes the number of unknowns that of the equations.

_MOST_STEPS = 300  # steps of a link; an iterate that takes more has gone astray, into an encounter


class OrbitChain(Links):
    """Two orbits to be connected.

    The unknowns are the time, the two phases [time of the scene], the shift if there is an energy,
    and the states between links.

    Attributes:
      base: the scene.
      starts: (2, k) starts of the orbits, at phase 0.
      tangents: (2, k) tangents of length 1 there, of the unstable manifold of the first orbit and
        of the stable one of the second.
      own: (2, k) sizes of the entries along each orbit, in which distances from it are measured.
      each: (k,) sizes of the entries.
      conserved: whether the energy is an integral.
      segments: number of links.
      rtol: tolerance of the integrations.
    """

    base: Scene
    starts: Array
    tangents: Array
    own: Array
    each: Array
    conserved: bool = eqx.field(static=True)
    segments: int = eqx.field(static=True)
    rtol: float

    def beside(self, i: int, phase: Array, step: Array) -> tuple[Array, Array]:
        """A state (k,) of orbit i, and the one at a distance from it along the manifold."""
        known = jax.lax.stop_gradient(phase)

        def state(y):
            return quick_solve(self.base.starting(y), known, rtol=self.rtol).y1

        y, v = jax.jvp(state, (self.starts[i],), (self.tangents[i],))
        # The phase enters to first order, which is all that its derivative needs.
        rate, tangent_rate = jax.jvp(lambda y: self.base.rate(jnp.zeros(()), y), (y,), (v,))
        y, v = y + rate * (phase - known), v + tangent_rate * (phase - known)
        return y, y + step * v / jnp.linalg.norm(v / self.own[i])

    def open(self, x, steps):
        y, first = self.beside(0, x[1], steps[0])
        if self.conserved:
            slope = jax.grad(lambda y: energy(self.base, 0.0, y))(jax.lax.stop_gradient(y))
            slope = slope * self.each
            first = first + x[3] * self.each * slope / jnp.linalg.norm(slope)
        return self.base, jnp.concatenate([first[None], self.states(x)]), x[0]

    def gaps(self, x, steps):
        scene, starts, time = self.open(x, steps)
        ends = self.ends(starts, time / self.segments)
        _, last = self.beside(1, x[2], steps[1])
        off = scene.system.difference(ends[-1], last)
        links = (ends[:-1] - starts[1:]) / self.each[None]
        return jnp.concatenate([links.ravel(), off / self.each])

    def ends(self, starts: Array, each: Array) -> Array:
        """(segments, k) the ends of the links.

        Each depends only on its own start, so that derivatives are computed once, not for each of
        the unknowns.
        """
        known, span = jax.lax.stop_gradient((starts, each))

        def end(y):
            start = self.base.starting(y)
            return quick_solve(start, span, rtol=self.rtol, max_steps=_MOST_STEPS).y1

        ends, slopes = jax.vmap(value_and_jacfwd(end))(known)
        rates = jax.vmap(lambda y: self.base.rate(jnp.zeros(()), y))(ends)
        moved = jnp.einsum("nij,nj->ni", slopes, starts - known)
        return ends + moved + rates * (each - span)


# ---- The search for connections of two orbits: where strands of their manifolds cross on a section

_BRANCHES = {
    "both": ("both", "both"),
    **{first + last: (first, last) for first in "+-" for last in "+-"},
}
_SAMPLES = 16  # samples of each link
_ATTEMPTS = 24  # most crossings of strands that are tried
_SAME_ENERGY = 1e-9  # difference of energies, relative to their terms, up to which they are equal
_SAME = 1e-6  # connections closer than this, in periods and in time, are the same
_BEYOND = 0.1  # how far a crossing may lie beyond the end of a piece of a curve, in its length
_SHIFTED = 10.0  # a shift of more than this many errors of the ends is a difference of energies
_DIMENSIONS = 3  # of the level sets in which two manifolds, as surfaces, meet along single motions


class OrbitOptions(NamedTuple):
    """The arguments of `orbits.connect` that concern orbits."""

    until: Event | None
    crossings: tuple[int, int]
    branch: str
    strands: int
    which: int
    time: float | None
    error: float
    segments: int
    rtol: float


def connect_orbits(a: Orbit, b: Orbit, options: OrbitOptions) -> Connection:
    """A connection of two orbits; see `orbits.connect`."""
    if options.until is None:
        remedy = "Take a section that strands of both orbits cross, jaxdyn.integrate.events."
        raise _checks.fail("until", "a section for the connection of orbits", "none", remedy)
    sides = tuple(_BRANCHES[_checks.choice("branch", options.branch, _BRANCHES)])
    conserved = _check(a, b)
    found = [
        manifold(
            orbit,
            kind,
            until=options.until,
            crossings=number,
            time=options.time,
            strands=options.strands,
            branch=side,
            error=options.error,
            samples=2,
            rtol=options.rtol,
        )
        for orbit, kind, number, side in zip(
            (a, b), ("unstable", "stable"), options.crossings, sides, strict=True
        )
    ]
    tangents = [(one.starts[0] - one.base[0]) * one.branches[0] / one.step_off for one in found]
    own = jnp.stack([jnp.asarray(sizes(orbit.scene)) for orbit in (a, b)])
    posed = OrbitChain(
        base=a.scene,
        starts=jnp.stack([jnp.asarray(a.y0), jnp.asarray(b.y0)]),
        tangents=jnp.asarray(np.stack(tangents)),
        own=own,
        each=jnp.max(own, axis=0),
        conserved=conserved,
        segments=options.segments,
        rtol=options.rtol,
    )
    return _polish(posed, (a, b), found, options.which)


def _check(a: Orbit, b: Orbit) -> bool:
    """Whether the scene conserves its energy.

    Raises:
      ValueError: connections of the orbits are not isolated, or cannot be followed.
    """
    scene = a.scene
    if is_driven(scene):
        got = "one that depends on time"
        raise _checks.fail("a", "an orbit of an autonomous scene", got, "Leave out the drive.")
    refuse_constraints("a", scene)
    y = jnp.asarray(b.y0)
    if not np.array_equal(scene.rate(jnp.zeros(()), y), b.scene.rate(jnp.zeros(()), y)):
        remedy = "Find both in the scene with the same numbers."
        raise _checks.fail("b", "an orbit of the scene of `a`", "one of another", remedy)
    integrals, k = stability(a).integrals, len(a.y0)
    if k - integrals != _DIMENSIONS or integrals > 1 or (integrals and not scene.has_energy):
        raise _checks.fail(
            "a",
            "an orbit in three dimensions, or in four with an energy",
            f"{k} dimensions with {integrals} known integrals",
            "Elsewhere surfaces of motions do not meet along single motions.",
        )
    if not integrals:
        return False
    starts = jnp.stack([jnp.asarray(orbit.y0) for orbit in (a, b)])
    levels = change(scene, jnp.zeros(2), starts)
    if levels.relative > _SAME_ENERGY:
        remedy = "Find both with hold=orbits.Energy(E)."
        first, last = levels.values
        expected = f"an orbit with the energy {first:.12g} of `a`"
        raise _checks.fail("b", expected, f"{last:.12g}", remedy)
    return True


def _polish(posed: OrbitChain, ends, found: list[Manifold], which: int) -> Connection:
    """Connection number `which` of those to which crossings of strands lead, nearest first."""
    guesses = _crossings(posed.base, found[0], found[1], np.asarray(posed.each))
    known: list[np.ndarray] = []
    total, residual, periods = 0, np.inf, np.array([orbit.period for orbit in ends])
    for signs, phases, times, turns in guesses[:_ATTEMPTS]:
        steps = np.array([s * one.step_off for s, one in zip(signs, found, strict=True)])
        solution = solve(posed, _unknowns(posed, phases, times, turns, steps), steps)
        total, residual = total + solution.iterations, min(residual, solution.residual)
        if not (solution.converged and solution.independent):
            continue
        error = max(one.linear_error for one in found)
        if posed.conserved and abs(solution.x[3]) > _SHIFTED * error:
            continue
        place = np.append(np.mod(solution.x[1:3] / periods, 1.0), solution.x[0] / periods[0])
        place = np.append(place, signs)
        if any(_alike(place, other) for other in known):
            continue
        known.append(place)
        if len(known) > which:
            return _result(posed, ends, solution, steps, error, total)
    outcome = ConnectionOutcome.NO_CONVERGENCE if guesses else ConnectionOutcome.NO_CROSSING
    if known:
        outcome = ConnectionOutcome.FEWER
    return no_connection(posed, posed.starts, outcome, residual, total, ends)


def _alike(place: np.ndarray, other: np.ndarray) -> bool:
    apart = place - other
    apart[:2] -= np.round(apart[:2])
    return bool(np.abs(apart).max() < _SAME)


def _unknowns(posed: OrbitChain, phases, times, turns, steps) -> np.ndarray:
    """The unknowns of the chain that consists of the motions from both ends to the section.

    The second is shifted by `turns` (k,), so that angles continue where the first ends.
    """
    whole = sum(times)
    nodes = whole * np.arange(1, posed.segments) / posed.segments
    states = np.empty((len(nodes), posed.starts.shape[1]))
    early = nodes <= times[0]
    for i, (chosen, ts) in enumerate(((early, nodes), (~early, nodes - whole))):
        if chosen.any():
            _, y = posed.beside(i, jnp.asarray(phases[i]), jnp.asarray(steps[i]))
            order = np.argsort(np.abs(ts[chosen]))
            ts = ts[chosen][order]
            run = quick_solve(posed.base.starting(y), ts[-1], ts=ts, rtol=posed.rtol)
            states[np.flatnonzero(chosen)[order]] = np.asarray(run.ys) + i * turns
    shift = [0.0] if posed.conserved else []
    return np.concatenate([[whole, *phases], shift, states.ravel()])


def _crossings(scene: Scene, first: Manifold, last: Manifold, each: np.ndarray) -> list[tuple]:
    """Where the curves of strands' ends cross: signs, phases, times and turns, nearest first.

    Signs, phases and times are those of both. Turns (k,) shift the angles of the second to those of
    the first. Curves are polygons here, in the sizes `each` (k,), and angles count modulo a turn.
    Two pieces cross where the points at which their straight lines come nearest are on both pieces,
    and closer than the longer piece is long.
    """
    (p, dp, of_p), (q, dq, of_q) = (_pieces(one, each) for one in (first, last))
    if not (len(p) and len(q)):
        return []
    apart = np.asarray(differences(scene.system, q * each, (p * each)[:, None])) / each
    pp, qq = (dp * dp).sum(axis=1)[:, None], (dq * dq).sum(axis=1)[None]
    pq = dp @ dq.T
    along_p, along_q = np.einsum("ijk,ik->ij", apart, dp), np.einsum("ijk,jk->ij", apart, dq)
    det = pp * qq - pq * pq
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (along_p * qq - along_q * pq) / det, (along_p * pq - along_q * pp) / det
    gap = np.linalg.norm(apart + t[..., None] * dq[None] - s[..., None] * dp[:, None], axis=2)
    inside = (np.abs(s - 0.5) < 0.5 + _BEYOND) & (np.abs(t - 0.5) < 0.5 + _BEYOND)
    near = inside & (gap < np.sqrt(np.maximum(pp, qq)))
    rows = np.argwhere(near)
    rows = rows[np.argsort(gap[near])]
    guesses = []
    for i, j in rows:
        (sign_p, phase_p, time_p), (sign_q, phase_q, time_q) = of_p[i], of_q[j]
        weights = s[i, j], t[i, j]
        phases, times = (
            tuple((1 - w) * z[0] + w * z[1] for w, z in zip(weights, pair, strict=True))
            for pair in ((phase_p, phase_q), (time_p, time_q))
        )
        turns = 2 * np.pi * np.round((apart[i, j] - (q[j] - p[i])) * each / (2 * np.pi))
        guesses.append(((sign_p, sign_q), phases, times, turns))
    return guesses


def _pieces(found: Manifold, each: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[tuple]]:
    """Starts (n, k) and sides (n, k) of the polygons, with signs, and phase and time at both ends.

    Phases are signed times from the start of the orbit, backwards for a stable manifold.
    """
    n = len(found) // len(np.unique(found.branches))
    period = found.orbit.period if found.orbit is not None else np.nan
    sense = 1.0 if found.kind == "unstable" else -1.0
    closes = found.multipliers[0].real > 0  # else both branches are one strip that closes on itself
    starts, sides, about = [], [], []
    for begin in range(0, len(found), n):
        for i in range(n if closes else n - 1):
            here, there = begin + i, begin + (i + 1) % n
            if not (found.ok[here] and found.ok[there]):
                continue
            starts.append(found.ends[here] / each)
            sides.append((found.ends[there] - found.ends[here]) / each)
            phases = (found.t0s[here], found.t0s[here] + sense * period / n)
            times = tuple(abs(found.durations[z]) for z in (here, there))
            about.append((float(found.branches[here]), phases, times))
    return np.array(starts), np.array(sides), about


def _result(
    posed: OrbitChain, ends, found: Solution, steps, error: float, total: int
) -> Connection:
    ts, ys = (np.asarray(z) for z in sample(posed, found.x, steps, _SAMPLES))
    phases = [float(x % orbit.period) for x, orbit in zip(found.x[1:3], ends, strict=True)]
    limits = [
        posed.beside(i, jnp.asarray(found.x[1 + i]), jnp.asarray(steps[i]))[0] for i in range(2)
    ]
    return Connection(
        scene=posed.base.starting(jnp.asarray(ys[0]), float(found.x[0])),
        parameter=np.nan,
        parameter_error=np.nan,
        limits=np.stack([np.asarray(y) for y in limits]),
        time=float(found.x[0]),
        step_off=(abs(float(steps[0])), abs(float(steps[1]))),
        error=error,
        residual=found.residual,
        ts=ts,
        states=ys,
        outcome=ConnectionOutcome.FOUND,
        iterations=total,
        rtol=float(posed.rtol),
        orbits=ends,
        phases=(phases[0], phases[1]),
    )
