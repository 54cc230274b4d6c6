"""Lagrange's equations, straight from the energies by automatic differentiation.

    d2L/dv2 a = dL/dq - (d2L/dq dv) v - d2L/dt dv + Q

For a mechanism (`Lagrange`) L = T - V, where V sums the potentials of the effects that have one,
and Q pulls back the forces of those that have none. It takes second derivatives of the energies at
each step: it is the route to compare others with (newton_euler is faster), and the one that follows
a textbook line by line. For a Lagrangian that is given as a function (`lagrangian`), Q is the
generalised force of the effects.

The energy of a bare L is the energy function h = v . dL/dv - L, which is conserved where L does not
depend on time. It is T + V where T is quadratic in the velocities; in coordinates that move
by themselves (a rotating frame) it is Jacobi's integral.
"""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._numerics import solve_spd
from jaxdyn.formulations.functions import (
    as_params,
    call,
    check_function,
    finite_params,
    name_entries,
)
from jaxdyn.formulations.mechanism import (
    Mechanism,
    MechanismSystem,
    on_coordinates,
    positions_and_velocities,
    pull_back,
    with_rates,
)
from jaxdyn.scene import Effect, Scene, System
from jaxdyn.system import check_value, potential_energy

#: Ratio of the smallest to the largest eigenvalue of d2L/dv2 that may be only rounding.
_SINGULAR = 1e-13


class Lagrange(MechanismSystem):
    """A mechanism whose coordinates are free: state [q, v].

    A subclass may override `lagrangian`; its energy then is the energy function of that.
    """

    mechanism: Mechanism

    def lagrangian(self, t: Array, q: Array, v: Array, effects: tuple[Effect, ...]) -> Array:
        """Kinetic minus potential energy () [J]."""
        r, velocity = positions_and_velocities(self.mechanism, t, q, v)
        m = self.mechanism.masses()
        kinetic = 0.5 * jnp.sum(m[:, None] * velocity**2)
        return kinetic - potential_energy(effects, t, r, m)

    def rate(self, t, y, effects):
        q, v = jnp.split(y, 2)
        t = jnp.asarray(t, y.dtype)
        energetic, others = self._partition(effects, t, y)
        force = on_coordinates(t, q, v, effects)
        if others:
            force = force + pull_back(self.mechanism, t, q, v, others)
        return jnp.concatenate([v, _accelerations(self._bare(energetic), t, q, v, force)])

    def energies(self, t, y, effects):
        if type(self).lagrangian is Lagrange.lagrangian:
            return super().energies(t, y, effects)
        return _energies(self._bare(self._partition(effects, t, y)[0]), t, y)

    def canonical(self, t, y):
        return _canonical(self._bare(()), t, y)

    def _bare(self, effects: tuple[Effect, ...]) -> Callable:
        return lambda t, q, v: self.lagrangian(t, q, v, effects)

    def _partition(self, effects: tuple[Effect, ...], t: Array, y: Array):
        """The effects with a potential, and those without."""
        r, _, m = self.points(t, y)
        has = [effect.potential(t, r, m) is not None for effect in effects]
        energetic = tuple(e for e, yes in zip(effects, has, strict=True) if yes)
        return energetic, tuple(e for e, yes in zip(effects, has, strict=True) if not yes)


class Lagrangian(System):
    """Coordinates whose Lagrangian is given by functions: state [q, v]; see `lagrangian`.

    Attributes:
      functions: (L,), a function of (t, q, v, params), or (T, V), where V is one of (t, q, params);
        without params where these are None.
      params: a pytree of numbers, or None.
      names: (name, unit) of each of the n coordinates.
    """

    functions: tuple[Callable, ...] = eqx.field(static=True)
    params: Any
    names: tuple[tuple[str, str], ...] = eqx.field(static=True)

    @property
    def accepts(self):
        return frozenset({"generalized"})

    def labels(self):
        return with_rates(self.names)

    def lagrangian(self, t: Array, q: Array, v: Array) -> Array:
        """The Lagrangian () [J]."""
        whole = call(self.functions[0], self.params, t, q, v)
        return whole - call(self.functions[1], self.params, t, q) if self._in_parts else whole

    def rate(self, t, y, effects):
        q, v = jnp.split(y, 2)
        t = jnp.asarray(t, y.dtype)
        force = on_coordinates(t, q, v, effects)
        return jnp.concatenate([v, _accelerations(self.lagrangian, t, q, v, force)])

    def kinetic(self, t, y):
        return self.energies(t, y, ())[0]

    def energies(self, t, y, effects):
        del effects
        if not self._in_parts:
            return _energies(self.lagrangian, t, y)
        q, v = jnp.split(y, 2)
        kinetic, potential = self.functions
        return call(kinetic, self.params, t, q, v), call(potential, self.params, t, q)

    def canonical(self, t, y):
        return _canonical(self.lagrangian, t, y)

    def check(self, t, y):
        finite_params(self.params)
        values = np.linalg.eigvalsh(_mass(self, t, y))
        if not values[0] > _SINGULAR * values[-1]:
            raise _checks.fail(
                "L",
                "a Lagrangian whose second derivative by the velocities is positive definite",
                f"one with the eigenvalues {values.tolist()} at the start",
                "Each coordinate needs a kinetic energy: L = T - V, not V - T; start beside a "
                "pose where coordinates lock.",
            )

    @property
    def _in_parts(self) -> bool:
        return len(self.functions) == 2


def lagrangian(
    L: Callable | tuple[Callable, Callable],
    q0,
    v0,
    t1=1.0,
    *,
    names: Sequence[str | tuple[str, str]] | None = None,
    params: Any = None,
) -> Scene:
    """The scene of a Lagrangian L(t, q, v, params): Lagrange's equations by autodiff.

    Args:
      L: a function of time (), coordinates (n,), velocities (n,) and `params` that returns () [J];
        or a pair (T, V) of the kinetic energy, a function of the same, and the potential energy,
        one of (t, q, params). They lack `params` where there are no parameters.
      q0: (n,) start.
      v0: (n,) velocities at the start.
      t1: () span worth seeing [s], the default of `simulate`.
      names: names of the n coordinates, each a name or a pair (name, unit); q0, q1, ... if left
        out. The velocity of "theta" is "theta_dot". A coordinate with the unit "rad" is an angle:
        values that differ by 2 pi are the same.
      params: see `jaxdyn.ode`.
    Returns:
      A scene without material points. Its energy is T + V, or for a bare L the energy function
      v . dL/dv - L; its momenta are dL/dv. Effects may act on its coordinates (motors, brakes).
    Raises:
      ValueError: `L` is not such a function; d2L/dv2 is not positive definite at the start; `q0`,
        `v0`, `t1` or `params` are not finite numbers; `names` are not n different ones.
    Limits: see `jaxdyn.ode`.
    Example:
      >>> import jax.numpy as jnp, jaxdyn
      >>> from jaxdyn.analysis import energy
      >>> def L(t, q, v, p):
      ...     return 0.5 * v[0] ** 2 + p["g"] * jnp.cos(q[0])
      >>> swing = jaxdyn.lagrangian(L, [2.0], [0.0], 10.0, params={"g": 9.81})
      >>> float(energy.drift(jaxdyn.simulate(swing, rtol=1e-13))) < 1e-13
      True
    """
    q0 = _checks.array("q0", q0, (None,))
    v0 = _checks.array("v0", v0, q0.shape, "One for each coordinate.")
    t1 = _checks.array("t1", t1, ())
    params = as_params(params)
    functions = tuple(L) if isinstance(L, tuple | list) else (L,)
    if len(functions) > 2 or not functions:
        raise _checks.fail("L", "a function, or a pair (T, V)", f"{len(functions)} of them")
    t, one = jnp.zeros(()), "An energy is one number."
    for function, args in zip(functions, (("t", "q", "v"), ("t", "q")), strict=False):
        name = "TV"[len(args) == 2] if len(functions) == 2 else "L"
        check_function(name, function, params, *args)
        values = (t, q0, v0)[: len(args)]
        of = eqx.Partial(call, function, params)
        check_value(name, (), one, of, *values)
    system = Lagrangian(functions, params, name_entries(names, "q", len(q0)))
    name = _text.name_of(functions[0]) if len(functions) == 1 else ""
    return Scene(system, y0=jnp.concatenate([q0, v0]), t1=t1, name=name)


def _accelerations(L: Callable, t: Array, q: Array, v: Array, force: Array) -> Array:
    """(n,) accelerations for a Lagrangian (t, q, v) -> () and other forces (n,) on coordinates."""

    def momenta(t, q, v):
        return jax.grad(L, argnums=2)(t, q, v)

    slope = jax.grad(L, argnums=1)(t, q, v)
    change = jax.jvp(lambda t, q: momenta(t, q, v), (t, q), (jnp.ones_like(t), v))[1]
    mass = jax.jacfwd(momenta, argnums=2)(t, q, v)
    return solve_spd(mass, slope - change + force)


def _energies(L: Callable, t: Array, y: Array) -> tuple[Array, Array]:
    """The energy function h in two terms: the part due to the velocities, and -L at rest.

    For L = T2 + T1 - V, where the index is the degree in the velocities, they are T2 and V.
    """
    q, v = jnp.split(y, 2)
    t = jnp.asarray(t, y.dtype)
    whole, change = jax.jvp(lambda v: L(t, q, v), (v,), (v,))
    at_rest = L(t, q, jnp.zeros_like(v))
    return change - (whole - at_rest), -at_rest


def _canonical(L: Callable, t: Array, y: Array) -> Array:
    """(k,) coordinates and their momenta dL/dv."""
    q, v = jnp.split(y, 2)
    return jnp.concatenate([q, jax.grad(L, argnums=2)(jnp.asarray(t, y.dtype), q, v)])


@eqx.filter_jit
def _mass(system: Lagrangian, t: Array, y: Array) -> Array:
    """(n, n) second derivative of the Lagrangian with respect to the velocities."""
    q, v = jnp.split(y, 2)
    return jax.hessian(system.lagrangian, argnums=2)(jnp.asarray(t, y.dtype), q, v)
