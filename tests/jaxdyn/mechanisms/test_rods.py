"""Points joined by rigid rods: closed forms, conservation, forces of the rods."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import simulate
from jaxdyn.analysis import energy
from jaxdyn.scenes import linkages

NOW = jnp.zeros(())


@pytest.mark.parametrize("drift", ["projection", "raw"])
def test_rod_on_a_line_moves_as_its_centre_of_mass(drift):
    scene = linkages.rod_on_line(m=(1.0, 3.0), force=2.0, frequency=1.5, drift=drift)
    motion = simulate(scene, samples=9, rtol=1e-13)
    t = motion.ts
    x = 2.0 / 4.0 * (t / 1.5 - jnp.sin(1.5 * t) / 1.5**2)
    # Even raw: the tie is linear, so only rounding drifts.
    assert gap(motion["x1"], x) < SOLVED * 100
    assert gap(motion["x2"] - motion["x1"], jnp.ones(9)) < SOLVED
    # The rod pulls the first mass along.
    force = scene.system.constraint_forces(jnp.asarray(0.4), scene.y0, scene.effects)
    assert gap(force[0], -2.0 * np.sin(0.6) / 4.0) < EXACT


def test_dumbbell_spins_on_a_circle():
    scene = linkages.dumbbell()
    motion = simulate(scene, samples=9, rtol=1e-13)
    angle = 2.0 * motion.ts
    second = 0.5 * jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=1)
    assert gap(motion.r[:, 1], second) < 1e-10
    kept = energy.along(energy.angular_momentum, motion)
    assert gap(kept, jnp.ones(9)) < SOLVED
    assert gap(energy.along(energy.momentum, motion), jnp.zeros((9, 2))) < SOLVED
    assert gap(energy.along(energy.energy, motion), jnp.ones(9)) < SOLVED
    # The rod holds each mass on its circle: m w^2 l / 2.
    assert gap(scene.system.constraint_forces(NOW, scene.y0, ())[0], -2.0) < EXACT * 10


def test_problem_21_unequal_speeds_part_where_nothing_is_done_about_drift():
    scene = linkages.rod_on_line(speed=(0.25, 1.0), drift="raw", force=2.0)
    motion = simulate(scene, 10.0, samples=5)
    assert gap(motion["x2"] - motion["x1"], 1.0 + 0.75 * motion.ts) < SOLVED
    for drift in ("projection", "baumgarte"):
        with pytest.raises(ValueError, match=r"a violation of 0 in place, 0\.75 in velocity\. The"):
            simulate(linkages.rod_on_line(speed=(0.25, 1.0), drift=drift), 1.0)
    with pytest.raises(ValueError, match=r"^formulation: expected one of constrained, got 'lagra"):
        linkages.rod_on_line(speed=(0.0, 1.0), formulation="lagrange")
