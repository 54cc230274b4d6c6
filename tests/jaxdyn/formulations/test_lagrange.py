"""Lagrangians as scenes: against the mechanisms of the zoo, closed forms, and their energies."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import odes
import pytest
from helpers import EXACT, SOLVED, Arm, gap

import jaxdyn
from jaxdyn import Effect, Scene, scenes, simulate, solve
from jaxdyn.analysis import energy
from jaxdyn.analysis.work_by_effect import with_work
from jaxdyn.effects import UniformGravity
from jaxdyn.formulations.lagrange import Lagrange

T = jnp.zeros(())


def swing(t, q, v, p):
    """A pendulum of mass m on a rod of length l."""
    return p["m"] * (0.5 * (p["l"] * v[0]) ** 2 + p["g"] * p["l"] * jnp.cos(q[0]))


SWING = jaxdyn.lagrangian(
    swing, [2.0], [0.0], 5.0, names=[("theta", "rad")], params={"m": 2.0, "l": 0.8, "g": 9.81}
)


def double_kinetic(t, q, v, p):
    """Two uniform bars of mass m and length l."""
    mixed = jnp.cos(q[0] - q[1]) * v[0] * v[1]
    return p["m"] * p["l"] ** 2 * (4 * v[0] ** 2 + v[1] ** 2 + 3 * mixed) / 6


def double_potential(t, q, p):
    return -p["m"] * p["g"] * p["l"] * (3 * jnp.cos(q[0]) + jnp.cos(q[1])) / 2


@pytest.mark.slow
def test_a_pendulum_is_that_of_the_zoo():
    own = scenes.pendulum(angle=2.0, length=0.8, m=2.0)
    motion, wanted = simulate(SWING, rtol=1e-13), simulate(own, 5.0, rtol=1e-13)
    assert SWING.labels() == (("theta", "rad"), ("theta_dot", "rad/s"))
    assert gap(motion.ys, wanted.ys) < 1e-11
    energies = [energy.along(energy.energy, m) for m in (motion, wanted)]
    assert gap(*energies) < 1e-11
    assert float(energy.drift(motion)) < SOLVED
    # A turn more is the same pose.
    assert (
        gap(SWING.system.difference(jnp.array([7.0, 1.0]), jnp.zeros(2)), [7 - 2 * np.pi, 1])
        < EXACT
    )


@pytest.mark.slow
def test_a_double_pendulum_from_its_two_energies():
    own = scenes.double_pendulum()
    params = {"m": 1.0, "l": 1.0, "g": 1.0}
    q0, v0 = jnp.split(own.y0, 2)
    given = jaxdyn.lagrangian((double_kinetic, double_potential), q0, v0, params=params)
    y = own.y0 + jnp.array([0.1, -0.4, 0.7, -1.3])
    assert gap(given.rate(T, y), own.rate(T, y)) < SOLVED
    assert abs(float(energy.energy(given, T, y) - energy.energy(own, T, y))) < SOLVED
    assert abs(float(given.system.kinetic(T, y) - own.system.kinetic(T, y))) < SOLVED
    ends = [solve(scene, 1.0, rtol=1e-13).y1 for scene in (given, own)]
    assert gap(*ends) < 10 * SOLVED


def charged(t, r, v, p):
    """A charge in a magnetic field B along z and an electric field E along x."""
    along = 0.5 * p["q"] * p["B"] * (r[0] * v[1] - r[1] * v[0])
    return 0.5 * p["m"] * jnp.sum(v * v) + along + p["q"] * p["E"] * r[0]


@pytest.mark.slow
def test_a_charge_in_a_magnetic_field_turns_and_drifts():
    params = {"m": 2.0, "q": 3.0, "B": 4.0, "E": 0.5}
    scene = jaxdyn.lagrangian(charged, [1.0, 0.5], [0.2, -0.3], 3.0, params=params)
    motion = simulate(scene, rtol=1e-13)
    # Cyclotron frequency q B / m, drift E / B along -y; complex numbers turn clockwise.
    w, drift = 6.0, -1j * 0.5 / 4.0
    ts = np.asarray(motion.ts)
    v = 0.2 - 0.3j - drift
    z = 1.0 + 0.5j + drift * ts + v * (1 - np.exp(-1j * w * ts)) / (1j * w)
    assert gap(motion.ys[:, :2], np.stack([z.real, z.imag], axis=1)) < SOLVED
    # The field does no work: m v^2 / 2 - q E x, without a part of B.
    x, _, a, b = np.asarray(motion.ys).T
    assert gap(energy.along(energy.energy, motion), a * a + b * b - 1.5 * x) < SOLVED
    assert float(energy.drift(motion)) < SOLVED
    # Canonical momenta are m v + q A, not m v.
    y = scene.y0
    wanted = [1.0, 0.5, 2 * 0.2 - 6 * 0.5, 2 * -0.3 + 6 * 1.0]
    assert gap(scene.system.canonical(T, y), wanted) < EXACT * 10


@pytest.mark.slow
def test_the_energy_in_a_turning_frame_is_jacobis_integral():
    mu = 0.1
    scene = jaxdyn.lagrangian(odes.restricted_lagrangian, [0.4, 0.1], [0.2, 0.9], 3.0, params=mu)
    y = scene.y0
    assert gap(scene.rate(T, y), odes.restricted(T, y, mu)) < SOLVED
    assert abs(float(energy.energy(scene, T, y) + odes.jacobi(T, y, mu) / 2)) < EXACT * 10
    motion = simulate(scene, rtol=1e-13)
    assert float(energy.drift(motion)) < SOLVED


@pytest.mark.slow
def test_an_energy_that_time_drives_is_not_conserved():
    def shaken(t, q, v):
        return 0.5 * v[0] ** 2 - 0.5 * (1 + 0.5 * jnp.cos(2 * t)) * q[0] ** 2

    change = jaxdyn.energy_change(simulate(jaxdyn.lagrangian(shaken, [1.0], [0.0], 5.0)))
    assert change.causes == ("the drive",)


class Turned(Lagrange):
    """The arm where its plane turns about the upright axis at a rate w: a Lagrangian of its own."""

    w: jax.Array

    def lagrangian(self, t, q, v, effects):
        turning = 0.5 * 3.0 * (2.0 * self.w * jnp.sin(q[0])) ** 2
        return super().lagrangian(t, q, v, effects) + turning


@pytest.mark.slow
def test_a_subclass_with_a_lagrangian_of_its_own_has_the_energy_of_that():
    scene = Scene(Turned(Arm(), jnp.asarray(4.0)), (UniformGravity(9.81),), y0=[0.3, 0.1])
    motion = simulate(scene, 5.0, rtol=1e-13)
    theta, omega = np.asarray(motion.ys).T
    # T2 - T0 + V, which is conserved; T2 + V, kinetic and potential energy of the point, is not.
    own = 6 * omega**2 - 96 * np.sin(theta) ** 2
    potential = -3 * 9.81 * 2 * np.cos(theta)
    found = np.asarray(energy.along(energy.energy, motion))
    assert gap(found, own + potential) < 1e-11
    assert float(energy.drift(motion)) < SOLVED
    assert np.ptp(6 * omega**2 + potential) > 10
    assert jaxdyn.energy_change(motion).causes == ()


def test_a_mechanism_that_is_moved_keeps_its_mechanical_energy():
    # T + V of the point, as in the other formulations; not the energy function, which lacks T0.
    scene = scenes.shaken_pendulum()
    lagrange = eqx.tree_at(lambda s: s.system, scene, Lagrange(scene.system.mechanism))
    y = scene.y0 + jnp.array([0.2, 0.5])
    assert abs(float(energy.energy(lagrange, 0.3, y) - energy.energy(scene, 0.3, y))) < EXACT * 10


class Brake(Effect):
    """A torque -c omega."""

    c: float
    velocity_dependent: ClassVar[bool] = True

    def generalized(self, t, q, v):
        return -self.c * v


@pytest.mark.slow
def test_effects_act_on_its_coordinates():
    def free(t, q, v):
        return 0.5 * 2.0 * v[0] ** 2

    scene = jaxdyn.lagrangian(free, [0.0], [3.0], 2.0) + Brake(0.5)
    motion = simulate(with_work(scene, Brake), rtol=1e-13)
    speed = 3 * np.exp(-0.25 * 2.0)
    assert abs(float(motion.ys[-1, 1]) - speed) < SOLVED
    assert abs(float(motion["work of Brake"][-1]) - (speed**2 - 9)) < SOLVED * 10
    assert jaxdyn.energy_change(simulate(scene)).causes == ("Brake",)


@pytest.mark.slow
def test_linear_modes_and_derivatives():
    def springs(t, q, v, k):
        return 0.5 * jnp.sum(v * v) - 0.5 * (k * q[0] ** 2 + k * q[1] ** 2 + (q[0] - q[1]) ** 2)

    scene = jaxdyn.lagrangian(springs, [0.0, 0.0], [0.0, 0.0], params=3.0)
    assert gap(jaxdyn.modes(scene).squares, [3.0, 5.0]) < EXACT * 10

    def end(k):
        return solve(jaxdyn.lagrangian(springs, [1.0, 1.0], [0.0, 0.0], params=k), 1.3).y1[0]

    # cos(sqrt(k) t)
    assert abs(float(jax.grad(end)(3.0)) + np.sin(np.sqrt(3) * 1.3) * 1.3 / (2 * np.sqrt(3))) < 1e-9


def test_names_and_units():
    scene = jaxdyn.lagrangian(lambda t, q, v: jnp.sum(v * v) - q[0], [0.0, 1.0], [0.0, 0.0])
    names = ("q0", "q1", "q0_dot", "q1_dot")
    assert scene.labels() == tuple((name, "1") for name in names)


def test_numbers_from_around_a_lagrangian_are_not_stale():
    mass = np.array(2.0)
    scene = jaxdyn.lagrangian(lambda t, q, v: 0.5 * mass * v[0] ** 2, [0.0], [1.0])
    scene.check()
    mass[()] = 3.0
    with pytest.raises(ValueError, match=r"^Lagrangian: .* another value of 'mass'\. Make"):
        scene.check()


def lowered(t, q, v):
    return -jnp.sum(v * v)


def half(t, q, v):
    return v[0] ** 2


lagrangian = jaxdyn.lagrangian
MISUSE = [
    (lambda: lagrangian(half, [1.0], [0.0, 1.0]), r"^v0: expected shape \(1,\), got shape \(2,\)"),
    (lambda: lagrangian(half, 1.0, 0.0), r"^q0: expected shape \(any,\)"),
    (lambda: lagrangian(half, [np.nan], [0.0]), "^q0: expected finite numbers"),
    (lambda: lagrangian(3, [1.0], [0.0]), r"^L: expected a function of \(t, q, v\), got 3"),
    (lambda: lagrangian((half,) * 3, [1.0], [0.0]), r"^L: .* a pair \(T, V\), got 3 of them"),
    (lambda: lagrangian((half, half), [1.0], [0.0]), r"^V: expected a function of \(t, q\), got"),
    (
        lambda: lagrangian(swing, [1.0], [0.0]),
        r"^L: .* got one of \(t, q, v, p\)\. It gets",
    ),
    (lambda: lagrangian(lambda t, q, v: v, [1.0], [0.0]), r"^L: expected shape \(\), got shape"),
    (lambda: lagrangian(half, [1.0], [0.0], names=["a", "b"]), "^names: expected 1, got 2"),
    (
        lambda: simulate(lagrangian(lowered, [1.0], [0.0])),
        "L: .* positive definite, .*not V - T",
    ),
    (lambda: simulate(lagrangian(half, [1.0, 1], [0.0, 1])), r"eigenvalues \[0\.0, 2\.0\] at the"),
    (lambda: simulate(SWING + UniformGravity()), "forces on coordinates, got forces on points"),
    (lambda: energy.potential(SWING, T, SWING.y0), "one with material points, got Lagrangian"),
]


@pytest.mark.parametrize(("misuse", "message"), MISUSE)
def test_misuse_is_refused(misuse, message):
    with pytest.raises(ValueError, match=message):
        misuse()
