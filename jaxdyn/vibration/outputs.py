"""The output of a response: an entry of the state, or a function of time and state."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn.scene import Scene

Output = str | Callable[[Array, Array], Array]


def output(name: str, what: Output, scene: Scene) -> Callable[[Array, Array], Array]:
    """The output as a function (t, y) -> () or (m,), from the name of an entry or a function.

    Raises:
      ValueError: there is no such entry, or the function returns neither of these.
    """
    names = [label for label, _ in scene.labels()]
    if callable(what):
        shape = jax.eval_shape(what, jnp.zeros(()), jnp.asarray(scene.y0, float)).shape
        if len(shape) > 1:
            got = f"one that returns the shape {shape}"
            raise _checks.fail(name, "a function (t, y) that returns () or (m,)", got)
        return what
    if not isinstance(what, str):
        wanted = "the name of an entry of the state, or a function (t, y)"
        raise _checks.fail(name, wanted, repr(what))
    i = names.index(_checks.choice(name, what, names))
    return lambda t, y: y[i]
