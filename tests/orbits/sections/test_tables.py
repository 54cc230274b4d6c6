"""orbits.section: the crossings of many starts, in an ensemble or one after the other."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap, refusal
from scipy.integrate import solve_ivp

import jaxdyn
import orbits
from jaxdyn import Status, scenes
from jaxdyn.ensemble import crossings as watches
from jaxdyn.ensemble import run
from jaxdyn.ensemble.watches import Together
from jaxdyn.integrate.events import Every, Reaches
from orbits.sections import complete

TIGHT = {"rtol": 1e-13}
SWING = scenes.oscillator(k=4.0, m=1.0)  # x = cos 2t
HENON, PLANE = scenes.henon_heiles(), Reaches(0, 0.0, 1)
STARTS = complete(HENON, PLANE, {"y": [0.1, -0.2, 0.3], "vy": [0.0, 0.1, 0.0]}, energy=1 / 12)


def by_scipy(y0, crossings):
    """States of Henon and Heiles's model at x = 0 with vx > 0, by DOP853 from one to the next."""

    def rate(t, y):
        q, r, u, v = y
        return [u, v, -q - 2 * q * r, -r - q * q + r * r]

    def solved(y, t, **more):
        return solve_ivp(rate, (0.0, t), y, method="DOP853", rtol=3e-14, atol=1e-15, **more)

    def rises(t, y):
        return y[0]

    rises.direction, rises.terminal = 1.0, True
    found = []
    for _ in range(crossings):
        y0 = solved(y0, 1.0).y[:, -1]
        y0 = solved(y0, solved(y0, 20.0, events=rises).t[-1]).y[:, -1]
        # The event's time is found on an interpolant.
        y0 = solved(y0, -y0[0] / y0[2]).y[:, -1]
        found.append(y0)
    return np.array(found)


def test_a_section_prints_energies_in_the_units_of_its_scene_or_none():
    def printed(scene):
        found = orbits.section(scene, Reaches(0, 0.0, 1), crossings=2)
        return dict(line.split(maxsplit=1) for line in repr(found).splitlines()[1:])

    def turns(t, y):
        return [y[1], -y[0]]

    assert not {"energies", "drift"} & printed(jaxdyn.ode(turns, [1.0, 0.0], 20.0)).keys()
    assert printed(SWING)["energies"] == "(2,) J"
    small = dataclasses.replace(SWING, units=("cm", "g", "s"))
    assert printed(small)["energies"] == "(2,) g cm^2/s^2"


@pytest.mark.slow
def test_crossings_are_those_of_scipy():
    found = orbits.section(HENON, PLANE, STARTS, crossings=20, **TIGHT)
    assert found.ok.all()
    assert found.message == "3 starts: OK."
    for ys, y0 in zip(found.ys, np.asarray(STARTS.y0s), strict=True):
        assert gap(ys, by_scipy(y0, 20)) < 1e-11
    assert gap(found.ys[..., 0], np.zeros((3, 20))) < 1e-15
    assert gap(found.energies, np.full(3, 1 / 12)) < 1e-15
    assert found.drift.max() < SOLVED
    assert found.names == ("y", "vy")
    assert gap(found.qp, found.ys[..., [1, 3]]) == 0.0


def test_a_start_does_not_depend_on_the_others():
    found = orbits.section(HENON, PLANE, STARTS, crossings=20, **TIGHT)
    alone = orbits.section(HENON, PLANE, STARTS.y0s[1:2], crossings=20, **TIGHT)
    assert gap(found.ys[1], alone.ys[0]) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("level", [0.0, 0.6, 0.999, 1 - 1e-9, -0.999])
def test_an_oscillator_crosses_each_level_twice_a_period(level):
    found = orbits.section(SWING, Reaches(0, level), [[0.0, 2.0]], crossings=40, **TIGHT)
    first = np.arcsin(level) / 2  # x = sin 2t
    rises, falls = first + np.pi * np.arange(21), np.pi / 2 - first + np.pi * np.arange(21)
    times = np.sort(np.concatenate([rises, falls]))
    times = times[times > 1e-9][:40]
    # At 1 - d the time is ill-conditioned: dt = dx / sqrt(8 d).
    loose = SOLVED * (1 + 100 / np.sqrt(1 - level**2))
    assert gap(found.ts[0], times) < loose
    assert gap(found.ys[0, :, 0], np.full(40, level)) < 1e-13
    assert set(np.abs(np.diff(found.directions[0]))) == {2}


def test_a_level_that_is_only_nearly_reached_is_not_crossed():
    found = orbits.section(SWING, Reaches(0, 1 + 1e-9), [[0.0, 2.0]], crossings=4, t1=50.0)
    assert found.counts.tolist() == [0]
    assert found.status.tolist() == [Status.FEW_CROSSINGS]


@pytest.mark.slow
@pytest.mark.parametrize(
    "way", [1, *(pytest.param(way, marks=pytest.mark.slow) for way in (-1, 0))]
)
def test_crossings_are_those_of_one_motion_in_each_direction_and_backwards(way):
    event = Reaches(2, 27.0, way)
    scene = scenes.lorenz()
    for t1 in (10.0, -0.5):
        one = jaxdyn.crossings(scene, event, t1, most=17, **TIGHT)
        found = orbits.section(scene, event, crossings=17, t1=t1, **TIGHT)
        n = int(one.count)
        assert found.counts.tolist() == [n]
        # Nearby motions of Lorenz's equations part like exp(0.9 t).
        assert gap(found.ts[0, :n], one.ts[:n]) < 1e-10
        assert gap(found.ys[0, :n], one.ys[:n]) < 1e-7
        assert found.directions[0].tolist() == one.directions.tolist()


@pytest.mark.slow
def test_a_stroboscope_sees_a_driven_scene_once_a_period():
    scene = scenes.shaken_pendulum(uniform=False)
    period = 2 * np.pi / 60
    found = orbits.section(scene, Every(period), [[0.2, 0.0], [3.0, 1.0]], crossings=33, **TIGHT)
    assert gap(found.ts, np.tile(period * np.arange(1, 34), (2, 1))) < SOLVED
    motion = jaxdyn.simulate(scene, 33 * period, samples=34, **TIGHT)
    assert gap(found.ys[0], motion.ys[1:]) < 100 * SOLVED
    assert found.names == ("theta", "theta_dot")
    assert np.abs(found.qp[..., 0]).max() <= np.pi


def test_statuses_and_the_crossings_before():
    def escapes(t, y):
        return [y[0] * y[0], 2 * jnp.pi * y[2], -2 * jnp.pi * y[1]]

    scene = jaxdyn.ode(escapes, [0.4, 1.0, 0.0], 9.0)  # infinite at t = 1 / y[0]
    starts = [[0.4, 1.0, 0.0], [-0.4, 1.0, 0.0], [np.nan, 1.0, 0.0]]
    found = orbits.section(scene, Reaches(1, 0.0), starts, crossings=20, t1=8.1)
    assert found.status.tolist() == [
        Status.STEP_COLLAPSED,
        Status.FEW_CROSSINGS,
        Status.NOT_FINITE,
    ]
    assert found.counts.tolist()[1:] == [16, 0]
    assert gap(found.ts[0, :4], [0.25, 0.75, 1.25, 1.75]) < 1e-9
    assert np.isnan(found.ts[0, found.counts[0] :]).all()
    assert np.isnan(found.drift).all()
    for text in ("Stop earlier", "Raise t1", "1 start: The start, its rate"):
        assert text in found.message


def test_a_forbidden_start_keeps_its_status():
    starts = complete(HENON, PLANE, {"y": [0.1, 0.9], "vy": 0.0}, energy=1 / 12)
    found = orbits.section(HENON, PLANE, starts, crossings=2)
    assert found.status.tolist() == [Status.OK, Status.FORBIDDEN]
    assert np.isnan(found.ys[1]).all()


def test_the_step_limit_is_a_status():
    found = orbits.section(HENON, PLANE, STARTS, crossings=20, max_steps=50)
    assert found.status.tolist() == [Status.STEP_LIMIT] * 3
    assert (found.counts > 0).all()


def test_misuse_is_refused():
    def call(event=PLANE, starts=None, **more):
        return refusal(lambda: orbits.section(HENON, event, starts, **more))

    assert "Write When(fn)" in call(event=lambda t, y: y[0])
    assert "starts: expected shape (n, 4), got shape (3,)" in call(starts=[1.0, 2.0, 3.0])
    assert "crossings: expected a whole number" in call(crossings=0)
    assert "coordinates: expected two different entries" in call(coordinates=("y", "y"))
    assert "coordinates: expected one of" in call(coordinates=("y", "w"))
    assert "rtol: expected between" in call(rtol=1.0)
    assert "t1: expected finite" in call(t1=np.inf)
    traced = refusal(lambda: jax.jit(lambda y: orbits.section(HENON, PLANE, y))(STARTS.y0s))
    assert "jaxdyn.crossings works under jit" in traced
    watch = watches.EachCrossing(HENON.field, PLANE, jnp.asarray(1), 4)
    assert "EachCrossing alone" in refusal(
        lambda: run(HENON, STARTS.y0s, 1.0, watch=Together(watch, watch))
    )


@pytest.mark.slow  # it compiles for 4 s
def test_a_stroboscope_of_a_square_wave_has_the_states_of_the_motion():
    period = 3.0

    def pushed(t, y):
        force = jnp.where(jnp.mod(t, period) < period / 2, 0.4, -0.4)
        return [y[1], y[0] - y[0] ** 3 - 0.2 * y[1] + force]

    starts = np.array([[0.1, 0.0], [-1.0, 0.1]])
    scene = jaxdyn.ode(pushed, starts[0], 100.0)
    found = orbits.section(scene, Every(period), starts, crossings=20)
    assert found.ok.all()
    times = period * np.arange(1, 21)
    assert gap(found.ts, np.tile(times, (2, 1))) < 1e-13
    for ys, y0 in zip(found.ys, starts, strict=True):
        motion = jaxdyn.simulate(jaxdyn.ode(pushed, y0, 61.0), samples=times)
        assert gap(ys, motion.ys) < 1e-10
    few = orbits.section(scene, Every(period), starts, crossings=20, t1=30.1)
    assert few.counts.tolist() == [10, 10]
    assert set(few.status.tolist()) == {Status.FEW_CROSSINGS}


def test_as_many_crossings_as_asked_for_where_the_span_is_a_period():
    def rate(t, y):
        return [y[1], -0.3 * y[0] + 0.1 * jnp.cos(t)]

    scene = jaxdyn.ode(rate, [1.0, 0.0], 2 * np.pi)
    found = orbits.section(scene, Every(2 * np.pi), crossings=5)
    assert found.counts.tolist() == [5]
    assert found.ts[0] == pytest.approx(2 * np.pi * np.arange(1, 6), abs=1e-12)
