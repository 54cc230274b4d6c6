"""A system with its effects, without a start: the interface to integrators and other libraries.

`Field` is what the compiled code of this library takes; `VectorField` is the same as a function
for other libraries.
"""

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import _checks, _shapes
from jaxdyn.scales import Groups, groups
from jaxdyn.system import Effect, Points, System


class Field(NamedTuple):
    """A system with its effects, without a start: what integrators and Jacobians need.

    A tuple, not a module: it is created at each call of a solver, ten times as fast.
    """

    system: System
    effects: tuple[Effect, ...]

    def rate(self, t: Array, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The vector field dy/dt."""
        return self.system.rate(t, y, self.effects)

    @property
    def groups(self) -> Groups:
        """Which entries of the state share a size."""
        return groups(self.system)

    def points(self, t: Array, y: Float[Array, " k"]) -> Points:
        """The material points; raises ValueError if the system has none."""
        points = self.system.points(t, y)
        if not len(points.m):
            raise _checks.fail("scene", "one with material points", type(self.system).__name__)
        return points

    def check_functions(self) -> None:
        """Raise ValueError if a number that a function captured has changed; see `Record`."""
        self.system.check_functions()
        for effect in self.effects:
            effect.check_functions()

    def project(self, t: Array, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The nearest state that satisfies the system's constraints."""
        return self.system.project(t, y)

    def undetermined(self, t: Array, y: Array) -> Array | None:
        """Whether () the constraints leave the acceleration undetermined at a state (k,)."""
        return self.system.undetermined(t, y)

    def loses(self, t0: Array, y0: Array, t1: Array, y1: Array) -> Array | None:
        """Whether () a step may pass a state that leaves the acceleration undetermined."""
        return self.system.loses(t0, y0, t1, y1)


class VectorField(eqx.Module):
    """The rate of a scene as a function: f(t, y), or f(t, y, args) for diffrax.

    NumPy in gives NumPy out, so that ``scipy.integrate.solve_ivp(scene.vector_field, ...)`` works.
    It is compiled once per kind of scene, whatever its numbers, and supports jit, grad and vmap.
    Equal fields, as of one scene, have the same hash, so that ``jax.jit(scene.vector_field)``
    compiles once.

    Attributes:
      field: the system and its effects.

    Example:
      >>> from scipy.integrate import solve_ivp
      >>> from jaxdyn import scenes
      >>> scene = scenes.oscillator()
      >>> run = solve_ivp(scene.vector_field, (0.0, 1.0), np.asarray(scene.y0), rtol=1e-10)
      >>> bool(abs(run.y[0, -1] - np.cos(1.0)) < 1e-6)
      True
    """

    field: Field

    def __call__(self, t: Any, y: Any, args: Any = None) -> Any:
        """Rates (k,) of the state y (k,) at time t; `args` is ignored."""
        del args
        _checks.float64()
        self.field.check_functions()
        labels = self.field.system.labels()
        _checks.check_shape("y", np.shape(y), (len(labels),), "One entry for each of the state.")
        rate = _rate(self.field, _float(t), _float(y))
        given = isinstance(y, np.ndarray) and not _checks.is_traced(rate)
        return np.asarray(rate) if given else rate

    def _values(self) -> Any:
        """The values that define equality; None while a number is traced."""
        leaves, tree = jax.tree.flatten(self.field)
        if _checks.is_traced(leaves):
            return None
        arrays = [np.asarray(x) for x in leaves]
        return tree, tuple((x.shape, x.dtype.str, x.tobytes()) for x in arrays)

    def __hash__(self) -> int:
        return hash(self._values() or id(self))

    def __eq__(self, other: object) -> bool:
        if self is other or not isinstance(other, VectorField):
            return self is other
        values = self._values()
        return values is not None and values == other._values()


def _float(x: Any) -> Array | np.ndarray:
    # JAX only for JAX arrays: a conversion to them costs more than the rate.
    return jnp.asarray(x, float) if isinstance(x, jax.Array) else np.asarray(x, float)


@functools.partial(jax.jit, inline=True)
def _rate(field: Field, t: Array, y: Array) -> Array:
    return field.rate(t, y)


@jax.jit
def properties_at(field: Field, t: Array, y: Array) -> tuple:
    """The points at a state, whether each force depends on velocity, whether v is dq/dt.

    One compiled call for all: each call takes as long as a short solve, and an uncompiled force
    takes milliseconds. Shapes are checked while it is traced.
    """
    points = field.system.points(t, y)
    _shapes.check_field(field, t, y)
    depends = tuple(_depends_on_velocity(effect, t, points) for effect in field.effects)
    return points, depends, _is_second_order(field.system, t, y)


def _depends_on_velocity(effect: Effect, t: Array, points: Points) -> Array | bool:
    """Whether a force that claims to be velocity-independent changes for NaN velocities.

    With NaN it becomes NaN, or takes the other branch of a comparison.
    """
    if effect.velocity_dependent:
        return False
    r, v, m = points
    probed, plain = (effect.force(t, r, u, m) for u in (v * jnp.nan, v))
    return ~jnp.array_equal(probed, plain, equal_nan=True)


def _is_second_order(system: System, t: Array, y: Array) -> Array | bool:
    """Whether dq/dt = v and dv/dt does not depend on v, where that is claimed; tested likewise."""
    if len(y) % 2 or not system.second_order:
        return False
    q, v = jnp.split(y, 2)
    v = v + jnp.arange(1.0, len(v) + 1)  # at rest any multiple of v would pass
    rate, probed = (system.rate(t, jnp.concatenate([q, u]), ()) for u in (v, v * jnp.nan))
    same = jnp.array_equal(rate[len(v) :], probed[len(v) :], equal_nan=True)
    return same & jnp.array_equal(rate[: len(v)], v)
