"""Bars hinged in a row: open, closed, with a skate at the end."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import simulate
from jaxdyn.analysis import energy
from jaxdyn.scenes import linkages, pendula

NOW = jnp.zeros(())


def test_hinge_forces_carry_the_weight_of_hanging_bars():
    scene = pendula.double_pendulum(m=(1.0, 3.0), g=2.0, angles=(0.0, 0.0))
    tied = pendula.double_pendulum(
        m=(1.0, 3.0), g=2.0, angles=(0.0, 0.0), formulation="constrained"
    )
    forces = tied.system.constraint_forces(NOW, tied.y0, tied.effects)
    assert gap(forces, jnp.array([0.0, 8.0, 0.0, 6.0])) < EXACT * 10
    assert gap(scene.rate(NOW, scene.y0), jnp.zeros(4)) < EXACT


@pytest.mark.slow
def test_small_oscillations_of_two_equal_bars():
    # The known frequencies of the compound double pendulum: w^2 = 3 (1 -+ 2 / sqrt(7)) g / l.
    scene = pendula.double_pendulum(g=2.0)
    stiffness = jax.jacfwd(scene.rate, argnums=1)(NOW, jnp.zeros(4))[2:, :2]
    squares = np.sort(-np.linalg.eigvals(stiffness).real)
    assert gap(squares, 6.0 * (1 + np.array([-2, 2]) / np.sqrt(7))) < EXACT * 100


def test_relative_angles_describe_the_same_motion():
    states = {"angles": (0.5, 1.4), "rates": (0.3, -0.8)}
    absolute = pendula.double_pendulum(**states)
    relative = pendula.double_pendulum(**states, relative=True)
    q = simulate(absolute, 3.0, samples=9, rtol=1e-13)
    p = simulate(relative, 3.0, samples=9, rtol=1e-13)
    assert gap(q["theta1"], p["phi1"]) < SOLVED * 10
    assert gap(q["theta2"] - q["theta1"], p["phi2"]) < SOLVED * 10


@pytest.mark.slow
def test_n_pendulum_of_many_bars_keeps_its_energy():
    motion = simulate(pendula.n_pendulum(), 5.0, samples=9, rtol=1e-13)
    assert float(energy.drift(motion)) < SOLVED


@pytest.mark.slow
def test_pinned_chain_stays_closed():
    scene = linkages.pinned_chain(rates=(1.0, -1.0, 0.5, 0.0))
    motion = simulate(scene, samples=9, rtol=1e-12)
    phi, rates = jax.vmap(scene.system.violation)(motion.ts, motion.ys)
    assert max(float(jnp.abs(phi).max()), float(jnp.abs(rates).max())) < 1e-12
    assert gap(motion.r[:, 4], jnp.broadcast_to(jnp.array([2.5, 0.0]), (9, 2))) < 1e-12
    assert float(energy.drift(motion)) < 1e-10


@pytest.mark.parametrize("g", [0.0, 1.0])
@pytest.mark.slow
def test_skate_at_the_end_of_a_chain_never_slides_sideways(g):
    scene = linkages.skate_chain(g=g)
    motion = simulate(scene, samples=9, rtol=1e-12)
    tips, v = jax.vmap(lambda t, y: scene.system.points(t, y)[:2])(motion.ts, motion.ys)
    along = tips[:, 3] - tips[:, 2]
    sideways = along[:, 0] * v[:, 3, 1] - along[:, 1] * v[:, 3, 0]
    assert gap(sideways, jnp.zeros(9)) < 1e-12
    # The skate's force is square to its velocity: no work.
    assert float(energy.drift(motion)) < 1e-10
    assert float(jnp.abs(v[:, 3]).max()) > 0.1
