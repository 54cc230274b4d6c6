"""What functions capture is remembered wherever it is kept; what they count in is not."""

import dataclasses
import functools
import types
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import _records
from jaxdyn._records import captures

STIFFNESS = 2.0
COUNTED = {"calls": 0}


def _law(y):
    return -STIFFNESS * y


def _in_a_dictionary():
    kept = {"k": 2.0}
    return lambda t, y: [y[1], -kept["k"] * y[0]], lambda: kept.update(k=5.0)


def _in_nested_lists():
    kept = [[1.0, 2.0]]
    return lambda t, y: [y[1], -kept[0][1] * y[0]], lambda: kept[0].append(5.0)


def _in_an_array():
    kept = np.array([2.0])
    return lambda t, y: [y[1], -kept[0] * y[0]], lambda: kept.fill(5.0)


def _in_an_object():
    kept = types.SimpleNamespace(spring=types.SimpleNamespace(k=2.0))
    return lambda t, y: [y[1], -kept.spring.k * y[0]], lambda: setattr(kept.spring, "k", 5.0)


def _in_a_class():
    class Kept:
        k = 2.0

    return lambda t, y: [y[1], -Kept.k * y[0]], lambda: setattr(Kept, "k", 5.0)


def _in_a_module():
    kept = types.ModuleType("kept")
    kept.k = 2.0
    return lambda t, y: [y[1], -kept.k * y[0]], lambda: setattr(kept, "k", 5.0)


@dataclasses.dataclass(slots=True, eq=False)
class Slotted:
    k: float


def _in_a_slot():
    kept = Slotted(2.0)
    return lambda t, y: [y[1], -kept.k * y[0]], lambda: setattr(kept, "k", 5.0)


class Spring:
    def __init__(self):
        self.k = 2.0

    @property
    def twice(self):
        return 2 * self.k

    def pull(self, y):
        return -self.twice * y

    def rate(self, t, y):
        return [y[1], self.pull(y[0])]

    __call__ = rate


def _in_the_owner_of_a_method():
    kept = Spring()
    return kept.rate, lambda: setattr(kept, "k", 5.0)


def _in_an_object_that_is_called():
    kept = Spring()
    return kept, lambda: setattr(kept, "k", 5.0)


def _in_a_variable_that_was_none():
    k = None

    def change():
        nonlocal k
        k = 5.0

    return (lambda t, y: [y[1], -y[0] if k is None else -k * y[0]]), change


def _in_a_variable_without_a_value():
    def change():
        nonlocal k
        k = 5.0

    def rate(t, y):
        return [y[1], -k * y[0]]

    if change is None:
        k = 0.0
    return rate, change


def _in_a_default():
    def rate(t, y, k=[2.0]):  # noqa: B006
        return [y[1], -k[0] * y[0]]

    return rate, lambda: rate.__defaults__[0].append(5.0)


def _in_a_partial_function():
    kept = [2.0]
    return functools.partial(lambda k, t, y: [y[1], -k[0] * y[0]], kept), lambda: kept.append(5.0)


PLACES = [
    _in_a_dictionary,
    _in_nested_lists,
    _in_an_array,
    _in_an_object,
    _in_a_class,
    _in_a_module,
    _in_a_slot,
    _in_the_owner_of_a_method,
    _in_an_object_that_is_called,
    _in_a_variable_that_was_none,
    _in_a_variable_without_a_value,
    _in_a_default,
    _in_a_partial_function,
]


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.__name__)
def test_a_number_is_remembered_wherever_it_is_kept(place):
    function, change = place()
    before = captures("rate", function)
    assert captures("rate", function) == before
    change()
    assert captures("rate", function) != before


def test_a_number_of_a_function_that_is_differentiated_is_remembered(monkeypatch):
    def height(x):
        return STIFFNESS * x**2

    slope = jax.grad(height)

    def rate(t, y):
        return [y[1], -slope(y[0])]

    before = captures("rate", rate)
    monkeypatch.setitem(globals(), "STIFFNESS", 5.0)
    assert captures("rate", rate) != before


def test_a_number_of_a_function_that_is_called_is_remembered(monkeypatch):
    def rate(t, y):
        return [y[1], _law(y[0])]

    before = captures("rate", rate)
    monkeypatch.setitem(globals(), "STIFFNESS", 5.0)
    assert captures("rate", rate) != before


def test_what_a_function_counts_in_is_left_out():
    calls, times, owner = [0.0], {"sum": 0.0}, Spring()

    def rate(t, y):
        calls.append(1.0)
        COUNTED["calls"] += 1
        times["sum"] = times["sum"] + 1.0
        owner.calls = 1.0
        return [y[1], -owner.k * y[0]]

    before = captures("rate", rate)
    rate(0.0, [1.0, 0.0])
    assert captures("rate", rate) == before


@pytest.mark.slow
def test_a_scene_never_goes_on_with_an_old_value():
    spring = Spring()
    stiffness = {"k": 2.0}

    def rate(t, y):
        return [y[1], -stiffness["k"] * y[0]]

    for function, change in (
        (spring.rate, lambda: setattr(spring, "k", 5.0)),
        (rate, lambda: stiffness.update(k=10.0)),
    ):
        scene = jaxdyn.ode(function, [1.0, 0.0], 1.0)
        jaxdyn.simulate(scene, samples=2)
        change()
        with pytest.raises(
            ValueError, match=r"captured numbers that have not changed, got another"
        ):
            jaxdyn.simulate(scene, samples=2)
        again = jaxdyn.simulate(jaxdyn.ode(function, [1.0, 0.0], 1.0), samples=2)
        assert abs(float(again["y0"][-1]) - np.cos(np.sqrt(10.0))) < 1e-8


class Several(jaxdyn.System):
    """The sum of rates that a list holds."""

    rates: Any = eqx.field(static=True)

    def labels(self):
        return (("y", "1"),)

    def rate(self, t, y, effects=()):
        return sum(rate(y) for rate in self.rates)


def test_a_function_that_is_put_into_a_list_later_is_seen():
    factor = 2.0
    rates = [lambda y: -factor * y]
    system = Several(rates)
    system.check_functions()
    stiffness = 3.0
    rates.append(lambda y: -stiffness * y)
    with pytest.raises(ValueError, match="another value of 'stiffness'"):
        system.check_functions()


def test_variables_of_a_function_that_functions_inside_it_read_are_its_own():
    def law(y):
        return sum((lambda a: a * y)(a) for a in (1.0, 2.0))

    read = _records.code_reads(law.__code__)
    assert "y" not in read.names


@pytest.mark.parametrize("make", [jax.random.key, jax.random.PRNGKey])
def test_a_key_of_random_numbers_may_be_captured(make):
    key = make(3)

    def rate(t, y):
        a = jax.random.uniform(key, (2,))
        return [y[1], -(1.0 + a[0]) * y[0] + a[1]]

    scene = jaxdyn.ode(rate, [1.0, 0.0], 2.0)
    more, push = np.asarray(jax.random.uniform(make(3), (2,)))
    k = 1.0 + more
    x = push / k + (1.0 - push / k) * np.cos(2.0 * np.sqrt(k))
    assert abs(jaxdyn.solve(scene, 2.0).y1[0] - x) < 1e-9
    key = make(4)
    with pytest.raises(ValueError, match="another value of 'key'"):
        jaxdyn.solve(scene, 2.0)
    other = jaxdyn.ode(rate, [1.0, 0.0], 2.0)
    drawn = jax.random.uniform(jax.random.key(4), (2,))
    assert jnp.allclose(other.rate(0.0, other.y0)[1], -(1.0 + drawn[0]) + drawn[1])
