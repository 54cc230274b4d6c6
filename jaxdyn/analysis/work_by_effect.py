"""The work of chosen effects, integrated with the state.

``with_work(scene, QuadraticDrag)`` is a scene whose state has one more entry, W with
dW/dt = sum of f . v, starting from 0. It is a scene like any other; a scene without such an entry
has no overhead. Since W is integrated with the same steps and tolerance as the state, work of all
non-conservative effects = change of energy is a test of both.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn.formulations.extended import Extended
from jaxdyn.scene import Effect, Field, Scene


class WorkByEffect(Extended):
    """A system whose state [y, W_1 .. W_w] carries the work of w kinds of effects.

    Attributes:
      system: the system without these entries.
      kinds: names of the effect classes whose work is summed, one entry each, with their
        subclasses. They are names, not effects, so that an effect's numbers live only in the scene.
    """

    kinds: tuple[str, ...] = eqx.field(static=True)

    def further(self):
        return tuple((f"work of {kind}", "J") for kind in self.kinds)

    def rate(self, t, y, effects):
        inner, _ = self.parts(y)
        field = Field(self.system, effects)
        works = [power(field, kind, t, inner) for kind in self.kinds]
        return jnp.concatenate([field.rate(t, inner), jnp.stack(works)])


@check_first
def power(scene: Scene | Field, kind: str, t, y: Array) -> Array:
    """Power () [W] of the scene's effects of one kind, by the name of their class.

    Forces on points count with the points' velocities, forces on coordinates (motors) with
    the rates of the coordinates; 0 where the scene has no such effect.
    """
    of_kind = (e for e in scene.effects if kind in (cls.__name__ for cls in type(e).__mro__))
    return sum((power_of(scene, effect, t, y)[0] for effect in of_kind), jnp.zeros(()))


@check_first
def power_of(scene: Scene | Field, effect: Effect, t, y: Array) -> tuple[Array, Array]:
    """Power () [W] of one effect, and () [W] the sum of the magnitudes of its terms."""
    r, v, m = scene.system.points(t, y)
    terms = [effect.force(t, r, v, m) * v]
    if "generalized" in effect.acts:
        q, q_dot = scene.system.coordinates(y)
        generalized = effect.generalized(t, q, q_dot)
        terms += [] if generalized is None else [generalized * q_dot]
    power, size = (sum(jnp.sum(f(x)) for x in terms) for f in (jnp.asarray, jnp.abs))
    return jnp.asarray(power), jnp.asarray(size)


@check_first
def with_work(scene: Scene, *kinds: type[Effect]) -> Scene:
    """The same scene with the work of each kind of effect as a further state entry.

    Args:
      scene: any scene.
      kinds: effect classes; `Effect` gives the total work of all effects.
    Returns:
      A scene with labels "work of QuadraticDrag" [J] and so on after its own.
    Raises:
      ValueError: no kind is given, or the scene has no effect of one of them.
    Limits: the scene is no longer of second order, so a conservative one loses the faster methods
      for forces that do not depend on velocity.
    Example:
      >>> from jaxdyn.analysis import work_by_effect
      >>> from jaxdyn import scenes, simulate
      >>> from jaxdyn.effects import QuadraticDrag
      >>> motion = simulate(work_by_effect.with_work(scenes.cannonball(drag=0.1), QuadraticDrag))
      >>> bool(motion["work of QuadraticDrag"][-1] < 0)
      True
    """
    has = ", ".join(type(e).__name__ for e in scene.effects) or "none"
    for kind in kinds or (type(None),):
        if not any(isinstance(effect, kind) for effect in scene.effects):
            raise _checks.fail("with_work", f"an effect of the scene ({has})", kind.__name__)
    system = WorkByEffect(scene.system, tuple(kind.__name__ for kind in kinds))
    y0 = jnp.concatenate([scene.y0, jnp.zeros(len(kinds))])
    return dataclasses.replace(scene, system=system, y0=y0)
