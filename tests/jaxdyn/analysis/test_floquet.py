"""Floquet multipliers against Mathieu's characteristic values, SciPy's integrator and Liouville."""

from functools import partial

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

import jaxdyn
from jaxdyn import drawing, scenes
from jaxdyn.analysis import floquet
from jaxdyn.analysis.monodromy import monodromy
from jaxdyn.effects import LinearDrag
from jaxdyn.hard.cases import shaken

AMPLITUDES, FREQUENCIES = np.linspace(0.01, 0.9, 30), np.linspace(4.0, 80.0, 25)


def mathieu_stable(a, q):
    """Between a_n and b_(n+1) for some n; q < 3 here, and a < 0 leaves few n to look at."""
    zones = [(a > mathieu_a(n, q)) & (a < mathieu_b(n + 1, q)) for n in range(4)]
    return np.any(zones, axis=0)


@pytest.mark.parametrize("uniform", [True, False])
@pytest.mark.slow
def test_problem_29_the_chart_is_mathieus(uniform):
    numbers = {"length": 1.2, "g": 5.0, "uniform": uniform}
    chart = shaken.upright_chart(AMPLITUDES, FREQUENCIES, **numbers)
    a, q = shaken.mathieu_numbers(AMPLITUDES[:, None], FREQUENCIES[None], **numbers)
    expected = mathieu_stable(*np.broadcast_arrays(a, q))
    assert 100 < expected.sum() < 650  # both kinds are there
    assert np.array_equal(chart.verdict == "stable", expected)
    assert np.array_equal(chart.verdict == "unstable", ~expected)
    assert np.array_equal(chart.growth > 1e-5, ~expected)


def _mathieu(a, q):
    def rate(t, y, c):
        return [y[1], -(c[0] - 2 * c[1] * jnp.cos(2 * t)) * y[0]]

    return jaxdyn.ode(rate, [0.0, 0.0], jnp.pi, params=[a, q]), jnp.pi


def test_the_chart_of_an_equation_without_canonical_coordinates_is_ince_and_strutts():
    a, q = np.linspace(-0.45, 5.05, 12), np.array([0.1, 0.6, 1.5])
    chart = floquet.chart(_mathieu, a, q)
    expected = mathieu_stable(*np.meshgrid(a, q, indexing="ij"))
    assert 10 < expected.sum() < 30  # both kinds are there
    assert np.array_equal(chart.verdict, np.where(expected, "stable", "unstable"))


def test_tiny_damping_whose_sign_the_multipliers_do_not_show_decides_nothing():
    def damped(c, a):
        def rate(t, y, c):
            return [y[1], -(c[1] + jnp.cos(2 * t)) * y[0] - c[0] * y[1]]

        return jaxdyn.ode(rate, [0.0, 0.0], jnp.pi, params=[c, a]), jnp.pi

    # By Liouville |multiplier| = exp(-c T / 2).
    verdicts = floquet.chart(damped, [-1e-3, -1e-11, 0.0, 1e-3], [2.0], rtol=1e-9).verdict[:, 0]
    assert verdicts.tolist() == ["unstable", "undecided", "stable", "stable"]


def _characteristic(curve, frequency: float) -> float:
    """The amplitude of a stick of length 1 at which Mathieu's number a lies on a curve of q."""
    a, least = (float(x) for x in shaken.mathieu_numbers(1e-3, frequency))
    return brentq(lambda q: curve(q) - a, least, 3.0, xtol=1e-15) / least * 1e-3


@pytest.mark.slow
def test_the_edges_are_characteristic_values_and_tend_to_the_averaged_limit():
    excess = []
    for frequency in (20.0, 40.0, 80.0):
        edge, upper = shaken.stability_edges(frequency)
        assert abs(edge - _characteristic(partial(mathieu_a, 0), frequency)) < SOLVED
        assert abs(upper - _characteristic(partial(mathieu_b, 1), frequency)) < SOLVED
        excess.append(edge / float(shaken.averaged_limit(frequency)) - 1)
    assert excess[0] > 0
    assert abs(excess[1] / excess[2] - 4) < 0.1  # relative correction q^2 7 / 64, q ~ 1 / w


@pytest.mark.slow
def test_the_matrix_is_that_of_the_linear_equation():
    numbers = {"length": 1.1, "g": 9.0, "uniform": False}
    scene, period = shaken.Upright(jnp.asarray(1.1), jnp.asarray(9.0), False)(
        jnp.asarray(0.2), jnp.asarray(30.0)
    )
    found = floquet.multipliers(scene, period)

    def rate(t, x):
        lift = (9.0 + 0.2 * 30.0**2 * np.cos(30.0 * t)) / 1.1
        return [x[1], lift * x[0], x[3], lift * x[2]]

    end = solve_ivp(rate, (0, period), [1, 0, 0, 1], rtol=1e-13, atol=1e-13, method="DOP853").y
    expected = end[:, -1].reshape(2, 2).T
    assert gap(found.monodromy, expected) < 1e-10
    assert gap(np.sort_complex(found.multipliers), np.sort_complex(np.linalg.eigvals(expected))) < (
        10 * found.bars.max()
    )
    chart = shaken.upright_chart([0.1, 0.2], [30.0], **numbers)
    assert gap(chart.monodromy[1, 0], found.monodromy) < 1e-9
    assert gap(monodromy(scene, period=period), found.monodromy) < SOLVED


@pytest.mark.slow
def test_damping_takes_area_as_liouville_says():
    # det M = exp(-c T / m) whatever the drive; a stable motion is then stable for good.
    scene = scenes.shaken_pendulum(angle=0.0, uniform=False, m=2.0) + LinearDrag(3.0)
    period = 2 * np.pi / 60.0
    found = floquet.multipliers(scene, period)
    assert gap(np.prod(found.multipliers).real, np.exp(-3.0 / 2.0 * period)) < SOLVED * 10
    assert str(found.verdict) == "stable"
    assert float(found.growth) < -0.7


@pytest.mark.slow
def test_without_shaking_it_falls_at_its_own_rate():
    scene = scenes.shaken_pendulum(angle=0.0, amplitude=0.0, length=1.5, g=4.0)
    found = floquet.multipliers(scene, 0.5)
    assert abs(float(found.growth) - 2.0) < 1e-10  # sqrt(g / (2/3 length))
    assert str(found.verdict) == "unstable"


@pytest.mark.slow
def test_a_double_multiplier_decides_nothing():
    # An oscillator seen after half of its period: M = -1.
    found = floquet.multipliers(scenes.oscillator(x=0.0), np.pi)
    assert gap(found.multipliers, -np.ones(2)) < 1e-10
    assert str(found.verdict) == "undecided"
    # A free particle: M = [[1, T], [0, 1]].
    free = scenes.particle(position=[0.0], velocity=[0.0])
    assert str(floquet.multipliers(free, 2.0).verdict) == "undecided"


@pytest.mark.slow
def test_a_run_that_fails_is_undecided_and_nan():
    class Broken(eqx.Module):
        def __call__(self, x, y):
            del y
            return scenes.oscillator(k=jnp.where(x > 1.5, jnp.nan, x), x=0.0), jnp.asarray(1.0)

    found = floquet.chart(Broken(), [1.0, 2.0], [0.0])
    assert found.verdict[:, 0].tolist() == ["stable", "undecided"]
    assert np.isnan(found.multipliers[1, 0]).all()
    assert np.isnan(found.growth[1, 0])


@pytest.mark.slow
def test_new_numbers_do_not_compile_again():
    traces = []

    class Counted(eqx.Module):
        k: jnp.ndarray

        def __call__(self, x, y):
            traces.append(1)
            return scenes.oscillator(k=self.k * x, c=y, x=0.0), jnp.asarray(1.0)

    floquet.chart(Counted(jnp.asarray(1.0)), [1.0, 2.0], [0.1])
    count = len(traces)
    floquet.chart(Counted(jnp.asarray(2.0)), [1.5, 2.5], [0.2])
    assert len(traces) == count + 1  # the corner that is checked, outside of the program


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: shaken.upright_chart([0.1], [0.0]), "frequencies: expected > 0"),
        (lambda: shaken.upright_chart([0.1], [1.0], length=-1.0), "length: expected > 0"),
        (
            lambda: shaken.upright_chart([], [1.0]),
            "grid: expected at least one number each way",
        ),
        (lambda: shaken.upright_chart(0.1, [1.0]), "first: expected shape"),
        (lambda: floquet.multipliers(scenes.oscillator, 1.0), "scene: expected a Scene"),
        (
            lambda: floquet.multipliers(scenes.oscillator(), 1.0, rtol=0.5),
            "rtol: expected between",
        ),
        (
            lambda: floquet.edges(_double, (1.0, 2.0), 1.0, rtol=-1.0),
            "rtol: expected between",
        ),
        (
            lambda: floquet.multipliers(scenes.oscillator(), -1.0),
            "period: expected > 0",
        ),
        (
            lambda: floquet.multipliers(scenes.oscillator(), 1.0),
            "y0: expected a motion that repeats after the period",
        ),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.slow
def test_the_picture_shows_each_verdict(tmp_path):
    chart = shaken.upright_chart([0.05, 0.1, 0.4], [20.0, 60.0])
    file = tmp_path / "chart.png"
    figure = drawing.stability_chart(chart, file, names=("amplitude [m]", "frequency [rad/s]"))
    assert file.stat().st_size > 1000
    ax = figure.axes[0]
    assert ax.get_xlabel() == "frequency [rad/s]"
    growing, stable, undecided = (np.ma.filled(c.get_array(), np.nan) for c in ax.collections)
    assert np.array_equal(np.isfinite(stable), chart.verdict == "stable")
    assert np.array_equal(np.isfinite(growing), chart.verdict == "unstable")
    assert not np.isfinite(undecided).any()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["stable", "unstable"]
    with pytest.raises(ValueError, match="path: expected a file name ending in"):
        drawing.stability_chart(chart, "chart.txt")


def test_edges_need_a_state_of_two_entries():
    with pytest.raises(ValueError, match=r"^scene: expected a state of 2 entries, got 4\. Use `ch"):
        floquet.edges(_double, (1.0, 2.0), 1.0)


def _double(x, y):
    return scenes.double_pendulum(g=x), y


def test_a_chart_prints_as_a_table_of_its_fields():
    def driven(a, q):
        return scenes.shaken_pendulum(angle=0.0, amplitude=a, frequency=q), 2 * np.pi / q

    chart = floquet.chart(driven, np.linspace(0.05, 0.1, 10), np.linspace(50.0, 60.0, 10))
    assert "10 x 10" in repr(chart).replace("(10, 10", "10 x 10")
    assert len(repr(chart)) < 1000
