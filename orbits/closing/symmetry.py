"""Symmetries of a scene that rearrange the entries of its state and change their signs.

Relabelling equal bodies, mirrors, half turns and running time backwards all do no more than
that. A rotation by any other angle is not among them: see `closing.relative`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene
from jaxdyn._checks import fail

#: Relative: how exactly a symmetry keeps the vector field.
EXACT = 1e-9


@jax.jit
def rate(scene: Scene, t, y: Float[Array, " k"]) -> Float[Array, " k"]:
    """The scene's vector field, compiled: step by step on the host it takes milliseconds."""
    return scene.rate(t, y)


class Symmetry(eqx.Module):
    """y -> g y with entry i of g y being ``signs[i]`` times entry ``places[i]`` of y.

    Attributes:
      places: (k,) where each entry comes from; None keeps all where they are.
      signs: (k,) +1 or -1; None keeps all signs.
      reversing: whether it is a symmetry of motions run backwards.
    """

    places: tuple[int, ...] | None = eqx.field(static=True, default=None)
    signs: tuple[int, ...] | None = eqx.field(static=True, default=None)
    reversing: bool = eqx.field(static=True, default=False)

    def act(self, y: Float[Array, " k"]) -> Float[Array, " k"]:
        """The symmetry applied to a state (or to a rate, up to the sign of time)."""
        y = y if self.places is None else y[np.array(self.places)]
        return y if self.signs is None else y * np.array(self.signs, float)

    def check(self, scene: Scene) -> None:
        """Raise ValueError unless it maps motions of the scene to motions of the scene."""
        k = len(scene.y0)
        if self.places is not None and sorted(self.places) != list(range(k)):
            raise fail(
                "closing",
                f"a rearrangement of the {k} entries of the state",
                f"one of {len(self.places)} places",
                "choreography(n, d) makes one for n free points in d dimensions.",
            )
        if self.signs is not None and not (len(self.signs) == k and {*self.signs} <= {1, -1}):
            raise fail("closing", f"{k} signs, each 1 or -1", f"{self.signs}")
        self._check_rate(scene)

    def _check_rate(self, scene: Scene) -> None:
        # Without the symmetry the motion after the first part is another one: it would not close.
        if self == IDENTITY:
            return
        t, y = 0.0, scene.y0
        back = -1.0 if self.reversing else 1.0
        there, here = rate(scene, t, self.act(y)), back * self.act(rate(scene, t, y))
        if not float(jnp.abs(there - here).max()) <= EXACT * float(jnp.abs(here).max()):
            raise fail(
                "closing",
                "a symmetry of the scene",
                "one that changes its forces",
                "Bodies that take each other's places need equal masses, and nothing that "
                "depends on the sign of a velocity is the same backwards.",
            )


IDENTITY = Symmetry()


def of_points(order, axes=(1, 1), *, reversing: bool = False) -> Symmetry:
    """A symmetry of free points: relabelled, mirrored along some axes, maybe backwards in time.

    Args:
      order: (n,) the point that each takes the place of.
      axes: (d,) +1 or -1 for each axis of space.
      reversing: run time backwards: velocities change sign once more.
    Example:
      >>> of_points([1, 0, 2], (-1, -1), reversing=True).signs     # the line of Euler's starts
      (-1, -1, -1, -1, -1, -1, 1, 1, 1, 1, 1, 1)
    """
    order, axes = np.asarray(order), np.asarray(axes)
    n, d = len(order), len(axes)
    one = (order[:, None] * d + np.arange(d)).ravel()
    signs = np.tile(axes, n)
    return Symmetry(
        tuple(np.concatenate([one, n * d + one]).tolist()),
        tuple(np.concatenate([signs, -signs if reversing else signs]).tolist()),
        reversing,
    )


def backwards(k: int) -> Symmetry:
    """Time run backwards for a state [q, v] of k entries: velocities change sign."""
    half = k // 2
    return Symmetry(None, (1,) * half + (-1,) * half, reversing=True)
