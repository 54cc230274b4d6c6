"""No unit matters: throws and closed loops are the same in all units."""

import numpy as np
import pytest

from jaxdyn import scenes
from jaxdyn.effects import PowerLaw
from orbits.targets import aim, loops

#: Units of length, time and mass: small ones, astronomical ones, and a mixture.
UNITS = [(1e-12, 1e-12, 1e-12), (1.496e11, 5e6, 1.989e30), (1e12, 1e-6, 1e-12)]
SAME = 1e-10


def ball(length, time, mass, drag=0.5):
    """With quadratic drag, of mass over length."""
    return scenes.cannonball(g=10.0 * length / time**2, m=mass, drag=drag * mass / length)


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_throws(units):
    length, time, _ = units
    plain, new = ball(1.0, 1.0, 1.0), ball(*units)
    here, there = aim.hit(plain, 1.0, 10.0), aim.hit(new, length, 10.0 * length / time)
    assert len(here.angles) == 2
    np.testing.assert_allclose(there.angles, here.angles, atol=SAME)
    assert there.message == here.message
    # Out of reach: the message says by how much, in units.
    missed = aim.hit(new, 100 * length, 10.0 * length / time)
    assert missed.outcome == aim.hit(plain, 100.0, 10.0).outcome
    here, there = aim.farthest(plain, 10.0), aim.farthest(new, 10.0 * length / time)
    assert float(there.angle) == pytest.approx(float(here.angle), abs=1e-8)
    assert float(there.x) / length == pytest.approx(float(here.x), rel=SAME)
    here, there = aim.slowest(plain, 2.0), aim.slowest(new, 2.0 * length)
    assert float(there.speed) * time / length == pytest.approx(float(here.speed), rel=SAME)


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_closed_loops(units):
    length, time, mass = units
    # A force of k / r, with k of mass and speed squared.
    law = PowerLaw(mass * (length / time) ** 2, -1.0)
    plain = loops.closed(PowerLaw(1.0, -1.0), 2, 3)
    orbit = loops.closed(law, 2, 3, r=length, m=mass)
    assert loops.count(orbit) == loops.count(plain)
    assert orbit.residual < 1e-12
    assert orbit.period / time == pytest.approx(plain.period, rel=SAME)
