"""The sizes of the entries of a state along a motion."""

import numpy as np
import pytest
from odes import ROD_MODES, heated

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.integrate.simulation import solve
from orbits.closing.sizes import alike, coupled_sizes, sizes, sizes_at_rest


def spring(t, y, k):
    return [y[1], -k * y[0]]


def test_a_velocity_that_is_zero_at_the_start_has_the_size_that_the_force_gives_it():
    for length, k in ((1.0, 1.0), (1e-10, 1e30), (1e9, 1e-12)):
        scene = jaxdyn.ode(spring, [length, 0.0], 2 * np.pi / np.sqrt(k), params=k)
        place, velocity = sizes(scene)
        assert place == length
        assert 0.2 < velocity / (length * np.sqrt(k)) < 2


def test_entries_of_a_unit_have_one_size():
    scene = scenes.three_body()
    each = sizes(scene)
    assert len(set(each[:6])) == len(set(each[6:])) == 1
    assert alike(scene, np.arange(12.0)).tolist() == [5.0] * 6 + [11.0] * 6


def test_what_bodies_do_to_each_other_raises_no_size_that_units_give():
    # Else another orbit, a few thousandths away from a known one, would count as the known one.
    scene = scenes.three_body(scenes.EIGHT_GUESS, t1=scenes.EIGHT_GUESS_PERIOD)
    each = sizes(scene)
    np.testing.assert_array_equal(coupled_sizes(scene, each), each)


def test_entries_at_rest_have_the_sizes_of_each_other():
    def rate(t, y, k):  # the last two are an oscillator at rest, beside one that moves
        return [y[1], -k * y[0], y[3], -k * y[2]]

    for k in (1.0, 1e24):
        scene = jaxdyn.ode(rate, [1.0, 0.0, 0.0, 0.0], 2 * np.pi / np.sqrt(k), params=k)
        each = sizes(scene)
        assert 0.2 < each[3] / (each[2] * np.sqrt(k)) < 2


def test_rounding_is_no_size_of_an_equilibrium():
    for k in (1.0, 1e24):
        scene = jaxdyn.ode(lambda t, y, k: [y[1], k * (1e-9 - y[0])], [0.0, 0.0], 1.0, params=k)
        place, velocity = sizes_at_rest(scene, np.array([1e-9, 1e-24]))
        assert place == 1e-9
        assert 0.2 < velocity / (1e-9 * np.sqrt(k)) < 2


def test_a_velocity_near_an_equilibrium_has_the_size_of_what_cancels_there():
    def rate(t, y, k):  # an oscillator about 1, so near to that that the rate is nearly 0
        return [y[1], -k * (y[0] - 1.0)]

    for k in (1.0, 1e24):
        scene = jaxdyn.ode(rate, [1.0 + 1e-6, 0.0], 2 * np.pi / np.sqrt(k), params=k)
        place, velocity = sizes(scene)
        assert abs(place - 1) < 1e-5
        assert 0.5 < velocity / np.sqrt(k) < 2


@pytest.mark.parametrize("even", [0.0, 1e-17])
def test_a_mode_that_symmetry_keeps_at_zero_has_no_rounding_for_its_size(even):
    y0 = np.where(np.arange(2 * ROD_MODES) % 2 == 1, even, 0.1)
    each = sizes(jaxdyn.ode(heated, y0, np.pi, params=2.0))
    assert (each > 1e-4).all()
    assert (each < 10.0).all()


@pytest.mark.slow
def test_an_orbit_among_modes_that_symmetry_keeps_at_zero_closes():
    y0 = np.where(np.arange(2 * ROD_MODES) == 0, 1.0, 0.0)
    names = [(f"mode {i}", "m") for i in range(len(y0))]
    near = solve(jaxdyn.ode(heated, y0, np.pi, names=names, params=2.0), 20.0).y1
    plain = orbits.find(jaxdyn.ode(heated, near, 3.1, params=2.0))
    together = orbits.find(jaxdyn.ode(heated, near, 3.1, names=names, params=2.0))
    assert plain.period == pytest.approx(np.pi, rel=1e-13)
    assert orbits.recheck(plain).closure < 1e-10
    one, other = (orbits.stability(orbit) for orbit in (plain, together))
    assert one.verdict == other.verdict == "stable"
    # Growth is in sizes, which differ; multipliers have no unit.
    largest = [np.abs(linear.nontrivial).max() for linear in (one, other)]
    assert largest[0] == pytest.approx(largest[1], abs=1e-9)
