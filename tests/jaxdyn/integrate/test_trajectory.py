"""What a trajectory says of its end."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdyn import IntegrationError, Status, ode, scenes, simulate, solve

ENDS = [
    (lambda: scenes.sideways_pendulum(rate=6.0), r"level of the hinge .* scenes\.sideways_edge"),
    (lambda: scenes.power_law(speed=0.0, n=-2.0), r"A central force may be infinite at its centre"),
    (lambda: scenes.bead_on_cycloid(speed=9.0), r"The wire ends upright"),
    (lambda: scenes.top(1e-9, representation="euler"), r"Euler angles lock .* another sequence"),
    (
        lambda: scenes.four_bar(
            length=(1.0, 2.0, 2.0), ground=4.5, rate=5.0, formulation="lagrange"
        ),
        r"coupler and rocker are in line",
    ),
    (
        lambda: scenes.two_body().starting([0.0, 0, 1, 0, 0, 0, 0, 0]),
        r"Bodies that meet .* regularized\.simulate_regularized",
    ),
]


ENDED = (Status.STEP_COLLAPSED, Status.NOT_FINITE, Status.STEP_LIMIT)  # rounding may decide


@pytest.mark.slow
@pytest.mark.parametrize(("make", "says"), ENDS, ids=[says[:20] for _, says in ENDS])
def test_a_motion_that_ends_in_a_singularity_says_which_ones_its_scene_has(make, says):
    scene = make()
    few = {"samples": 2, "rtol": 1e-8, "max_steps": 20_000}
    motion = simulate(scene, 5.0, **few, throw=False)
    assert motion.status_code in ENDED
    assert motion.message.startswith(motion.status_code.message)
    assert re.search(says, motion.message)
    others = [other for _, other in ENDS if other != says]
    assert not any(re.search(other, motion.message) for other in others)
    with pytest.raises(IntegrationError, match=says):
        simulate(scene, 5.0, **few)


def test_a_motion_of_entries_without_units_that_runs_out_of_steps_says_that_units_help():
    def turn(t, y):
        return [y[1], -y[0]]

    plain = simulate(ode(turn, [1.0, 0.0], 9.0), max_steps=2, throw=False)
    assert plain.status_code == Status.STEP_LIMIT
    assert plain.message.endswith("names with one unit: they share a size.")
    named = ode(turn, [1.0, 0.0], 9.0, names=[("x", "m"), ("y", "m")])
    assert simulate(named, max_steps=2, throw=False).message == Status.STEP_LIMIT.message


def test_the_last_state_is_that_of_solve():
    swing = scenes.pendulum()
    motion = simulate(swing, 1.0, samples=5)
    np.testing.assert_allclose(motion.y1, solve(swing, 1.0).y1, rtol=0, atol=1e-12)
    batch = jax.vmap(lambda y: simulate(swing.starting(y), 1.0, samples=5))(
        jnp.stack([swing.y0, 0.5 * swing.y0])
    )
    assert batch.y1.shape == (2, 2)
    np.testing.assert_allclose(batch.y1[0], motion.y1, rtol=0, atol=1e-12)
