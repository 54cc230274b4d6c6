"""Special points of families: what is found, what is not there, and that it is where it is said."""

import jax.numpy as jnp
import numpy as np
import pytest
from cycles import Bautin, Moebius, Pitchfork, Spiral, Torus, cycle
from helpers import SOLVED
from odes import jacobi, restricted
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq

import jaxdyn
import orbits
from orbits import Kind, Outcome
from orbits.families import steps

#: Share of the Moon in the mass of Earth and Moon, and about the place of their point L1.
EARTH_MOON, L1 = 0.01215058560962404, 0.8369151258197125


def swing(t, y):
    """A pendulum, whose energy is not named."""
    return [y[1], -jnp.sin(y[0])]


def shaken(t, y, p):
    """A damped oscillator with a sinusoidal force."""
    return [y[1], jnp.cos(p["rate"] * t) - 0.2 * y[1] - y[0] - p["cubic"] * y[0] ** 3]


def at_drive(rate, cubic=0.0):
    params = {"rate": rate, "cubic": cubic}
    return jaxdyn.ode(shaken, [1.0, 0.0], 2 * jnp.pi / rate, params=params)


def lyapunov(**integrals):
    """A small orbit of the Earth and the Moon's L1, with what the scene says to be conserved."""
    start = np.array([L1 - 0.003, 0.0, 0.0, 0.0, 0.02509, 0.0])
    scene = jaxdyn.ode(restricted, start, 2.6915, params=EARTH_MOON, **integrals)
    return orbits.find(scene, hold="y0")


def test_an_integral_that_the_scene_does_not_name_forces_a_unit_multiplier():
    family = orbits.continue_family(orbits.find(jaxdyn.ode(swing, [1.0, 0.0], 6.7)), members=6)
    assert family.special == ()
    assert {m.stability.unit for m in family.members} == {2}
    reasons = {m.stability.reasons for m in family.members}
    assert reasons == {("integral of flow", "flow", "family")}


@pytest.mark.slow
def test_the_period_follows_the_drive():
    make = at_drive
    family = orbits.continue_family(orbits.find(make(0.5)), make, 0.5, step=0.5, members=16)
    rates = family.parameters
    assert rates.max() - rates.min() > 0.3
    assert np.abs(family.periods * rates / (2 * np.pi) - 1).max() < 1e-14
    exact = 1 / (1 - rates**2 + 0.2j * rates)
    y0 = np.array([m.orbit.y0 for m in family.members])
    assert np.abs(y0[:, 0] - exact.real).max() < SOLVED
    assert np.abs(y0[:, 1] - (1j * rates * exact).real).max() < SOLVED


@pytest.mark.slow
def test_folds_of_a_resonance():
    def make(rate):
        return at_drive(rate, cubic=0.05)

    family = orbits.continue_family(
        orbits.find(make(0.5)), make, 0.5, step=0.1, members=200, within=(0.4, 2.5)
    )
    folds = family.special
    assert [x.kind for x in folds] == [Kind.FOLD, Kind.FOLD]
    for fold in folds:
        assert abs(fold.stability.nontrivial - 1).min() < 1e-7
        assert orbits.analysis.closure(fold.orbit) < SOLVED
    assert folds[1].parameter < folds[0].parameter < 2.5


@pytest.mark.slow
def test_multipliers_that_meet_off_the_circle_are_nothing_special():
    def make(a):
        return cycle(Spiral, a, [1.0, 0.0, 0.0, 0.0])

    family = orbits.continue_family(orbits.find(make(-0.05)), make, -0.05, within=(-0.06, 0.05))
    assert family.parameters[0] < 0 < family.parameters[-1]
    assert family.special == ()


@pytest.mark.slow
def test_a_family_ends_at_a_equilibrium():
    def oscillator(t, y, mu):
        return [y[1], (mu - y[0] ** 2) * y[1] - y[0]]

    def make(mu):
        return jaxdyn.ode(oscillator, [0.2, 0.0], 6.3, params=mu)

    family = orbits.continue_family(orbits.find(make(0.01)), make, 0.01, step=0.02, down=True)
    assert family.end == "an equilibrium, to which the orbits shrink"
    (hopf,) = family.special
    assert hopf.kind == Kind.REST
    assert abs(hopf.parameter) < 1e-10
    assert abs(hopf.orbit.period - 2 * np.pi) < 1e-10


def quartic(t, y):
    return [y[1], y[0] - y[0] ** 3]


def predators(t, y):
    return [y[0] * (1 - y[1]), y[1] * (y[0] - 1)]


def slow_about_the_triangle():
    """For Earth and Moon the scene, a guess, a step, the equilibrium, and the period there."""
    mu, rest = EARTH_MOON, np.array([0.5 - EARTH_MOON, np.sqrt(0.75), 0, 0])
    # s^4 + s^2 + 27/4 mu (1 - mu) = 0
    square = (1 - np.sqrt(1 - 27 * mu * (1 - mu))) / 2
    scene = jaxdyn.ode(restricted, rest + np.array([0.015, -0.009, 0, -0.001]), 21.0, params=mu)
    return scene, 21.07, 0.01, rest, 2 * np.pi / np.sqrt(square)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "period", "step", "rest", "exact"),
    [
        (jaxdyn.scenes.pendulum(angle=1.0), 2.2, 0.2, [0, 0], 2 * np.pi / np.sqrt(9.81)),
        (jaxdyn.ode(quartic, [1.2, 0.0], 1.0), 4.5, 0.1, [1, 0], np.pi * np.sqrt(2)),
        (jaxdyn.ode(predators, [1.5, 1.0], 1.0), 6.5, 0.05, [1, 1], 2 * np.pi),
        slow_about_the_triangle(),
    ],
)
def test_swings_shrink_to_the_equilibrium_wherever_they_start(scene, period, step, rest, exact):
    """Starts move across the flow, and pass beside the equilibrium."""
    first = orbits.find(scene, period=period, hold=scene.labels()[0][0])
    family = orbits.continue_family(first, step=step, members=20, down=True)
    assert family.end == "an equilibrium, to which the orbits shrink"
    (point,) = family.special
    assert point.kind == Kind.REST
    assert np.abs(np.asarray(point.orbit.y0) - rest).max() < 1e-4
    assert len(family.members) > 1
    # Rounding of a state, 1 away from the origin at L4, over the radius and the speed.
    assert abs(point.orbit.period / exact - 1) < 2e-8


@pytest.mark.slow
def test_orbits_that_come_near_a_saddle_do_not_shrink_to_it():
    scene = jaxdyn.ode(quartic, [0.01, 0.0], 12.7)
    family = orbits.continue_family(orbits.find(scene, hold="y0"), members=20)
    assert family.special == ()
    assert len(family.members) == 20
    assert family.periods[-1] > 24.0


def spring(t, y):
    """A mass on a spring of stiffness 10 and length 1 that swings in a plane."""
    pull = 10 * (1 - 1 / jnp.sqrt(y[0] ** 2 + y[1] ** 2))
    return [y[2], y[3], -pull * y[0], -pull * y[1] - 1.0]


def spring_energy(t, y):
    stretch = jnp.sqrt(y[0] ** 2 + y[1] ** 2) - 1
    return 0.5 * (y[2] ** 2 + y[3] ** 2) + 5 * stretch**2 + y[1]


@pytest.mark.slow
def test_branch_points_have_a_multiplier_of_1_where_newtons_method_is_slow():
    still = orbits.reversal(orbits.Symmetry(signs=(1, 1, -1, -1), reversing=True))
    scene = jaxdyn.ode(spring, [0.3, -1.06, 0.0, 0.0], 6.6, energy=spring_energy)
    first = orbits.find(scene, closing=still, hold="y0")
    family = orbits.continue_family(first, members=90, step=0.03, energies=(-1.1, 8.0))
    assert [point.kind for point in family.special] == [Kind.BRANCH] * 2

    def varied(t, z):
        (x, y, vx, vy), m = z[:4], z[4:].reshape(4, 4)
        r = np.hypot(x, y)
        slopes = np.eye(2) * (1 - 1 / r) + np.outer([x, y], [x, y]) / r**3
        slope = np.block([[np.zeros((2, 2)), np.eye(2)], [-10 * slopes, np.zeros((2, 2))]])
        pull = 10 * (1 - 1 / r)
        return np.concatenate([[vx, vy, -pull * x, -pull * y - 1], (slope @ m).ravel()])

    for point in family.special:
        # All four multipliers are 1, by another integrator: a pair 1 +- d has a sum of 2 + d^2.
        start = np.concatenate([point.orbit.y0, np.eye(4).ravel()])
        end = solve_ivp(varied, (0, point.orbit.period), start, "DOP853", rtol=1e-12, atol=1e-12)
        assert abs(np.trace(end.y[4:, -1].reshape(4, 4)) - 4) < 1e-6


@pytest.mark.slow
def test_halo_orbits_and_their_special_points():
    """The same points whether the scene names its energy or not; each solves its own equation."""
    known = lyapunov(energy=lambda t, y, mu: -0.5 * jacobi(t, y, mu))
    branch_points = []
    for plane in (known, lyapunov()):
        family = orbits.continue_family(plane, members=9, step=0.02)
        (point,) = family.special
        assert point.kind == Kind.BRANCH
        branch_points.append(point.orbit.period)
    assert abs(branch_points[0] - branch_points[1]) < 1e-9
    assert abs(branch_points[0] - 2.7430) < 5e-5

    family = orbits.continue_family(known, members=9, step=0.02)
    halo, _ = orbits.switch_branch(family, family.special[0], amplitude=0.05)
    family = orbits.continue_family(halo, members=100, step=0.03, energies=(-2.0, -1.468))
    kinds = [x.kind for x in family.special]
    assert kinds.count(Kind.FOLD) == 2
    assert kinds.count(Kind.KREIN) == 1
    assert Kind.TORUS not in kinds
    for x in family.special:
        a, b = broucke(x.stability.nontrivial)
        if x.kind in (Kind.FOLD, Kind.BRANCH):
            assert abs(b + 2 * a + 2) < 1e-6 * abs(a)
        if x.kind == Kind.DOUBLING:
            assert abs(b - 2 * a + 2) < 1e-6 * abs(a)
        if x.kind == Kind.KREIN:
            assert abs(a * a - 4 * b + 8) < 1e-6


def broucke(multipliers):
    """Coefficients of z^4 + a z^3 + b z^2 + a z + 1, whose roots are two pairs of multipliers."""
    coefficients = np.poly(multipliers).real
    return coefficients[1], coefficients[2]


#: Cycles with a special point at a = -1/4, 0, 0, 0, and the way to it.
SPECIAL = {
    Kind.FOLD: (Bautin, -0.2, (0.85, 0.0), {"step": 0.05, "members": 10, "down": True}),
    Kind.BRANCH: (Pitchfork, -0.3, (1.0, 0.0, 0.0), {"step": 0.1, "members": 8}),
    Kind.DOUBLING: (Moebius, -0.2, (1.0, 0.0, 0.0, 0.0), {"step": 0.08, "members": 6}),
    Kind.TORUS: (Torus, -0.1, (1.0, 0.0, 0.0, 0.0), {"step": 0.06, "members": 6}),
}
#: The functions of the non-trivial multipliers that vanish there.
CONDITIONS = {
    Kind.FOLD: lambda z: np.prod(z - 1),
    Kind.BRANCH: lambda z: np.prod(z - 1),
    Kind.DOUBLING: lambda z: np.prod(z + 1),
    # One pair is on the circle, where the product of two is 1.
    Kind.TORUS: lambda z: z[np.argmax(z.imag)] * z[np.argmin(z.imag)] - 1,
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", SPECIAL)
def test_special_points_solve_the_equation_of_their_kind(kind):
    system, a, start, options = SPECIAL[kind]

    def make(a):
        return cycle(system, a, start)

    family = orbits.continue_family(orbits.find(make(a)), make, a, **options)
    (point,) = family.special
    assert point.kind == kind
    assert orbits.analysis.closure(point.orbit) < 1e-12
    # From a monodromy matrix of the orbit alone, not that of the family.
    multipliers = orbits.stability(point.orbit).nontrivial
    assert abs(CONDITIONS[kind](multipliers)) < 1e-10
    assert abs(point.parameter - (-0.25 if kind == Kind.FOLD else 0.0)) < 1e-10


@pytest.mark.slow
def test_a_point_is_located_where_only_short_steps_succeed(monkeypatch):
    # As near a collision, where Newton's method has to begin nearby.
    towards, whole = steps.OrbitChart._towards, []

    def timid(chart, a, b, share):
        length = abs(a.point.along(a.tangent, b.point.x))
        whole.append(length)
        return None if share * length > 0.2 * whole[0] else towards(chart, a, b, share)

    monkeypatch.setattr(steps.OrbitChart, "_towards", timid)
    system, a, start, options = SPECIAL[Kind.DOUBLING]

    def make(a):
        return cycle(system, a, start)

    (point,) = orbits.continue_family(orbits.find(make(a)), make, a, **options).special
    assert point.kind == Kind.DOUBLING
    assert abs(point.parameter) < 1e-10


@pytest.mark.slow
def test_small_swings_of_a_double_pendulum_are_its_normal_modes():
    # Two uniform bars of mass, length and gravity 1: 4/3, 1/2, 1/3 are their moments about hinges.
    squares, shapes = eigh(np.diag([1.5, 0.5]), [[4 / 3, 0.5], [0.5, 1 / 3]])
    for square, shape in zip(squares, shapes.T, strict=True):
        periods = []
        for size in (0.01, 0.02):
            start = [*(size * shape / np.abs(shape).max()), 0.0, 0.0]
            scene = jaxdyn.scenes.double_pendulum().starting(start)
            swing = orbits.find(scene, period=2 * np.pi / np.sqrt(square), hold="theta1")
            assert orbits.stability(swing).verdict == "stable"
            assert abs(swing.y0[1] / swing.y0[0] * shape[0] / shape[1] - 1) < size
            periods.append(swing.period)
        # The period is even in the size of a swing.
        limit = (4 * periods[0] - periods[1]) / 3
        assert abs(limit * np.sqrt(square) / (2 * np.pi) - 1) < 1e-6


@pytest.mark.slow
def test_noise_near_a_homoclinic_orbit_is_no_special_point():
    """The cycles of Lorenz that end there (13.9265574) with multipliers beyond all digits."""
    scene = jaxdyn.scenes.lorenz(rho=24.0)
    cycle = orbits.find(scene, [9.83, 9.83, 23.0], 0.67, hold="z")
    family = orbits.continue_family(
        cycle,
        lambda rho: jaxdyn.scenes.lorenz(rho=rho),
        24.0,
        step=1.0,
        members=30,
        down=True,
        segments=16,
    )
    last = family.members[-1]
    assert abs(last.parameter - 13.926557407) < 1e-8
    assert (last.stability.bars > np.abs(last.stability.nontrivial)).any()
    assert (last.stability.verdict, last.orbit.outcome) == ("undecided", Outcome.UNDETERMINED)
    assert not orbits.recheck(last.orbit).closure < 1e-2
    assert family.special == ()
    # A cycle that passes the origin for longer has multipliers that are larger by exp(4.466 T),
    # with the eigenvalues of the origin (Shilnikov): far beyond what one run over a period holds.
    long = [member for member in family.members if 7 < member.orbit.period < 12]
    assert len(long) >= 3
    rate = (np.sqrt(121 + 40 * (last.parameter - 1)) - 11) / 2 - 8 / 3
    for member in long:
        known = member.stability
        assert known.verdict == "unstable"
        assert known.bars[0] < 0.01 * known.nontrivial[0].real
    heights = np.log([member.stability.nontrivial[0].real for member in long])
    periods = [member.orbit.period for member in long]
    np.testing.assert_allclose(np.diff(heights) / np.diff(periods), rate, rtol=3e-3)
    assert heights[-1] > np.log(1e13)
    # The same from an orbit alone, as long as that determines its segments; then no number.
    last = [member for member in family.members if member.orbit.ok][-1]
    alone, known = orbits.stability(last.orbit), last.stability
    assert (alone.verdict, known.verdict) == ("unstable", "unstable")
    assert alone.nontrivial[0].real > 1e5
    assert abs(alone.nontrivial[0] - known.nontrivial[0]) <= alone.bars[0] + known.bars[0]
    assert orbits.stability(long[-1].orbit).verdict == "undecided"


def two_shaken(square, ratio):
    """Two damped pendula on a pivot that is shaken up and down, the second one harder."""

    def rate(t, y, q):
        def pull(angle, q):
            return (square - 2 * q * jnp.cos(2 * t)) * jnp.sin(angle)

        first = [y[1], -0.1 * y[1] - pull(y[0], q)]
        return [*first, y[3], -0.1 * y[3] - pull(y[2], ratio * q)]

    return lambda q: jaxdyn.ode(rate, jnp.zeros(4), jnp.pi, params=q)


def largest_multiplier(square, q):
    """Of Mathieu's equation with damping, by SciPy."""

    def rate(t, y):
        return [y[1], -0.1 * y[1] - (square - 2 * q * np.cos(2 * t)) * y[0]]

    span, fine = (0, np.pi), {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
    columns = [solve_ivp(rate, span, start, **fine).y[:, -1] for start in np.eye(2)]
    return np.abs(np.linalg.eigvals(np.array(columns))).max()


@pytest.mark.parametrize(
    ("square", "kind", "ratio"),
    [(1.0, Kind.DOUBLING, 1.01), (1.0, Kind.DOUBLING, 1.0), (4.0, Kind.BRANCH, 1.1)],
    ids=["doublings", "one doubling of both", "branch points"],
)
def test_two_multipliers_may_leave_through_the_same_point_in_one_step(square, kind, ratio):
    make = two_shaken(square, ratio)
    rest = orbits.find(make(0.01), jnp.zeros(4), jnp.pi)
    family = orbits.continue_family(rest, make, 0.01, within=(0.0, 2.0 if square > 1 else 0.3))
    unstable = brentq(lambda q: largest_multiplier(square, q) - 1, 0.01, 1.5, xtol=1e-13)
    wanted = sorted({unstable, unstable / ratio})
    assert [x.kind for x in family.special] == [kind] * len(wanted)
    assert np.abs([x.parameter for x in family.special] - np.array(wanted)).max() < 1e-10


@pytest.mark.parametrize(
    ("first", "down"), [(0.4, True), (-0.4, False)], ids=["inwards", "outwards"]
)
def test_a_pair_may_cross_the_circle_far_within_a_step(first, down):
    make = lambda a: cycle(Torus, a, jnp.array([1.0, 0.0, 0.0, 0.0]))  # noqa: E731
    orbit = orbits.find(make(first))
    family = orbits.continue_family(orbit, make, first, down=down, step=1.0, members=12)
    # Those at the circle decide the kind: a pair of 12 is no quadruple with what it comes near.
    assert [x.kind for x in family.special] == [Kind.TORUS]
    assert abs(family.special[0].parameter) < 1e-10


def neuron(t, y, current):
    """FitzHugh and Nagumo's neuron; (v, w, I) -> (-v, -w + 7/4, 7/4 - I) leaves it as it is."""
    v, w = y
    return [v - v**3 / 3 - w + current, 0.08 * (v + 0.7 - 0.8 * w)]


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_a_family_passes_two_canard_explosions_from_either_end(number):
    # Orbits of two kinds nearly coincide there, and the parameter is constant to 1e-10.
    def make(current):
        return jaxdyn.ode(neuron, [-1.2, -0.6], 100.0, names=["v", "w"], params=current)

    rests = jaxdyn.continue_equilibria(make, 0.0, [-1.2, -0.62], within=(0.0, 2.0))
    begin, end = np.roll([x for x in rests.special if x.kind == Kind.HOPF], -number)
    first, current = orbits.from_hopf(rests, begin)
    family = orbits.continue_family(first, make, current, members=150)
    assert [x.kind for x in family.special] == [Kind.FOLD, Kind.FOLD, Kind.REST]
    near, far, last = (x.parameter for x in family.special)
    assert abs(near + far - 1.75) < SOLVED
    assert abs(min(near, far) - 0.3241785225037) < SOLVED
    assert abs(last - end.parameter) < 1e-6
    assert {len(m.stability.nontrivial) for m in family.members} == {1}
