"""Special points of families: what is found, what is not there, and that it is where it is said."""

import jax.numpy as jnp
import numpy as np
import pytest
from cycles import Bautin, Moebius, Pitchfork, Spiral, Torus, cycle
from helpers import SOLVED
from odes import jacobi, restricted
from scipy.linalg import eigh

import jaxdyn
import orbits
from orbits import Kind

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
    assert {m.stability.reasons for m in family.members} == {("flow", "family")}


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
        assert orbits.closure(fold.orbit) < SOLVED
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


@pytest.mark.slow
def test_halo_orbits_and_their_special_points():
    """The same points whether the scene names its energy or not; each solves its own equation."""
    known = lyapunov(energy=lambda t, y, mu: -0.5 * jacobi(t, y, mu))
    branch_points = []
    for plane in (known, lyapunov()):
        family = orbits.continue_family(plane, members=5, step=0.02)
        (point,) = family.special
        assert point.kind == Kind.BRANCH
        branch_points.append(point.orbit.period)
    assert abs(branch_points[0] - branch_points[1]) < 1e-9
    assert abs(branch_points[0] - 2.7430) < 5e-5

    family = orbits.continue_family(known, members=5, step=0.02)
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
    Kind.FOLD: (Bautin, -0.2, (0.85, 0.0), {"step": 0.05, "members": 14, "down": True}),
    Kind.BRANCH: (Pitchfork, -0.3, (1.0, 0.0, 0.0), {"step": 0.1, "members": 8}),
    Kind.DOUBLING: (Moebius, -0.2, (1.0, 0.0, 0.0, 0.0), {"step": 0.08, "members": 6}),
    Kind.TORUS: (Torus, -0.1, (1.0, 0.0, 0.0, 0.0), {"step": 0.06, "members": 6}),
}
#: What vanishes there, of the non-trivial multipliers.
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
    assert orbits.closure(point.orbit) < 1e-12
    # From a monodromy matrix of the orbit alone, not that of the family.
    multipliers = orbits.stability(point.orbit).nontrivial
    assert abs(CONDITIONS[kind](multipliers)) < 1e-10
    assert abs(point.parameter - (-0.25 if kind == Kind.FOLD else 0.0)) < 1e-10


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
