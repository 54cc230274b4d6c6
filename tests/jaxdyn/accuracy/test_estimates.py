"""Estimates of errors against the errors themselves, where motions are known in closed form."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import squeezer
from calibrated import assert_calibrated, calibration, quotient
from closed_forms import known
from helpers import kepler

from jaxdyn import accuracy, scenes, simulate, solvers
from jaxdyn.effects import DryFriction

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15)
KNOWN = known()
THROW = {"cannonball, drag": KNOWN["cannonball, drag"]}
DAMPED = {"damped oscillator": KNOWN["damped oscillator"]}
_MORE = (
    "ellipse 0.9",
    "flipping body",
    "two masses",
    "pushed rod",
    "straight line",
    "limit cycle",
)
SOME = DAMPED | {name: KNOWN[name] for name in _MORE}
TSIT5 = solvers.from_diffrax(diffrax.Tsit5())


@pytest.mark.slow
def test_estimates_are_errors_in_all_scenes_with_closed_forms():
    assert_calibrated(calibration(accuracy.estimate, KNOWN, TOLERANCES))


@pytest.mark.long
@pytest.mark.parametrize("solver", [solvers.DOPRI8, TSIT5], ids=lambda s: s.name)
def test_estimates_are_errors_of_other_solvers_too(solver):
    tolerances = TOLERANCES[:-2]
    assert_calibrated(calibration(accuracy.estimate, SOME | THROW, tolerances, solver=solver))


@pytest.mark.slow
def test_a_second_method_says_the_same():
    assert_calibrated(calibration(accuracy.by_second_method, DAMPED, TOLERANCES[:-1]))
    assert_calibrated(calibration(accuracy.by_second_method, SOME, TOLERANCES))
    # Its series is more accurate than the pair at a thousandth of a loose tolerance.
    assert (calibration(accuracy.by_second_method, THROW, TOLERANCES[:3]) > 1).all()
    assert_calibrated(calibration(accuracy.by_second_method, THROW, TOLERANCES[3:]))


def test_a_second_method_is_another_one():
    case = KNOWN["damped oscillator"]
    assert_calibrated(calibration(accuracy.by_second_method, DAMPED, TOLERANCES[2:3]))
    with pytest.raises(ValueError, match="second: expected another solver, got Verner"):
        accuracy.by_second_method(case.scene, solver=solvers.VERNER9, second=solvers.VERNER9)


def test_a_motion_that_friction_stops_has_an_estimate():
    """Two half swings, about -c and c, and rest: rounding is perturbed in each branch."""
    c = 0.25
    scene = scenes.oscillator(k=4.0, m=1.0) + DryFriction(mu=0.1, normal=40.0 * c)
    found = accuracy.estimate(scene, 4.0)
    t = np.minimum(found.ts, np.pi)
    centre = np.where(t < np.pi / 2, c, -c)
    x = centre + np.where(t < np.pi / 2, 1 - c, 1 - 3 * c) * np.cos(2 * t)
    true = np.abs(found.ys[:, 0] - x)
    assert (true <= 10 * found.error[:, 0] + 1e-13).all()
    assert found.error.max() < 1e-10


@pytest.mark.sample("1e-08")
@pytest.mark.parametrize("rtol", [1e-4, 1e-8, 1e-12])
def test_the_tangent_map_gives_a_bound(rtol):
    quotients = calibration(accuracy.by_tangents, DAMPED, (rtol,))
    assert quotients.min() > 0.9  # first order in the errors
    assert quotients.max() < 20


@pytest.mark.sample("verlet")
@pytest.mark.parametrize(
    ("solver", "dt"), [(solvers.VERLET, 0.01), (solvers.KAHAN_LI8, 0.2)], ids=["verlet", "kahan-li"]
)
def test_halved_steps_tell_the_error_of_symplectic_solvers(solver, dt):
    case = KNOWN["oscillator"]
    found = accuracy.estimate(case.scene, case.t1, samples=5, solver=solver, dt=dt)
    assert 0.5 < quotient(case, found) < 2
    assert f"order {solver.order}" in found.basis


@pytest.mark.sample("euler")
@pytest.mark.parametrize(("method", "n"), [(solvers.EULER, 2000), (TSIT5, 100)], ids=["euler", "5"])
def test_problem_3_d_halved_steps_tell_the_error(method, n):
    case = KNOWN["damped oscillator"]
    found = accuracy.by_halving(case.scene, case.t1, steps=n, method=method)
    assert 0.5 < quotient(case, found) < 2
    assert float(found.basis.split()[3]) == pytest.approx(method.order, abs=0.2)
    assert found.fineness[0] == case.t1 / n


def test_an_estimate_says_what_it_rests_on():
    found = accuracy.estimate(scenes.oscillator(), rtol=1e-6)
    assert found.basis.startswith("tolerance ladder: Taylor 16 at 1.0e-06 against Taylor 20")
    assert found.digits == pytest.approx(-np.log10(found.relative))
    assert found.until(found.digits - 0.1) == 10.0
    assert np.isnan(found.until(30))
    unknown = eqx.tree_at(lambda e: e.error, found, np.full_like(found.error, np.nan))
    assert np.isnan(unknown.until(1))
    assert found.error.shape == found.ys.shape == (33, 2)


# ---- a requested number of digits


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "digits"), [("flipping body", 4), ("flipping body", 9), ("ellipse 0.9", 12)]
)
def test_digits_are_delivered(name, digits):
    case = KNOWN[name]
    motion = simulate(case.scene, case.t1, samples=8, digits=digits)
    assert motion.error.digits >= digits
    assert motion.warning == ""
    missed = np.abs(np.asarray(motion.ys)[:, case.entries] - case.exact(np.asarray(motion.ts)))
    assert missed.max() < 10.0**-digits


@pytest.mark.slow
def test_digits_of_a_mechanism_are_delivered():
    motion = simulate(squeezer.scene(), squeezer.T1, samples=2, digits=12)
    missed = np.abs(np.asarray(motion.ys[-1]) - squeezer.END) / motion.error.scale
    assert motion.error.digits >= 12
    assert motion.error.relative / 5 < missed.max() < 5 * motion.error.relative
    # What is printed with the problem is the state 1.0e-12 s later.
    late = (np.array(squeezer.PRINTED) - squeezer.END[:3]) / squeezer.END[7:10]
    assert np.ptp(late) < 1e-16
    assert 1.00e-12 < late[0] < 1.01e-12


@pytest.mark.long
def test_the_reference_of_the_mechanism_is_that_of_extrapolation():
    found = squeezer.extrapolated(150)
    assert np.abs((found - squeezer.END) / np.repeat(squeezer.END[[1, 8]], 7)).max() < 1e-15


def test_a_small_motion_gets_its_digits_too():
    motion = simulate(scenes.oscillator(x=1e-7), samples=7, digits=10)
    assert np.abs(motion["x"] - 1e-7 * np.cos(motion.ts)).max() < 1e-17


@pytest.mark.slow
def test_chaos_is_said_with_how_long_the_digits_hold():
    with pytest.warns(
        UserWarning, match="9 digits were requested; over the whole span 0.0 are certain"
    ):
        motion = simulate(scenes.lorenz(), 60.0, digits=9, samples=61)
    good = motion.error.until(9)
    assert 15 < good < 40
    assert motion.warning == motion.error.shortfall
    # By another solver they hold as long as that, to the factor of 5 of any estimate.
    other = simulate(scenes.lorenz(), good, rtol=1e-15, samples=2, solver=solvers.DOPRI8)
    there = motion.ys[np.searchsorted(motion.ts, good)]
    assert np.abs(other.ys[-1] - there).max() < 5e-9 * motion.error.scale.max()


def test_digits_that_not_even_the_first_sample_has_are_said_so():
    with pytest.warns(UserWarning, match=r"all of them at no sample\. Rounding, amplified"):
        simulate(scenes.lorenz(), 60.0, digits=9, samples=[40.0, 60.0])


def test_more_digits_than_the_motion_has_are_refused():
    # The middle axis: a disturbance grows like e^(0.58 t) up to the flip. What rounding does is
    # drawn at random and depends on the processor: 10.9 to 11.2 were seen.
    with pytest.raises(ValueError, match=r"digits: expected at most 1[01](\.\d)? for this motion"):
        simulate(scenes.free_body(), 60.0, digits=15, samples=8)


@pytest.mark.slow
def test_the_limit_of_a_motion_does_not_depend_on_the_request():
    # Two random changes, of other steps for each request, gave 10.6 to 11.0.
    limits = set()
    for digits in (11.5, 12, 13, 14):
        with pytest.raises(ValueError, match=r"digits: expected at most 1[01]") as refused:
            simulate(kepler(0.99), 190.0, digits=digits, samples=5)
        limits.add(str(refused.value).partition(" for ")[0])
    assert len(limits) == 1


@pytest.mark.parametrize("digits", [16, 0, -3])
def test_more_digits_than_doubles_have_are_refused(digits):
    with pytest.raises(ValueError, match=f"digits: expected above 0, at most 15, got {digits}"):
        simulate(kepler(0.3), digits=digits)


def test_digits_go_with_no_tolerance_and_not_into_traces():
    with pytest.raises(ValueError, match="digits: expected no rtol, atol or dt"):
        simulate(kepler(0.3), digits=9, rtol=1e-3)
    with pytest.raises(ValueError, match="Pass rtol inside jit"):
        jax.jit(lambda t: simulate(kepler(0.3), t, digits=9).ys)(jnp.asarray(1.0))


@pytest.mark.parametrize("name", ["estimate", "by_second_method", "by_tangents", "by_halving"])
def test_estimates_are_made_outside_of_traces(name):
    def error(k):
        return getattr(accuracy, name)(scenes.oscillator(k=k), 1.0).error

    with pytest.raises(ValueError, match=r"^estimate: .*traced by jit.* Call it outside"):
        jax.jit(error)(1.0)
