"""Bifurcation diagrams: what they find, what they keep where something fails, and their picture."""

import jax.numpy as jnp
import numpy as np
import pytest
from odes import pitchfork_of_cycles, roessler
from scipy.integrate import solve_ivp

import jaxdyn
import orbits


def _van_der_pol(mu):
    def rate(t, y, mu):
        return [y[1], mu * y[1] - y[0] ** 2 * y[1] - y[0]]

    return jaxdyn.ode(rate, [0.0, 0.0], 10.0, params=mu)


def _roessler(c):
    return jaxdyn.ode(roessler, jnp.zeros(3), 6.0, params=c)


@pytest.fixture(scope="module")
def cycles():
    seen = []
    found = orbits.diagram(
        _van_der_pol, -0.5, [0.0, 0.0], within=(-1, 1), orbit_members=6, report=seen.append
    )
    return found, seen


@pytest.mark.slow
def test_equilibria_and_the_orbits_that_begin_there(cycles, tmp_path):
    found, seen = cycles
    (family,) = found.orbits
    assert seen == [*found.equilibria, family]
    assert found.depths == (0,)
    # To the second order the amplitude is 2 sqrt(mu), and the period 2 pi (1 + mu^2 / 16).
    first = family.members[0]
    low, high = orbits.families.diagram.extremes(first, 0)
    np.testing.assert_allclose(-low, high, rtol=1e-3)
    np.testing.assert_allclose(first.parameter, high**2 / 4, rtol=1e-3)
    assert all(member.stability.verdict == "stable" for member in family.members[1:])
    assert "supercritical Hopf point at" in repr(found)
    ends = sorted(family.parameters[-1] for family in found.equilibria)
    np.testing.assert_allclose(ends, [-1.0, 1.0], rtol=1e-12)
    path = tmp_path / "diagram.png"
    orbits.drawing.diagram(found, path, entry="y0", parameter="mu")
    assert path.stat().st_size > 10_000
    with pytest.raises(ValueError, match="entry"):
        orbits.drawing.diagram(found, entry="z")


@pytest.mark.slow
def test_a_failure_is_kept_beside_what_was_found():
    found = orbits.diagram(
        _van_der_pol, -0.5, [0.0, 0.0], within=(-1, 1), orbit_members=6, amplitude=1e6
    )
    (failure,) = found.failures
    assert failure.point.kind == "Hopf point"
    assert "No orbit was found at this amplitude" in failure.reason
    assert found.orbits == ()
    assert len(found.equilibria) == 2
    assert "not followed" in repr(found)
    assert "Not followed: Hopf point" in repr(failure)


@pytest.mark.slow
def test_orbits_of_fast_and_slow_motions_begin_very_near_to_their_hopf_point():
    """Hindmarsh and Rose (1984), Proc. R. Soc. Lond. B 221, 87: a model of a neuron."""

    def neuron(t, y, current):
        x, u, z = y
        return [u - x**3 + 3 * x * x - z + current, 1 - 5 * x * x - u, 0.006 * (4 * (x + 1.6) - z)]

    def make(current):
        return jaxdyn.ode(neuron, [-0.1, 1.0, 6.0], 40.0, params=current)

    start = [-0.04, 1.0, 6.2]
    found = orbits.diagram(make, 5.3, start, within=(5.2, 5.6), depth=0, orbit_members=2)
    assert found.failures == ()
    (family,) = found.orbits
    (hopf,) = (x for equilibria in found.equilibria for x in equilibria.special)
    assert hopf.criticality == "supercritical"
    period = 2 * np.pi / hopf.frequency
    # Of second order in its distance, at most a hundredth of the sizes; less, since it had to be.
    assert abs(family.members[0].orbit.period / period - 1) < 1e-5
    with pytest.raises(orbits.SearchError):
        orbits.from_hopf(found.equilibria[0], hopf, amplitude=1e-2)


def test_the_depth_is_a_whole_number():
    with pytest.raises(ValueError, match="depth"):
        orbits.diagram(_van_der_pol, -0.5, [0.0, 0.0], within=(-1, 1), depth=-1)


@pytest.mark.long
def test_roesslers_doublings():
    found = orbits.diagram(
        _roessler,
        0.5,
        [0.1, -0.5, 0.5],
        within=(0.1, 4.5),
        depth=2,
        orbit_step=0.2,
        orbit_members=60,
    )
    # The equilibria fold at c = 2 a = 0.4.
    folds = [x.parameter for family in found.equilibria for x in family.special if x.kind == "fold"]
    np.testing.assert_allclose(folds, 0.4, rtol=1e-12)
    assert found.depths == (0, 1, 2)
    special = [
        [x for x in family.special if x.kind == "period doubling"] for family in found.orbits
    ]
    for (point,), family in zip(special, found.orbits[1:], strict=False):
        nearest = np.abs(point.stability.multipliers + 1).min()
        assert nearest < 1e-8
        np.testing.assert_allclose(
            family.members[0].orbit.period, 2 * point.orbit.period, rtol=1e-3
        )
    np.testing.assert_allclose([x[0].parameter for x in special], [2.832, 3.837, 4.124], atol=2e-3)


@pytest.mark.slow
def test_both_halves_of_a_branch_of_orbits():
    def make(mu):
        return jaxdyn.ode(pitchfork_of_cycles, jnp.zeros(3), 6.0, params=mu)

    found = orbits.diagram(
        make, -0.1, jnp.zeros(3), within=(-0.2, 0.4), orbit_members=14, orbit_step=0.1
    )
    assert found.failures == ()
    first, *others = found.orbits
    (point,) = (x for x in first.special if x.kind == orbits.Kind.BRANCH)
    assert abs(point.parameter - 0.2) < 1e-9
    assert orbits.criticality(point).verdict == "supercritical"
    assert len(others) == 2
    sides = set()
    for family in others:
        last = family.members[-1]
        z = float(last.orbit.y0[2])
        assert abs(z * z - (last.parameter - 0.2)) < 1e-9
        assert last.stability.verdict == "stable"
        sides.add(np.sign(z))
    assert sides == {1.0, -1.0}


def _fitzhugh_nagumo(current, recovery=0.08):
    def rate(t, y, p):
        return [y[0] - y[0] ** 3 / 3 - y[1] + p[0], p[1] * (y[0] + 0.7 - 0.8 * y[1])]

    return jaxdyn.ode(rate, [-1.2, -0.6], 10.0, params=[current, recovery])


@pytest.mark.slow
def test_a_canard_explosion_turns_at_a_fold():
    """Beside the fold the parameter changes along the family by no more than rounding."""
    start = [-1.19940804, -0.62426004]
    found = orbits.diagram(_fitzhugh_nagumo, 0.0, start, within=(0, 0.5))
    (family,) = found.orbits
    assert not found.failures
    assert {point.kind for point in family.special} <= {orbits.Kind.FOLD}
    np.testing.assert_allclose(
        [point.parameter for point in family.special], 0.324178522, atol=1e-8
    )


def _slow_fitzhugh_nagumo(current):
    return _fitzhugh_nagumo(current, 0.01)


@pytest.mark.slow
def test_no_orbit_in_the_plane_doubles_its_period_in_a_canard_explosion():
    """The multiplier is exp of the integral of the divergence, > 0, however large the tangents."""
    make, within = _slow_fitzhugh_nagumo, (0.2, 0.5)
    rests = jaxdyn.continue_equilibria(make, 0.0, [-1.2, -0.6], within=(0, 0.5))
    cycle, hopf = orbits.from_hopf(rests, rests.special[0])
    family = orbits.continue_family(cycle, make, hopf, members=29, within=within)
    assert not family.special
    multipliers = np.array([member.stability.nontrivial[0].real for member in family.members])
    assert (np.diff(multipliers) > 0).all()
    assert 1e9 < multipliers[-1] < 1e13  # 3e26 where it is noise


def _textbook(mu):
    def rate(t, y, mu):
        return [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]]

    return jaxdyn.ode(rate, [0.0, 0.0], 10.0, params=mu)


@pytest.mark.slow
def test_limit_cycles_of_van_der_pol_are_reached_through_the_orbits_of_the_centre(tmp_path):
    """At mu = 0 all orbits are circles, and the limit cycles cross them where the radius is 2."""
    found = orbits.diagram(_textbook, -0.5, [0.0, 0.0], within=(-1, 1), orbit_members=20)
    hopf = found.equilibria[0].special[0]
    assert (hopf.criticality, hopf.coefficient) == ("", 0.0)
    assert not found.failures
    circles, *sides = found.orbits
    assert max(abs(x.parameter) for x in circles.members) < 1e-12
    (crossing,) = circles.special
    assert crossing.kind == orbits.Kind.BRANCH
    np.testing.assert_allclose(np.linalg.norm(crossing.orbit.y0), 2.0, rtol=1e-9)
    # One side is stable, the other, which is it backwards in time, is not.
    assert [side.members[-1].stability.verdict for side in sides] == ["unstable", "stable"]
    for side in sides:
        last = side.members[-1]
        assert abs(last.parameter) > 0.5
        period = _period_by_scipy(abs(last.parameter))
        np.testing.assert_allclose(last.orbit.period, period, rtol=1e-9)
    ax = orbits.drawing.diagram(found, tmp_path / "diagram.png", parameter="mu").axes[0]
    assert 2.0 < ax.get_ylim()[1] < 4.0  # not as far as the circles reach


def _period_by_scipy(mu):
    """Of van der Pol's cycle: the time from one of its upper turns to the next."""

    def rate(t, y):
        return [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]]

    def turns(t, y):
        return y[1]

    options = {"events": turns, "rtol": 1e-13, "atol": 1e-13, "method": "DOP853"}
    times = solve_ivp(rate, (0.0, 100.0), [2.0, 0.0], **options).t_events[0]
    return times[-1] - times[-3]
