"""Numbers of a scene as constants of the program: the same motions, and what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdyn import scenes
from jaxdyn.integrate.fixed import FixedField
from jaxdyn.integrate.simulation import solve
from jaxdyn.solvers import TAYLOR12


@pytest.mark.parametrize("solver", [None, TAYLOR12])
def test_fixed_numbers_give_the_same_motion(solver):
    scene = scenes.pendulum(angle=2.0, length=0.7)
    free, fixed = (solve(scene, 3.0, rtol=1e-13, solver=solver, fixed=x) for x in (False, True))
    assert np.abs(free.y1 - fixed.y1).max() <= 1e-11


@pytest.mark.slow
def test_a_constrained_scene_has_fixed_numbers_too():
    scene = scenes.pendulum(angle=2.0, formulation="constrained")
    free, fixed = (solve(scene, 1.0, fixed=x).y1 for x in (False, True))
    assert np.abs(free - fixed).max() <= 1e-10


@pytest.mark.slow
def test_derivatives_by_the_start_and_the_time_are_there():
    scene = scenes.pendulum(angle=1.0)

    def end(y0, t1, fixed):
        return solve(scene.starting(y0), t1, rtol=1e-12, fixed=fixed).y1[0]

    found, wanted = (jax.grad(end, argnums=(0, 1))(scene.y0, 2.0, x) for x in (True, False))
    for a, b in zip(found, wanted, strict=True):
        assert np.abs(a - b).max() <= 1e-10
    ends = jax.jit(jax.vmap(lambda y: end(y, 2.0, True)))(jnp.stack([scene.y0, 0.5 * scene.y0]))
    assert ends.shape == (2,)


def test_equal_numbers_are_the_same_program_and_others_another():
    moon, other = (FixedField(scenes.pendulum(g=1.62).field) for _ in range(2))
    assert moon == other
    assert hash(moon) == hash(other)
    assert moon != FixedField(scenes.pendulum(g=9.81).field)


def test_equal_numbers_of_any_kind_are_compiled_once():
    traces = []

    class Counted(FixedField):
        def rate(self, t, y):
            traces.append(1)
            return super().rate(t, y)

    end = jax.jit(lambda field, y: field.rate(jnp.zeros(()), y))
    for g in (9, 9.0, np.float32(9), jnp.asarray(9)):
        end(Counted(scenes.pendulum(g=g).field), jnp.ones(2))
    assert len(traces) == 1


def test_traced_numbers_are_refused():
    with pytest.raises(ValueError, match="fixed: expected a scene with concrete numbers"):
        jax.grad(lambda g: solve(scenes.pendulum(g=g), 1.0, fixed=True).y1[0])(9.81)
