"""Constrained motion in more coordinates than degrees of freedom: a differential-algebraic system.

Constraints phi(t, q) = 0 (rods, hinges, guides, closed loops) and rolling conditions B(t, q) v = 0
(skates, wheels) are both conditions G a = gamma on the accelerations, with G = [d phi/dq; B].
With Lagrange multipliers lambda, the constraint forces, the accelerations satisfy them:

    M a = f + G^T lambda,    (G M^-1 G^T) lambda = gamma - G M^-1 f.

The constraints themselves then drift: rounding and step errors in phi grow without bound. `drift`
selects the remedy:

- "projection" (default): after each step the state is projected to the nearest one on the
  constraints, in the metric of the kinetic energy. They hold to rounding, for one more solve.
- "baumgarte": gamma is lowered by 2 a (d phi/dt) + a^2 phi, a damped restoring term, where the
  rate a is a compromise between drift and stiffness.
- "raw": there is no remedy, to observe the drift, also from a start off the constraints.

Conditions may be redundant (one rod too many). Then G M^-1 G^T is singular; the motion is still
determined, and only the distribution of the constraint force is not. If the conditions lose rank
only in single poses, as those of a parallelogram of bars do where it lies flat, the motion can
continue in several ways and the equations do not determine which. `undetermined` distinguishes the
two cases by derivatives: a combination c of the conditions with c G = 0 is redundant if it stays
zero along all allowed motions, c (dG/dq u) w = 0 for all u and w with G u = G w = 0; otherwise
several motions cross in this pose. A step that would pass such a pose is refused (`loses`), so
that a motion ends before it, with the status `SINGULAR`.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._numerics import solve_spd
from jaxdyn.formulations.dependence import LOST, crossing, independent, times, turns_over
from jaxdyn.formulations.mechanism import (
    Mechanism,
    MechanismSystem,
    mass_and_force,
    mass_matrix,
    row_sums,
)
from jaxdyn.scene import Effect

DRIFTS = ("projection", "baumgarte", "raw")
#: Least eigenvalue below which a mass matrix with unit diagonal counts as singular.
_MIN_EIGENVALUE = 1e-15
_MAX_VIOLATION = 1e-6  # largest relative violation that the projection may leave
_PROJECTION_STEPS = 2  # Newton steps; the first leaves the square of a step's error
#: Relative violation of the conditions by the velocities that is allowed at the start.
CONSISTENT = 1e-9


class Constrained(MechanismSystem):
    """A mechanism with constraints or rolling conditions: state [q, v].

    Attributes:
      mechanism: its `constraints` are the holonomic ones, `rolling` the rolling conditions.
      drift: "projection", "baumgarte" or "raw".
      pull: () rate a of Baumgarte's method [1/s].
    """

    mechanism: Mechanism
    drift: str = eqx.field(static=True, default="projection")
    pull: Array = eqx.field(default=10.0, converter=_checks.as_float)

    def rate(self, t, y, effects):
        a, _ = _accelerations(self, t, y, effects)
        return jnp.concatenate([jnp.split(y, 2)[1], a])

    def constraint_forces(self, t, y, effects):
        """(c + b,) multipliers: the forces of the constraints, then of the rolling conditions."""
        return _accelerations(self, t, y, effects)[1]

    def gram(self, t: Array, y: Array) -> Array:
        """(c + b, c + b) matrix G M^-1 G^T: the values G a that unit constraint forces cause."""
        return times(*self._reach(t, jnp.split(y, 2)[0]))

    def undetermined(self, t, y):
        """Whether () constraints contradict each other at a state, or leave the motion open."""
        return _undetermined(self, t, y)

    def _is_undetermined(self, t: Array, y: Array) -> Array:
        t = jnp.asarray(t, y.dtype)
        q, v = jnp.split(y, 2)
        phi, rates, g, _ = self._conditions(t, q, v)
        if not g.shape[0]:
            return jnp.zeros((), bool)
        reach = solve_spd(mass_matrix(self.mechanism, t, q), g.T)
        found = independent(g, reach, g)
        off = jnp.max(jnp.abs(phi), initial=0.0) / (1 + jnp.max(jnp.abs(q)))
        fast = jnp.max(jnp.abs(rates)) / (1 + jnp.max(jnp.abs(v)))
        contradiction = (self.drift == "projection") & (jnp.maximum(off, fast) > _MAX_VIOLATION)
        turning = jax.jacfwd(lambda q: self._conditions(t, q, v)[2])(q)
        allowed = jnp.eye(q.shape[0]) - times(reach, found.x)
        return contradiction | crossing(found, turning, allowed)

    def loses(self, t0, y0, t1, y1):
        return _loses(self, t0, y0, t1, y1)

    def _loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array:
        """Whether () independent conditions become dependent within a step, or may.

        The rows of G at the end, projected onto those at the start, are X times the latter. X is
        the identity for a short step, and singular where the rows pass a pose of lost rank. A
        positive determinant is not enough, since X may be far from the identity: all its leading
        minors must be positive, or the step is too long for a decision. Each half of the step is
        tested, since a step that passes two such poses may have turned X back to the identity.
        """
        (q0, v0), (q1, v1) = jnp.split(y0, 2), jnp.split(y1, 2)
        # Halfway on the cubic through both ends.
        t, q = 0.5 * (t0 + t1), 0.5 * (q0 + q1) + 0.125 * (t1 - t0) * (v0 - v1)
        # The poses are taken in a loop: written out, they would be compiled three times.
        poses = jnp.stack(jnp.broadcast_arrays(t0, t, t1)), jnp.stack([q0, q, q1])
        gs, reaches = jax.lax.map(lambda at: self._reach(*at), poses)
        if not gs.shape[1]:
            return jnp.zeros((), bool)
        start, middle, end = zip(gs, reaches, strict=True)
        kept, last = (independent(*at, at[0], LOST).kept for at in (start, end))
        crossed = turns_over(start, middle, kept) | turns_over(middle, end, kept)
        return (jnp.sum(last) < jnp.sum(kept)) | crossed

    def _reach(self, t: Array, q: Array) -> tuple[Array, Array]:
        """G (c + b, n) and M^-1 G^T in a pose."""
        t = jnp.asarray(t, q.dtype)
        g = self._conditions(t, q, jnp.zeros_like(q))[2]
        return g, solve_spd(mass_matrix(self.mechanism, t, q), g.T)

    def violation(self, t: Array, y: Array) -> tuple[Array, Array]:
        """Residuals (c,) of the constraints, and (c + b,) of the conditions on the velocities."""
        q, v = jnp.split(y, 2)
        t = jnp.asarray(t, y.dtype)
        phi, rates, _, _ = self._conditions(t, q, v)
        return phi, rates

    def project(self, t, y):
        return y if self.drift != "projection" else self.nearest(t, y)

    def nearest(self, t: Array, y: Array) -> Array:
        """(k,) the nearest state on the constraints, in the metric of the kinetic energy."""
        return _nearest(self, t, y)

    def _nearest(self, t: Array, y: Array) -> Array:
        q, v = jnp.split(y, 2)
        t = jnp.asarray(t, y.dtype)

        def onto(_, q):
            phi, _, g, _ = self._conditions(t, q, v)
            return q - self._least(t, q, g[: phi.shape[0]], phi)

        q = jax.lax.fori_loop(0, _PROJECTION_STEPS, onto, q)
        _, rates, g, _ = self._conditions(t, q, v)
        return jnp.concatenate([q, v - self._least(t, q, g, rates)])

    def check(self, t, y):
        super().check(t, y)
        _checks.float64()  # the bounds on violations are those of 64 bits
        _checks.choice("drift", self.drift, DRIFTS)
        # This is compiled, since second derivatives take seconds if the host runs each operation.
        # Violations do not depend on `drift`, so one program serves all three values.
        same = dataclasses.replace(self, drift="raw")
        place, speed, lost, pivot = (float(x) for x in _violations(same, t, y))
        if pivot <= _MIN_EIGENVALUE:
            raise _checks.fail(
                "y0",
                "a pose from which every coordinate moves something",
                "one where the mass matrix is singular",
                "Some coordinates lock there, as Euler angles of a disk that lies flat or of a "
                "body upright do; start beside it, or take other coordinates.",
            )
        if self.drift != "raw" and max(place, speed) > CONSISTENT * (1.0 + float(np.abs(y).max())):
            raise _checks.fail(
                "y0",
                "a start that satisfies the constraints",
                f"a violation of {place:.3g} in place, {speed:.3g} in velocity",
                f"The nearest one that does is {[float(f'{x:.12g}') for x in self.nearest(t, y)]}.",
            )
        if lost:
            raise _checks.fail(
                "y0",
                "a pose whose constraints determine the motion",
                "one where they lose rank",
                "It could continue in several ways (a linkage at a dead centre); start beside it.",
            )

    def _solve(self, t: Array, y: Array, effects: tuple[Effect, ...]) -> tuple[Array, Array]:
        q, v = jnp.split(y, 2)
        t = jnp.asarray(t, y.dtype)
        phi, rates, g, gamma = self._conditions(t, q, v)
        if self.drift == "baumgarte":
            position = jnp.concatenate([phi, jnp.zeros_like(rates[phi.shape[0] :])])
            gamma = gamma - 2 * self.pull * rates - self.pull**2 * position
        mass, force = mass_and_force(self.mechanism, t, q, v, effects)
        free, reach = self._free(mass, force, g)
        wanted = gamma - row_sums(g, free)
        multipliers = independent(g, reach, wanted).x
        return free + row_sums(reach, multipliers), multipliers

    def _conditions(self, t: Array, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
        """The phi (c,), rates (c + b,), G (c + b, n) and gamma (c + b,) for which G a = gamma."""
        constraints, rolling = self.mechanism.constraints, self.mechanism.rolling
        none = jnp.zeros((0,), q.dtype)
        ties = constraints(t, q)
        phi = none if ties is None else ties
        one = jnp.ones_like(t)
        rates, rows, gammas = [], [], []
        if phi.shape[0]:

            def rate(t, q):
                return jax.jvp(constraints, (t, q), (one, v))[1]

            value, second = jax.jvp(rate, (t, q), (one, v))
            rates, gammas = [value], [-second]
            rows = [jax.jacfwd(lambda q: constraints(t, q))(q)]
        b = rolling(t, q)
        if b is not None:
            rolling_rate = jax.jvp(rolling, (t, q), (one, v))[1]
            rates.append(row_sums(b, v))
            gammas.append(-row_sums(rolling_rate, v))
            rows.append(b)
        if not rows:
            return none, none, jnp.zeros((0, q.shape[0]), q.dtype), none
        return phi, jnp.concatenate(rates), jnp.concatenate(rows), jnp.concatenate(gammas)

    @staticmethod
    def _free(mass: Array, force: Array, g: Array) -> tuple[Array, Array]:
        """M^-1 f (n,) and M^-1 G^T (n, c), by one elimination."""
        solved = solve_spd(mass, jnp.concatenate([force[:, None], g.T], axis=1))
        return solved[:, 0], solved[:, 1:]

    def _least(self, t: Array, q: Array, g: Array, error: Array) -> Array:
        """(n,) the change of q or v, smallest in kinetic energy, that removes an error."""
        if not g.shape[0]:
            return jnp.zeros_like(q)
        reach = solve_spd(mass_matrix(self.mechanism, t, q), g.T)
        return row_sums(reach, independent(g, reach, error).x)


# Traced once for the stages, the start, the samples and the ends of a solve.
_accelerations = jax.jit(Constrained._solve)
_undetermined = jax.jit(Constrained._is_undetermined)
_nearest = jax.jit(Constrained._nearest)
_loses = jax.jit(Constrained._loses)


@eqx.filter_jit
def _violations(system: Constrained, t: Array, y: Array) -> tuple[Array, ...]:
    """Largest violations in position and in velocity, and whether the motion is undetermined.

    The last result is the least eigenvalue of the mass matrix, scaled to a unit diagonal.
    """
    phi, rates = system.violation(t, y)
    place, speed = (jnp.max(jnp.abs(x), initial=0.0) for x in (phi, rates))
    mass = mass_matrix(system.mechanism, t, jnp.split(y, 2)[0])
    unit = 1 / jnp.sqrt(jnp.diag(mass))
    pivot = jnp.linalg.eigvalsh(unit[:, None] * mass * unit[None, :])[0]
    return place, speed, system.undetermined(t, y), jnp.where(jnp.isnan(pivot), 0.0, pivot)
