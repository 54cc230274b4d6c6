"""Numbers for which something holds of an orbit or a special point, against closed forms."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cycles import Bautin, cycle
from harmonics import Balance
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve, least_squares, minimize_scalar
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.phase import Exit, Phase
from jaxdyn.scenes import nbody
from jaxdyn.scenes.walkers import HeelStrikes, changes_feet
from orbits import Kind, design, minimise
from orbits.closing.closings import point_symmetry
from orbits.targets import DesignOutcome, OptimumOutcome


def pendulum(numbers):
    return scenes.pendulum(length=numbers[0], angle=1.0)


@pytest.fixture(scope="module")
def swing():
    return orbits.find(pendulum(jnp.array([1.0])), period=2.2, hold="theta")


def period_of(orbit):
    return orbit.period - 2.0


def test_the_length_of_a_pendulum_of_a_wanted_period(swing):
    found = design(pendulum, period_of, [1.0], swing, hold="theta")
    # T = 4 sqrt(l / g) K(sin(1/2)^2)
    exact = 9.81 * (2.0 / (4 * ellipk(np.sin(0.5) ** 2))) ** 2
    assert found.ok
    assert found.numbers[0] == pytest.approx(exact, rel=1e-10)
    assert found.found.y0[0] == pytest.approx(1.0, abs=1e-14)


def test_a_far_period_is_not_that_of_several_swings_nor_of_wider_ones(swing):
    found = design(pendulum, lambda orbit: orbit.period - 20.0, [1.0], swing, hold="theta")
    assert found.numbers[0] == pytest.approx(
        9.81 * (20.0 / (4 * ellipk(np.sin(0.5) ** 2))) ** 2, rel=1e-10
    )
    assert found.found.y0 == pytest.approx([1.0, 0.0], abs=1e-10)


def _kepler(t, y, mu):
    return [y[2], y[3], *(-mu * y[:2] / jnp.linalg.norm(y[:2]) ** 3)]


@pytest.mark.parametrize(("metre", "second"), [(1.0, 1.0), (1e-3, 1 / 86400)])
def test_what_a_name_holds_is_the_start_of_the_scene(metre, second):
    """Kepler's third law: the start is a function of the radius that is not linear."""
    mu = 3.986004418e14 * metre**3 / second**2

    def circle(numbers):
        (r,) = numbers
        y0 = jnp.stack([r, 0.0, 0.0, jnp.sqrt(mu / r)])
        span = 2 * jnp.pi * jnp.sqrt(r**3 / mu)
        return jaxdyn.ode(_kepler, y0, span, names=["x", "y", "vx", "vy"], params=mu)

    day, r, hold = 86164.0905 * second, 4e7 * metre, ["x", "vy"]
    near = orbits.find(circle(jnp.array([r])), hold=hold)
    found = design(circle, lambda orbit: orbit.period / day - 1, [r], near, hold=hold)
    exact = (mu * day**2 / (4 * np.pi**2)) ** (1 / 3)
    assert found.numbers[0] == pytest.approx(exact, rel=1e-10)
    assert found.found.y0[3] == pytest.approx(np.sqrt(mu / exact), rel=1e-10)


@pytest.mark.parametrize("unit", [1e13, 1e-13])
def test_a_parameter_of_zero_has_the_size_that_its_slope_gives(swing, unit):
    def longer(numbers):
        return scenes.pendulum(length=1.0 + unit * numbers[0], angle=1.0)

    found = design(longer, period_of, [0.0], swing, hold="theta")
    assert 1.0 + unit * found.numbers[0] == pytest.approx(0.874143129, rel=1e-8)


def test_what_bounds_do_not_allow_ends_at_the_least(swing):
    found = design(pendulum, period_of, [1.0], swing, hold="theta", lower=[0.9], throw=False)
    assert found.outcome == DesignOutcome.LEAST
    assert found.numbers[0] == 0.9
    with pytest.raises(orbits.SearchError, match="The requirement cannot be met near here"):
        design(pendulum, period_of, [1.0], swing, hold="theta", lower=[0.9])


@pytest.mark.parametrize(("scales", "low"), [([0.5, 0.4, 1.0], 0.1), ([0.5, 0.4, 0.0], 0.95)])
def test_requirements_that_contradict_each_other_are_met_in_the_least_squares(scales, low):
    def turned(numbers):
        return scenes.pendulum(length=numbers[0], angle=numbers[1])

    def off(period, speed, angle):
        return [(period - 2.0), (speed - 2.5), (angle - 1.0)]

    def wanted(orbit):
        speed, angle = orbit.amplitude("theta_dot"), orbit.amplitude("theta")
        return jnp.array(scales) * jnp.stack(off(orbit.period, speed, angle))

    def known(numbers):  # T = 4 sqrt(l / g) K(sin(angle/2)^2), the speed 2 sqrt(g / l) sin(angle/2)
        root, half = np.sqrt(numbers[0] / 9.81), np.sin(0.5 * numbers[1])
        return scales * np.array(off(4 * root * ellipk(half**2), 2 * half / root, numbers[1]))

    first = orbits.find(turned(jnp.ones(2)), period=2.2, hold="theta")
    found = design(turned, wanted, [1.0, 1.0], first, hold="theta", lower=[low, 0.1], throw=False)
    exact = least_squares(known, [1.0, 1.0], bounds=([low, 0.1], 9), xtol=1e-15, ftol=1e-15)
    assert found.outcome == DesignOutcome.LEAST
    # SciPy ends where the sum of squares is level to rounding, so that half of the digits are left.
    np.testing.assert_allclose(found.numbers, exact.x, rtol=3e-8)


@pytest.fixture(scope="module")
def hopf():
    make = lorenz(jnp.array([10.0, 8 / 3]))
    return jaxdyn.continue_equilibria(make, 20.0, [7.0, 7.0, 19.0], within=(2, 30)).special[0]


def lorenz(numbers):
    return lambda rho: scenes.lorenz(sigma=numbers[0], beta=numbers[1], rho=rho)


def test_a_hopf_point_where_it_is_wanted_with_a_wanted_frequency(hopf):
    def wanted(point):
        return jnp.stack([point.parameter - 30.0, point.frequency - 11.0])

    s, b = design(lorenz, wanted, [10.0, 8 / 3], hopf).numbers
    assert s * (s + b + 3) / (s - b - 1) == pytest.approx(30.0, rel=1e-10)
    assert 2 * b * s * (s + 1) / (s - b - 1) == pytest.approx(121.0, rel=1e-10)


@pytest.mark.slow
def test_what_cannot_be_reached_is_said(hopf):
    # No positive sigma and beta have one at rho = 3.
    found = design(
        lorenz, lambda point: point.parameter - 3.0, [10.0, 8 / 3], hopf, throw=False, steps=10
    )
    assert not found.ok
    assert np.isfinite(found.numbers).all()
    assert "Design" in repr(found)
    one = design(
        lorenz, lambda point: point.parameter - 30.0, [10.0, 8 / 3], hopf, steps=1, throw=False
    )
    assert one.outcome == DesignOutcome.STEP_LIMIT


def test_a_search_ends_when_its_time_is_up(swing):
    def wanted(orbit):
        return orbit.period - 7.0

    asked = {"hold": "theta", "throw": False}
    short = design(pendulum, wanted, [1.0], swing, seconds=1e-9, **asked)
    assert short.outcome == DesignOutcome.TIME_LIMIT
    np.testing.assert_array_equal(short.numbers, [1.0])
    assert short.found is swing
    assert "increase seconds" in short.message
    with pytest.raises(ValueError, match="seconds: expected > 0, got 0"):
        design(pendulum, wanted, [1.0], swing, seconds=0.0, **asked)


def van_der_pol(t, y, n):
    del t
    return [y[1], n[0] * (1 - y[0] ** 2) * y[1] - n[1] * y[0]]


@pytest.mark.slow
def test_period_and_multiplier_of_a_cycle():
    def make(n):
        return jaxdyn.ode(van_der_pol, [2.0, 0.0], 6.66, params=n)

    def wanted(orbit):
        return jnp.stack([orbit.period - 5.0, orbit.multipliers()[0].real - 0.01])

    found = design(make, wanted, [1.3, 1.0], orbits.find(make(jnp.array([1.3, 1.0]))))
    assert found.found.period == pytest.approx(5.0, abs=1e-10)
    assert orbits.stability(found.found).nontrivial[0] == pytest.approx(0.01, abs=1e-10)


def test_a_fold_of_cycles_where_it_is_wanted():
    def make(numbers):  # a fold at -c^2 - 1/4
        return lambda a: cycle(Bautin, a + numbers[0] ** 2, (0.85, 0.0))

    known = make(jnp.array([0.3]))
    first = orbits.find(known(-0.29))
    (fold,) = orbits.continue_family(first, known, -0.29, step=0.05, members=10, down=True).special
    found = design(make, lambda fold: fold.parameter + 0.5, [0.3], fold, lower=[0.0])
    assert found.numbers[0] == pytest.approx(0.5, abs=1e-10)
    assert found.found.parameter == pytest.approx(-0.5, abs=1e-10)
    assert np.hypot(*found.found.orbit.y0) == pytest.approx(np.sqrt(0.5), abs=1e-7)
    held = design(make, lambda fold: fold.parameter + 0.5, [0.3], fold, upper=[0.4], throw=False)
    assert held.outcome == DesignOutcome.LEAST
    assert held.numbers[0] == 0.4


def forced(t, y, p):
    omega, beta = p
    return [y[1], jnp.cos(omega * t) - 0.1 * y[1] - y[0] - beta * y[0] ** 3]


@pytest.mark.slow
def test_no_fold_of_duffings_response_below_two():
    def make(numbers):
        def at(omega):
            numbers_of = jnp.stack([jnp.asarray(omega, float), numbers[0]])
            return jaxdyn.ode(forced, [0.0, 0.0], 2 * jnp.pi / omega, params=numbers_of)

        return at

    start = make(jnp.array([2.0]))
    family = orbits.continue_family(
        orbits.find(start(3.0)), start, 3.0, within=(1.6, 3.0), down=True, step=0.3
    )
    fold = family.special[0]
    found = design(make, lambda fold: jnp.minimum(fold.parameter - 2.0, 0.0), [2.0], fold)
    # By harmonic balance: from the orbit's first harmonic, the fold near it.
    beta = float(found.numbers[0])
    known = Balance(lambda p, x, v: jnp.cos(p) - 0.1 * v - x - beta * x**3, 1, 15)
    orbit = found.found.orbit
    motion = jaxdyn.simulate(orbit.scene, orbit.period, samples=257).ys[:-1, 0]
    c = np.fft.rfft(motion)[1] * 2 / 256
    omega = known.fold(2.0 * 1.001, known.start([[c.real], [-c.imag]]))
    assert omega == pytest.approx(2.0, abs=1e-9)


def upright(t, y, p):
    amplitude, shape = p
    shaken = amplitude * (jnp.cos(t) + shape * jnp.cos(2 * t))
    return [y[1], (0.1 + shaken) * jnp.sin(y[0]) - 0.1 * y[1]]


def drive(numbers):
    return lambda amplitude: jaxdyn.ode(
        upright, [0.0, 0.0], 2 * jnp.pi, params=jnp.stack([amplitude, numbers[0]])
    )


def limits(shape):
    """The amplitudes between which a pendulum stands upright, from M along the drive by SciPy."""

    def trace(amplitude):
        def rate(t, z):
            k = 0.1 + amplitude * (np.cos(t) + shape * np.cos(2 * t))
            return [z[1], k * z[0] - 0.1 * z[1], z[3], k * z[2] - 0.1 * z[3]]

        end = solve_ivp(rate, (0, 2 * np.pi), [1, 0, 0, 1], "DOP853", rtol=1e-12, atol=1e-13)
        return end.y[0, -1] + end.y[3, -1]

    # Multipliers 1 and -1; their product is exp(-0.2 pi).
    product = np.exp(-0.2 * np.pi)
    low = brentq(lambda a: trace(a) - 1 - product, 0.3, 0.6, xtol=1e-14)
    return low, brentq(lambda a: trace(a) + 1 + product, low, 0.9, xtol=1e-14)


@pytest.mark.slow
def test_the_widest_range_of_amplitudes_at_which_a_pendulum_stands_upright():
    start = drive(jnp.array([0.5]))
    rest = orbits.find(start(jnp.asarray(0.6)))
    (low,), (high,) = (
        orbits.continue_family(rest, start, 0.6, within=(0.45, 0.72), down=down).special
        for down in (True, False)
    )
    assert (low.kind, high.kind) == (Kind.BRANCH, Kind.DOUBLING)
    at = limits(0.5)
    assert (low.parameter, high.parameter) == pytest.approx(at, abs=1e-10)

    def less(ends):
        return ends[0].parameter - ends[1].parameter

    best = minimise(drive, less, [0.5], (low, high), lower=[0.0], upper=[2.0])
    assert best.outcome == OptimumOutcome.FOUND
    ends = [end.parameter for end in best.found]
    assert ends == pytest.approx(limits(best.numbers[0]), abs=1e-10)
    exact = minimize_scalar(lambda s: np.subtract(*limits(s)), (1.0, 1.1, 1.3), tol=1e-9)
    assert best.numbers[0] == pytest.approx(exact.x, abs=1e-5)  # as flat as it is there
    assert best.value == pytest.approx(exact.fun, abs=1e-12)
    # A margin that is required, about the amplitude in the middle.
    placed = design(
        drive, lambda ends: ends[1].parameter - ends[0].parameter - 0.2, [0.5], [low, high]
    )
    assert np.ptp(limits(placed.numbers[0])) == pytest.approx(0.2, abs=1e-9)


def test_the_shortest_period_of_a_swinging_rod(swing):
    def rod(numbers):  # about a point at a distance from its middle
        return scenes.oscillator(k=9.81 * numbers[0], m=1 / 12 + numbers[0] ** 2)

    known = orbits.find(rod(jnp.array([0.4])), [1.0, 0.0], 2.0, hold="x")
    best = minimise(rod, lambda orbit: orbit.period, [0.4], known, hold="x")
    assert best.numbers[0] == pytest.approx(1 / np.sqrt(12), abs=1e-7)
    assert "Optimum" in repr(best)
    held = minimise(rod, lambda orbit: orbit.period, [0.4], known, hold="x", lower=[0.35])
    assert held.numbers[0] == 0.35
    assert held.ok
    # The last step that is allowed may be the one that arrives.
    last = minimise(rod, lambda orbit: orbit.period, [0.4], known, hold="x", steps=best.steps)
    assert last.ok
    few = minimise(rod, lambda orbit: orbit.period, [0.4], known, hold="x", steps=1, throw=False)
    assert few.outcome == OptimumOutcome.STEP_LIMIT
    with pytest.raises(orbits.SearchError, match="The search reached its step limit"):
        minimise(rod, lambda orbit: orbit.period, [0.4], known, hold="x", steps=1)

    # A number that is 0 at first, in a unit in which it stays small.
    def moved(numbers):
        return rod(0.4 - 1e9 * numbers)

    small = minimise(moved, lambda orbit: orbit.period, [0.0], known, hold="x")
    assert small.numbers[0] == pytest.approx(1e-9 * (0.4 - 1 / np.sqrt(12)), rel=1e-6)

    short = minimise(
        rod, lambda orbit: orbit.period, [0.4], known, hold="x", seconds=1e-9, throw=False
    )
    assert short.outcome == OptimumOutcome.TIME_LIMIT
    np.testing.assert_array_equal(short.numbers, [0.4])

    # A slope that does not lead to smaller values.
    def wrong(orbit):
        return orbit.period - 2 * jax.lax.stop_gradient(orbit.period)

    lost = minimise(pendulum, wrong, [1.0], swing, hold="theta", throw=False)
    assert lost.outcome == OptimumOutcome.LOST


def sprung_step(t, y, p):
    """A step of the simplest walker with a spring between its legs."""
    del t
    slope, spring = p
    stance, swing, stance_rate, swing_rate = y
    turn = jnp.sin(stance - slope)
    hang = stance_rate**2 - jnp.cos(stance - slope)
    return [stance_rate, swing_rate, turn, turn + hang * jnp.sin(swing) - spring * swing]


def walker(numbers):
    step = jaxdyn.ode(sprung_step, scenes.simplest_walker().y0, 4.0, params=numbers)
    strikes = Exit(HeelStrikes(), "swing", changes_feet, one_sided=False)
    return {"swing": Phase(step, (strikes,))}


def one_step(start, numbers):
    """(angle and rate after a step, duration) from those after the step before, by SciPy."""

    def landed(stance, rate):
        kept = np.cos(2 * stance)
        return [stance, 2 * stance, rate, (1 - kept) * rate]

    def strike(t, y):
        return y[1] - 2 * y[0]

    strike.direction = 1
    path = solve_ivp(
        lambda t, y: np.array(sprung_step(t, y, numbers), float),
        (0.0, 6.0),
        landed(*start),
        "DOP853",
        rtol=1e-12,
        atol=1e-14,
        events=strike,
    )
    ends = zip(path.t_events[0], path.y_events[0], strict=True)
    t, y = next((t, y) for t, y in ends if t > 0.1 and y[0] < 0)
    return np.array([-y[0], np.cos(2 * y[0]) * y[2]]), t


@pytest.mark.slow
def test_the_least_slope_of_a_gait_that_is_stable_enough():
    start = jnp.array([0.003, 1.0])
    gait = orbits.find_hybrid(walker(start), [0.1277, 0.2554, -0.1484, -0.0048])

    def wanted(gait):
        speed = 2 * jnp.sin(gait.y0[0]) / gait.period
        return jnp.stack([speed - 0.1, jnp.abs(gait.multipliers()[0]) - 0.8])

    found = design(walker, wanted, start, gait)

    # The gait, its slope and its spring by SciPy, with multipliers from differences.
    def left(z):
        after, t = one_step(z[:2], z[2:])
        h = 5e-5  # errors 1e-8
        columns = []
        for e in np.eye(2):
            ends = {i: one_step(z[:2] + i * h * e, z[2:])[0] for i in (-2, -1, 1, 2)}
            columns.append((8 * (ends[1] - ends[-1]) - ends[2] + ends[-2]) / (12 * h))
        largest = np.abs(np.linalg.eigvals(np.transpose(columns))).max()
        return [*(after - z[:2]), 2 * np.sin(z[0]) / t - 0.1, largest - 0.8]

    other = fsolve(left, [0.1, -0.13, 0.0017, 1.9], xtol=1e-9)
    assert found.numbers == pytest.approx(other[2:], rel=1e-7)
    assert found.found.y0[0] == pytest.approx(other[0], rel=1e-7)
    assert orbits.stability(found.found).verdict == "stable"
    # At this speed less slope takes a stiffer spring, with which disturbances decay more slowly.
    assert np.linalg.solve(found.slopes, [0.0, 1.0])[0] < 0
    assert len(found.found.path) == 1


class Attraction(jaxdyn.Effect):
    """An attraction m_i m_j / r^(n + 1) of all pairs; n = 1 is gravity."""

    n: jax.Array = eqx.field(converter=jnp.asarray)
    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        i, j = np.triu_indices(len(m), 1)
        between = r[j] - r[i]
        return -jnp.sum(m[i] * m[j] * jnp.sum(between**2, axis=1) ** (-self.n / 2)) / self.n


def eight(numbers):
    """Three bodies, of which the one in the middle at the start has another mass."""

    def at(mass):
        m = jnp.stack([1.0, 1.0, jnp.asarray(mass, float)])
        bodies = FreePoints(m, d=2)
        return jaxdyn.Scene(
            bodies, (Attraction(numbers[0]),), y0=nbody.EIGHT, t1=nbody.EIGHT_PERIOD
        )

    return at


def eight_monodromy(start, period, mass, n):
    """(12, 12) the monodromy matrix of three bodies, by SciPy."""
    m = np.array([1.0, 1.0, mass])

    def rate(t, z):
        r, by_start = z[:6].reshape(3, 2), z[12:].reshape(12, 12)
        a, slope = np.zeros((3, 2)), np.zeros((3, 2, 3, 2))
        for i in range(3):
            for j in {0, 1, 2} - {i}:
                d = r[j] - r[i]
                s = d @ d
                a[i] += m[j] * d * s ** (-n / 2 - 1)
                block = m[j] * s ** (-n / 2 - 1) * (np.eye(2) - (n + 2) * np.outer(d, d) / s)
                slope[i, :, j] += block
                slope[i, :, i] -= block
        change = np.block([[np.zeros((6, 6)), np.eye(6)], [slope.reshape(6, 6), np.zeros((6, 6))]])
        return np.concatenate([z[6:12], a.ravel(), (change @ by_start).ravel()])

    start = np.concatenate([start, np.eye(12).ravel()])
    end = solve_ivp(rate, (0, period), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return end[12:].reshape(12, 12)


@pytest.mark.slow
def test_the_figure_eight_is_stable_for_other_masses_with_another_force():
    hold = orbits.Period(nbody.EIGHT_PERIOD)
    closing = orbits.reversal(point_symmetry([1, 0, 2], (-1, -1), reversing=True))
    newton = eight(jnp.array([1.0]))
    known = orbits.find(newton(1.0), hold=hold, closing=closing)
    family = orbits.continue_family(
        known, newton, 1.0, hold=hold, within=(0.9999, 1.1), members=12, step=1e-3
    )
    # Galan et al. (2002), Phys. Rev. Lett. 88, 241101: stable for |m - 1| of about 1e-5.
    (fold,) = family.special
    assert fold.kind == Kind.FOLD
    assert 1e-5 < fold.parameter - 1.0 < 1e-4
    assert [member.stability.verdict for member in family.members[:4]] == ["stable"] * 4
    assert family.members[-1].stability.verdict == "unstable"
    found = design(
        eight, lambda fold: fold.parameter - 1.0004, [1.0], fold, hold=hold, lower=1.0, upper=1.01
    )
    n, orbit = float(found.numbers[0]), found.found.orbit
    # At the fold two more multipliers are 1 than by the 4 integrals and 4 symmetries.
    m = eight_monodromy(np.asarray(orbit.y0), orbit.period, 1.0004, n)
    off = np.sort(np.abs(np.linalg.eigvals(m) - 1.0))
    assert off[9] < 0.02 < 1.0 < off[10]
    # For equal masses it is stable, and no two of them are 1.
    equal = orbits.find(eight(found.numbers)(1.0), known.y0, hold=hold, closing=closing)
    assert orbits.stability(equal).verdict == "stable"
    m = eight_monodromy(np.asarray(equal.y0), equal.period, 1.0, n)
    assert np.sort(np.abs(np.linalg.eigvals(m) - 1.0))[8] > 0.05


@pytest.mark.slow
def test_a_chain_takes_no_conditions():
    roll = scenes.rimless_wheel()
    found = orbits.find_hybrid(scenes.phases_of(roll), roll.y0)

    def make(numbers):
        return scenes.phases_of(scenes.rimless_wheel(slope=numbers[0]))

    with pytest.raises(ValueError, match="hold: expected none for a chain of legs"):
        design(make, period_of, [0.08], found, hold="theta")
    # omega after a step, 2 cot 2a sqrt(g / l sin a sin slope), for a wanted one
    slope = design(make, lambda gait: gait.y0[1] - 0.4, [0.08], found).numbers[0]
    assert 2 * np.sqrt(np.sin(np.pi / 8) * np.sin(slope)) == pytest.approx(0.4, rel=1e-9)


def test_misuse(swing, hopf):
    with pytest.raises(ValueError, match=r"guess: expected .* For one number write \[10\.0\]\."):
        design(pendulum, period_of, 1.0, swing)
    with pytest.raises(ValueError, match="guess: expected within its bounds"):
        design(pendulum, period_of, [1.0], swing, upper=0.5)
    with pytest.raises(ValueError, match="near: expected an orbit, or a special point of a family"):
        design(pendulum, period_of, [1.0], swing.scene)
    with pytest.raises(ValueError, match="near: expected at least one orbit"):
        design(pendulum, period_of, [1.0], [])
    with pytest.raises(ValueError, match="quantity: expected one number, got 2"):
        minimise(pendulum, lambda orbit: orbit.y0, [1.0], swing, hold="theta")
    with pytest.raises(ValueError, match="wanted: expected a number or numbers"):
        design(pendulum, lambda orbit: jnp.zeros((2, 2)), [1.0], swing, hold="theta")
    with pytest.raises(ValueError, match="wanted: expected finite numbers with derivatives"):
        design(pendulum, lambda orbit: jnp.nan * orbit.period, [1.0], swing, hold="theta")
    with pytest.raises(ValueError, match=r"lower: expected shape \(1,\), got shape \(2,\)"):
        design(pendulum, period_of, [1.0], swing, lower=[0.1, 0.2])


def test_what_is_traced_is_named(swing):
    def least(x):
        return minimise(pendulum, lambda orbit: x * orbit.period, [1.0], swing, hold="theta").value

    def nearest(x):
        return design(pendulum, lambda orbit: orbit.period - x, [1.0], swing).numbers[0]

    def bounded(x):
        return design(pendulum, period_of, [1.0], swing, lower=x).numbers[0]

    for of_x, name in ((least, "quantity"), (nearest, "wanted"), (bounded, "lower")):
        with pytest.raises(ValueError, match=f"{name}: expected numbers, got values traced by"):
            jax.grad(of_x)(0.5)


def test_a_family_without_hold_is_named_where_a_design_fails(swing):
    def unmet(orbit):
        return [orbit.period - 2.0, orbit.period - 2.1]

    free = design(pendulum, unmet, [1.0], swing, throw=False)
    held = design(pendulum, unmet, [1.0], swing, hold="theta", throw=False)
    assert free.outcome == held.outcome == DesignOutcome.LEAST
    assert "come in families, with one for each energy" in free.message
    assert "pass hold=, the name of an entry of the start, or orbits.Energy(E)." in free.message
    assert "families" not in held.message


@pytest.mark.slow
@pytest.mark.parametrize(("power", "outcome"), [(1, "CORNER"), (2, "FOUND")])
def test_a_corner_is_named_where_a_quantity_is_least(swing, power, outcome):
    def off(orbit):
        return jnp.abs(orbit.period - 2.0) ** power

    found = minimise(pendulum, off, [1.0], swing, hold="theta", throw=False)
    assert found.outcome.name == outcome
    assert ("Minimise a smooth one, such as its square" in found.message) == (power == 1)
    # The period is 4 K(sin(1/2)^2) sqrt(l / g).
    exact = 9.81 * (0.5 / ellipk(np.sin(0.5) ** 2)) ** 2
    assert abs(found.numbers[0] - exact) < 1e-8
