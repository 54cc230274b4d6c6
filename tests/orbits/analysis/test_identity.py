"""Invariants of orbits known in closed form, and where there are none."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, kepler

import orbits
from jaxdyn import Scene, System, scenes
from jaxdyn.effects import LinearDrag, PairGravity, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import Points
from orbits.analysis.identity import has_normal_form, permutation_error, scale_free_period
from orbits.orbit import Orbit, Outcome


def orbit_of(scene):
    return Orbit(scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-14)


def ring(n, m=1.0, shift=0.0):
    """n equal bodies turning on a circle of radius 1 (Lagrange): speed^2 = sum of pulls."""
    angles = 2 * np.pi * np.arange(n) / n
    speed = np.sqrt(m / 4 * np.sum(1 / np.sin(np.pi * np.arange(1, n) / n)))
    r = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    v = speed * np.stack([-np.sin(angles), np.cos(angles)], axis=1)
    y0 = np.concatenate([(r + shift).ravel(), v.ravel()])
    scene = Scene(FreePoints([m] * n), (PairGravity(1.0),), y0=y0, t1=2 * np.pi / speed)
    return scene, speed


@pytest.mark.parametrize("n", [2, 3, 4])
@pytest.mark.slow
def test_a_turning_ring_is_a_choreography(n):
    scene, speed = ring(n)
    what = orbits.identify(orbit_of(scene))
    assert what.choreography
    assert what.permutation_error < SOLVED
    # Virial theorem: E = -kinetic energy; angular momentum n m v r.
    assert abs(what.energy + n * speed**2 / 2) < SOLVED
    assert abs(what.angular_momentum - n * speed) < SOLVED
    assert abs(what.scale_free - 2 * np.pi / speed * (n * speed**2 / 2) ** 1.5) < 1e-11


def test_an_ellipse_is_none_although_it_closes():
    what = orbits.identify(orbit_of(kepler(0.5)))
    assert not what.choreography
    # Half a period later the separation is 1.5, not 0.5, in the same direction.
    assert what.permutation_error > 0.1
    # E = -mu / (2 a) with reduced mass 1/4 and G M = 1.
    assert abs(what.energy + 1 / 8) < SOLVED
    assert abs(what.scale_free - np.pi / 2) < SOLVED  # any two bodies


def attracting(m, G):
    return Scene(FreePoints(m), (PairGravity(G),), y0=np.arange(4.0 * len(m)))


@pytest.mark.parametrize("ratio", [1.0, 0.0123, 1e-12])
def test_all_ellipses_of_two_bodies_have_one_scale_free_period(ratio):
    # The Earth and the Moon, and lighter moons, in SI units: T |E|^(3/2) by Kepler's third law.
    G, a, m = 6.6743e-11, 3.844e8, np.array([5.9722e24, 5.9722e24 * ratio])
    scene = attracting(m, G)
    period, e = 2 * np.pi * np.sqrt(a**3 / (G * m.sum())), -G * m.prod() / (2 * a)
    assert abs(scale_free_period(scene, period, e) - np.pi / 2) < EXACT


def test_test_particles_do_not_change_a_scale_free_period():
    one, two = (attracting(m, 2.0) for m in ([3.0, 1.0], [3.0, 0.0, 1.0]))
    assert scale_free_period(one, 1.5, -0.5) == scale_free_period(two, 1.5, -0.5)
    alone = attracting([3.0, 0.0], 1.0)
    assert scale_free_period(alone, 1.5, 0.5) is None


def test_unequal_masses_give_the_printed_figure_times_their_product():
    # T |E|^(3/2) of G = 1 is this times p^(3/2) / m^(1/2): here p = 5/3 and m = 4/3.
    scene = attracting([1.0, 1.0, 2.0], 1.0)
    found = scale_free_period(scene, 7.0, -1.25)
    assert abs(found * (5 / 3) ** 1.5 / (4 / 3) ** 0.5 - 7.0 * 1.25**1.5) < 10 * EXACT


@pytest.mark.parametrize(("scale", "m"), [(3.0, 1.0), (1.0, 5.0), (1e11, 2e30)])
def test_scale_free_ignores_scale_and_mass(scale, m):
    one = orbits.identify(orbit_of(ring(3)[0])).scale_free
    r, v = np.asarray(ring(3, m)[0].y0).reshape(2, -1)
    y0 = np.concatenate([scale * r, v / np.sqrt(scale)])
    scene = ring(3, m)[0]
    other = orbits.identify(orbit_of(scene.starting(y0, scale**1.5 * scene.t1))).scale_free
    assert abs(other / one - 1) < 1e-12


def test_unequal_bodies_have_no_permutation_error():
    scene = scenes.three_body(m=(1.0, 1.0, 2.0))
    assert permutation_error(orbit_of(scene)) is None
    assert not orbits.identify(orbit_of(scene)).choreography


def test_one_body_is_no_choreography():
    scene = Scene(FreePoints(1.0), (UniformGravity(1.0),), y0=[0.0, 0, 1, 0], t1=1.0)
    what = orbits.identify(orbit_of(scene))
    assert not what.choreography
    assert what.scale_free is None


class Pendulum(System):
    def labels(self):
        return (("angle", "rad"), ("rate", "rad/s"))

    def points(self, t, y):
        r = jnp.stack([jnp.sin(y[0]), -jnp.cos(y[0])])
        v = y[1] * jnp.stack([jnp.cos(y[0]), jnp.sin(y[0])])
        return Points(r[None], v[None], jnp.ones(1))

    def rate(self, t, y, effects):
        return jnp.stack([y[1], -jnp.sin(y[0])])


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene",
    [
        Scene(Pendulum(), y0=[0.5, 0.0]),
        Scene(FreePoints([1.0, 1.0]), (), y0=kepler(0.0).y0),
        kepler(0.0) + LinearDrag(0.1),
    ],
    ids=["another system", "no force", "drag"],
)
def test_scale_free_needs_newtonian_attraction_alone(scene):
    assert orbits.identify(orbit_of(scene)).scale_free is None


@pytest.mark.parametrize(
    "scene",
    [
        kepler(0.0),
        scenes.three_body(m=(1.0, 1.0, 2.0)),
        scenes.three_body() + LinearDrag(0.1),
        Scene(FreePoints([1.0] * 3, d=3), (PairGravity(1.0),), y0=np.arange(18.0)),
        Scene(Pendulum(), y0=[0.5, 0.0]),
    ],
    ids=["two bodies", "unequal", "drag", "space", "another system"],
)
def test_only_three_equal_bodies_in_the_plane_have_a_normal_form(scene):
    assert not has_normal_form(orbit_of(scene))
    with pytest.raises(ValueError, match="orbit: expected three equal bodies in the plane"):
        orbits.normal_form(orbit_of(scene))
