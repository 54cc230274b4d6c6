"""Families of orbits end on their bounds, where closed forms or a search say what is there."""

import math

import numpy as np
import pytest
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.continuation.kinds import Kind

G = 9.81
ON = 1e-12  # relative: that to which members are located


def _van_der_pol(t, y, mu):
    return [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]]


def van_der_pol(mu):
    return jaxdyn.ode(_van_der_pol, [2.0, 0.0], 6.3, params=mu)


def _hopf(t, y, mu):
    grows = mu - y[0] ** 2 - y[1] ** 2
    return [grows * y[0] - y[1], grows * y[1] + y[0]]


def hopf(mu):
    """Circles of radius sqrt(mu), with the multiplier exp(-4 pi mu)."""
    return jaxdyn.ode(_hopf, [math.sqrt(0.3), 0.0], 2 * math.pi, params=mu)


@pytest.fixture(scope="module")
def circle():
    return orbits.find(hopf(0.3))


@pytest.fixture(scope="module")
def swing():
    return orbits.find(scenes.pendulum(angle=0.5), period=2.0)


def period_of_swing(energy):
    return 4 / math.sqrt(G) * ellipk((1 + energy / G) / 2)


def test_the_last_orbit_is_that_of_a_search_on_the_bound():
    first = orbits.find(van_der_pol(0.5), period=6.4)
    family = orbits.continue_family(first, van_der_pol, 0.5, within=(0.5, 1.0), step=0.1)
    assert family.end == "the bounds (0.5, 1.0)"
    assert (family.parameters[:-1] < 1.0).all()
    last = family.members[-1]
    assert abs(last.parameter - 1.0) < ON
    found = orbits.find(van_der_pol(1.0), last.orbit.y0, period=6.6)
    # 6.66328685932: Andersen, Geer (1982), SIAM J. Appl. Math. 42, 678.
    assert abs(last.orbit.period - found.period) < 1e-11
    assert abs(last.orbit.period - 6.663286859) < 1e-9
    (multiplier,) = orbits.stability(found).nontrivial
    np.testing.assert_allclose(last.stability.nontrivial, multiplier, rtol=1e-7)
    assert last.orbit.ok
    assert orbits.recheck(last.orbit).closure < 1e-11


def test_a_bound_on_the_energy_is_met_and_of_two_bounds_the_first(swing):
    family = orbits.continue_family(swing, energies=(-G, -7.0), step=0.2)
    assert abs(family.energies[-1] + 7.0) < 7 * ON
    assert abs(family.periods[-1] - period_of_swing(-7.0)) < 1e-11
    assert family.end == f"the bounds on the energy, ({-G}, -7.0)"
    for off, end in ((1e-3, "the bounds on the energy, "), (-1e-3, "the bounds (")):
        within = (0.0, period_of_swing(-7.0) + off)
        family = orbits.continue_family(swing, within=within, energies=(-G, -7.0), step=0.2)
        assert family.end.startswith(end)
        if off < 0:
            assert abs(family.periods[-1] / within[1] - 1) < ON
            assert family.energies[-1] < -7.0


@pytest.mark.parametrize("low", [0.02, 1e-3])
def test_a_family_that_would_shrink_to_an_equilibrium_ends_on_a_bound_before_it(circle, low):
    family = orbits.continue_family(circle, hopf, 0.3, down=True, within=(low, 1), step=0.2)
    assert (family.end, family.special) == (f"the bounds ({low}, 1)", ())
    last = family.members[-1]
    assert abs(last.parameter - low) < ON * low
    assert abs(float(np.linalg.norm(last.orbit.y0)) - math.sqrt(low)) < 1e-10
    np.testing.assert_allclose(last.stability.nontrivial, math.exp(-4 * math.pi * low), rtol=1e-9)


def test_a_family_ends_at_the_equilibrium_on_its_bound(circle):
    family = orbits.continue_family(circle, hopf, 0.3, down=True, within=(0, 1), step=0.2)
    assert [x.kind for x in family.special] == [Kind.REST]


@pytest.mark.parametrize(("off", "found"), [(-1e-6, []), (1e-6, [Kind.DOUBLING])])
def test_a_doubling_is_found_up_to_the_bound_and_not_beyond(off, found):
    """Of a ball that bounces on a table: 1 + trace + determinant is 0, see `test_chains`."""
    e, turn = 0.8, 10.0
    a, speed = 2 * G * (1 + e * e) / (1 + e) ** 2, G * math.pi / turn * (1 - e) / (1 + e)
    doubling = math.hypot(a / turn**2, speed / turn)

    def ball(amplitude):
        return scenes.phases_of(scenes.ball_on_table(amplitude=amplitude))

    bounce = orbits.find_hybrid(ball(0.1), scenes.ball_on_table(phase=1.2, velocity=3.0).y0)
    family = orbits.continue_family(bounce, ball, 0.1, within=(0.0, doubling + off))
    assert abs(family.parameters[-1] - (doubling + off)) < ON
    assert [x.kind for x in family.special] == found


@pytest.mark.parametrize("off", [-1e-14, 0.0, 1e-14])
def test_a_family_may_begin_on_a_bound(circle, off):
    options = {"within": (0.3 + off, 0.5), "step": 0.2}
    inward = orbits.continue_family(circle, hopf, 0.3, **options)
    assert abs(inward.parameters[-1] - 0.5) < ON
    outward = orbits.continue_family(circle, hopf, 0.3, down=True, **options)
    assert (len(outward.members), outward.end) == (1, f"the bounds ({0.3 + off}, 0.5)")


def test_a_family_goes_on_from_its_bounds_in_its_file(circle, tmp_path):
    path, seen = tmp_path / "run.jsonl", []

    def upto(high):
        seen.clear()
        return orbits.continue_family(
            circle, hopf, 0.3, within=(0.1, high), step=0.2, path=path, report=seen.append
        )

    short, size = upto(0.5), path.stat().st_size
    loaded = orbits.families.load(path, hopf).orbits[0]
    np.testing.assert_array_equal(loaded.parameters, short.parameters)
    np.testing.assert_array_equal(upto(0.5).parameters, short.parameters)
    assert path.stat().st_size == size
    assert len(seen) == len(short.members)
    long = upto(0.7)
    np.testing.assert_array_equal(long.parameters[: len(short.members)], short.parameters)
    assert abs(long.parameters[-1] - 0.7) < ON
    narrow = upto(0.4)
    assert abs(narrow.parameters[-1] - 0.4) < ON
    radii = [np.linalg.norm(member.orbit.y0) for member in (*long.members, *narrow.members)]
    np.testing.assert_allclose(np.square(radii), [*long.parameters, *narrow.parameters], rtol=1e-10)
