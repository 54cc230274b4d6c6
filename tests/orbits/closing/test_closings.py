"""Closing conditions: by symmetry, by reversal, up to a turn, on constraints, with conditions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap
from scipy.special import ellipk

import orbits
from jaxdyn import effects, ode, scenes
from jaxdyn.analysis import energy
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Effect

EULER = orbits.point_symmetry([1, 0, 2], (-1, -1), reversing=True)

MIRROR = orbits.point_symmetry([0, 1, 2], (-1, 1))


def swing_period(angle: float, g: float = 9.81) -> float:
    """Period of a pendulum of length 1 that swings to an angle, by the elliptic integral."""
    return 4 * ellipk(np.sin(angle / 2) ** 2) / np.sqrt(g)


@pytest.fixture(scope="module")
def ring():
    return orbits.find(scenes.three_body(), closing=orbits.choreography(3))


def test_a_choreography_needs_a_body():
    for n in (0, -3, 1.5):
        with pytest.raises(ValueError, match=r"^n: expected a whole number, at least 1, got"):
            orbits.choreography(n)
    with pytest.raises(ValueError, match=r"^d: expected a whole number, at least 1, got 0"):
        orbits.choreography(3, 0)


@pytest.mark.slow
def test_the_eight_by_reversal_is_the_eight_by_choreography(ring):
    half = orbits.find(scenes.three_body(), closing=orbits.reversal(EULER))
    assert half.closing.parts == 2
    assert len(half.closing.free(12)) == 6  # half of the unknowns
    assert gap(half.y0[:6], EULER.act(half.y0)[:6]) == 0.0
    a, b = (orbits.identify(orbit).scale_free for orbit in (half, ring))
    assert abs(a - b) < SOLVED
    assert orbits.analysis.closure(half) < SOLVED


@pytest.mark.slow
def test_the_eight_is_a_relative_orbit_that_does_not_turn(ring):
    orbit = orbits.find(scenes.three_body(), closing=orbits.relative())
    assert abs(orbit.angle) < SOLVED
    assert abs(orbits.identify(orbit).scale_free - orbits.identify(ring).scale_free) < SOLVED
    linear, whole = orbits.stability(orbit), orbits.stability(ring)
    assert gap(linear.nontrivial, whole.nontrivial) < 1e-9


@pytest.mark.slow
def test_a_reflection_turns_the_rotation_of_the_next_part_round(ring):
    c, s = np.cos(0.3), np.sin(0.3)
    turned = (np.asarray(ring.y0).reshape(6, 2) @ np.array([[c, s], [-s, c]])).ravel()
    closing = orbits.relative("turn in xy", MIRROR, 2)
    orbit = orbits.find(scenes.three_body(), turned, ring.period, closing=closing)
    # It is mirrored in a line at 0.3 rad, but for what the start turns by.
    assert abs(orbit.angle - 0.6) < 1e-6
    assert orbits.recheck(orbit).closure < SOLVED
    assert orbits.analysis.closure(orbit, periods=2) < 10 * SOLVED
    linear, whole = orbits.stability(orbit), orbits.stability(ring)
    assert (linear.unit, linear.verdict) == (8, "stable")
    assert gap(np.sort_complex(linear.nontrivial), np.sort_complex(whole.nontrivial)) < 1e-9


def test_states_before_a_relative_orbit_are_those_from_which_it_comes():
    three = scenes.three_body()
    ring = orbits.point_symmetry([1, 2, 0], (1, 1))
    for symmetry, parts in ((ring, 3), (MIRROR, 2)):
        closing = orbits.relative("turn in xy", symmetry, parts)
        for periods in (1, 2):
            later = closing.after(three.system, three.y0, 0.4, periods)
            assert gap(closing.after(three.system, later, 0.4, -periods), three.y0) < SOLVED


def test_a_turn_of_many_waves_is_exact():
    waves = np.array([3.0, 17.0])

    def turn(y):
        return jnp.concatenate([-waves * y[2:], waves * y[:2]])

    def rate(t, y):
        return turn(y) - y

    scene = ode(rate, [1.0, 0.5, 0.0, 2.0], 1.0, generators={"turn": turn})
    closing = orbits.relative("turn").fit_to(scene)
    assert closing.frequency == 17
    y, angle = np.asarray(scene.y0), 2.5
    exact = (y[:2] + 1j * y[2:]) * np.exp(1j * waves * angle)
    turned = closing.act(scene.system, scene.y0, angle)
    assert gap(turned, np.concatenate([exact.real, exact.imag])) < 1e-13


@pytest.mark.slow
def test_a_rosette_turns_by_twice_the_apsidal_angle():
    law = effects.PowerLaw(1.0, -1.0)
    scene = scenes.power_law(n=-1.0, speed=0.6)
    orbit = orbits.find(scene, period=3.18, closing=orbits.relative())
    ts = np.linspace(0.0, orbit.period, 4001)
    r = np.linalg.norm(np.asarray(solve(orbit.scene, orbit.period, ts=ts).ys)[:, :2], axis=1)
    # The radii on a grid; the angle is stationary in neither, so only to the grid's error.
    exact = 2 * float(scenes.apsidal_angle(law, r.min(), r.max()))
    assert abs((orbit.angle - exact + np.pi) % (2 * np.pi) - np.pi) < 1e-5
    assert orbit.residual < SOLVED
    assert orbits.analysis.closure(orbit, periods=3) < 10 * SOLVED


def test_half_a_swing_gives_the_period():
    closing = orbits.reversal(orbits.time_reversal(2))
    orbit = orbits.find(scenes.pendulum(angle=1.2), period=2.3, closing=closing)
    assert orbit.y0[1] == 0.0
    assert abs(orbit.period - swing_period(float(orbit.y0[0]))) < SOLVED


@pytest.mark.slow
def test_an_orbit_on_a_constraint_surface():
    orbit = orbits.find(scenes.pendulum(angle=1.0, formulation="constrained"), period=2.2)
    x, y = orbit.y0[:2]
    assert abs(np.hypot(x, y) - 1.0) < 1e-14
    e = float(energy.energy(orbit.scene, jnp.zeros(()), orbit.y0))
    assert abs(orbit.period - swing_period(np.arccos(-e / 9.81))) < SOLVED
    linear = orbits.stability(orbit)
    assert linear.multipliers.shape == (2,)  # two of four directions lie on the surface
    assert linear.unit == 2


def test_a_pendulum_that_goes_over_the_top_closes_after_a_turn():
    orbit = orbits.find(scenes.pendulum(angle=0.0, rate=8.0), period=1.0)
    w0 = float(orbit.y0[1])
    m = 4 * 9.81 / w0**2  # at the bottom, angle 0: T = (4 / w0) K(4 g / w0^2)
    angle = float(orbit.y0[0])
    w0 = np.sqrt(w0**2 + 2 * 9.81 * (1 - np.cos(angle)))
    m = 4 * 9.81 / w0**2
    assert abs(orbit.period - 4 / w0 * ellipk(m)) < SOLVED


@pytest.mark.sample("1")
@pytest.mark.parametrize("segments", [1, 3])
def test_a_driven_orbit_in_segments(segments):
    k, w, f = 4.0, 1.3, 0.7
    scene = scenes.oscillator(k=k) + effects.SinusoidalForce([f], w)
    orbit = orbits.find(scene, [0.1, 0.3], 2 * np.pi / w, segments=segments)
    # x = f sin(w t) / (k - w^2), the only motion with the drive's period.
    assert gap(orbit.y0, [0.0, f * w / (k - w * w)]) < SOLVED


def test_conditions_pick_one_of_a_family():
    orbit = orbits.find(scenes.pendulum(angle=1.0), period=2.2, hold=orbits.Period(2.5))
    assert abs(orbit.period - 2.5) < SOLVED
    e = -9.81 * np.cos(1.5)
    held = [orbits.Energy(e), orbits.Section(1, 0.0)]
    orbit = orbits.find(scenes.pendulum(angle=1.4), period=2.4, hold=held)
    assert gap(np.abs(orbit.y0), [1.5, 0.0]) < SOLVED
    assert abs(orbit.period - swing_period(1.5)) < SOLVED


@pytest.mark.parametrize("hold", [(), "theta", ["theta_dot"], orbits.Section(0, 2.0)])
@pytest.mark.parametrize("period", [2.3, 2.66, 3.0])
def test_a_start_that_is_periodic_stays_and_only_the_guessed_period_moves(hold, period):
    orbit = orbits.find(scenes.pendulum(angle=2.0), period=period, hold=hold)
    assert gap(orbit.y0, [2.0, 0.0]) < SOLVED
    assert orbit.shift < SOLVED
    assert abs(orbit.period - swing_period(2.0)) < SOLVED


def test_a_held_entry_stays_where_the_start_has_to_move():
    held = ["theta", orbits.Energy(-5.0)]
    orbit = orbits.find(scenes.pendulum(angle=1.0, rate=0.5), period=2.2, hold=held)
    rate = np.sqrt(2 * (9.81 * np.cos(1.0) - 5.0))
    assert gap(orbit.y0, [1.0, rate]) < SOLVED
    assert abs(orbit.shift - (rate - 0.5)) < SOLVED
    # Without a reason to stay both entries move.
    free = orbits.find(scenes.pendulum(angle=1.0, rate=0.5), period=2.2, hold=orbits.Energy(-5.0))
    assert abs(free.y0[0] - 1.0) > 1e-3
    assert free.shift == np.abs(np.asarray(free.y0) - [1.0, 0.5]).max()


def test_segments_are_chosen_by_growth():
    a, b, period = 0.5379557207, 0.3414578545, 26.918669616
    y0 = [-1, 0, 1, 0, 0, 0, a, b, a, b, -2 * a, -2 * b]
    orbit = orbits.find(scenes.three_body(y0), None, period, closing=orbits.reversal(EULER))
    assert orbit.residual < SOLVED
    assert orbit.iterations <= 6  # from a published row of 10 digits
    assert abs(orbit.period - period) < 1e-8


@pytest.mark.parametrize(
    ("closing", "message"),
    [
        (orbits.relative("turn in zz"), "turn: expected one of"),
        (orbits.reversal(orbits.point_symmetry([1, 0, 2], (1, 1))), "time reversals of order 2"),
        (orbits.Return(EULER), "a symmetry that keeps the direction of time"),
        (
            orbits.reversal(orbits.time_reversal(12)),
            "a start in the fixed set of the time reversal of 'reversal'",
        ),
        (orbits.Return(orbits.Symmetry(None, (1, -1))), "closing: expected 12 signs"),
        (orbits.relative("turn in xy", MIRROR, 1), "parts: expected a multiple of the order of g"),
        (orbits.Return(orbits.choreography(3)[0].symmetry, 2), "of the order of g, 3, got 2"),
        (orbits.reversal(EULER, parts=3), "twice the order of both reversals' product, 2, got 3"),
        ("choreography", "closing: expected"),
    ],
)
def test_misuse_of_closings(closing, message):
    with pytest.raises(ValueError, match=message):
        orbits.find(scenes.three_body(), closing=closing)


@pytest.mark.parametrize("transform", [jax.jit, jax.grad])
def test_a_symmetric_closing_of_traced_numbers_is_refused(transform):
    def angle(x):
        orbits.closing.symmetric_closing(scenes.pendulum(angle=x))
        return x

    with pytest.raises(ValueError, match="scene: expected numbers, got values traced by"):
        transform(angle)(0.5)


def test_a_turn_must_be_a_symmetry():
    scene = scenes.power_law(n=-1.0, speed=0.6) + effects.ConstantForce([1.0, 0.0])
    with pytest.raises(ValueError, match="turn: expected a symmetry of the scene"):
        orbits.find(scene, closing=orbits.relative())


class Shove(Effect):
    """A force along x that is zero at the start."""

    def force(self, t, r, v, m):
        return jnp.sin(t) * jnp.ones((len(r), 1)) * jnp.array([[1.0, 0.0]])


def test_a_drive_that_is_zero_at_the_start_breaks_a_turn():
    scene = scenes.power_law(n=-1.0, speed=0.6) + Shove()
    with pytest.raises(ValueError, match="turn: expected a symmetry of the scene"):
        orbits.find(scene, period=2 * np.pi, closing=orbits.relative())


class Comb(Effect):
    """A drag of motions along x alone."""

    def force(self, t, r, v, m):
        return -0.1 * v * jnp.array([[1.0, 0.0]])


def test_a_drag_that_does_not_show_at_rest_breaks_a_turn():
    scene = scenes.power_law(n=-1.0, speed=0.0) + Comb()
    with pytest.raises(ValueError, match="turn: expected a symmetry of the scene"):
        orbits.find(scene, period=2 * np.pi, closing=orbits.relative())


def test_a_symmetry_that_leads_to_where_there_is_no_rate_is_none():
    scene = ode(lambda t, y: [y[1] * jnp.sqrt(y[0]), -y[0]], [1.0, 0.5], 2 * np.pi)
    half = orbits.Return(orbits.Symmetry(signs=(-1, -1)), parts=2)
    with pytest.raises(ValueError, match="got one that changes its forces"):
        orbits.find(scene, closing=half)


def duffing(t, y, p):
    return [y[1], -0.2 * y[1] - y[0] ** 3 + 0.3 * jnp.cos(p * t)]


@pytest.mark.parametrize(
    "scene",
    [
        scenes.pendulum(angle=2.0) + effects.LinearDrag(0.1),
        scenes.pendulum(angle=2.0) + effects.QuadraticDrag(0.1),
        scenes.restricted_three_body(x=0.48, y=0.86, vy=0.0),
    ],
    ids=["linear drag", "quadratic drag", "rotating axes"],
)
def test_forces_that_vanish_at_rest_break_a_reversal(scene):
    # Motions from rest that come to rest again do not retrace their path here.
    at_rest = orbits.reversal(orbits.time_reversal(len(scene.y0)))
    with pytest.raises(ValueError, match="expected a symmetry of the scene, got one that changes"):
        orbits.find(scene, period=9.0, closing=at_rest)


def test_a_drive_is_the_image_of_itself_half_a_period_earlier():
    half = orbits.Return(orbits.Symmetry(signs=(-1, -1)), parts=2)
    scene = ode(duffing, [0.3, 0.4], 2 * np.pi, params=1.0)
    orbit, whole = orbits.find(scene, closing=half), orbits.find(scene)
    assert gap(orbit.y0, whole.y0) < SOLVED
    assert orbits.recheck(orbit).closure < SOLVED
    # At twice the frequency half of a period changes nothing, and the symmetry is none.
    for phase in (0.0, np.pi / 2):  # also where the drive is zero at the start
        twice = ode(_twice, [0.3, 0.4], 2 * np.pi, params=phase)
        with pytest.raises(ValueError, match="a drive must be the image of itself"):
            orbits.find(twice, closing=half)


def _twice(t, y, phase):
    return [y[1], -0.2 * y[1] - y[0] ** 3 + 0.3 * jnp.cos(2 * t + phase)]


@pytest.mark.parametrize(
    ("hold", "message"),
    [
        (orbits.Energy(np.nan), "energy: expected finite numbers"),
        (orbits.Period(-1.0), "period: expected > 0"),
        (orbits.Section(12), "entry: expected an entry of the state, 0 to 11"),
        ("energy", "hold: expected one of .*got 'energy'"),
        (1.0, "hold: expected a Condition"),
    ],
)
def test_misuse_of_conditions(hold, message):
    with pytest.raises(ValueError, match=message):
        orbits.find(scenes.three_body(), hold=[hold])


def test_two_reversals_need_their_parts():
    other = orbits.point_symmetry([1, 0, 2], (1, -1), reversing=True)
    with pytest.raises(ValueError, match="parts: expected a number where two reversals differ"):
        orbits.reversal(EULER, other)
