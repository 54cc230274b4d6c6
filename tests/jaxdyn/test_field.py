"""The rate of a scene in the hands of other libraries: diffrax and SciPy."""

from typing import ClassVar

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap
from scipy.integrate import solve_ivp

from jaxdyn import Effect, Scene, scenes, simulate, solve
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import VectorField

SWING = scenes.double_pendulum()
TIMES = np.linspace(0.0, 2.0, 5)
TIGHT = diffrax.PIDController(rtol=1e-13, atol=1e-13)


@pytest.fixture(scope="module")
def swing():
    return np.asarray(simulate(SWING, 2.0, samples=TIMES, rtol=1e-14).ys)


def test_scipy_finds_the_motion_of_a_scene(swing):
    y0, how = np.asarray(SWING.y0), {"rtol": 1e-13, "atol": 1e-13}
    run = solve_ivp(SWING.vector_field, (0.0, 2.0), y0, "DOP853", TIMES, **how)
    assert gap(run.y.T, swing) < 1e-9


def test_diffrax_finds_the_motion_of_a_scene(swing):
    for t1, rows in ((2.0, swing), (-2.0, simulate(SWING, -2.0, samples=2, rtol=1e-14).ys)):
        run = diffrax.diffeqsolve(
            SWING.term(), diffrax.Dopri8(), 0.0, t1, None, SWING.y0, stepsize_controller=TIGHT
        )
        assert gap(run.ys[-1], rows[-1]) < 1e-9


@pytest.mark.slow
def test_derivatives_through_diffrax_are_those_of_solve():
    def end(angle):
        scene = scenes.pendulum(angle=angle)
        how = {"stepsize_controller": TIGHT, "args": "not looked at"}
        return diffrax.diffeqsolve(
            scene.term(), diffrax.Tsit5(), 0.0, 1.0, 0.01, scene.y0, **how
        ).ys[-1, 0]

    ours = jax.grad(lambda angle: solve(scenes.pendulum(angle=angle), 1.0, rtol=1e-13).y1[0])(1.0)
    assert abs(jax.jit(jax.grad(end))(1.0) - ours) < 1e-9


class Noted(Effect):
    """A drag that notes each trace of its force."""

    c: jax.Array
    traces: ClassVar[list] = []

    def force(self, t, r, v, m):
        self.traces.append(None)
        return -self.c * v


def _noted(c, y0=(1.0, 2.0, 3.0, 4.0)):
    return Scene(FreePoints(1.0), (Noted(jnp.asarray(c)),), y0=y0)


def test_a_vector_field_is_compiled_once_for_all_numbers_of_a_scene():
    y = np.array([1.0, 2.0, 3.0, 4.0])
    first, other = _noted(0.1).vector_field, _noted(0.2, 2 * y).vector_field
    rate = first(0.0, y)
    before = len(Noted.traces)
    assert isinstance(rate, np.ndarray)
    np.testing.assert_array_equal(rate, [3.0, 4.0, -0.1 * 3.0, -0.1 * 4.0])
    np.testing.assert_array_equal(other(np.float64(1.0), 2 * y), [6.0, 8.0, -0.2 * 6, -0.2 * 8])
    first(1, jnp.asarray(y))
    solve_ivp(other, (0.0, 1.0), y)
    assert len(Noted.traces) == before


def test_equal_vector_fields_have_one_hash_and_one_program():
    one, same, other = (_noted(c).vector_field for c in (0.1, 0.1, 0.2))
    assert (one == same, hash(one) == hash(same), one != other, one != 3) == (True,) * 4
    assert len({one, same, other}) == 2
    y = jnp.array([1.0, 2.0, 3.0, 4.0])
    rate = jax.jit(one)(0.0, y)
    before = len(Noted.traces)
    assert gap(jax.jit(same)(0.0, y), rate) == 0
    assert len(Noted.traces) == before
    assert gap(jax.jit(other)(0.0, y)[2:], -0.2 * y[2:]) < EXACT


def test_a_vector_field_of_traced_numbers_has_a_hash_too():
    def speed(c):
        vf = _noted_unchecked(c)
        assert hash(vf) == hash(vf)
        assert vf == vf
        assert vf != _noted_unchecked(c)
        return jax.jit(vf)(0.0, jnp.ones(4))[2]

    assert jax.grad(speed)(0.3) == -1.0
    # NumPy in, but what comes out is being traced.
    assert jax.grad(lambda c: _noted_unchecked(c)(0.0, np.ones(4))[2])(0.3) == -1.0


def _noted_unchecked(c):
    return VectorField(_noted(c).field)


@pytest.mark.slow
def test_a_vector_field_may_be_vmapped_and_differentiated():
    vf, ys = SWING.vector_field, jnp.arange(8.0).reshape(2, 4) / 10
    for rate, y in zip(jax.vmap(vf, in_axes=(None, 0))(0.0, ys), ys, strict=True):
        assert gap(rate, SWING.rate(jnp.zeros(()), y)) < EXACT
    ours = jax.jacfwd(SWING.rate, argnums=1)(jnp.zeros(()), ys[0])
    assert gap(jax.jacrev(vf, argnums=1)(0.0, ys[0]), ours) < 10 * EXACT


def test_states_and_scenes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"^y: expected shape \(4,\), got shape \(4, 3\)\. One e"):
        SWING.vector_field(0.0, np.zeros((4, 3)))
    ignored = Scene(scenes.lorenz().system, (UniformGravity(),), y0=jnp.ones(3))
    for hand_over in (lambda: ignored.vector_field, ignored.term):
        with pytest.raises(ValueError, match=r"^UniformGravity: expected an effect that "):
            hand_over()
