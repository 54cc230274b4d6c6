"""Orbits unlike known ones: the deflated step, distances, and what is found where plain fails."""

import jax.numpy as jnp
import numpy as np
import pytest
from odes import VAN_DER_POL, VAN_DER_POL_X, van_der_pol

import jaxdyn
import orbits
from jaxdyn import scenes
from orbits.shooting import deflation, newton
from orbits.shooting.equations import Equations

LEVEL = orbits.Energy(1 / 8)
STARTS = [[0.0, 0.1, 0.4, 0.0], [0.0, -0.1, 0.3, 0.1], [0.2, 0.1, -0.1, 0.3]]


def duffing(t, y, w):
    """x'' + 0.04 x' + x + x^3 = 0.1 cos(w t), with three motions of the drive's period."""
    x, v = y
    return [v, 0.1 * jnp.cos(w * t) - 0.04 * v - x - x**3]


def driven():
    return jaxdyn.ode(duffing, [0.3, 0.1], 2 * np.pi / 1.3, params=1.3)


def cycle():
    return orbits.find(jaxdyn.ode(van_der_pol, [VAN_DER_POL_X, 0.0], VAN_DER_POL, params=1.0))


def equations(orbit, hold=()):
    return Equations(scene=orbit.scene, closing=orbit.closing, conditions=hold)


def unknowns(orbit):
    return np.append(np.asarray(orbit.y0), orbit.period)


def away(orbit, other):
    """The distance of an orbit from another one."""
    return deflation.distance(
        equations(orbit), unknowns(orbit), deflation.known_orbits([other], orbit.scene)
    )


@pytest.fixture(scope="module")
def well():
    return orbits.find(scenes.henon_heiles(), STARTS[0], 6.5, hold=LEVEL)


@pytest.mark.slow
def test_the_slope_is_that_of_log_m(well):
    (known,) = deflation.known_orbits([well], well.scene)
    here = equations(well)
    at = np.array([0.05, 0.2, 0.3, 0.1, 6.4])

    def log_m(x):
        return float(np.log1p(1 / deflation._square(here, x, known)[0]))

    slope = deflation._slope(deflation._squares(here, at, [known]))
    # So short that the nearest line is the same one: its second derivatives are of order ten.
    h = 1e-6
    expected = [(log_m(at + h * e) - log_m(at - h * e)) / (2 * h) for e in np.eye(5)]
    np.testing.assert_allclose(slope, expected, atol=1e-8)


def test_the_newton_step_of_m_f_is_that_of_f_times_a_number(well):
    """By Sherman and Morrison's formula, against the step of the deflated equations themselves."""
    several = deflation.known_orbits([well], well.scene)
    here = equations(well, (LEVEL,))
    at = np.array([0.05, 0.2, 0.3, 0.1, 6.4])
    found = here(at, 1e-11)
    residual, jacobian = map(np.asarray, (found.residual, found.jacobian))
    jacobian = jacobian + np.eye(*jacobian.shape)  # regular: no direction is left undetermined
    slope = deflation._slope(deflation._squares(here, at, several))
    plain = np.linalg.solve(jacobian, -residual)
    m = 1 + deflation.distance(here, at, several) ** -2
    both = np.linalg.solve(m * (jacobian + np.outer(residual, slope)), -m * residual)
    np.testing.assert_allclose(both, plain / (1 - slope @ plain), rtol=1e-11)


def test_the_first_step_is_damped_and_within_the_bounds():
    x, slope = np.array([1.0, 1.0]), np.eye(2)
    upper = np.array([np.inf, 1.5])
    step = newton.first_step(
        x, np.array([0.3, -1.0]), slope, np.full(2, -np.inf), upper, np.ones(2), 0.03
    )
    damping = 0.03 * np.hypot(0.3, 1.0)
    np.testing.assert_allclose(step[0], -0.3 / (1 + damping**2), rtol=0.01)
    assert step[1] == 0.5


@pytest.mark.slow
def test_an_orbit_is_itself_however_it_is_seen():
    eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    late = np.asarray(jaxdyn.solve(eight.scene, 1.3).y1).reshape(2, 3, 2)[:, [1, 0, 2]]
    turn = np.array([[0.6, 0.8], [0.8, -0.6]])  # improper
    scaled = late @ turn * np.array([1.7, -(1.7**-0.5)])[:, None, None]
    for times in (1, 2):
        period = times * eight.period * 1.7**1.5
        seen = orbits.find(eight.scene, scaled.ravel(), period)
        assert away(seen, eight) < 0.5 * deflation.SAME
    neighbour = orbits.find(scenes.three_body(scenes.EIGHT_GUESS, t1=scenes.EIGHT_GUESS_PERIOD))
    assert 1e-3 < away(neighbour, eight) < 3e-2


@pytest.mark.slow
def test_angles_are_compared_modulo_turns():
    swing = orbits.find(scenes.pendulum(angle=2.0), period=8.0)
    turned = orbits.find(swing.scene, swing.y0 + jnp.array([2 * jnp.pi, 0.0]), swing.period)
    assert away(turned, swing) < 0.5 * deflation.SAME


def test_other_orbits_from_one_start(well):
    found = [well]
    for _ in range(2):
        found.append(
            orbits.find(
                scenes.henon_heiles(), STARTS[0], 6.5, hold=LEVEL, strategy=orbits.Deflated(found)
            )
        )
    # Periods of the three kinds of the eight families Pi of Churchill, Pecelli and Rod (1979).
    periods = sorted(round(orbit.period, 4) for orbit in found)
    assert periods == [6.0756, 6.9006, 7.5433]


def test_an_orbit_that_is_known_already_is_left(well):
    other = orbits.find(well.scene, hold=LEVEL, strategy=orbits.Deflated([well]))
    assert not orbits.same_orbit(other, well)


@pytest.mark.slow
def test_all_three_motions_of_duffings_oscillator():
    found = orbits.find_all(driven(), [[0.3, 0.1], [0.0, 0.0]])
    verdicts = sorted(orbits.stability(orbit).verdict for orbit in found)
    # The index of the stroboscopic map is 1: each saddle is one more of the others.
    assert verdicts == ["stable", "stable", "unstable"]
    assert all(orbit.period == pytest.approx(2 * np.pi / 1.3) for orbit in found)


def test_there_is_no_other_cycle_of_van_der_pol():
    known = cycle()
    orbit = orbits.find(
        known.scene, strategy=orbits.Deflated([known]), throw=False, max_iterations=20
    )
    assert orbit.outcome == orbits.Outcome.NO_OTHER
    with pytest.raises(orbits.SearchError, match="No orbit unlike the known ones"):
        orbits.find(known.scene, strategy=orbits.Deflated([known]), max_iterations=5)


def test_progress_is_reported_within_the_limit():
    steps, known = [], cycle()
    options = {
        "strategy": orbits.Deflated([known]),
        "throw": False,
        "max_iterations": 4,
        "report": steps.append,
    }
    orbits.find(known.scene, [0.5, 0.5], **options)
    assert [step.index for step in steps] == [0, 1, 2, 3, 4]
    orbits.find(known.scene, **options)  # from the known orbit itself, in three directions
    assert [step.index for step in steps[5:]].count(0) == 3


def test_what_is_no_orbit_is_refused():
    with pytest.raises(ValueError, match="Deflated: expected known orbits that close, got int"):
        orbits.find(scenes.henon_heiles(), strategy=orbits.Deflated([3]))


def test_orbits_of_another_scene_are_refused(well):
    with pytest.raises(
        ValueError, match="Deflated: expected known orbits of lorenz, of x, y, z, got "
    ):
        orbits.find(scenes.lorenz(), period=2.0, strategy=orbits.Deflated([well]))


@pytest.mark.parametrize(
    ("y0s", "period", "message"),
    [
        ([0.0, 0.1, 0.4, 0.0], 6.5, r"y0s: expected guesses of shape \(n, 4\), got shape \(4,\)"),
        (STARTS, [6.5, 7.0], r"period: expected one time, or one for each of 3, got shape \(2,\)"),
    ],
)
def test_guesses_of_the_wrong_shape(y0s, period, message):
    with pytest.raises(ValueError, match=message):
        orbits.find_all(scenes.henon_heiles(), y0s, period)


@pytest.mark.slow
def test_the_eight_families_of_henon_and_heiles():
    found, plain, seen = [], [], []
    for y0 in STARTS:
        orbit = orbits.find(scenes.henon_heiles(), y0, 6.5, hold=LEVEL, throw=False)
        if orbit.ok and not any(orbits.same_orbit(orbit, known) for known in plain):
            plain.append(orbit)
    found = orbits.find_all(scenes.henon_heiles(), STARTS, 6.5, hold=LEVEL, report=seen.append)
    assert seen == found
    # Turns by a third and mirror images: three and three of two kinds; the loops both ways round.
    periods = [round(orbit.period, 4) for orbit in found]
    assert {x: periods.count(x) for x in periods} == {6.0756: 2, 6.9006: 3, 7.5433: 3}
    assert len(plain) <= 3


@pytest.mark.slow
def test_cycles_of_lorenz_from_one_start():
    found = orbits.find_all(scenes.lorenz(), [[1.0, 1.0, 20.0]], 3.0)
    # D. Viswanath, Nonlinearity 16 (2003) 1035: words of two to five letters.
    known = (1.5586522107, 2.3059072639, 3.0235837034, 3.0842767758)
    known += (3.7256417716, 3.8202541634, 3.8695391126)
    for orbit in found:
        assert np.abs(np.array(known) - orbit.period).min() < 1e-9
    assert len(found) >= 5
