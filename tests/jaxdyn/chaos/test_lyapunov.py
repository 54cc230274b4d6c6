"""Lyapunov exponents against published values, closed forms, and the sums that must hold."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap, refusal
from scipy.integrate import solve_ivp

import jaxdyn
from jaxdyn import scenes
from jaxdyn.chaos import lyapunov
from jaxdyn.chaos.lyapunov import lyapunov_exponents, orthonormal


def roessler(t, y, p):
    del t
    return [-y[1] - y[2], y[0] + p["a"] * y[1], p["b"] + y[2] * (y[0] - p["c"])]


def driven_pendulum(t, y, p):
    del t
    angle, rate, phase = y
    torque = p["amplitude"] * jnp.sin(phase)
    return [rate, torque - p["damping"] * rate - jnp.sin(angle), p["frequency"]]


def damped(t, y, p):
    """Three linear modes, mixed: their rates are the exponents."""
    del t
    return p["mix"] @ (p["rates"] * jnp.linalg.solve(p["mix"], y))


def henon_heiles(t, q, v):
    del t
    well = 0.5 * (q[0] ** 2 + q[1] ** 2) + q[0] ** 2 * q[1] - q[1] ** 3 / 3
    return 0.5 * (v[0] ** 2 + v[1] ** 2) - well


ROESSLER = {"a": 0.2, "b": 0.2, "c": 5.7}
PENDULUM = {"amplitude": 0.6, "damping": 0.05, "frequency": 0.7}


def henon_heiles_scene(energy: float, y: float, names=None):
    """At x = 0 with velocity along x."""
    speed = np.sqrt(2 * energy - y**2 + 2 * y**3 / 3)
    return jaxdyn.lagrangian(henon_heiles, [0.0, y], [speed, 0.0], names=names)


@pytest.mark.parametrize("shape", [(3, 3), (5, 2), (1, 1)])
def test_orthonormal_columns_are_those_of_lapack(shape):
    v = np.random.default_rng(1).normal(size=shape) * 10.0 ** np.arange(shape[1])
    q, r = orthonormal(jnp.asarray(v))
    q_lapack, r_lapack = np.linalg.qr(v)
    signs = np.sign(np.diag(r_lapack))
    assert gap(q, q_lapack * signs) < 10 * EXACT
    assert gap(r / np.abs(np.diag(r_lapack)), np.ones(shape[1])) < 10 * EXACT


def test_almost_parallel_columns_become_orthogonal():
    v = np.ones((4, 3)) + 1e-9 * np.random.default_rng(2).normal(size=(4, 3))
    q, _ = orthonormal(jnp.asarray(v))
    assert gap(q.T @ q, np.eye(3)) < EXACT


@pytest.mark.slow
def test_a_linear_system_has_the_rates_of_its_modes():
    rates, mix = np.array([0.3, -0.2, -1.5]), np.array([[1, 0.4, 0], [0, 1, 0.3], [0.2, 0, 1]])
    params = {"rates": jnp.asarray(rates), "mix": jnp.asarray(mix)}
    scene = jaxdyn.ode(damped, [0.0, 0.0, 0.0], params=params)
    found = lyapunov_exponents(scene, 40.0, transient=20.0, rtol=1e-12)
    assert gap(found.exponents, rates) < 1e-3  # tangents align like exp(-0.5 t)
    assert abs(found.trace_residual) < 1e-10
    assert abs(found.divergence - rates.sum()) < 1e-12
    # Backwards in time the order and the signs are reversed.
    back = lyapunov_exponents(scene, -40.0, transient=20.0, rtol=1e-12)
    assert gap(back.exponents, -rates[::-1]) < 1e-3


def test_lorenz_has_the_published_exponents():
    found = lyapunov_exponents(scenes.lorenz(), 2000.0)
    published = np.array([0.9056, 0.0, -14.5723])  # Sprott (2003)
    assert (np.abs(found.exponents - published) < found.bars).all()
    assert found.bars.max() < 0.02
    assert abs(found.divergence + 41 / 3) < 1e-11  # -(sigma + 1 + beta), constant
    assert abs(found.trace_residual) < 1e-9
    assert abs(found.dimension - 2.0622) < found.dimension_bar < 2e-3
    assert np.isnan(found.pairing_residual)  # of an odd number
    assert gap(found.batches.mean(axis=0), found.exponents) < EXACT
    # An independent route to the largest: the mean growth of one tangent by SciPy.
    assert abs(_largest_by_scipy(100.0) - found.exponents[0]) < 0.2


def _largest_by_scipy(t1: float) -> float:
    def rate(t, s):
        del t
        (x, y, z), (u, v, w) = s[:3], s[3:6]
        direction = np.array([10 * (v - u), u * (28 - z) - v - x * w, x * v + y * u - 8 / 3 * w])
        growth = direction @ s[3:6]
        field = [10 * (y - x), x * (28 - z) - y, x * y - 8 / 3 * z]
        return [*field, *(direction - growth * s[3:6]), growth]

    run = solve_ivp(rate, (0, t1), [1, 1, 1, 0, 1, 0, 0], rtol=1e-8, atol=1e-8, method="DOP853")
    return run.y[-1, -1] / t1


def test_new_numbers_do_not_compile_again():
    lyapunov_exponents(scenes.lorenz(), 20.0)
    before = lyapunov._spectrum._cache_size()  # pyright: ignore[reportFunctionMemberAccess]
    lyapunov_exponents(scenes.lorenz(rho=30.0), 25.0, transient=3.0, chunk=0.05, rtol=1e-8)
    assert lyapunov._spectrum._cache_size() == before  # pyright: ignore[reportFunctionMemberAccess]


@pytest.mark.slow
@pytest.mark.parametrize("labels", [None, [("x", "m"), ("y", "m")]])
def test_exponents_of_a_conservative_scene_are_in_pairs(labels):
    found = lyapunov_exponents(henon_heiles_scene(1 / 6, -0.1, labels), 2000.0)
    # Tangents pair once they are aligned, in sizes that leave the symplectic form as it is.
    assert found.pairing_residual < 1e-5
    assert found.exponents[0] > 5 * found.bars[0]  # chaotic at this energy
    assert (np.abs(found.exponents[1:3]) < found.bars[1:3]).all()
    assert found.dimension == 4.0
    regular = lyapunov_exponents(henon_heiles_scene(1 / 100, 0.01), 2000.0)
    assert (np.abs(regular.exponents) < regular.bars).all()
    assert regular.bars.max() < 5e-3


@pytest.mark.slow
def test_leading_exponents_are_those_of_the_whole_spectrum():
    few = lyapunov_exponents(scenes.lorenz(), 200.0, count=1, chunk=0.1, rtol=1e-12)
    assert few.exponents.shape == (1,)
    assert np.isnan(few.trace_residual)
    assert np.isnan(few.dimension)  # its sum is still positive
    assert abs(few.exponents[0] - 0.9056) < few.bars[0]


@pytest.mark.slow
def test_constraints_leave_as_many_exponents_as_directions():
    scene = scenes.free_body()  # a quaternion of length 1
    found = lyapunov_exponents(scene, 200.0)
    assert len(found.exponents) == len(scene.y0) - 1
    assert (np.abs(found.exponents) < found.bars).all()  # it is integrable


def runner(t, y, p):
    """A phase that runs at two speeds, one in each half of a turn, and a contraction across it."""
    del t
    angle, x = y
    return [2.0 + p["jump"] * jnp.sign(jnp.sin(angle)), -p["rate"] * x]


@pytest.mark.slow
def test_switches_of_the_rate_stretch_tangents():
    start, params = np.array([0.1, 1.0]), {"jump": 1.0, "rate": 0.25}
    turn = np.pi / 3 + np.pi  # half a turn at speed 3, half at 1
    found = lyapunov_exponents(jaxdyn.ode(runner, start, 40 * turn, params=params), transient=turn)
    # Whole turns: tangents stretch by 3 and shrink by 3 where the speed changes.
    assert (np.abs(found.exponents - np.array([0.0, -0.25])) < found.bars).all()
    assert abs(found.exponents.sum() + 0.25) < 1e-9
    assert abs(found.trace_residual) < 1e-9


def belted(t, y):
    """A block on a spring and a belt, whose friction decreases with the speed: it sticks, slips."""
    del t
    x, v = y
    return [v, -x + 0.3 * jnp.sign(0.2 - v) + 0.1 * v]


@pytest.mark.slow
def test_a_motion_that_sticks_has_exponents_of_minus_infinity():
    slips = jaxdyn.ode(belted, [1.0, 0.0], 60.0)
    both, first = (lyapunov_exponents(slips, count=count, throw=False) for count in (2, 1))
    assert both.status == jaxdyn.Status.MERGED
    assert "its exponent is minus infinity" in both.message
    assert first.ok
    assert first.divergence == -np.inf
    assert abs(first.exponents[0]) < first.bars[0]  # along the cycle


def test_a_spectrum_describes_itself():
    found = lyapunov_exponents(scenes.lorenz(), 200.0)
    assert "exponent 1" in repr(found)
    assert "1/" not in repr(found)  # without units
    slow = dataclasses.replace(found, exponents=found.exponents * 1e-9, bars=found.bars * 1e-9)
    assert f"exponent 1  {float(slow.exponents[0]):.6g} +-" in repr(slow)
    assert "+-" in repr(found)
    assert found.ok
    rows = ("dimension ", "trace ")
    assert all(row in repr(found) for row in rows)
    nothing = {"dimension": jnp.array(np.nan), "trace_residual": jnp.array(np.nan)}
    few = repr(dataclasses.replace(found, **nothing))
    assert not any(row in few for row in (*rows, "residuals", "nan"))


def test_a_motion_that_fails_has_a_status_and_no_number():
    with pytest.raises(jaxdyn.IntegrationError, match="limit of steps"):
        lyapunov_exponents(scenes.lorenz(), 20.0, max_steps=5)
    found = lyapunov_exponents(scenes.lorenz(), 20.0, max_steps=5, throw=False)
    assert not found.ok
    for number in (found.exponents, found.bars, found.divergence, found.dimension):
        assert np.isnan(number).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"t1": 0.0}, "t1: expected an end after or before t0"),
        ({"transient": 20.0}, "transient: expected between 0 and the time, 10"),
        ({"count": 4}, "count: expected at most 3"),
        ({"chunk": 0.0}, "chunk: expected > 0"),
    ],
)
def test_misuse_is_refused(arguments, message):
    call = {"t1": 10.0} | arguments
    assert refusal(lambda: lyapunov_exponents(scenes.lorenz(), **call)).startswith(message)


def test_traced_scenes_are_refused():
    def largest(rho):
        return lyapunov_exponents(scenes.lorenz(rho=rho), 10.0).exponents[0]

    assert "traced" in refusal(lambda: jax.jit(largest)(28.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "params", "y0", "published", "dimension"),
    [
        (roessler, ROESSLER, [1.0, 1.0, 0.0], (0.0714, 0.0, -5.3943), 2.0132),
        (driven_pendulum, PENDULUM, [0.0, 0.0, 0.0], (0.1400, 0.0, -0.1900), 2.7367),
    ],
)
def test_published_spectra(rate, params, y0, published, dimension):
    # Sprott (2003), Chaos and Time-Series Analysis, appendix A.
    found = lyapunov_exponents(jaxdyn.ode(rate, y0, params=params), 20000.0)
    # Three standard deviations, where bars are two, since rounding decides which motion is
    # followed. From six starts Roessler's exponents are on both sides of the published ones, within
    # their bars.
    assert (np.abs(found.exponents - np.array(published)) < 1.5 * found.bars).all()
    assert found.bars.max() < 8e-3
    assert abs(found.trace_residual) < 1e-9
    assert abs(found.dimension - dimension) < found.dimension_bar
