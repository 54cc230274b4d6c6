"""The slowest spin at which a top stays upright (sleeps), in three ways: problems 59 b and 61.

The slowest spin of an almost upright top in steady precession is 2 sqrt((I - I_3) m g d) / I_3
relative to the precessing frame, and 2 sqrt(I m g d) / I_3 in total, with I the transverse moment
about the pivot. These are different motions, and the first has the faster total spin. The total
decides stability: the course's conjecture from 59 b is true if it means the total spin.
`steady.linearize_steady` decides it for any given spin, and for any steady motion.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._numerics import safe_sqrt
from jaxdyn.analysis.linearize import classify, jacobian
from jaxdyn.formulations.rigid import inertia_matrix
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes.bodies import top

_TILT_ENTRIES = np.array([0, 1, 3, 4])  # of the state: the two angles that tilt, and their rates
_MIN_GROWTH = 1e-7  # in units of the spin; double eigenvalues are accurate to 1e-9
#: A sleeping top is released at the first of these tilts [rad] and has fallen at the second.
_RELEASED, _FALLEN = 1e-5, 1e-2
#: In units of 2 I_1 / (I_3 omega), the time of growth far below the critical spin.
_WATCHED_SPAN = 1500.0
_WATCHED_SAMPLES = 4000


def critical_spin(*, m, d, I1, I3, g=9.81) -> Array:
    """Slowest total spin () [rad/s] of a stable sleeping top.

    2 sqrt(I m g d) / I_3, with I about the pivot. Above it an almost upright top also has two
    steady precessions, below it none.
    """
    return 2 * jnp.sqrt((I1 + m * d * d) * m * g * d) / I3


def slowest_relative_spin(*, m, d, I1, I3, g=9.81) -> Array:
    """Slowest spin () [rad/s] relative to the precessing frame, almost upright.

    2 sqrt((I - I_3) m g d) / I_3, with I about the pivot; 0 for I <= I_3, where steady
    precession exists at any spin. The limit of stability is `critical_spin`, not this.
    """
    excess = jnp.maximum(I1 + m * d * d - I3, 0.0)
    return 2 * safe_sqrt(excess * m * g * d) / I3


def critical_spin_by_linearisation(**top_numbers) -> float:
    """`critical_spin` as the spin where the eigenvalues of the upright top turn real; host only.

    Args:
      top_numbers: m, d, I1, I3, g of `scenes.bodies.top`.
    """
    guess = float(critical_spin(**top_numbers))

    def unstable(spin):
        # Upright, XYZ Euler angles are regular, and the third, which grows steadily, does not
        # enter the rates: the motion has eigenvalues like an equilibrium.
        scene = top(0.0, spin=spin, representation="euler", sequence="XYZ", **top_numbers)
        a = jacobian(scene, scene.y0)[_TILT_ENTRIES, :][:, _TILT_ENTRIES]
        return classify(a).eigenvalues[0].real > _MIN_GROWTH * spin

    return _threshold(unstable, guess, 45)


def critical_spin_by_simulation(**top_numbers) -> float:
    """`critical_spin` to a few parts in 1e5, from tops released almost upright; host only.

    Below the critical spin such a top falls to cos(theta / 2) = spin / critical spin and rises
    again, for any small initial tilt; above, it stays upright.

    Args:
      top_numbers: m, d, I1, I3, g of `scenes.bodies.top`.
    """
    guess = float(critical_spin(**top_numbers))
    scene = top(_RELEASED, spin=guess, **top_numbers)
    body: Any = scene.system
    inertia = inertia_matrix(body.matter)
    t1 = _WATCHED_SPAN * 2 * inertia[0, 0] / (inertia[2, 2] * guess)
    ts = jnp.linspace(0.0, t1, _WATCHED_SAMPLES)

    @jax.jit
    def unstable(spin):
        y0 = top(_RELEASED, spin=spin, **top_numbers).y0
        ys = solve(scene.starting(y0), t1, ts=ts, rtol=1e-11).ys
        axis = jax.vmap(body.pose)(ys).R_wb[..., 2]
        return jnp.min(axis[:, 2]) < jnp.cos(_FALLEN)

    return _threshold(unstable, guess, 20)


def _threshold(unstable, guess: float, halvings: int) -> float:
    low, high = 0.3 * guess, 3.0 * guess
    for _ in range(halvings):
        middle = (low + high) / 2
        below = unstable(middle)
        low, high = (middle, high) if below else (low, middle)
    return (low + high) / 2
