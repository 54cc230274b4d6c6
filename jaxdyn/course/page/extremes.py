"""The largest value of a quantity along a motion, at an end or at a maximum, to full precision."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import as_float
from jaxdyn.integrate.event_search.all_crossings import crossings
from jaxdyn.integrate.events import Event
from jaxdyn.integrate.simulation import simulate
from jaxdyn.scene import Scene

_RTOL = 1e-13


class Largest(NamedTuple):
    """The largest value of a quantity, with its time and state."""

    value: Any
    t: Any
    y: Any


class _Turns(Event):
    """Where a weighted sum of the entries of a quantity has the rate zero along a motion."""

    scene: Scene
    weights: Array = eqx.field(converter=as_float)
    quantity: Callable[[Array, Array], Array] = eqx.field(static=True)

    def value(self, t, y):
        f = self.scene.rate(t, y)
        _, slope = jax.jvp(self.quantity, (t, y), (jnp.ones_like(t), f))
        return self.weights @ jnp.ravel(slope)


def largest(
    scene: Scene,
    quantity: Callable[[Array, Array], Array],
    t1: Any = None,
    *,
    rtol: float = _RTOL,
) -> Largest:
    """The largest value of a quantity along the motion of a scene, over all its entries.

    The largest sample would be too small. Here both ends and all zeros of the rate of the quantity
    are compared.

    Args:
      scene: system, effects, start.
      quantity: ``quantity(t, y)``, () or (n,), differentiable. If an absolute value or a distance
        may vanish, use its square.
      t1: () end of the span; the scene's own by default.
      rtol: tolerance of the steps.

    Example:
      >>> from jaxdyn import scenes
      >>> swing = scenes.oscillator(k=1.0, m=1.0)
      >>> found = largest(swing, lambda t, y: -y[0], 5.0)
      >>> round(float(found.value), 12), round(float(found.t), 12)
      (1.0, 3.14159265359)
    """
    end = scene.t1 if t1 is None else t1
    # Not `solve`: motions with the usual number of samples have one program, that of a page's own.
    last = np.asarray(simulate(scene, end, rtol=rtol).ys)[-1]
    value = jax.jit(lambda t, y: jnp.ravel(quantity(t, y)))
    n = jax.eval_shape(value, jnp.zeros(()), scene.y0).size
    best = []
    for weights in np.eye(n):
        turns = crossings(scene, _Turns(scene, weights, quantity), end, rtol=rtol)
        ts = np.concatenate([[0.0], turns.ts, [end]])
        ys = np.concatenate([np.asarray(scene.y0)[None], turns.ys, last[None]])
        # One by one, since each number of them would be another program.
        values = np.array([value(t, y) for t, y in zip(ts, ys, strict=True)]) @ weights
        k = int(values.argmax())
        best.append(Largest(values[k], ts[k], ys[k]))
    return max(best, key=lambda one: one.value)
