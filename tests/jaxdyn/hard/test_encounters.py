"""Close encounters: logarithmic time against plain time, high precision and Kepler's laws."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, TESTS, gap

from jaxdyn import Scene, scenes, simulate
from jaxdyn.analysis import regularized
from jaxdyn.analysis.approaches import closest_approaches
from jaxdyn.analysis.regularized import regularize, simulate_regularized
from jaxdyn.effects import LinearDrag, PairGravity, PowerLaw
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.hard.cases import encounters
from jaxdyn.status import IntegrationError, Status

REFERENCE = json.loads((TESTS / "references" / "pythagorean_reference.json").read_text())
BODIES = scenes.two_body().starting([-1.0, 0.0, 0.5, 0.0, 0.0, -0.2, 0.0, 0.1], 6.0)


def test_the_numbers_in_the_package_are_those_of_the_reference():
    wanted = [float(x) for x in REFERENCE["outcome"].values()]
    assert list(encounters.PYTHAGOREAN_OUTCOME) == wanted
    near = [(float(x["t"]), float(x["distance"])) for x in REFERENCE["closest_approaches"][:2]]
    assert list(encounters.PYTHAGOREAN_APPROACHES) == near
    assert gap(encounters.pythagorean_outcome(np.array(REFERENCE["state"], float)), wanted) < 1e-13


def test_test_particles_alone_give_no_logarithmic_time():
    scene = scenes.n_body([[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]], m=[1.0, 0.0])
    said = "a potential below 0, as of gravity, got 0 J. .*give the test particles, .* small masses"
    with pytest.raises(ValueError, match=said):
        regularize(scene)


@pytest.mark.slow
def test_bodies_go_through_fifteen_encounters():
    motion = simulate_regularized(encounters.pythagorean(), rtol=1e-14)
    found = encounters.pythagorean_outcome(motion.ys[-1])
    assert np.max(np.abs(found / np.array(encounters.PYTHAGOREAN_OUTCOME) - 1)) < 1e-6


@pytest.mark.slow
def test_drag_does_as_in_plain_time():
    scene = BODIES + LinearDrag(0.05)
    slow = simulate_regularized(scene, 4.0, rtol=1e-13)
    # The encounter, nearer by 40 times than the start, amplifies errors.
    assert gap(slow.ys[-1], simulate(scene, 4.0, rtol=1e-13).ys[-1]) < 100 * SOLVED


@pytest.mark.slow
def test_a_motion_runs_back_to_its_start():
    there = simulate_regularized(BODIES, rtol=1e-13)
    back = simulate_regularized(BODIES.starting(there.ys[-1]), 0.0, t0=6.0, rtol=1e-13)
    assert gap(back.ys[-1], BODIES.y0) < SOLVED
    assert float(back.ts[-1]) == 0.0


@pytest.mark.slow
def test_the_end_is_at_the_wanted_time_and_samples_are_in_order():
    motion = simulate_regularized(BODIES, 5.0, t0=1.0)
    assert motion.ts[0] == 1.0
    assert motion.ts[-1] == 5.0
    assert np.all(np.diff(motion.ts) > 0)


@pytest.mark.slow
def test_the_energy_follows_a_force_that_depends_on_time():
    class Growing(PairGravity):
        def potential(self, t, r, m):
            return (1 + 0.1 * t) * super().potential(t, r, m)

        def force(self, t, r, v, m):
            return (1 + 0.1 * t) * super().force(t, r, v, m)

    scene = Scene(BODIES.system, (Growing(),), y0=BODIES.y0, t1=2.0)
    slow = simulate_regularized(scene, rtol=1e-13)
    assert gap(slow.ys[-1], simulate(scene, rtol=1e-13).ys[-1]) < 100 * SOLVED


@pytest.mark.slow
def test_approaches_of_a_kepler_orbit_are_at_its_perihelion():
    # mu = 3, from the far point 1.5 at speed 0.3.
    size = 2 / 1.5 - 0.3**2 / 3
    nearest = 2 / size - 1.5
    period = 2 * np.pi * size**-1.5 / np.sqrt(3.0)
    found = closest_approaches(BODIES, rtol=1e-13)
    assert len(found) == int(6.0 / period + 0.5)
    for near in found:
        assert near.pair == (0, 1)
        assert abs(near.distance - nearest) < SOLVED
    assert gap(sorted(n.t for n in found), (np.arange(len(found)) + 0.5) * period) < SOLVED


@pytest.mark.slow
def test_gradients_go_through_an_encounter():
    def end(speed, how):
        y0 = BODIES.y0.at[5].set(-2 * speed).at[7].set(speed)
        return how(BODIES.starting(y0, 2.0))

    plain = jax.jacfwd(end)(0.1, lambda scene: simulate(scene, rtol=1e-12, samples=2).ys[-1])
    slow = jax.jacfwd(end)(0.1, lambda s: simulate_regularized(s, rtol=1e-12, samples=2).ys[-1])
    assert gap(plain, slow) < 1e-9 * float(jnp.max(jnp.abs(plain)))


@pytest.mark.slow
def test_a_collision_ends_in_a_status():
    head_on = BODIES.starting([-1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0], 6.0)
    motion = simulate_regularized(head_on, throw=False, max_steps=20_000)
    assert Status(int(motion.status)) in (Status.STEP_COLLAPSED, Status.STEP_LIMIT)
    assert np.isnan(motion.ys[-1]).all()
    with pytest.raises(IntegrationError):
        simulate_regularized(head_on, max_steps=20_000)


def test_a_search_that_ends_before_the_end_time_is_a_status(monkeypatch):
    monkeypatch.setattr(regularized, "_UNREACHABLE_SPAN", 1e-3)
    found = simulate_regularized(BODIES, 1.0, throw=False)
    assert found.status == Status.NOT_FINITE
    assert np.isnan(regularized.logarithmic_span(BODIES, 1.0))


def test_what_makes_no_sense_is_refused():
    with pytest.raises(ValueError, match="a potential below 0"):
        regularize(Scene(FreePoints([1.0]), (PowerLaw(1.0, 1.0),), y0=[1.0, 0, 0, 0]))
    with pytest.raises(ValueError, match="scene: expected free points, got NewtonEuler"):
        regularize(scenes.pendulum())
    with pytest.raises(ValueError, match="samples: expected at least 2"):
        simulate_regularized(BODIES, samples=1)
    with pytest.raises(ValueError, match="t1: expected a time other than t0"):
        simulate_regularized(BODIES, 0.0)


@pytest.mark.slow
def test_an_approach_at_a_sample_is_not_lost():
    # From the greatest distance over three periods, the second approach is the middle sample.
    e, period = 0.6, 2 * np.pi / np.sqrt(3.0)
    v = np.sqrt(3.0 * (1 - e) / (1 + e))
    y0 = [-2 * (1 + e) / 3, 0, (1 + e) / 3, 0, 0, -2 * v / 3, 0, v / 3]
    near = closest_approaches(scenes.two_body().starting(y0, 3 * period), samples=21)
    np.testing.assert_allclose(sorted(x.t / period for x in near), [0.5, 1.5, 2.5], rtol=1e-9)
    np.testing.assert_allclose([x.distance for x in near], 1 - e, rtol=1e-9)
