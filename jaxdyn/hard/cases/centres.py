"""Loops about a centre of force: radii many powers of ten apart, and nearly circular orbits.

Angles and times between the nearest and the farthest point are compared with quadrature to 20
digits (the integral of dtheta/dr between the radii, by Gauss-Legendre rules of mpmath in the square
root of the distance from either end). The turns counted on a motion are compared with those angles.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn.effects import PowerLaw
from jaxdyn.hard.case import Case, Figure, absolute_error, relative_error
from jaxdyn.scenes.apsidal import apsidal_limits, apsides
from jaxdyn.scenes.central import power_law, swept_angle

#: Rows of exponent, ratio of radii, angle over pi, and time for r_max = k = m = 1.
_KNOWN = np.array(
    [
        (-2.9, 1e-8, 7.4968263682028551456, 1.1085650452083655171),
        (-2.6, 1e-8, 2.4674273139482388002, 1.0412005085066960811),
        (-2.25, 1e-8, 1.3329079380047886456, 1.080182109645494574),
        (-1.0, 1e-8, 0.51457980198923311146, 1.2533141374656181632),
        (0.0, 1e-8, 0.50000002944385895637, 1.4142135623730960741),
        (10.0, 1e-8, 0.49999999723753527963, 2.6284316091355914272),
        (100.0, 1e-8, 0.49999999686080656921, 7.2034018977610929068),
        (-2.6, 1e-30, 2.499998703254461089, 1.0407488349438416052),
        (-1.0, 1e-30, 0.50368369953710760442, 1.2533141373155002432),
    ]
)
_ALL_CLOSE = ((-2.0, 1.0), (1.0, 0.5))  # exponent, angle over pi of every orbit
_DEPTHS = (1e-8, 1e-4, 1.0, 20.0, 170.0)


@jax.jit
def _ways(n, depth):
    return jax.vmap(lambda n, depth: apsides(PowerLaw(1.0, n), depth))(n, depth)


def _angles() -> tuple[Figure, ...]:
    n, ratio, angle, time = _KNOWN.T
    found = _ways(n, -np.log(ratio))
    law, same = np.repeat(_ALL_CLOSE, len(_DEPTHS), axis=0).T
    closing = _ways(law, np.tile(_DEPTHS, 2)).angle / np.pi
    laws = np.linspace(-2.95, 20.0, 40)
    circles = _ways(laws, np.full(40, 1e-8)).angle / np.pi
    return (
        Figure(
            "angle, ratios of radii down to 1e-30",
            relative_error(found.angle / np.pi, angle),
            1e-13,
        ),
        Figure("time", relative_error(found.time, time), 1e-13),
        Figure("angle for springs and gravity, any shape", relative_error(closing, same), 1e-14),
        Figure("angle near circles", relative_error(circles, apsidal_limits(laws)[0]), 1e-13),
    )


def _turns() -> tuple[Figure, ...]:
    """The figures of three loops with radii in the ratio 1e-4, where a turn is very short."""
    errors = []
    for n in (-2.6, -2.25, -1.0):
        way = apsides(PowerLaw(1.0, n), math.log(1e4))
        loops = 6 * float(way.time)
        swept = swept_angle(power_law(n=n, speed=way.momentum), jnp.asarray(loops), rtol=1e-14)
        errors.append(absolute_error(swept, 6 * way.angle))
    return (Figure("angle swept in three loops [rad]", max(errors), 1e-8),)


CASES = (
    Case(
        "apsidal-angle",
        "Loops about a centre have the apsidal angle of their shape, for any shape.",
        _angles,
    ),
    Case("near-passages", "No turn about a close centre is lost.", _turns),
)
