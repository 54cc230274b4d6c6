"""Nothing goes on with an old value: all that holds a user's function notices a change."""

import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn._records import _MOST_KEPT, _kept, captures
from jaxdyn.effects import Spring
from jaxdyn.integrate import events
from jaxdyn.integrate.phase import END, Exit, Phase
from jaxdyn.integrate.phases import simulate_phases

LEVEL = 0.9
SCALE = [1.0]
CHANGED = "captured numbers that have not changed, got another value of"
#: x = cos t.
SCENE = scenes.oscillator(k=1.0, x=1.0)


def height(t, y):
    return y[0] - LEVEL


class Falls(events.Event):
    """The entry falls to a level, of a global variable, a class or a field."""

    offset: jax.Array
    above = 0.0

    def value(self, t, y):
        return y[0] - self._level - self.above - self.offset

    @property
    def _level(self):
        return LEVEL


class Pull(jaxdyn.Effect):
    velocity_dependent = False
    share: jax.Array

    def force(self, t, r, v, m):
        return -SCALE[0] * self.share * r


class Decay(jaxdyn.System):
    """y' = -LEVEL y."""

    def labels(self):
        return (("y", "1"),)

    def rate(self, t, y, effects):
        return -LEVEL * y


@pytest.fixture
def lower(monkeypatch):
    return lambda level=0.5: monkeypatch.setitem(globals(), "LEVEL", level)


EVENTS = [lambda: events.When(height), lambda: Falls(jnp.zeros(()))]


@pytest.mark.sample("find1-When")
@pytest.mark.parametrize("make", EVENTS, ids=["When", "subclass"])
@pytest.mark.parametrize("find", [jaxdyn.until, functools.partial(jaxdyn.crossings, most=1)])
def test_an_event_is_never_that_of_an_old_value(make, find, lower):
    def first(event):
        found = find(SCENE, event, 3.0, rtol=1e-13)
        return float(np.ravel(found.t if isinstance(found, events.Stop) else found.ts)[0])

    event = make()
    assert abs(first(event) - np.arccos(0.9)) < 1e-12
    lower()
    with pytest.raises(ValueError, match=rf"^{type(event).__name__}: .*{CHANGED} 'LEVEL'\. Make"):
        find(SCENE, event, 3.0)
    assert abs(first(make()) - np.arccos(0.5)) < 1e-12
    lower(0.9)
    assert abs(first(event) - np.arccos(0.9)) < 1e-12  # as when it was made


def test_a_number_of_the_class_counts_as_one_of_its_methods(monkeypatch):
    event = Falls(jnp.zeros(()))
    event.check_functions()
    monkeypatch.setattr(Falls, "above", 0.1)
    with pytest.raises(ValueError, match=f"{CHANGED} 'Falls'"):
        jaxdyn.until(SCENE, event, 3.0)


def _place(scene):
    return float(jaxdyn.solve(scene, 1.0, rtol=1e-13).y1[0])


def _last(scene):
    return float(jaxdyn.simulate(scene, 1.0, samples=2, rtol=1e-13).ys[-1, 0])


def _acceleration(scene):
    return float(scene.vector_field(0.0, np.array([1.0, 0.0]))[1])


@pytest.mark.sample("_acceleration--1.0--4.0")
@pytest.mark.parametrize(
    ("of", "first", "then"),
    [
        (_place, np.cos(1.0), np.cos(2.0)),
        (_last, np.cos(1.0), np.cos(2.0)),
        (_acceleration, -1.0, -4.0),
    ],
)
def test_an_effect_is_never_that_of_an_old_value(of, first, then, monkeypatch):
    scale = [1.0]
    monkeypatch.setitem(globals(), "SCALE", scale)

    def made():
        return SCENE.without(Spring) + Pull(jnp.ones(()))

    scene = made()
    assert abs(of(scene) - first) < 1e-10
    scale[0] = 4.0
    # In the second the start is new, the effect is not.
    for old in (scene, scene.starting(scene.y0)):
        with pytest.raises(ValueError, match=f"^Pull: .*{CHANGED} 'SCALE'"):
            of(old)
    assert abs(of(made()) - then) < 1e-10


def test_a_system_is_never_that_of_an_old_value(lower):
    def end(scene):
        return float(jaxdyn.simulate(scene, 1.0, samples=2, rtol=1e-13).ys[-1, 0])

    scene = jaxdyn.Scene(Decay(), y0=[1.0])
    assert abs(end(scene) - np.exp(-0.9)) < 1e-12
    lower()
    with pytest.raises(ValueError, match=f"^Decay: .*{CHANGED} 'LEVEL'"):
        end(scene)
    assert abs(end(jaxdyn.Scene(Decay(), y0=[1.0])) - np.exp(-0.5)) < 1e-12


@pytest.mark.slow
def test_what_a_phase_does_is_never_that_of_an_old_value(lower):
    def raised(t, y):
        return y + LEVEL

    def phases():
        return {"swing": Phase(SCENE, (Exit(events.Reaches(0, 0.0, -1), END, raised),))}

    made = phases()
    assert abs(simulate_phases(made, "swing", [1.0, 0.0], 3.0).y[0] - 0.9) < 1e-12
    lower()
    with pytest.raises(ValueError, match=f"^Exit: .*{CHANGED} 'LEVEL'"):
        simulate_phases(made, "swing", [1.0, 0.0], 3.0)
    assert abs(simulate_phases(phases(), "swing", [1.0, 0.0], 3.0).y[0] - 0.5) < 1e-12


class Through(orbits.closing.Condition):
    def value(self, scene, y0, period):
        return y0[0] - LEVEL


def test_a_condition_of_an_orbit_is_never_that_of_an_old_value(lower):
    hold = Through()
    assert abs(orbits.find(SCENE, hold=hold).y0[0] - 0.9) < 1e-9
    lower()
    with pytest.raises(ValueError, match=f"^Through: .*{CHANGED} 'LEVEL'"):
        orbits.find(SCENE, hold=hold)
    assert abs(orbits.find(SCENE, hold=Through()).y0[0] - 0.5) < 1e-9


@pytest.mark.slow
def test_a_section_is_never_that_of_an_old_value(lower):
    event = events.When(height, 1)
    scene = scenes.oscillator(k=1.0, x=1.0)
    orbits.section(scene, event, crossings=1)
    lower()
    with pytest.raises(ValueError, match=f"^When: .*{CHANGED} 'LEVEL'"):
        orbits.section(scene, event, crossings=1)


def test_an_integral_is_never_that_of_an_old_value(lower):
    def moved(t, y):
        return y[0] + LEVEL

    scene = jaxdyn.ode(lambda t, y: [y[1], -y[0]], [1.0, 0.0], integrals={"moved": moved})
    scene.check()
    lower()
    with pytest.raises(ValueError, match=f"^Ode: .*{CHANGED} 'LEVEL'"):
        jaxdyn.solve(scene, 1.0)


def test_records_without_functions_of_the_user_cost_nothing():
    for record in (SCENE, SCENE.system, *SCENE.effects, events.Reaches(0), orbits.PLAIN):
        assert record.captured is None
    assert events.When(height).captured is not None
    assert SCENE == eqx.tree_at(lambda scene: scene.y0, SCENE, SCENE.y0)


@pytest.mark.slow
def test_a_record_that_is_made_within_a_trace_is_as_good():
    def time(offset):
        return jaxdyn.until(SCENE, Falls(offset), 3.0, rtol=1e-13).t

    slope = jax.jit(jax.grad(time))(jnp.zeros(()))
    assert abs(slope + 1 / np.sqrt(1 - 0.9**2)) < 1e-9


def test_a_traced_number_from_around_is_refused():
    def time(level):
        return jaxdyn.until(SCENE, events.When(lambda t, y: y[0] - level), 3.0).t

    with pytest.raises(ValueError, match=r"^When: expected no captured values that are traced"):
        jax.grad(time)(0.5)


def test_a_copy_of_a_record_with_another_field_is_made_anew(lower):
    event = Falls(jnp.zeros(()))
    lower()
    dataclasses.replace(event, offset=jnp.ones(())).check_functions()
    with pytest.raises(ValueError, match=CHANGED):
        event.check_functions()


def test_values_kept_at_hand_do_not_pile_up():
    for _ in range(_MOST_KEPT + 2):
        captures("rate", lambda t, y: LEVEL * y)
    assert len(_kept) <= _MOST_KEPT
