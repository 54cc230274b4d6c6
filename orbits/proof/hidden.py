"""Integrals of the two central laws whose bounded motions all close (Bertrand's theorem).

With a = -w(r) r, of one point at r with velocity v:

    Laplace's vector   v x (r x v) + (a . r) r     is conserved if a = -k r / |r|^3,
    Fradkin's tensor   v v^T + w r r^T             is conserved if a = -k r,

the first also divided by k. Both are written with the acceleration itself, so no strength is
needed; which of them is conserved is left to `posing` and `theorems`. Their orbits are as many as
starts, and their closing equations depend on each other by these integrals.

Reference: Goldstein, Poole, Safko (2002), Classical Mechanics, section 3.9; Fradkin (1965),
American Journal of Physics 33, 207.
"""

import itertools

import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import Scene

_STATES = (4, 6)  # lengths of [r, v] of one point in a plane or in space


def hidden_integrals(scene: Scene, t, y: Array) -> dict[str, Array]:
    """The entries of both, each (), by name, if a state may be [r, v] of one point; else {}.

    Example:
      >>> from jaxdyn.effects import PowerLaw
      >>> from orbits.targets import loops
      >>> scene = loops.closed(PowerLaw(1.0, -2.0), 1, 1).scene
      >>> found = hidden_integrals(scene, 0.0, scene.y0)
      >>> list(found)[:2], abs(float(found["Laplace's vector y"])) < 1e-30
      (["Laplace's vector x", "Laplace's vector y"], True)
    """
    if len(y) not in _STATES or not scene.second_order:
        return {}
    r, v = jnp.split(y, 2)
    a = scene.rate(t, y)[len(r) :]
    falls = jnp.dot(a, r)
    # v x (r x v) = (v . v) r - (r . v) v
    laplace = jnp.dot(v, v) * r - jnp.dot(r, v) * v + falls * r
    weight = -falls / jnp.dot(r, r)
    axes = "xyz"[: len(r)]
    vector = {f"Laplace's vector {axes[i]}": x for i, x in enumerate(laplace)}
    pairs = itertools.combinations_with_replacement(range(len(r)), 2)
    tensor = {
        f"Fradkin's tensor {axes[i]}{axes[j]}": v[i] * v[j] + weight * r[i] * r[j] for i, j in pairs
    }
    return vector | tensor
