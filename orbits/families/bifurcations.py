"""Functions of a family's members that change sign at bifurcations: `TESTS`.

`continuation` evaluates them at each member and bisects where one has changed its sign.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn.analysis import energy
from orbits.families.family import Kind, Member
from orbits.families.surface import Surface

#: A displacement along a tangent, for differences.
NUDGE = 1e-6


def _fold(surface: Surface, member: Member) -> float:
    """The change of the parameter, or else the energy, along the family."""
    if surface.equations.make is not None:
        return float(member.tangent[-2])
    scene, y0 = member.orbit.scene, member.orbit.y0
    if not scene.has_energy:
        return 1.0
    ahead = surface.equations.start(jnp.asarray(member.point.x + NUDGE * member.tangent))
    zero = jnp.zeros(())
    change = energy.energy(scene, zero, ahead) - energy.energy(scene, zero, y0)
    size = NUDGE * (1.0 + abs(member.energy))
    return float(change) if abs(change) > NUDGE * size else 0.0


def _through(value: float):
    def test(surface: Surface, member: Member) -> float:
        del surface
        return float(np.prod(member.stability.nontrivial - value).real)

    return test


def _outside(surface: Surface, member: Member) -> float:
    """Whether complex multipliers lie off the unit circle: -1 if some do."""
    del surface
    values, bars = member.stability.nontrivial, member.stability.bars
    complexes = np.abs(values.imag) > bars
    return -1.0 if (complexes & (np.abs(values) - 1 > bars)).any() else 1.0


TESTS = {
    Kind.FOLD: _fold,
    Kind.BRANCH: _through(1.0),
    Kind.DOUBLING: _through(-1.0),
    Kind.TORUS: _outside,
}
