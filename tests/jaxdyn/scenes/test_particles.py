"""Particle scenes: closed forms, large speeds, straightness, the Lorenz system."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import Scene, Trajectory, simulate
from jaxdyn.analysis import energy, linearize
from jaxdyn.analysis.energy_change import energy_change
from jaxdyn.analysis.momenta import centre_of_mass, kinetic_split, moment_balance
from jaxdyn.effects import LinearDrag, QuadraticDrag, Spring, UniformGravity
from jaxdyn.formulations.polar import PolarParticle
from jaxdyn.scenes import cannonball, lorenz, particle, polar_particle, straightness
from jaxdyn.scenes.ballistics import cannonball_linear_exact


def test_problem_1_one_particle_with_any_forces():
    effects = (Spring(4.0), LinearDrag(0.1))
    scene = particle(*effects, position=(1.0, 2.0, 3.0), velocity=(0.0, 1.0, 0.0), m=2.0)
    expected = [0, 1, 0, -2.0, -4.0 - 0.05, -6.0]
    assert gap(scene.rate(0.0, scene.y0), expected) < EXACT
    assert particle().effects == ()


def test_drag_of_exactly_zero_is_absent():
    kinds = [type(e) for e in cannonball().effects]
    assert kinds == [UniformGravity]
    assert [type(e) for e in cannonball(g=0.0, drag=1.0, linear=2.0).effects] == [
        QuadraticDrag,
        LinearDrag,
    ]


@pytest.mark.parametrize("speed", [1.0, 1e2, 1e4, 1e6, 1e8])
def test_problems_9_and_12_at_any_speed(speed):
    exact = cannonball_linear_exact(5.0, speed=speed)
    motion = simulate(cannonball(speed=speed, linear=1.0), 5.0, samples=1, rtol=1e-13)
    assert gap(motion.ys[-1] / speed, exact / speed) < SOLVED
    # Quadratic drag without gravity: v = v0 / (1 + c v0 t), x = log(1 + c v0 t) / c.
    ball, grown = cannonball(speed=speed, angle=0.0, g=0.0, drag=1.0), 1 + 5 * speed
    there = [np.log(grown), 0.0, speed / grown, 0.0]
    assert gap(simulate(ball, 5.0, samples=1, atol=1e-9).ys[-1], there) < 1e-8
    # By default a speed is known to its largest, from which the drag has taken most of it here.
    assert gap(simulate(ball, 5.0, samples=1).ys[-1], there) < max(1e-8, 1e-12 * speed)


def test_fast_balls_end_in_free_fall_under_quadratic_drag():
    # The terminal speed is sqrt(m g / c), whatever the start.
    motion = simulate(cannonball(speed=1e8, drag=1.0, g=4.0), 30.0, samples=1)
    assert gap(motion["vy"][-1], -2.0) < 1e-8


@pytest.mark.slow
def test_problem_8_the_path_is_straighter_at_tighter_tolerance():
    bends = [float(straightness(simulate(polar_particle(), rtol=r))) for r in (1e-4, 1e-8, 1e-13)]
    assert bends[0] > 10 * bends[1] > 1e3 * bends[2]
    assert bends[2] < 10 * EXACT


@pytest.mark.parametrize("beside", [0.5, 1e-3, 1e-6])
def test_problem_8_polar_coordinates_near_the_origin(beside):
    motion = simulate(polar_particle(position=(1.0, beside)), rtol=1e-13)
    t = np.asarray(motion.ts)
    expected = np.stack([1.0 - t, np.full_like(t, beside)], axis=-1)
    assert gap(motion.r[:, 0], expected) < SOLVED
    # and at constant speed, past the turn by pi
    speed2 = 2 * energy.along(energy.energy, motion)
    assert gap(speed2, np.ones(200)) < SOLVED


def test_straightness_is_the_height_of_an_arc():
    t = jnp.linspace(0.0, np.pi, 2001)
    ys = jnp.stack([jnp.cos(t), jnp.sin(t), -jnp.sin(t), jnp.cos(t)], axis=-1)
    arc = Trajectory(particle(), t, ys, *[jnp.zeros(())] * 3)
    # A half circle of radius 1: its mean height is 2/pi, the farthest from it the two ends,
    # its width 2.
    assert gap(straightness(arc), (2 / np.pi) / 2) < 1e-3


@pytest.mark.slow
def test_polar_and_cartesian_coordinates_tell_one_motion():
    effects = (Spring(3.0, 0.5, anchor=(0.2, 0.1)), UniformGravity(1.0), LinearDrag(0.2))
    start = {"position": (1.0, 0.5), "velocity": (-1.0, 0.3), "m": 2.0}
    polar = polar_particle(*effects, **start)
    flat = particle(*effects, **start)
    one, other = (simulate(s, 1.0, samples=5, rtol=1e-13) for s in (polar, flat))
    assert gap(one.r, other.r) < 1e-11
    assert gap(polar.system.points(0.0, polar.y0).v, flat.system.points(0.0, flat.y0).v) < EXACT


def test_polar_angles_wrap():
    y = jnp.array([1.0, 3.0, 0.0, 0.0])
    turn = jnp.array([0.0, 2 * np.pi + 0.25, 0.0, 1.0])
    assert gap(PolarParticle().difference(y + turn, y), [0.0, 0.25, 0.0, 1.0]) < 10 * EXACT


def test_polar_coordinates_refuse_the_origin_and_a_mass_below_zero():
    at_origin = Scene(PolarParticle(), y0=[0.0, 0.0, 1.0, 0.0])
    with pytest.raises(ValueError, match=r"^y0: expected r not 0, got r = 0\. There theta has no"):
        simulate(at_origin)
    with pytest.raises(ValueError, match=r"^mass: expected > 0, got -2\.0\. Masses are in kg\.$"):
        simulate(polar_particle(m=-2.0))


def test_problem_3_lorenz_loses_volume_at_the_constant_rate_it_must():
    scene = lorenz()
    found = linearize.jacobian(scene, jnp.array([1.0, -2.0, 20.0]))
    assert gap(jnp.trace(found), -(10 + 1 + 8 / 3)) < 10 * EXACT
    # x -> -x, y -> -y is a symmetry of the flow
    turned = jnp.array([-1.0, -1.0, 1.0])
    rates = [scene.rate(0.0, y) for y in (scene.y0, turned * scene.y0)]
    assert gap(rates[1], turned * rates[0]) == 0


def test_lorenz_has_no_points_and_no_energy_and_says_so():
    motion = simulate(lorenz(), 1.0, samples=3)
    scene = motion.scene
    assert motion.r.size == 0
    assert energy.integrals(scene, 0.0, scene.y0) == {}
    assert energy_change(motion) is None
    for quantity in (energy.potential, energy.momentum, energy.angular_momentum, kinetic_split):
        with pytest.raises(ValueError, match="scene: expected one with material points, got Loren"):
            quantity(scene, 0.0, scene.y0)
    for asked in (energy.drift, lambda motion: energy.energy(scene, 0.0, scene.y0)):
        with pytest.raises(ValueError, match=r"one with an energy, got Lorenz.*pass energy="):
            asked(motion)
    with pytest.raises(ValueError, match="of: expected no name, since there is none, got 'momentu"):
        energy.drift(motion, "momentum")
    with pytest.raises(ValueError, match="kinetic: expected material points, got Lorenz"):
        scene.system.kinetic(0.0, scene.y0)
    with pytest.raises(ValueError, match="material points"):
        moment_balance(motion, centre_of_mass)


@pytest.mark.slow
def test_a_particle_differentiates_through_its_constructor():
    def height(angle, speed, drag):
        return simulate(cannonball(speed=speed, angle=angle, drag=drag), 0.5, samples=1).ys[-1, 1]

    slope = jax.grad(height, argnums=(0, 1))(0.7, 10.0, 0.0)
    # y = v sin(a) t - g t^2 / 2: a traced coefficient of 0 keeps the effect, not its force.
    assert gap(slope[0], 10 * np.cos(0.7) * 0.5) < 1e-8
    assert gap(slope[1], np.sin(0.7) * 0.5) < 1e-8


def test_a_start_at_the_origin_is_named():
    with pytest.raises(ValueError, match=r"y0: expected r not 0, got r = 0\. There theta has no"):
        polar_particle(position=(0.0, 0.0)).check()
