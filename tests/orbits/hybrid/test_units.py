"""No unit matters: hybrid orbits are the same in all units."""

import jax.numpy as jnp
import numpy as np
import pytest

import orbits
from jaxdyn import scenes
from jaxdyn.course import eccentric_cylinder as cylinder
from jaxdyn.integrate import events

#: Units of length, time and mass: small ones, astronomical ones, and a mixture.
UNITS = [(1e-12, 1e-12, 1e-12), (1.496e11, 5e6, 1.989e30), (1e12, 1e-6, 1e-12)]


def bounce(t, y):
    return y * jnp.array([1.0, 1.0, 1.0, -1.0])


@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), *UNITS])
def test_a_bouncing_ball(units):
    length, time, mass = units
    ball = scenes.cannonball(g=10.0 * length / time**2, m=mass)
    falls = orbits.Leg(ball, (events.Reaches(1, 0.0),), bounce)
    rises = orbits.Leg(ball, (events.Reaches(3, 0.0), events.Reaches(1, 5.0 * length)))
    start = np.array([0.0, 4.0 * length, 0.0, 0.0])
    found = orbits.find_hybrid([falls, rises], start, [0.8 * time, 0.9 * time])
    assert found.period / time == pytest.approx(2.0, abs=1e-11)
    np.testing.assert_allclose(found.y0 / length, [0.0, 5.0, 0.0, 0.0], atol=1e-11)
    assert found.residual < 1e-12
    # Not below the height at which it is to turn.
    with pytest.raises(orbits.SearchError):
        orbits.find_hybrid([falls, rises], start, [0.8 * time, 0.9 * time], max_iterations=1)


@pytest.mark.slow
@pytest.mark.parametrize("units", UNITS)
def test_a_hop(units):
    length, time, mass = units
    plain = cylinder.hop(scenes.cylinder_on_ramp(slope=0.0))
    inertia = 0.4 * mass * length**2
    new = scenes.cylinder_on_ramp(
        slope=0.0, m=mass, r=length, d=0.5 * length, inertia=inertia, g=9.81 * length / time**2
    )
    found = cylinder.hop(new)
    assert found.period / time == pytest.approx(plain.period, rel=1e-9)
    assert cylinder.advance(found) / length == pytest.approx(cylinder.advance(plain), rel=1e-9)
    assert found.outcome == plain.outcome


#: Lengths of 1e9 and times of 1e6, and masses.
LARGE = (1e9, 1e6, 1e30)


def _bounces(units):
    """A ball that falls and rises again, in other units."""
    length, time, mass = units
    ball = scenes.cannonball(g=10.0 * length / time**2, m=mass)
    falls = orbits.Leg(ball, (events.Reaches(1, 0.0),), bounce)
    rises = orbits.Leg(ball, (events.Reaches(3, 0.0), events.Reaches(1, 5.0 * length)))
    start = np.array([0.0, 4.0 * length, 0.0, 0.0])
    return orbits.find_hybrid([falls, rises], start, [0.8 * time, 0.9 * time])


@pytest.mark.parametrize("units", [LARGE, *UNITS])
def test_checks_files_and_pictures_in_other_units(units, tmp_path):
    one, other = _bounces((1.0, 1.0, 1.0)), _bounces(units)
    length, time, _ = units
    known, found = orbits.digits(one), orbits.digits(other)
    for a, b in ((known.y0, found.y0), (known.period, found.period)):
        assert min(a, b) > 11
        assert abs(a - b) < 2
    assert orbits.recheck(other).closure < 1e-12
    assert orbits.same_orbit(other, other)
    period, times = orbits.minimal_period(other)
    assert times == 1
    assert period / time == pytest.approx(2.0, abs=1e-11)
    path = tmp_path / "bounces.json"
    orbits.save(path, other)
    again, _ = orbits.load(path, other.legs)
    assert orbits.verify(path, other.legs)[1] == []
    np.testing.assert_array_equal(again.y0, other.y0)
    np.testing.assert_array_equal(again.spans, other.spans)
    assert orbits.recheck(again).closure < 1e-12
    ys = np.concatenate([np.asarray(leg.ys) for leg in again.trajectory().pieces])
    assert np.abs(ys[:, 1]).max() / length == pytest.approx(5.0, abs=1e-9)
    figure = orbits.drawing.orbits([again], tmp_path / "bounces.png", title="")
    assert (tmp_path / "bounces.png").stat().st_size > 5_000
    low, high = figure.axes[0].get_ylim()
    assert low / length < 0.0 < 5.0 < high / length < 10.0
