"""Central forces: circular speeds, apsidal angles, and orbits that close (problem 11)."""

import re

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import simulate
from jaxdyn.analysis import energy
from jaxdyn.effects import CentralForce, PowerLaw
from jaxdyn.hard.cases.centres import _KNOWN
from jaxdyn.integrate import events
from jaxdyn.scenes.apsidal import apsidal_angle, apsidal_limits, apsides
from jaxdyn.scenes.central import (
    central_orbit,
    circular_speed,
    fewest_loops,
    power_law,
    swept_angle,
)
from jaxdyn.scenes.nbody import three_body


class Falls(events.Event):
    """The distance from the origin is least."""

    def value(self, t, y):
        del t
        return jnp.sum(y[:2] * y[2:])

    @property
    def direction(self):
        return 1


def test_problem_11_a_one_speed_for_all_circles():
    radii = jnp.array([0.01, 1.0, 7.0, 1e4])
    speeds = jax.vmap(lambda r: circular_speed(PowerLaw(3.0, -1.0), r, m=2.0))(radii)
    assert gap(speeds, np.full(4, np.sqrt(1.5))) < EXACT
    # and no other power: v ~ r^((n+1)/2)
    for n in (-2.0, 0.0, 1.0):
        ratio = circular_speed(PowerLaw(3.0, n), 4.0) / circular_speed(PowerLaw(3.0, n), 1.0)
        assert gap(ratio, 2.0 ** (n + 1)) < 10 * EXACT
    assert np.isnan(circular_speed(PowerLaw(-1.0, -2.0), 1.0))


@pytest.mark.parametrize("n", [-2.0, -1.0, 0.5])
def test_the_circular_speed_makes_a_circle(n):
    law = PowerLaw(2.0, n)
    v = circular_speed(law, 1.5, m=0.5)
    motion = simulate(central_orbit(law, r=1.5, speed=v, m=0.5), 3.0, rtol=1e-13, samples=5)
    angle = v / 1.5 * motion.ts
    expected = 1.5 * jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)
    assert gap(motion.r[:, 0], expected) < 10 * SOLVED


@pytest.mark.parametrize("n", [-2.9, -2.5, -2.0, -1.0, 0.0, 1.0, 3.0, 7.0])
def test_problem_11_b_apsidal_angle_tends_to_pi_over_sqrt_3_plus_n(n):
    off = [
        float(apsidal_angle(PowerLaw(1.7, n), 1 - eps, 1.0)) - np.pi / np.sqrt(3 + n)
        for eps in (1e-1, 1e-2)
    ]
    # quadratic in the eccentricity, or nothing at all (Bertrand's two laws)
    assert abs(off[1]) < max(abs(off[0]) / 90, 1e-13 / 1e-2**2)


@pytest.mark.parametrize("ratio", [1e-70, 1e-8, 0.05, 0.3, 0.9, 1 - 1e-8])
def test_only_springs_and_gravity_close_at_every_radius(ratio):
    assert gap(apsidal_angle(PowerLaw(0.7, 1.0), 2 * ratio, 2.0), np.pi / 2) < EXACT
    assert gap(apsidal_angle(PowerLaw(0.7, -2.0), 2 * ratio, 2.0), np.pi) < EXACT
    # gravity plus a 1/r^3 pull of strength j turns the same ellipse: pi / sqrt(1 - j / L^2)
    if ratio < 0.05:  # the pull has drawn it in
        return
    # An ellipse with 1/r^2 alone has L^2 = the harmonic mean of its radii; with the pull j more.
    l2 = 2 / (0.5 + 0.5 / ratio) + 0.1
    expected = np.pi / np.sqrt(1 - 0.1 / l2)
    assert gap(apsidal_angle(Precessing(), 2 * ratio, 2.0), expected) < EXACT * 10


def by_quadrature(n, depth):
    """Angle over pi and time of power laws between radii 1 and e^-depth, by mpmath.

    The integrals of dtheta/dx and dt/dx with x = log r, in the root of the distance from an end.
    """
    with mpmath.workdps(40):
        n, depth = mpmath.mpf(n), mpmath.mpf(depth)

        def energy(x):
            return x if n == -1 else mpmath.expm1((n + 1) * x) / (n + 1)

        spin2 = -2 * energy(-depth) / mpmath.expm1(2 * depth)

        def slope(x):
            return mpmath.sqrt(mpmath.expm1(2 * x) - 2 * energy(x) * mpmath.exp(2 * x) / spin2)

        middle = mpmath.sqrt(depth / 2)
        cuts = [0, *(middle / mpmath.mpf(2) ** k for k in range(14, -1, -1))]

        def integral(weight):
            return sum(
                mpmath.quad(
                    lambda u, at=at: 2 * u * weight(at(u)) / slope(at(u)),
                    cuts,
                    method="gauss-legendre",
                )
                for at in (lambda u: u * u - depth, lambda u: -u * u)
            )

        angle, time = integral(lambda x: 1), integral(lambda x: mpmath.exp(2 * x))
        return float(angle / mpmath.pi), float(time / mpmath.sqrt(spin2))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n", "depth"), [(-2.9, 2.0), (-1.0, 1e-3), (-1.0 + 1e-9, 3.0), (2.5, 6.0), (30.0, 1.0)]
)
def test_angle_and_time_against_a_quadrature_of_40_digits(n, depth):
    way = apsides(PowerLaw(1.0, n), depth)
    angle, time = by_quadrature(n, depth)
    assert abs(float(way.angle) / np.pi / angle - 1) < EXACT
    assert abs(float(way.time) / time - 1) < EXACT


@pytest.mark.slow
@pytest.mark.parametrize("row", range(len(_KNOWN)))
def test_what_the_hard_cases_compare_with(row):
    n, ratio, *known = _KNOWN[row]
    assert gap(by_quadrature(n, -np.log(ratio)), known) < EXACT * 10


def test_an_orbits_numbers_scale_with_force_mass_and_radius():
    one, other = apsides(PowerLaw(1.0, -1.5), 2.0), apsides(PowerLaw(3.0, -1.5), 2.0, 5.0, 0.7)
    assert gap(other.angle, one.angle) < EXACT
    force = 3.0 * 5.0**-1.5
    assert gap(other.time / np.sqrt(0.7 * 5.0 / force), one.time) < EXACT * 10
    assert gap(other.momentum / np.sqrt(0.7 * 5.0**3 * force), one.momentum) < EXACT * 10


@pytest.mark.sample("-2.25", "-1.5", "0.0")
@pytest.mark.parametrize("n", [-2.7, -2.25, -1.5, -1.0, 0.0, 2.0, 50.0])
def test_the_angle_goes_one_way_between_its_limits(n):
    depths = np.geomspace(1e-3, 100.0, 200)
    angles = jax.lax.map(lambda x: apsides(PowerLaw(1.0, n), x).angle, jnp.asarray(depths)) / np.pi
    circle, line = apsidal_limits(n)
    towards = np.sign(line - circle)
    # Near the line the steps are rounding.
    assert (np.diff(angles) * towards > -1e-13).all()
    assert (np.diff(angles)[:120] * towards > 0).all()
    assert (angles[0] - circle) * towards > 0
    second = (n - 1) * (n + 2) / 96 * depths[0] ** 2  # of the eccentricity's powers
    assert abs((float(angles[0]) / circle - 1) / second - 1) < 1e-3
    assert (line - angles[-1]) * towards > -1e-13


def test_apsidal_limits_of_laws_without_orbits_between_two_radii():
    assert np.isnan(apsidal_limits(-3.0)).all()
    assert np.isnan(apsidal_limits([-3.5, 0.0])[0]).tolist() == [True, False]
    assert np.isnan(apsides(PowerLaw(1.0, -3.0), 1.0).angle)
    assert np.isnan(apsides(PowerLaw(1.0, -3.5), 1.0).angle)


@pytest.mark.parametrize("ratio", [0.3, 1e-5])
def test_the_angle_swept_in_whole_periods_of_an_ellipse(ratio):
    way = apsides(PowerLaw(1.0, -2.0), -np.log(ratio))
    scene = power_law(n=-2.0, speed=-way.momentum, t1=6 * way.time)
    assert gap(swept_angle(scene, rtol=1e-14), -6 * np.pi) < 1e-9 / ratio
    assert gap(swept_angle(scene, way.time, rtol=1e-14), -np.pi) < 1e-9 / ratio
    with pytest.raises(ValueError, match="y0: expected shape"):
        swept_angle(three_body())


class Precessing(CentralForce):
    """1/r^2 + 0.1/r^3: ellipses that turn, in closed form (Newton's revolving orbits)."""

    def energy(self, r):
        return -1 / r - 0.05 / r**2


def test_apsidal_angle_against_a_simulated_orbit():
    law, low, high = PowerLaw(1.0, -1.0), 0.3, 1.0
    # Speed at the far end, from energy and angular momentum at both.
    speed = np.sqrt(2 * np.log(high / low) / ((high / low) ** 2 - 1))
    scene = power_law(n=-1.0, r=high, speed=speed)

    def radial(t):  # r . v vanishes at the near end
        x, y, vx, vy = simulate(scene, t, rtol=1e-13, samples=1).ys[-1]
        return x * vx + y * vy, (x, y)

    lo, hi = 0.3, 1.5
    assert float(radial(lo)[0]) < 0 < float(radial(hi)[0])
    for _ in range(45):
        middle = 0.5 * (lo + hi)
        lo, hi = (middle, hi) if radial(middle)[0] < 0 else (lo, middle)
    x, y = radial(lo)[1]
    assert gap(jnp.hypot(x, y), low) < 1e-12
    assert gap(jnp.arctan2(y, x) % (2 * np.pi), apsidal_angle(law, low, high)) < 1e-11


def test_problem_11_b_an_orbit_that_closes_by_choice_of_its_radii():
    # F = const (n = 0): angles run from pi/sqrt(3) (circle) down to pi/2; 5 pi / 9 is between.
    law = PowerLaw(1.0, 0.0)
    lo, hi = 0.05, 0.999
    for _ in range(60):
        middle = 0.5 * (lo + hi)
        small = apsidal_angle(law, middle, 1.0) < 5 * np.pi / 9
        lo, hi = (middle, hi) if small else (lo, middle)
    speed = np.sqrt(2 * (1 - lo) / (lo**-2 - 1))  # energy r, L = 1 * speed
    scene = power_law(n=0.0, r=1.0, speed=speed)
    # 9 loops in 5 turns: a period is 9 times the time between two far ends, found by energy:
    # dt/dr = 1 / sqrt(2 (E - r) - L^2 / r^2), with r = mid + half sin s.
    s = (np.arange(400) + 0.5) * np.pi / 400 - np.pi / 2
    r = 0.5 * (1 + lo) + 0.5 * (1 - lo) * np.sin(s)
    radial = 2 * (1 + speed**2 / 2 - r) - speed**2 / r**2
    loop = 2 * np.mean(0.5 * (1 - lo) * np.cos(s) / np.sqrt(radial)) * np.pi
    motion = simulate(scene, 9 * loop, rtol=1e-13, samples=[9 * loop])
    assert gap(motion.ys[-1], scene.y0) < 1e-10


@pytest.mark.parametrize(
    ("n", "turns", "loops"),
    [(-2.7, 2, 1), (-2.5, 3, 2), (-1.5, 3, 4), (-1.0, 2, 3), (0.0, 4, 7), (2.0, 5, 11)],
)
@pytest.mark.slow
def test_problem_11_b_ii_fewest_loops_and_an_orbit_that_has_them(n, turns, loops):
    assert fewest_loops(n) == loops
    law, low, high = PowerLaw(1.0, n), 0.02, 0.99
    rises = apsidal_angle(law, low, 1.0) < apsidal_angle(law, high, 1.0)
    for _ in range(60):
        middle = (low + high) / 2
        below = apsidal_angle(law, middle, 1.0) < np.pi * turns / loops
        low, high = (middle, high) if below == rises else (low, middle)
    # Energy is kept from r = 1 to r_min: v1^2 = 2 (V(r_min) - V(1)) / (1 - 1 / r_min^2).
    speed2 = 2 * (law.energy(jnp.asarray(low)) - law.energy(jnp.asarray(1.0))) / (1 - 1 / low**2)
    scene = central_orbit(law, r=1.0, speed=jnp.sqrt(speed2))
    inward = events.until(scene, Falls(), 50.0, rtol=1e-12)
    period = 2 * loops * float(inward.t)  # from farthest to nearest, there and back
    motion = simulate(scene, period, samples=2001, rtol=1e-12)
    assert gap(motion.ys[-1], scene.y0) < 1e-8
    r = np.hypot(motion["x"], motion["y"])
    assert np.sum((r[1:-1] > r[:-2]) & (r[1:-1] >= r[2:])) == loops - 1  # and the start
    angle = np.unwrap(np.arctan2(motion["y"], motion["x"]))
    assert abs(angle[-1] / (2 * np.pi) - turns) < 1e-8


def test_fewest_loops_of_the_two_laws_that_always_close_and_near_them():
    assert [fewest_loops(n) for n in (-2.0, 1.0)] == [1, 2]
    assert fewest_loops(0.999) > 1000
    with pytest.raises(ValueError, match="n: expected above -3"):
        fewest_loops(-3.0)


def test_energy_and_angular_momentum_are_kept():
    motion = simulate(power_law(n=-1.0, speed=0.3), 10.0, rtol=1e-13, samples=9)
    assert energy.drift(motion) < SOLVED
    spin = energy.along(energy.angular_momentum, motion)
    assert gap(spin, np.full(9, 0.3)) < SOLVED


@pytest.mark.slow
def test_apsidal_angle_is_differentiable_and_batched():
    def angle(ratio, n):
        return apsidal_angle(PowerLaw(1.0, n), ratio, 1.0)

    slope = jax.grad(angle, argnums=(0, 1))(0.5, -1.3)
    h = 1e-4
    expected = [(angle(0.5 + h, -1.3) - angle(0.5 - h, -1.3)) / (2 * h)]
    expected += [(angle(0.5, -1.3 + h) - angle(0.5, -1.3 - h)) / (2 * h)]
    assert gap(jnp.stack(slope), jnp.stack(expected)) < 1e-6
    batch = jax.vmap(angle)(jnp.array([0.2, 0.5]), jnp.array([1.0, -2.0]))
    assert gap(batch, [np.pi / 2, np.pi]) < 1e-12


def test_no_orbit_between_these_radii_is_nan_and_no_radii_are_refused():
    assert np.isnan(apsidal_angle(PowerLaw(-1.0, -2.0), 0.5, 1.0))  # repelled
    for low, high in ((1.0, 1.0), (2.0, 1.0), (0.0, 1.0)):
        message = f"r_max: expected above r_min = {low} > 0, got {high}. They are distances."
        with pytest.raises(ValueError, match="^" + re.escape(message)):
            apsidal_angle(PowerLaw(), low, high)


def test_a_start_in_the_singular_centre_is_refused():
    with pytest.raises(ValueError, match=r"^y0: expected a finite PowerLaw force"):
        simulate(power_law(n=-2.0, r=0.0))
