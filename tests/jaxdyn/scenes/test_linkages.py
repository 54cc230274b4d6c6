"""Rods and linkages against closed forms and conservation laws."""

import jax
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


@pytest.mark.slow
def test_parallelogram_swings_as_a_pendulum():
    # Coupler without rotation: (m1/3 + m2 + m3/3) l theta'' = -(m1/2 + m2 + m3/2) g sin(theta).
    numbers = {"m": (1.0, 2.0, 1.5), "l": (1.2, 2.0, 1.2), "ground": 2.0, "g": 3.0}
    numbers |= {"crossed": True}  # hanging, the coupler lies right of the line to the far hinge
    a = -(0.5 + 2.0 + 0.75) * 3.0 * np.sin(0.7) / ((1.0 + 6.0 + 1.5) / 3 * 1.2)
    entries = {"newton_euler": (0,), "lagrange": (0,), "loop": (0, 2), "constrained": (2, 8)}
    for formulation, which in entries.items():
        scene = linkages.four_bar(**numbers, angle=0.7, rate=0.4, formulation=formulation)
        acceleration = jnp.split(scene.rate(NOW, scene.y0), 2)[1]
        for i in which:
            assert gap(acceleration[i], a) < EXACT * 100


def test_crossed_linkage_is_the_mirror_image():
    scene = linkages.four_bar(ground=2.0, l=(1.0, 2.0, 2.0), angle=np.pi / 2)
    crossed = linkages.four_bar(ground=2.0, l=(1.0, 2.0, 2.0), angle=np.pi / 2, crossed=True)
    r, mirrored = (s.system.points(NOW, s.y0).r for s in (scene, crossed))
    assert gap(r, mirrored * jnp.array([[1.0, -1.0]])) < EXACT


def test_links_that_cannot_close_are_refused():
    with pytest.raises(ValueError, match=r"l: expected links that can close, got a longest side"):
        linkages.four_bar(l=(1.0, 1.0, 5.0))
    with pytest.raises(ValueError, match=r"links that can close.*Shorten the longest link"):
        linkages.pinned_chain(span=4.5)
    with pytest.raises(ValueError, match=r"angles: expected shape \(4,\)"):
        linkages.pinned_chain(angles=(1.0,))
    with pytest.raises(ValueError, match=r"rates: expected shape \(3,\)"):
        linkages.skate_chain(rates=(1.0,))
    with pytest.raises(ValueError, match=r"Did you mean 'loop'\?"):
        linkages.pinned_chain(formulation="lop")


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


@pytest.mark.parametrize("formulation", ["constrained", "loop", "newton_euler", "lagrange"])
def test_a_linkage_at_its_change_point_is_refused_by_name(formulation):
    for angle, rate in ((np.pi / 2, 0.0), (-np.pi / 2, 1.0)):
        with pytest.raises(
            ValueError, match=r"^angle: expected .* are not in line, got .*change poi"
        ):
            linkages.four_bar(
                l=(1.0, 2.0, 1.0), ground=2.0, angle=angle, rate=rate, formulation=formulation
            )
    with pytest.raises(ValueError, match=r"^angle: expected .* reach the far hinge, got"):
        linkages.four_bar(l=(2.0, 1.0, 1.5), ground=1.0, angle=-1.5, formulation=formulation)


def test_problem_21_unequal_speeds_part_where_nothing_is_done_about_drift():
    scene = linkages.rod_on_line(speed=(0.25, 1.0), drift="raw", force=2.0)
    motion = simulate(scene, 10.0, samples=5)
    assert gap(motion["x2"] - motion["x1"], 1.0 + 0.75 * motion.ts) < SOLVED
    for drift in ("projection", "baumgarte"):
        with pytest.raises(ValueError, match=r"a violation of 0 in place, 0\.75 in velocity\. The"):
            simulate(linkages.rod_on_line(speed=(0.25, 1.0), drift=drift), 1.0)
    with pytest.raises(ValueError, match=r"^formulation: expected one of constrained, got 'lagra"):
        linkages.rod_on_line(speed=(0.0, 1.0), formulation="lagrange")
