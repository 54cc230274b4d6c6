"""`page.largest`: the largest value along a motion, between samples and at its ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from jaxdyn import scenes
from jaxdyn.course.page import largest

SWING = scenes.oscillator(k=4.0, m=1.0, t1=5.0)  # x = cos(2 t)


def several(t, y):
    """Place less a half, its opposite, and what is always less."""
    return jnp.stack([y[0] - 0.5, -y[0], -3.0 + 0.0 * y[0]])


def speed(t, y):
    """Square of the velocity."""
    return y[1] ** 2


def leaving(t, y):
    """A quantity that grows all the time."""
    return t + 0.1 * y[0]


def test_a_largest_value_is_found_where_the_quantity_turns():
    found = largest(SWING, speed)
    assert found.value == pytest.approx(4.0, abs=1e-12)
    assert found.t == pytest.approx(np.pi / 4, abs=1e-12)
    np.testing.assert_allclose(found.y, [0.0, -2.0], atol=1e-12)


@pytest.mark.slow
def test_it_may_be_at_an_end():
    found = largest(SWING, leaving)
    assert found.t == 5.0
    assert found.value == pytest.approx(5.0 + 0.1 * np.cos(10.0), abs=1e-12)
    first = largest(SWING.starting(jnp.array([-1.0, 0.0])), several, 2.0)
    assert (first.t, first.value) == (0.0, 1.0)


def test_another_number_of_turns_compiles_nothing(caplog):
    largest(SWING, speed)
    with jax.log_compiles(), caplog.at_level("WARNING"):
        found = largest(SWING, speed, 4.0)
    assert found.t == pytest.approx(np.pi / 4, abs=1e-12)
    compiled = [one.message for one in caplog.records if "Compiling" in one.message]
    assert len(compiled) == 1, compiled  # the quantity by itself, which is new at each call


def test_of_several_entries_the_largest_counts():
    found = largest(SWING, several, 2.0)
    assert found.value == pytest.approx(1.0, abs=1e-14)
    assert found.t == pytest.approx(np.pi / 2, abs=1e-10)


@pytest.mark.slow
def test_a_peak_that_samples_miss_is_that_of_scipy():
    # The stick of problem 29, whose angle ripples with its base.
    def stick(t, y):
        return [y[1], 1.5 * (9.81 + 360 * np.cos(60 * t)) * np.sin(y[0])]

    tight = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14, "dense_output": True}
    way = solve_ivp(stick, (0, 5), [0.2, 0], **tight).sol
    found = largest(scenes.shaken_pendulum(), lambda t, y: y[0] ** 2).value ** 0.5
    assert found == pytest.approx(refined(lambda t: abs(way(t)[0]), 5.0), abs=1e-10)


def refined(value, end):
    """The largest of a function of time, from dense samples and a search around the best."""
    ts = np.linspace(0.0, end, 200_001)
    k = int(np.argmax(value(ts)))
    near = (ts[max(k - 1, 0)], ts[min(k + 1, len(ts) - 1)])
    found = minimize_scalar(
        lambda t: -value(t), bounds=near, options={"xatol": 1e-12}, method="bounded"
    )
    return -found.fun
