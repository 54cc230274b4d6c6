"""Points of mass 0: attracted by the others, attracting nothing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import IntegrationError, Scene, effects, scenes, simulate
from jaxdyn.analysis import energy, work_by_effect
from jaxdyn.formulations.newton import FreePoints

RNG = np.random.default_rng(3)


def bodies(n, d, massless=(1, 3)):
    m = RNG.uniform(1, 2, n)
    m[list(massless)] = 0.0
    return m, np.concatenate([5 * RNG.normal(size=n * d), 0.1 * RNG.normal(size=n * d)])


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("n", [4, 12])
def test_they_feel_the_field_of_the_others(n, d):
    m, y0 = bodies(n, d)
    acting = effects.PairGravity(0.7), effects.UniformGravity(0.1)
    scene = Scene(FreePoints(m, d=d), acting, y0=y0, t1=1.0)
    r = y0[: n * d].reshape(n, d)
    away = r[None] - r[:, None]
    pulls = 0.7 * m[None, :] / (np.sum(away**2, -1) + np.eye(n)) ** 1.5
    expected = np.sum(pulls[:, :, None] * away, axis=1) - 0.1 * np.eye(d)[-1]
    assert gap(scene.rate(0.0, y0)[n * d :].reshape(n, d), expected) < 10 * EXACT
    motion = simulate(scene, samples=3, rtol=1e-13)
    assert energy.drift(motion) < SOLVED
    assert np.isfinite(energy.along(energy.momentum, motion)).all()


@pytest.mark.slow
def test_they_are_the_limit_of_small_masses():
    small = simulate(scenes.three_body(m=(1.0, 1.0, 1e-15)), 1.5, samples=3)
    none = simulate(scenes.three_body(m=(1.0, 1.0, 0.0)), 1.5, samples=3)
    assert gap(small.ys, none.ys) < SOLVED


@pytest.mark.slow
def test_derivatives_by_a_mass_of_zero_are_those_of_the_limit():
    def end(m):
        return simulate(scenes.three_body(m=m), 1.0, samples=2, rtol=1e-13).ys[-1]

    at = jnp.array([1.0, 1.0, 0.0])
    forward, reverse = jax.jacfwd(end)(at), jax.jacrev(end)(at)
    assert gap(forward, reverse) < SOLVED
    assert gap(forward, jax.jacfwd(end)(jnp.array([1.0, 1.0, 1e-12]))) < 1e-10


@pytest.mark.parametrize("masses", [{"m1": 0.0}, {"m2": 0.0}])
def test_one_of_two_bodies_may_be_one(masses):
    scene = scenes.two_body(**masses)
    assert gap(simulate(scene, samples=2, rtol=1e-13).ys[-1], scene.y0) < SOLVED


@pytest.mark.slow
def test_forces_on_other_points_act_beside_them():
    m, y0 = bodies(4, 2)
    spring = effects.Spring(2.0, 0.0, i=0, j=2)
    scene = Scene(FreePoints(m), (effects.PairGravity(1.0), spring), y0=y0, t1=1.0)
    plain = Scene(FreePoints(m), (effects.PairGravity(1.0),), y0=y0, t1=1.0)
    pull = (scene.rate(0.0, y0) - plain.rate(0.0, y0))[8:].reshape(4, 2)
    r = y0[:8].reshape(4, 2)
    assert gap(pull[0], 2.0 * (r[2] - r[0]) / m[0]) < 10 * EXACT
    assert not pull[jnp.array([1, 3])].any()

    def rate(m):
        return Scene(FreePoints(m), scene.effects, y0=y0, t1=1.0).rate(0.0, y0)

    assert np.isfinite(jax.jacrev(rate)(jnp.asarray(m))).all()


@pytest.mark.parametrize(
    "effect",
    [
        effects.Spring(1.0, 1.0, i=0, j=1),
        effects.LinearDrag(0.1),
        effects.ConstantForce([1.0, 0.0]),
    ],
)
def test_a_force_on_one_is_refused(effect):
    # The spring is at its rest length at the start.
    y0 = jnp.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    scene = Scene(FreePoints([1.0, 0.0]), (effects.PairGravity(1.0), effect), y0=y0, t1=1.0)
    message = r": expected no force on a point of mass 0, got one on point 2\. Give it a mass"
    with pytest.raises(ValueError, match=type(effect).__name__ + message):
        simulate(scene)


def test_a_force_on_one_is_refused_inside_of_an_extension_too():
    y0 = jnp.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    drag = effects.LinearDrag(0.1)
    scene = Scene(FreePoints([1.0, 0.0]), (effects.PairGravity(1.0), drag), y0=y0, t1=1.0)
    with pytest.raises(ValueError, match=r"^LinearDrag: expected no force on a point of mass 0"):
        simulate(work_by_effect.with_work(scene, effects.LinearDrag))


def test_a_force_that_begins_later_ends_the_motion():
    y0 = jnp.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    late = effects.StepForce([1.0, 0.0], 0.3, on=(1,))
    scene = Scene(FreePoints([1.0, 0.0]), (effects.PairGravity(1.0), late), y0=y0, t1=1.0)
    with pytest.raises((IntegrationError, ValueError)):
        simulate(scene)


def test_masses_are_not_negative_and_not_all_zero():
    with pytest.raises(
        ValueError, match=r"^mass: expected >= 0, got -1\.0\. Masses are in kg; 0 is"
    ):
        simulate(scenes.three_body(m=(1.0, -1.0, 0.0)))
    message = r"^mass: expected one that is not 0, got no mass at all\. Test particles move among"
    with pytest.raises(ValueError, match=message):
        simulate(scenes.three_body(m=(0.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match=r"^m1 \+ m2: expected > 0, got 0\.0"):
        scenes.two_body(m1=0.0, m2=0.0)
    with pytest.raises(ValueError, match=r"^m1: expected >= 0, got -1\.0"):
        scenes.two_body(m1=-1.0)


class Double(effects.PairGravity):
    """Twice the force."""

    def force(self, t, r, v, m):
        return 2 * super().force(t, r, v, m)


def test_a_subclass_that_overrides_the_force_is_moved_by_that():
    scene = scenes.two_body()
    twice = Scene(scene.system, (Double(1.0),), y0=scene.y0, t1=1.0)
    assert not twice.effects[0].accelerates
    assert gap(twice.rate(0.0, scene.y0)[4:], 2 * scene.rate(0.0, scene.y0)[4:]) < EXACT
