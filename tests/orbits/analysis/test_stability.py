"""Multipliers against closed forms, unit ones counted, verdicts that admit what they cannot see."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import odes
import pytest
from helpers import DIFFED, SOLVED, central_difference, gap, kepler

import jaxdyn
import orbits
from jaxdyn import Effect, IntegrationError, Scene, Status
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.simulation import solve
from orbits.analysis.stability import rotation_numbers
from orbits.orbit import Orbit, Outcome


def orbit_of(scene, rtol=1e-13):
    """An orbit known in closed form, without a search."""
    return Orbit(scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, rtol)


class Springs(Effect):
    """The potential (k_x x^2 + k_y y^2) / 2 of one point of mass 1."""

    k: jax.Array
    velocity_dependent: ClassVar[bool] = False

    def potential(self, t, r, m):
        return 0.5 * jnp.sum(self.k * r[0] ** 2)


class Push(Effect):
    """A force c v_y along y, which damps if c < 0."""

    c: jax.Array
    velocity_dependent: ClassVar[bool] = True

    def force(self, t, r, v, m):
        return v * jnp.array([[0.0, 1.0]]) * self.c


def springs(k, y0=(1.0, 0.3, 0.2, 0.5), t1=2 * np.pi):
    return Scene(FreePoints(1.0, d=2), (Springs(jnp.asarray(k)),), y0=y0, t1=t1)


def stuart_landau(a, b, w, c):
    period = 2 * np.pi / (w + a * b)
    start = [np.sqrt(a), 0.0, 0.0]
    return jaxdyn.ode(odes.stuart_landau, start, period, params=(a, b, w, c))


@pytest.mark.parametrize(("c", "verdict"), [(-0.02, "stable"), (0.03, "unstable")])
def test_stuart_landau_has_its_exact_multipliers(c, verdict):
    a, b, w = 0.3, 0.4, 1.1
    scene = stuart_landau(a, b, w, c)
    result = orbits.stability(orbit_of(scene))
    # Radial perturbations decay at -2 a, those along z at c, those along the flow not at all.
    exact = np.sort(np.exp(np.array([-2 * a, c]) * float(scene.t1)))[::-1]
    assert gap(result.nontrivial, exact.astype(complex)) < SOLVED
    assert (np.abs(result.nontrivial - exact) < result.bars).all()
    assert (result.unit, result.reasons) == (1, ("flow",))
    assert result.verdict == verdict
    assert result.symplectic_defect is None
    assert result.determinant_defect is None
    assert result.exponents == (None,)  # two real multipliers, listed as one pair
    assert "indices" not in repr(result)


def test_a_shift_that_changes_nothing_is_found_without_being_declared():
    result = orbits.stability(orbit_of(stuart_landau(0.3, 0.4, 1.1, 0.0)))
    assert (result.unit, result.reasons) == (2, ("flow", "shift of y2"))
    assert result.verdict == "stable"


def test_a_verdict_within_its_bars_is_undecided():
    # exp(c T) is 1 up to less than its bar, and the shift of z no symmetry of the field.
    result = orbits.stability(orbit_of(stuart_landau(0.3, 0.4, 1.1, 1e-11)), rtol=1e-9)
    assert (result.unit, result.verdict) == (1, "undecided")


@pytest.mark.slow
def test_the_product_is_the_exponential_of_the_divergence():
    period, start = odes.VAN_DER_POL, [odes.VAN_DER_POL_X, 0.0]
    scene = jaxdyn.ode(odes.van_der_pol, start, period, params=1.0)
    result = orbits.stability(orbit_of(scene))
    ts = jnp.arange(128.0) * period / 128
    x = solve(scene, period, ts=ts, rtol=1e-14).ys[:, 0]
    # The divergence 1 - x^2 is periodic and smooth: the plain mean is exact to rounding.
    exact = np.exp(np.mean(1 - x * x) * period)
    assert abs(result.nontrivial[0] - exact) < SOLVED
    assert abs(np.linalg.det(result.monodromy) - exact) < SOLVED
    assert result.verdict == "stable"


def test_a_multiplier_below_the_rounding_of_another_follows_from_the_divergence():
    # exp(10 pi) and exp(-4 pi): in doubles the matrix does not hold the second one.
    scene = jaxdyn.ode(odes.askew, odes.ASKEW[:, 0], 2 * np.pi, params=5.0)
    result = orbits.stability(orbit_of(scene))
    large, small = np.exp(10 * np.pi), np.exp(-4 * np.pi)
    assert np.linalg.norm(result.monodromy) * np.finfo(float).eps > 1e3 * small
    assert (np.abs(result.nontrivial - [large, small]) < result.bars).all()
    assert result.bars[1] < 0.1 * small
    assert (result.verdict, result.unit) == ("unstable", 1)


@pytest.mark.parametrize("e", [0.2, 0.6])
def test_all_multipliers_of_a_kepler_ellipse_are_one(e):
    result = orbits.stability(orbit_of(kepler(e)))
    assert result.unit == 8
    assert len(result.nontrivial) == 0
    assert (result.multipliers == 1).all()
    assert result.exponents == ()
    assert result.verdict == "stable"
    assert result.symplectic_defect < SOLVED
    # The eigenvalues themselves show it only to a root of the rounding: why they are split off.
    assert np.abs(np.linalg.eigvals(result.monodromy) - 1).max() > 1e-9


@pytest.mark.slow
def test_the_flow_has_an_integral_where_the_form_is_kept():
    # The scene names neither; or the angular momentum alone, which has its symmetry then.
    def rate(t, y, p):
        r = jnp.sqrt(y[0] ** 2 + y[1] ** 2)
        return [y[2], y[3], -y[0] / r**p, -y[1] / r**p]

    def momentum(t, y, p):
        return y[0] * y[3] - y[1] * y[2]

    def orbit(power, speed, known=()):
        scene = jaxdyn.ode(rate, [1.0, 0.0, 0.0, speed], 6.28, params=power, integrals=dict(known))
        return orbits.stability(orbits.find(scene))

    # Beside a circle r oscillates sqrt(3 - n) times as it turns, with a force of 1 / r^n.
    circle = orbit(2.5, 1.0)
    assert (circle.reasons, circle.verdict) == (("integral of flow", "flow"), "stable")
    assert (circle.unnamed, circle.integrals) == (1, 1)
    assert abs(circle.exponents[0] - abs(np.sqrt(1.5) - 1)) < SOLVED
    ellipse = orbit(3.0, 0.9, {"L": momentum})
    assert set(ellipse.reasons) == {"L", "symmetry of L", "integral of flow", "flow"}
    assert (ellipse.unit, ellipse.verdict) == (4, "stable")


@pytest.mark.slow
def test_a_rate_of_unlike_oscillations_is_stable_by_its_form_alone():
    # The transverse mode of a bond, which it stretches by the square of the amplitude.
    def rate(t, y):
        x, z, u, v = y
        return [u, v, -2 * x + 3 * x * x - 0.3 * z * z, -1.7 * z - 0.6 * x * z]

    scene = jaxdyn.ode(rate, [0.0, 0.0, 0.0, 0.0], 3.0)
    for amplitude in (1e-3, 0.15):
        seeds = orbits.discovery.seeds.modes(scene, scene.y0, amplitude)
        seed = max(seeds, key=lambda seed: seed.period)
        result = orbits.stability(orbits.find(scene, seed.y0, seed.period))
        assert (result.verdict, result.unit) == ("stable", 2)
        assert result.reasons == ("integral of flow", "flow")
        # Beside it the bond oscillates by sqrt(2).
        turns = np.sqrt(2 / 1.7)
        assert abs(result.exponents[0] - abs(turns - round(turns))) < amplitude


@pytest.mark.slow
@pytest.mark.parametrize("c", [1e-8, -1e-8, 1e-10])
def test_hardly_any_damping_is_no_conservative_scene(c):
    def rate(t, y, c):
        return [y[2], y[3], -y[0], -2.0 * y[1] + c * y[3]]

    scene = jaxdyn.ode(rate, [1.0, 0.0, 0.0, 0.0], 2 * np.pi, params=c)
    result = orbits.stability(orbit_of(scene))
    assert result.symplectic_defect is None
    assert result.verdict == ("unstable" if c > 0 else "undecided")
    # The same with canonical coordinates, which damped scenes have as well.
    pushed = springs([1.0, 2.0], [1.0, 0.0, 0.0, 0.0]) + Push(jnp.asarray(c))
    again = orbits.stability(orbit_of(pushed))
    assert (again.verdict == "unstable") == (c > 0)
    assert (np.abs(np.abs(again.nontrivial) - 1) > again.bars).all()


@pytest.mark.slow
@pytest.mark.parametrize("amplitude", [1e-4, 1e-6])
def test_small_orbits_have_bars_that_hold(amplitude):
    # Rates are differences of nearly equal numbers; the multipliers are those of the linear system.
    scene = jaxdyn.scenes.double_pendulum(angles=(0.0, 0.0))
    seeds = orbits.discovery.seeds.modes(scene, scene.y0, amplitude)
    for seed, other in zip(seeds, seeds[::-1], strict=True):
        result = orbits.stability(orbits.find(scene, seed.y0, seed.period))
        exact = np.exp(2j * np.pi * seed.period / other.period)
        wrong = np.abs(result.nontrivial[:, None] - [exact, np.conj(exact)]).min(axis=1)
        assert (wrong < result.bars + 10 * amplitude**2).all()
        assert (result.verdict, result.unit) == ("stable", 2)


@pytest.mark.slow
@pytest.mark.parametrize("amplitude", [1e-3, 1e-5])
def test_small_orbits_about_the_triangle_are_stable(amplitude):
    mu = 0.01215058560962404
    at = {"x": 0.5 - mu, "y": np.sqrt(0.75), "vx": 0.0, "vy": 0.0}
    scene = jaxdyn.scenes.restricted_three_body(mu=mu, **at)
    for seed in orbits.discovery.seeds.modes(scene, scene.y0, amplitude):
        result = orbits.stability(orbits.find(scene, seed.y0, seed.period))
        assert result.verdict == "stable"
        assert (np.abs(np.abs(result.nontrivial) - 1) < result.bars).all()


@pytest.mark.slow
def test_momenta_turn_with_an_orbit_however_little_it_turns():
    # Broucke's A1 turns by 5e-6 in a period: the momenta and shifts have exp(+-5e-6 i).
    x, v = [-0.9892620043, 2.2096177241, -1.2203557197], [1.9169244185, 0.1910268738, -2.1079512924]
    y0 = np.array([x, np.zeros(3), np.zeros(3), v]).reshape(2, 2, 3).transpose(0, 2, 1).ravel()
    scene = jaxdyn.scenes.three_body(y0)
    orbit = orbits.find(scene, y0, 6.283213, closing=orbits.relative())
    result = orbits.stability(orbit)
    assert (result.unit, result.verdict) == (4, "stable")
    assert 1e-6 < abs(orbit.angle) < 1e-5
    turned = result.multipliers[4:8]
    assert np.abs(np.sort(turned.imag) - orbit.angle * np.array([-1, -1, 1, 1])).max() < 1e-10
    assert (result.multipliers[8:] == 1).all()


def test_a_circular_orbit_is_undecided():
    # Turning it and moving along it are one direction, so two multipliers are left; both are 1.
    result = orbits.stability(orbit_of(kepler(0.0)))
    assert result.unit == 6
    assert gap(result.nontrivial, np.ones(2, complex)) < 1e-6
    assert result.verdict == "undecided"


@pytest.mark.slow
def test_an_oscillator_confirms_only_what_is_conserved():
    # Every solution has period 2 pi, so M = 1 fits momenta, shifts and turns as well.
    result = orbits.stability(orbit_of(springs([1.0, 4.0])))
    assert gap(result.monodromy, np.eye(4)) < SOLVED
    assert result.reasons == ("energy", "flow")
    assert result.unit == 2
    assert gap(result.nontrivial, np.ones(2, complex)) < SOLVED
    assert result.verdict == "undecided"


def test_a_round_oscillator_has_its_angular_momentum_too():
    result = orbits.stability(orbit_of(springs([1.0, 1.0])))
    assert set(result.reasons) == {"energy", "angular momentum", "flow", "turn in xy"}
    assert len(result.nontrivial) == 0
    assert result.verdict == "stable"


@pytest.mark.parametrize(
    ("k", "nu", "verdict"),
    [
        (1.3**2, 0.3, "stable"),
        (0.8**2, 0.2, "stable"),
        (1.5**2, 0.5, "undecided"),  # both at -1: they could leave the circle there
        (-0.3, None, "unstable"),
    ],
)
def test_motion_along_one_spring_and_the_other_beside_it(k, nu, verdict):
    # Along x with frequency 1; a perturbation in y turns by 2 pi sqrt(k), or grows.
    result = orbits.stability(orbit_of(springs([1.0, k], y0=[1.0, 0.0, 0.0, 0.0])))
    assert result.unit == 2
    assert result.verdict == verdict
    if nu is None:
        growth = np.exp(2 * np.pi * np.sqrt(-k))
        exact = np.array([growth, 1 / growth])
        assert np.abs(result.nontrivial - exact).max() < SOLVED * growth
        assert result.exponents == (None,)
    else:
        angle = 2 * np.pi * nu
        assert abs(np.sum(result.nontrivial) - 2 * np.cos(angle)) < SOLVED
        if verdict == "stable":
            assert abs(result.exponents[0] - nu) < SOLVED
            assert f"\n  indices      {np.cos(angle):.9f}" in repr(result)
    assert result.symplectic_defect < SOLVED
    assert result.determinant_defect < 1e-9


def test_monodromy_is_the_derivative_of_the_flow():
    scene = kepler(0.1)

    def end(y):
        return solve(scene.starting(y), 1.0, rtol=1e-14).y1

    exact = orbits.monodromy(scene, period=1.0)
    assert gap(exact, central_difference(end, scene.y0)) < DIFFED
    assert gap(exact, orbits.monodromy(kepler(0.0), scene.y0, 1.0)) == 0


def test_a_tolerance_too_loose_shows_in_the_bars_and_the_verdict():
    scene = springs([1.0, 1.01**2], y0=[1.0, 0.0, 0.0, 0.0])
    tight = orbits.stability(orbit_of(scene))
    loose = orbits.stability(orbit_of(scene), rtol=0.03)
    assert tight.verdict == "stable"
    assert loose.verdict == "undecided"
    assert loose.bars.min() > 1e6 * tight.bars.max()
    # The rate keeps the form whatever the tolerance, and the matrix does to its error.
    rough = orbits.stability(orbit_of(scene), rtol=1e-3)
    assert rough.symplectic_defect > 1e-7
    assert (rough.conservative, rough.verdict) == (True, "stable")
    medium = orbits.stability(orbit_of(scene), rtol=1e-7)
    assert medium.verdict == "stable"
    assert abs(medium.nontrivial[0] - tight.nontrivial[0]) < medium.bars[0]


CIRCLE = np.exp(2j * np.pi * np.array([0.1, -0.1, 0.3, -0.3]))


def test_rotation_numbers_come_by_pairs():
    values = np.array([2.0, CIRCLE[2], CIRCLE[3], 0.5, CIRCLE[0], CIRCLE[1]])
    numbers = rotation_numbers(values, np.full(6, 1e-10))
    assert numbers[0] is None
    np.testing.assert_allclose(numbers[1:], [0.1, 0.3], atol=1e-15)
    assert rotation_numbers(np.array([-2.0 + 0j, -0.5]), np.full(2, 1e-10)) == (None,)
    # A quadruple off the circle: two pairs, their angles counted, one of them each.
    quadruple = np.array([1.2, 1.2, 1 / 1.2, 1 / 1.2]) * CIRCLE[[0, 1, 0, 1]]
    np.testing.assert_allclose(rotation_numbers(quadruple, np.full(4, 1e-10)), [0.1, 0.1])


def test_a_motion_that_ends_before_its_period_has_no_multipliers():
    falling = orbit_of(kepler(0.0).starting([-0.5, 0, 0.5, 0, 0, 0, 0, 0]))
    with pytest.raises(IntegrationError, match=r"step size fell below.*Bodies that meet attract"):
        orbits.stability(falling)
    result = orbits.stability(falling, throw=False)
    assert (result.ok, result.status) == (False, Status.STEP_COLLAPSED)
    assert result.message == Status.STEP_COLLAPSED.message
    assert (result.verdict, result.unit, result.exponents) == ("undecided", 0, ())
    for numbers in (result.multipliers, result.nontrivial, result.bars, result.monodromy):
        assert np.isnan(numbers).all()
        assert len(numbers) == 8


@pytest.mark.slow
def test_orbits_of_a_rate_alone_are_stable_about_the_triangle():
    """About L4 of Earth and Moon, whose mass ratio is below Routh's 0.0385."""
    mu = 0.01215058560962404
    start = [0.515 - mu, np.sqrt(0.75) - 0.009, 0.0, -0.001]
    known = {"Jacobi": odes.jacobi}
    slow = orbits.find(jaxdyn.ode(odes.restricted, start, 21.07, params=mu, integrals=known))
    linear = orbits.stability(slow)
    assert linear.verdict == "stable"
    assert linear.symplectic_defect < 1e-12
    # The other pair turns by the fast frequency over the slow one.
    root = np.sqrt(1 - 27 * mu * (1 - mu))
    turns = np.sqrt((1 + root) / (1 - root))
    assert abs(linear.exponents[0] - abs(turns - round(turns))) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [None, 1e-9, 1e-12])
def test_bars_of_an_orbit_by_collocation_hold(rtol):
    # A circle, beside which z grows by exp(c t) over a period, and swings in between.
    def rate(t, y, p):
        x, v, z = y
        s = 1 - x * x - v * v
        return [x * s - v, v * s + x, (p["c"] + 8.0 * x) * z]

    for c in (0.0, 1e-12):
        scene = jaxdyn.ode(rate, [1.0, 0.0, 0.0], 2 * np.pi, params={"c": c})
        orbit = orbits.find(scene, strategy=orbits.Collocation())
        result = orbits.stability(orbit, rtol=rtol)
        exact = np.exp([c * 2 * np.pi, -4 * np.pi])
        wrong = np.abs(np.sort(result.nontrivial.real)[::-1] - exact)
        assert (wrong < result.bars[np.argsort(-result.nontrivial.real)]).all()
        assert result.verdict in (("undecided", "unstable") if c else ("undecided",))


def test_a_motion_that_does_not_close_has_no_verdict():
    scene = jaxdyn.scenes.restricted_three_body(mu=0.3)
    lost = orbits.find(scene, [0.4, 0.0, 0.0, 1.0], 3.0, throw=False, max_iterations=2)
    found = orbits.stability(lost)
    assert not lost.ok
    assert (found.verdict, found.closes) == ("undecided", False)
    assert (found.bars > np.abs(found.multipliers)).all()
    assert found.message.startswith("The motion does not close after the period")
