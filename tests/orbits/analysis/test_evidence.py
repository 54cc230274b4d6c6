"""The second opinion: it sees what the finder's own residual cannot."""

import math

import numpy as np
import pytest
from helpers import SOLVED, gap, kepler, kepler_state
from scipy.integrate import solve_ivp

import orbits
from jaxdyn import scenes
from jaxdyn.effects import LinearDrag
from jaxdyn.solvers import DOPRI8
from orbits.closing.sizes import sizes
from orbits.orbit import Orbit, Outcome


def orbit_of(scene, rtol=1e-14):
    return Orbit(scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, rtol)


def test_closure_of_an_exact_orbit_is_rounding():
    orbit = orbit_of(kepler(0.3))
    assert orbits.analysis.closure(orbit) < SOLVED
    assert orbits.analysis.closure(orbit, periods=5) < 10 * SOLVED
    assert orbits.analysis.closure(orbit, solver=DOPRI8) < SOLVED


def test_closure_of_no_orbit_is_the_distance_to_the_start():
    scene = kepler(0.3)
    t = 0.9 * 2 * np.pi
    orbit = orbit_of(scene.starting(scene.y0, t))
    each = sizes(orbit.scene)
    exact = gap(kepler_state(0.3, t) / each, kepler_state(0.3, 0.0) / each)
    assert abs(orbits.analysis.closure(orbit) - exact) < SOLVED
    exact = gap(kepler_state(0.3, 3 * t) / each, kepler_state(0.3, 0.0) / each)
    assert abs(orbits.analysis.closure(orbit, periods=3) - exact) < 10 * SOLVED


def test_recheck_owes_nothing_to_the_orbits_own_tolerance_and_residual():
    exact = orbit_of(kepler(0.6), rtol=1e-4)
    assert (
        orbits.analysis.closure(exact) > 1e-9
    )  # by the loose integrator, which hides nothing here
    assert orbits.recheck(exact).closure < SOLVED
    late = 1e-8
    scene = kepler(0.3)
    wrong = orbit_of(scene.starting(scene.y0, scene.t1 + late))
    assert wrong.residual == 0.0
    speed = np.abs(np.asarray(scene.rate(0.0, scene.y0)) / sizes(scene)).max()
    assert abs(orbits.recheck(wrong).closure / (late * speed) - 1) < 1e-4


def test_recheck_takes_another_method_and_tolerance():
    second = orbits.recheck(orbit_of(kepler(0.3)))
    assert (second.solver, second.tolerance) == ("Verner 9(8)", 1e-15)
    assert second.closure < SOLVED
    # With drag the finder itself uses that method for the variational equations.
    second = orbits.recheck(orbit_of(kepler(0.3) + LinearDrag(0.1)))
    assert second.solver == DOPRI8.name
    assert second.closure > 0.01


def test_a_motion_that_ends_has_no_closure():
    falling = kepler(0.0).starting([-0.5, 0, 0.5, 0, 0, 0, 0, 0])
    assert math.isnan(orbits.analysis.closure(orbit_of(falling)))
    assert math.isnan(orbits.recheck(orbit_of(falling)).closure)


def test_digits_are_those_of_a_known_period():
    swing = orbits.find(scenes.oscillator(k=4.0), [1.0, 0.0], 3.0)
    found = orbits.digits(swing)
    assert 12 < found.period <= 16
    assert 12 < found.y0 <= 16
    # Four digits of the period are wrong here, and the start is on a circle whatever it is.
    wrong = orbits.Orbit(swing.scene.starting(swing.y0, np.pi * 1.0001), *_rest(swing))
    assert 3.5 < orbits.digits(wrong).period < 5


def _rest(orbit):
    return orbit.closing, orbit.residual, orbit.outcome, orbit.iterations, orbit.rtol


@pytest.mark.slow
def test_one_run_closes_worse_than_the_residual_of_segments_where_errors_grow():
    """A halo orbit, over which errors grow 3000 times; its segments join to rounding."""
    scene = scenes.restricted_three_body_in_space()
    orbit = orbits.find(scene, period=2.7465, segments=4)
    start, span = np.asarray(orbit.y0), (0.0, orbit.period)
    flow = solve_ivp(scene.rate, span, start, method="DOP853", rtol=3e-14, atol=1e-15)
    missed = np.abs((flow.y[:, -1] - start) / sizes(orbit.scene)).max()
    assert orbit.residual < 1e-14
    assert 5 * orbit.residual < missed < 1e-11
    assert orbit.residual < orbits.recheck(orbit).closure < 1e-11


def test_the_docstring_of_find_says_what_its_goal_measures():
    assert "`orbits.recheck`" in orbits.find.__doc__
    with pytest.raises(ValueError, match="largest residual of an orbit"):
        orbits.find(scenes.oscillator(), period=6.0, goal=0.0)
