"""The energy and momenta of a scene, at a state and along a motion.

Both are computed from the material points of the system, so they hold for any coordinates; a
system may define its own energy (`System.energies`). A scene without an energy, or without material
points, raises. The angular momentum here is about the origin; `momenta` has the one about moving
points. What is conserved depends on the effects; `drift` measures it.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.integrate.spans import cut_rows, fill, of_samples
from jaxdyn.integrate.trajectory import Trajectory, each_motion
from jaxdyn.scene import Field, Scene
from jaxdyn.system import potential_energy

_NO_ENERGY = (
    "It has no material points and defines no energy: pass energy= to jaxdyn.ode, or "
    "override System.energies."
)


@check_first
def potential(scene: Scene | Field, t, y: Array) -> Array:
    """Potential energy () [J] of the effects: the sum over those that have one."""
    r, _, m = scene.points(t, y)
    return potential_energy(scene.effects, t, r, m)


@check_first
def energy(scene: Scene | Field, t, y: Array) -> Array:
    """Energy () [J]: kinetic plus potential, or as the system defines it.

    Raises:
      ValueError: the scene has no energy.
    """
    return _energy(scene, t, y)


@jax.jit  # or each operation would be compiled by itself at its first call
def _energy(scene: Scene | Field, t, y: Array) -> Array:
    return sum(_terms(scene, t, y), jnp.zeros(()))


#: Names of a scene's energies, in the order of `System.energies`, and of their sum.
NAMES = ("kinetic", "potential", "total")


@check_first
def energies(scene: Scene | Field, t, y: Array) -> dict[str, Array]:
    """Energies () [J] by name: "kinetic", "potential" and "total", or only the total one.

    There is only the total one where the system defines an energy without its kinetic part.

    Raises:
      ValueError: the scene has no energy.
    Example:
      >>> from jaxdyn import scenes, simulate
      >>> motion = simulate(scenes.oscillator(k=4.0), 1.0)
      >>> {name: round(float(x[0]), 6) for name, x in along(energies, motion).items()}
      {'kinetic': 0.0, 'potential': 2.0, 'total': 2.0}
    """
    terms = _terms(scene, t, y)
    named = zip(NAMES, terms, strict=False) if len(terms) == len(NAMES) - 1 else ()
    return dict(named) | {NAMES[-1]: sum(terms, jnp.zeros(()))}


@check_first
def momentum(scene: Scene | Field, t, y: Array) -> Array:
    """Linear momentum (d,) [kg m/s] of all material points."""
    return _momentum(scene, t, y)


@jax.jit
def _momentum(scene: Scene | Field, t, y: Array) -> Array:
    _, v, m = scene.points(t, y)
    return jnp.sum(m[:, None] * v, axis=0)


@check_first
def angular_momentum(scene: Scene | Field, t, y: Array) -> Array:
    """Angular momentum about the origin [kg m^2/s]: () in the plane, (3,) in space.

    Limits: a scalar 0 for points on a line.
    """
    return _angular_momentum(scene, t, y)


@jax.jit
def _angular_momentum(scene: Scene | Field, t, y: Array) -> Array:
    r, v, m = scene.points(t, y)
    return moment(r, m[:, None] * v)


def moment(arms: Array, vectors: Array) -> Array:
    """Sum of arm x vector, both (n, d): () in the plane and 0 on a line, (3,) in space."""
    if arms.shape[1] == 1:
        return jnp.zeros(())
    if arms.shape[1] == 2:
        return jnp.sum(arms[:, 0] * vectors[:, 1] - arms[:, 1] * vectors[:, 0])
    return jnp.sum(jnp.cross(arms, vectors), axis=0)


@check_first
def integrals(scene: Scene | Field, t, y: Array) -> dict[str, Array]:
    """The candidates for conserved quantities, each () or (d,), by name; {} if there are none.

    They are the energy, the momenta of material points, and the integrals that the system names
    (`System.integrals`), each where the scene has it. Which of them are conserved depends on the
    effects and is not decided here.
    """
    found = {}
    if scene.system.energies(t, y, scene.effects):
        found["energy"] = energy(scene, t, y)
    if len(scene.system.points(t, y).m):
        found["momentum"] = momentum(scene, t, y)
        found["angular momentum"] = angular_momentum(scene, t, y)
    return found | scene.system.integrals(t, y)


def along(quantity, motion: Trajectory) -> Any:
    """(s, ...) values of a quantity of this file along a motion, e.g. ``along(energy, motion)``.

    For a batch of motions they are (b, s, ...); a record of such values for a record like `Pose`.

    Example:
      >>> from jaxdyn.analysis import energy
      >>> from jaxdyn import scenes, simulate
      >>> motion = simulate(scenes.cannonball(), 1.0)
      >>> energy.along(energy.momentum, motion).shape
      (200, 2)
    """
    return _along(motion, quantity)


@each_motion
@of_samples
def _along(motion: Trajectory, quantity) -> Any:
    return jax.vmap(lambda t, y: quantity(motion.scene, t, y))(motion.ts, motion.ys)


@check_first
@each_motion
def drift(motion: Trajectory, of: str = "energy") -> Array:
    """Largest relative change of the energy, or of another integral, along a motion () [1].

    It is max_i |E(t_i) - E(t_0)| over its size, max_i (|T(t_i)| + |V(t_i)|), and is rightly large
    with effects without a potential, such as drag. A quantity I whose terms are not known has the
    size max_i (|I| + sum over the state's entries of |dI/dy_j (y_j(t_i) - y_j(t_0))|), the terms
    of its change. For a batch it is (b,).

    Args:
      motion: any motion of a scene.
      of: name of the quantity, one of `integrals`.
    Raises:
      ValueError: the motion has fewer than two samples, or `of` is not one of `integrals`.
    Limits: it says nothing of particles without mass; `jaxdyn.accuracy.estimate` does.
    """
    if len(motion.ts) < 2:
        raise _checks.fail("motion", "at least 2 samples", len(motion.ts), "Simulate with more.")
    return change(motion.scene, motion.ts, motion.ys, of).relative


class Change(NamedTuple):
    """The change of a quantity.

    Attributes:
      values: (s, ...) values of the quantity.
      size: () magnitude of its terms, or of those of its change; 1 where they are all 0.
      relative: () largest change from the first value, over the size.
    """

    values: Array
    size: Array
    relative: Array


@check_first
def change(scene: Scene, ts: Array, ys: Array, of: str = "energy") -> Change:
    """The change of a quantity of `integrals` over states ys (s, k) at times ts (s,)."""
    if of != "energy":
        names = jax.eval_shape(lambda y: integrals(scene, jnp.zeros(()), y), scene.y0)
        _checks.choice("of", of, names)
    more = fill(ts, ys)
    return cut_rows(_change(scene, *more, of), len(more[0]), len(ts))


@eqx.filter_jit
def _change(scene: Scene, ts: Array, ys: Array, of: str) -> Change:
    if of == "energy":
        terms = jnp.stack(jax.vmap(lambda t, y: _terms(scene, t, y))(ts, ys))
        values, sizes = jnp.sum(terms, axis=0), jnp.sum(jnp.abs(terms), axis=0)
        known = len(terms) > 1
    else:
        values = jax.vmap(lambda t, y: integrals(scene, t, y)[of])(ts, ys)
        known = False
    if not known:
        sizes = jnp.abs(values) + _terms_of_change(scene, ts, ys, of)
    size = jnp.max(sizes)
    # At rest without forces the size is 0, and so is the change.
    size = jnp.where(size == 0, 1.0, size)
    return Change(values, size, jnp.max(jnp.abs(values - values[:1])) / size)


def _terms_of_change(scene: Scene, ts: Array, ys: Array, of: str) -> Array:
    """(s, ...) sum of |dI/dy_j (y_j - y_j(t_0))|, to first order the terms of I - I(t_0)."""

    def size(t, y):
        slope = jax.jacfwd(lambda y: integrals(scene, t, y)[of])(y)
        return jnp.sum(jnp.abs(slope * scene.system.difference(y, ys[0])), axis=-1)

    return jax.vmap(size)(ts, ys)


def _terms(scene: Scene | Field, t, y: Array) -> tuple[Array, ...]:
    terms = scene.system.energies(t, y, scene.effects)
    if not terms:
        kind = type(scene.system).__name__
        raise _checks.fail("scene", "one with an energy", kind, _NO_ENERGY)
    return terms
