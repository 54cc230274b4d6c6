"""Energies and momenta against sums written out by hand."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap, kepler

from jaxdyn import Effect, Scene, scenes, simulate, vibration
from jaxdyn.analysis.energy import (
    along,
    angular_momentum,
    drift,
    energy,
    integrals,
    momentum,
    potential,
)
from jaxdyn.analysis.energy_change import energy_change
from jaxdyn.analysis.work_by_effect import with_work
from jaxdyn.effects import DryFriction, LinearDrag, PairGravity, Spring, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.events import Reaches
from jaxdyn.integrate.phases import Exit, Phase, simulate_phases
from jaxdyn.scenes.corners import phases_of

T = jnp.zeros(())
M = (2.0, 3.0)
R = np.array([[1.0, 2.0], [4.0, 6.0]])  # 5 apart
V = np.array([[0.5, -1.0], [0.0, 2.0]])
Y = jnp.asarray(np.concatenate([R, V]).ravel())


def scene(*effects, m=M, d=2, y0=Y):
    return Scene(FreePoints(m, d=d), effects, y0=y0)


def test_kinetic_energy_is_half_m_v_squared():
    assert float(energy(scene(), T, Y)) == 0.5 * 2 * 1.25 + 0.5 * 3 * 4
    assert float(potential(scene(), T, Y)) == 0.0


def test_potentials_add_up():
    pair, down = PairGravity(10.0), UniformGravity(9.0)
    of_pair, of_down = -10 * 2 * 3 / 5, 9 * (2 * 2 + 3 * 6)
    assert float(potential(scene(pair), T, Y)) == of_pair
    assert float(potential(scene(down), T, Y)) == of_down
    both = scene(pair, down, LinearDrag(1.0))
    assert abs(float(potential(both, T, Y)) - (of_pair + of_down)) < EXACT * of_down
    assert abs(float(energy(both, T, Y)) - (of_pair + of_down + 7.25)) < EXACT * of_down


def test_momenta_in_the_plane():
    np.testing.assert_array_equal(momentum(scene(), T, Y), [2 * 0.5, 2 * -1 + 3 * 2])
    assert float(angular_momentum(scene(), T, Y)) == 2 * (1 * -1 - 2 * 0.5) + 3 * (4 * 2 - 6 * 0)


def test_momenta_in_space_and_on_a_line():
    y = jnp.array([1.0, 0.0, 2.0, 0.0, 3.0, -1.0])
    ball = scene(m=2.0, d=3, y0=y)
    np.testing.assert_array_equal(momentum(ball, T, y), [0, 6, -2])
    np.testing.assert_array_equal(angular_momentum(ball, T, y), 2 * np.cross(y[:3], y[3:]))
    bead = scene(m=2.0, d=1, y0=[1.0, 3.0])
    assert float(angular_momentum(bead, T, bead.y0)) == 0.0
    assert momentum(bead, T, bead.y0).tolist() == [6.0]


def test_a_field_will_do():
    falling = scene(UniformGravity(9.0))
    assert energy(falling.field, T, Y) == energy(falling, T, Y)


def test_integrals_have_zero_rate_where_they_are_conserved():
    two = kepler(0.4)
    y = two.y0 + 0.1 * jnp.arange(8.0)
    _, rates = jax.jvp(lambda y: integrals(two, T, y), (y,), (two.rate(T, y),))
    assert rates.keys() == {"energy", "momentum", "angular momentum"}
    for rate in rates.values():
        assert jnp.abs(rate).max() < EXACT


def test_energy_lost_is_the_power_of_drag():
    ball = scenes.cannonball() + LinearDrag(0.3)
    _, power = jax.jvp(lambda y: energy(ball, T, y), (ball.y0,), (ball.rate(T, ball.y0),))
    assert abs(float(power) + 0.3 * 10.0**2) < 100 * EXACT  # -c v^2 at 10 m/s


def test_along_a_motion_is_one_value_a_sample():
    motion = simulate(scenes.cannonball(), 1.0, samples=5)
    values = along(momentum, motion)
    exact = np.stack([np.full(5, motion.ys[0, 2]), motion.ys[0, 3] - 9.81 * motion.ts], axis=1)
    np.testing.assert_allclose(values, exact, atol=SOLVED)


@pytest.mark.slow
def test_drift_is_rounding_without_drag_and_exact_with_it():
    assert drift(simulate(kepler(0.6), rtol=1e-13)) < SOLVED
    slowed = Scene(FreePoints(1.0, d=1), (LinearDrag(1.0),), y0=[0.0, 2.0])
    # E = v^2 / 2 falls by the factor exp(-2) in one second; the size is the start's.
    assert abs(float(drift(simulate(slowed, 1.0))) - (1 - np.exp(-2))) < 1e-9


@pytest.mark.sample("effects0")
@pytest.mark.parametrize("effects", [(), (LinearDrag(1.0),)])
def test_drift_of_what_never_moves_is_zero(effects):
    still = Scene(FreePoints(1.0, d=1), effects, y0=[3.0, 0.0])
    assert float(drift(simulate(still, 1.0))) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("moves", "causes"),
    [
        (kepler(0.6), ()),
        (
            Scene(FreePoints(1.0, d=1), (LinearDrag(1.0), Spring(1.0)), y0=[0.0, 2.0]),
            ("LinearDrag",),
        ),
        (scenes.two_masses(), ("StepForce",)),
        (scenes.shaken_pendulum(t1=0.1), ("the drive",)),
    ],
)
def test_what_changes_the_energy_is_told_from_errors(moves, causes):
    motion = simulate(moves)
    found = energy_change(motion)
    assert found.causes == causes
    assert found.size == pytest.approx(float(drift(motion)), rel=EXACT)
    assert (found.size > 1e-9) == bool(causes)
    assert len(found.works) == len(causes)


class Magnetic(Effect):
    """A force across the velocity, which does no work."""

    def force(self, t, r, v, m):
        return 3.0 * jnp.stack([v[:, 1], -v[:, 0]], axis=1)


class WithoutForce(Effect):
    """A linear spring that does not give its potential."""

    velocity_dependent: ClassVar[bool] = False

    def force(self, t, r, v, m):
        return -r


class Moving(Effect):
    """A spring whose anchor moves: a potential that depends on time."""

    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        return 0.5 * jnp.sum((r - jnp.sin(t)) ** 2)


def _ball(*effects):
    return Scene(FreePoints(2.0), effects, y0=[1.0, 0.0, 0.0, 1.5], t1=3.0)


@pytest.mark.slow
def test_a_force_that_does_no_work_changes_no_energy():
    found = energy_change(simulate(_ball(Spring(1.0), Magnetic())))
    assert (found.causes, found.works, found.without_potential) == ((), (), ())
    assert "because" not in found.message


@pytest.mark.slow
def test_the_work_of_a_force_without_potential_is_measured():
    motion = simulate(_ball(WithoutForce(), Magnetic(), UniformGravity()))
    found = energy_change(motion)
    assert found.causes == found.without_potential == ("WithoutForce",)
    # The energy that is counted is all but that of the spring, r^2 / 2.
    gained = (jnp.sum(motion.r[0] ** 2) - jnp.sum(motion.r[-1] ** 2)) / 2
    whole, stored = along(energy, motion), along(potential, motion)
    size = jnp.max(jnp.abs(whole - stored) + jnp.abs(stored))
    assert gap(found.works[0], gained / size) < 1e-8
    assert (
        f"because of WithoutForce (no potential known, work {found.works[0]:.1e})" in found.message
    )


@pytest.mark.slow
def test_each_of_several_causes_has_its_work():
    motion = simulate(_ball(LinearDrag(0.3), Moving(), Magnetic()))
    found = energy_change(motion)
    assert (found.causes, found.without_potential) == (("LinearDrag", "Moving"), ("LinearDrag",))
    whole, stored = along(energy, motion), along(potential, motion)
    size = jnp.max(jnp.abs(whole - stored) + jnp.abs(stored))
    assert gap(sum(found.works), (whole[-1] - whole[0]) / size) < 1e-8
    lost = simulate(with_work(motion.scene, LinearDrag))["work of LinearDrag"][-1]
    assert gap(found.works[0], lost / size) < 1e-8


@pytest.mark.slow
def test_friction_that_carries_a_block_along_works_against_the_spring():
    """A belt that holds a block stretches its spring to x = 0.25: the work is k x^2 / 2."""
    held = scenes.oscillator(x=0.0, v=0.5) + DryFriction(0.3, 1.0, belt=[0.5])
    found = energy_change(simulate(held, 0.5))
    assert found.causes == ("DryFriction",)
    start = 0.5 * 0.5**2
    assert gap(found.works[0], 0.25**2 / 2 / (start + 0.25**2 / 2)) < 1e-12


@pytest.mark.slow
def test_a_work_of_which_samples_say_too_little_is_not_known():
    wiggles = simulate(_ball(Spring(1e4), LinearDrag(1.0)), samples=7)
    found = energy_change(wiggles)
    assert found.causes == ("LinearDrag",)
    assert np.isnan(found.works[0])
    assert "LinearDrag (no potential known, work not known)" in found.message


@pytest.mark.slow
def test_raw_constraints_drift_and_are_not_driven():
    raw = scenes.pendulum(formulation="constrained", drift="raw", angle=2.0)
    found = energy_change(simulate(raw, 30.0, rtol=1e-5))
    # Gravity's share of the samples' quadrature, of some 1e-6, is not put down to the drift.
    assert abs(found.works[0]) <= found.size
    assert found.causes == ("drift of the constraints",)
    shaken = scenes.shaken_pendulum(t1=0.1, formulation="constrained")
    assert energy_change(simulate(shaken)).causes == ("the drive",)


def test_a_step_is_a_drive():
    pushed = vibration.drive(scenes.oscillator(), "x", vibration.Step(2.0, 0.5))
    assert energy_change(simulate(pushed, 3.0)).causes == ("the drive",)


class _Damped(FreePoints):
    """Points with a damping of their own."""

    second_order: ClassVar[bool] = False

    def rate(self, t, y, effects):
        moving = jnp.arange(len(y)) >= len(y) // 2
        return super().rate(t, y, effects) - jnp.where(moving, 0.1 * y, 0.0)


def test_what_a_system_loses_by_itself_is_said():
    found = energy_change(simulate(Scene(_Damped(1.0), y0=[0.0, 0.0, 1.0, 1.0]), 1.0))
    assert found.causes == ("the system itself",)
    assert gap(found.works[0], np.exp(-0.2) - 1) < 1e-9


@pytest.mark.slow
def test_impacts_and_friction_in_contact_change_the_energy():
    def bounce(t, y):
        return y * jnp.array([1.0, 1.0, 1.0, -0.5])

    falls = Phase(scenes.cannonball(), (Exit(Reaches(1, 0.0, -1), "fly", bounce),))
    down = jnp.array([0.0, 1.0, 0.0, 0.0])
    found = energy_change(simulate_phases({"fly": falls}, "fly", down, 0.6, samples=5))
    assert found.causes == ("impacts",)
    assert abs(found.size - 0.75) < 1e-9  # the square of the speed that is kept is lacking
    skids = scenes.cylinder_on_ramp(slope=0.0, d=0.0)
    thrown = skids.y0.at[3].set(1.0)  # without spin: it cannot roll
    motion = simulate_phases(phases_of(skids), None, thrown, 0.01)
    assert len(motion.names) == 1
    assert motion.names[0].startswith("slip")
    assert energy_change(motion).causes == motion.names


def test_a_failed_motion_has_no_change_of_energy():
    falling = kepler(0.0).starting([-0.5, 0, 0.5, 0, 0, 0, 0, 0])
    assert energy_change(simulate(falling, throw=False)) is None


def test_drift_of_a_motion_that_failed_is_nan():
    falling = kepler(0.0).starting([-0.5, 0, 0.5, 0, 0, 0, 0, 0])
    assert jnp.isnan(drift(simulate(falling, throw=False)))


def test_gradients_forward_and_reverse_agree():
    both = scene(PairGravity(2.0), UniformGravity(9.0))
    forward = jax.jacfwd(lambda y: energy(both, T, y))(Y)
    reverse = jax.jit(jax.grad(lambda y: energy(both, T, y)))(Y)
    np.testing.assert_allclose(forward, reverse, atol=100 * EXACT)
    # The gradient with respect to positions is minus the force, to velocities the momentum.
    np.testing.assert_allclose(reverse[4:], np.repeat(M, 2) * Y[4:], rtol=EXACT)
    np.testing.assert_allclose(-reverse[:4], np.repeat(M, 2) * both.rate(T, Y)[4:], rtol=SOLVED)


@pytest.mark.sample("samples0")
@pytest.mark.parametrize("samples", [[], 1])
def test_drift_without_a_change_to_see_is_refused(samples):
    motion = simulate(scenes.cannonball(), samples=samples)
    message = r"^motion: expected at least 2 samples, got [01]\. Simulate with more\.$"
    with pytest.raises(ValueError, match=message):
        drift(motion)
