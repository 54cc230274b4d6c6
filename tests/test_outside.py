"""Orbits from outside the course, which prove that nothing is special-cased."""

import jax
import jax.numpy as jnp
import numpy as np
import odes
import pytest
from closed_forms import HenonHeiles
from helpers import SOLVED, gap
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import jaxdyn
import orbits
from jaxdyn import Scene, scenes
from jaxdyn.analysis import energy
from jaxdyn.formulations.newton import FreePoints
from orbits import Orbit, Outcome
from orbits.files import family_files


def orbit_of(scene):
    return Orbit(scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)


@pytest.mark.slow
def test_the_shortest_orbit_of_lorenz():
    # Two turns, AB; period by D. Viswanath, Physica D 190 (2004) 115.
    guess = [-13.763610682134, -19.578751942452, 27.0]
    orbit = orbits.find(scenes.lorenz(), guess, 1.5586, hold=orbits.Section(2, 27.0))
    assert abs(orbit.period - 1.5586522107161747) < SOLVED
    linear = orbits.stability(orbit)
    assert linear.verdict == "unstable"
    # The product of all multipliers is exp(divergence x period), divergence -(10 + 1 + 8/3).
    product = float(np.prod(linear.multipliers).real)
    assert abs(np.log(abs(product)) + (41 / 3) * orbit.period) < 1e-3  # the small one: 1e-9 of |M|


@pytest.mark.slow
def test_the_straight_mode_of_henon_and_heiles():
    scene = Scene(FreePoints(1.0), (HenonHeiles(),), y0=[0.0, 0.3, 0.0, 0.05], t1=6.4)
    orbit = orbits.find(scene)
    x, y, vx, vy = np.asarray(orbit.y0)
    assert abs(x) + abs(vx) < 1e-14
    level = 0.5 * vy**2 + 0.5 * y**2 - y**3 / 3
    a, b, c = np.sort(np.roots([2 / 3, -1.0, 0.0, 2 * level]).real)
    exact = 4 * np.sqrt(1.5 / (c - a)) * ellipk((b - a) / (c - a))
    assert abs(orbit.period - exact) < 1e-11
    linear = orbits.stability(orbit)
    assert (linear.unit, linear.verdict) == (2, "stable")  # along the flow and the energy


@pytest.mark.slow
def test_a_halo_orbit():
    # K. Howell, Celestial Mechanics 32 (1984) 53, table of the L1 family for mu = 0.04.
    mirror = orbits.Symmetry(None, (1, -1, 1, -1, 1, -1), reversing=True)
    scene = jaxdyn.ode(odes.restricted, [0.723, 0.0, 0.04, 0.0, 0.198, 0.0], 2.6, params=0.04)
    halo = orbits.find(scene, closing=orbits.reversal(mirror), hold=orbits.Section(2, 0.04))
    assert abs(float(halo.y0[0]) - 0.723268) < 1e-6
    assert abs(float(halo.y0[4]) - 0.198019) < 1e-6
    assert abs(halo.period / 2 - 1.300177) < 1e-6
    large = orbits.stability(halo).nontrivial[0].real
    assert abs(0.5 * (large + 1 / large) - 1181.69) < 0.5  # from a start of six digits
    assert halo.residual < SOLVED


@pytest.mark.slow
def test_normal_modes_of_a_double_pendulum_go_on_from_the_linear_ones():
    scene = scenes.double_pendulum()
    modes = orbits.discovery.seeds.modes(scene, jnp.zeros(4), amplitude=0.05)
    slow = max(modes, key=lambda guess: guess.period)
    orbit = orbits.find(scene, slow.y0, slow.period)
    family = orbits.continue_family(orbit, members=4, step=0.1)
    rest = float(energy.energy(scene, jnp.zeros(()), jnp.zeros(4)))
    assert (np.diff(family.energies) > 0).all() or (np.diff(family.energies) < 0).all()
    assert family.energies.max() - rest > 0.05
    assert max(member.orbit.residual for member in family.members) < SOLVED


HUNT = (1.5, 1.0, 1.0, 0.8)


@pytest.fixture(scope="module")
def hunt():
    level = {"level": odes.populations_integral}
    scene = jaxdyn.ode(odes.populations, [2.0, 1.0], 5.5, params=HUNT, integrals=level)
    return orbits.find(scene, hold="y0")


def test_prey_and_predators_return_and_their_integral_counts(hunt):
    start = np.asarray(hunt.y0)

    def passes(t, y):
        return y[0] - start[0]

    passes.direction = np.sign(float(hunt.scene.rate(0.0, hunt.y0)[0]))
    how = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14, "events": passes}
    found = solve_ivp(lambda t, y: np.array(odes.populations(t, y, HUNT)), (0, 6), start, **how)
    assert abs(hunt.period - found.t_events[0][-1]) < 1e-11
    linear = orbits.stability(hunt)
    assert (linear.unit, linear.verdict, linear.reasons) == (2, "stable", ("level", "flow"))
    assert orbits.identify(hunt).energy is None
    assert orbits.report(hunt).energy is None
    # Without its integral nothing says that the second multiplier is 1.
    plain = jaxdyn.ode(odes.populations, hunt.y0, hunt.period, params=HUNT)
    linear = orbits.stability(orbit_of(plain))
    assert (linear.unit, linear.verdict) == (1, "undecided")
    assert abs(linear.nontrivial[0] - 1) < 1e-10


def test_an_integral_counts_where_points_nearby_have_no_value_of_it():
    # With this few prey a tenth of the predators less of them would be below 0: a logarithm of it.
    level = {"level": odes.populations_integral}
    scene = jaxdyn.ode(odes.populations, [0.05, 1.5], 6.6, params=HUNT, integrals=level)
    linear = orbits.stability(orbits.find(scene, hold="y0"))
    assert (linear.unit, linear.reasons) == (2, ("level", "flow"))


def test_a_family_without_parameter_or_energy_is_followed(hunt):
    family = orbits.continue_family(hunt, members=3)
    assert (np.diff(family.periods) > 0).all()
    assert np.isnan(family.energies).all()
    with pytest.raises(ValueError, match="energies: expected none for a scene without an energy"):
        orbits.continue_family(hunt, energies=(0.0, 1.0))
    with pytest.raises(ValueError, match="one with an energy, got Ode"):
        orbits.find(hunt.scene, hold=orbits.Energy(2.0))
    with pytest.raises(ValueError, match="listed: expected a family with a parameter or an energy"):
        orbits.drawing.family(family_files.listing(family))


def test_an_energy_that_is_given_picks_a_member():
    scene = jaxdyn.ode(
        odes.populations, [2.0, 1.0], 5.5, params=HUNT, energy=odes.populations_integral
    )
    orbit = orbits.find(scene, hold=orbits.Energy(2.5))
    level = float(odes.populations_integral(0.0, orbit.y0, HUNT))
    assert abs(level - 2.5) < SOLVED
    known = orbits.identify(orbit).energy
    assert known is not None
    assert abs(known - 2.5) < SOLVED


def _variational(t, state, mu):
    """The restricted problem in the plane and its variational equations, by hand."""
    y, m = state[:4], state[4:].reshape(4, 4)
    (x, z, u, w), a = y, np.zeros((4, 4))
    rate = np.array([u, w, x + 2 * w, z - 2 * u])
    a[:2, 2:], a[2:, 2:] = np.eye(2), [[0, 2], [-2, 0]]
    a[2:, :2] = np.eye(2)
    for weight, middle in ((1 - mu, -mu), (mu, 1 - mu)):
        d = np.array([x - middle, z])
        r = np.hypot(*d)
        rate[2:] -= weight * d / r**3
        a[2:, :2] -= weight * (np.eye(2) / r**3 - 3 * np.outer(d, d) / r**5)
    return np.concatenate([rate, (a @ m).ravel()])


@pytest.mark.slow
def test_the_restricted_problem_has_the_unit_multipliers_of_jacobis_integral():
    mu, x = 0.1, 0.2
    start, period = [x, 0.0, 0.0, 1.4377], 1.3184
    integrals = {"Jacobi": odes.jacobi}
    scene = jaxdyn.ode(odes.restricted, start, period, params=mu, integrals=integrals)
    orbit = orbits.find(scene, hold="y0")
    linear = orbits.stability(orbit)
    assert (linear.unit, linear.reasons) == (2, ("Jacobi", "flow"))
    first = np.concatenate([np.asarray(orbit.y0), np.eye(4).ravel()])
    how = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13}
    end = solve_ivp(_variational, (0, orbit.period), first, args=(mu,), **how).y[:, -1]
    assert gap(end[:4], first[:4]) < 1e-10
    assert gap(linear.monodromy, end[4:].reshape(4, 4)) < 1e-8
    values = np.linalg.eigvals(end[4:].reshape(4, 4))
    values = np.sort_complex(values[np.argsort(np.abs(values - 1))[2:]])
    assert gap(np.sort_complex(linear.nontrivial), values) < 1e-9
    # On the unit circle, and the symplectic form of a rotating frame holds them there.
    assert linear.verdict == "stable"
    q0, v0 = np.split(np.asarray(orbit.y0), 2)
    same = jaxdyn.lagrangian(odes.restricted_lagrangian, q0, v0, orbit.period, params=mu)
    linear = orbits.stability(orbit_of(same))
    assert (linear.unit, linear.reasons) == (2, ("energy", "flow"))
    assert linear.verdict == "stable"
    assert linear.symplectic_defect is not None
    assert linear.symplectic_defect < SOLVED
    assert gap(np.sort_complex(linear.nontrivial), values) < 1e-9


#: Coefficients of mu^0, mu^2 and so on in the frequency of van der Pol's cycle: C. Andersen and
#: J. Geer, SIAM J. Appl. Math. 42 (1982) 678.
SLOW_CYCLE = (1.0, -1 / 16, 17 / 3072, 35 / 884736, -678899 / 5096079360)


def _slow_cycle(mu):
    """Its period, to an error of some 1e-3 mu^10."""
    return 2 * np.pi / np.polynomial.Polynomial(SLOW_CYCLE)(mu * mu)


@pytest.mark.slow
def test_van_der_pols_cycles_are_followed_and_differentiated():
    def make(mu):
        return jaxdyn.ode(odes.van_der_pol, [2.0, 0.0], 6.3, params=mu)

    orbit = orbits.find(make(0.1))
    family = orbits.continue_family(orbit, make, 0.1, members=4, step=0.03)
    for mu, period in zip(family.parameters, family.periods, strict=True):
        assert abs(period - _slow_cycle(mu)) < max(1e-3 * mu**10, SOLVED)
    assert np.diff(family.parameters).min() > 0.01

    def period(mu):
        return orbits.differentiable(make(mu).starting(orbit.y0, orbit.period), orbit).period

    frequency = np.polynomial.Polynomial(SLOW_CYCLE)
    slope = -2 * np.pi * frequency.deriv()(0.01) * 0.2 / frequency(0.01) ** 2
    assert abs(float(jax.grad(period)(0.1)) - slope) < 1e-11
    assert orbits.same_orbit(orbit, family.members[0].orbit)
    assert orbits.recheck(orbit).closure < SOLVED
    figure = orbits.drawing.orbits([orbit])
    assert figure.axes[0].get_xlabel() == "y0"
