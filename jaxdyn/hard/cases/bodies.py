"""Bodies that keep flipping over, and rotations that must remain rotations.

The flips about the middle axis are compared with Jacobi's elliptic functions (Landau, Lifshitz,
Mechanics, section 37), whose period needs only an arithmetic-geometric mean.
"""

import functools
import math
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.analysis import energy
from jaxdyn.formulations.rigid import pose
from jaxdyn.hard.case import Case, Figure
from jaxdyn.hard.elliptic import complete
from jaxdyn.integrate.simulation import simulate
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.scenes.bodies import free_body

_RTOL = 1e-15
_PERIODS = 10_000
_SAMPLES = 1000
_MOST = 5_000_000
_MOMENTS = (1, 2, 3)


def flipping_body(wobble: float, representation: str = "quaternion") -> Scene:
    """A body of moments 1, 2, 3 that spins at 1 rad/s about axis 2 and slightly about axis 1."""
    return free_body((wobble, 1.0, 0.0), representation=representation)


def flip_period(wobble: float) -> float:
    """The period [s] of `flipping_body`, 4 K(k) / n, in which omega_3 passes 0 twice.

    1 - k^2, on which K depends like a logarithm near the separatrix, is computed exactly.
    """
    i1, i2, i3 = _MOMENTS
    a, b = Fraction(wobble) ** 2, Fraction(1)
    h2, t2 = a * i1 * i1 + b * i2 * i2, a * i1 + b * i2
    rest = 1 - (i3 - i2) * (h2 - t2 * i1) / ((i2 - i1) * (t2 * i3 - h2))
    rate = math.sqrt((i2 - i1) * (t2 * i3 - h2) / Fraction(i1 * i2 * i3))
    return 4 * complete(math.sqrt(rest)) / rate


def _flips(wobble: float) -> tuple[Figure, ...]:
    period = flip_period(wobble)
    motion = _motion(flipping_body(wobble), _PERIODS * period)
    y = motion.ys[-1]
    # omega_3 is 0 after whole periods; this is the time by which the motion is past that zero.
    late = float(y[-1] / motion.scene.rate(motion.ts[-1], y)[-1])
    momentum = np.asarray(energy.along(energy.angular_momentum, motion))
    size = np.linalg.norm(momentum[0])
    return (
        Figure("period", abs(late) / (_PERIODS * period), 1e-8),
        Figure("energy", float(energy.drift(motion)), 1e-12),
        Figure("angular momentum", float(np.abs(momentum - momentum[0]).max() / size), 1e-12),
        Figure("quaternion norm", float(_norm_error(motion)), 1e-12),
        Figure("steps a period", int(motion.steps) / _PERIODS),
    )


def _orthogonal() -> tuple[Figure, ...]:
    span = 4000 * flip_period(0.1)
    motion = _motion(flipping_body(0.1, "matrix"), span)
    R = np.asarray(energy.along(pose, motion).R_wb)
    off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max()
    other = simulate(flipping_body(0.1), span, samples=2, rtol=_RTOL, max_steps=_MOST)
    gap = pose(other.scene, span, other.ys[-1]).R_wb - R[-1]
    return (
        Figure("orthogonality", float(off), 1e-12),
        Figure("apart from the quaternion", float(jnp.abs(gap).max()), 1e-7),
        Figure("fewer steps than a million", max(0, 1_000_000 - int(motion.steps)), 0),
    )


def _motion(scene: Scene, t1: float) -> Trajectory:
    return simulate(scene, t1, samples=_SAMPLES, rtol=_RTOL, max_steps=_MOST)


def _norm_error(motion: Trajectory) -> Array:
    names = [name for name, _ in motion.scene.system.labels()]
    q = motion.ys[:, names.index("qw") : names.index("qz") + 1]
    return jnp.max(jnp.abs(jnp.linalg.norm(q, axis=1) - 1))


CASES = (
    Case(
        "flips",
        "A body flips about its middle axis 10 000 times, as elliptic functions predict.",
        functools.partial(_flips, 0.1),
    ),
    Case(
        "flips-near-separatrix",
        "A body that starts a hundredth beside the unstable spin flips likewise.",
        functools.partial(_flips, 0.01),
    ),
    Case(
        "rotation-matrix",
        "A rotation matrix stays orthogonal over a million steps.",
        _orthogonal,
    ),
)
