"""Certificates of orbits: what is proved, what must not be, and against closed forms."""

import dataclasses
import functools
import json
from typing import Any

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from helpers import forge, run_python

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.ball_arithmetic.arithmetic import arb, precision
from jaxdyn.ball_arithmetic.decimals import decimal
from orbits.proof import checking
from orbits.proof.posing import equations_of
from orbits.proof.proving import certify
from orbits.proof.refinement import solve


def _van_der_pol(mu=1.0, period=6.66):
    rate = lambda t, y, p: [y[1], p["mu"] * (1 - y[0] ** 2) * y[1] - y[0]]  # noqa: E731
    return jaxdyn.ode(rate, [2.0, 0.0], period, params={"mu": mu})


@functools.cache
def _swing():
    return orbits.find(scenes.pendulum(angle=2.0), period=2.7, hold="theta")


@functools.cache
def _cycle():
    return orbits.find(_van_der_pol())


def _contains(enclosed, exact: Any) -> bool:
    return abs(mpmath.mpf(enclosed.mid) - exact) <= mpmath.mpf(enclosed.rad)


def _exact_swing():
    with mpmath.workdps(60):
        return 4 * mpmath.ellipk(mpmath.sin(mpmath.mpf(1)) ** 2) / mpmath.sqrt(mpmath.mpf(9.81))


def test_the_period_of_a_swing_is_enclosed_and_is_the_elliptic_integral():
    proof = orbits.prove(_swing())
    assert proof.proved
    with mpmath.workdps(60):
        assert _contains(proof.period, _exact_swing())
        assert mpmath.mpf(proof.period.rad) < mpmath.mpf(10) ** -25
    assert dict(proof.held) == {"theta": 2.0, "theta_dot": 0.0}


@pytest.mark.slow
def test_a_swing_that_retraces_its_path_needs_no_integral():
    closing = orbits.reversal(orbits.time_reversal(2))
    swing = orbits.find(scenes.pendulum(angle=2.0), period=2.7, closing=closing, hold="theta")
    proof = orbits.prove(swing)
    assert proof.proved
    assert "conserves" not in proof.reason
    assert "conserves: energy" in orbits.prove(_swing(), digits=15).reason
    with mpmath.workdps(60):
        assert _contains(proof.period, _exact_swing())


@pytest.mark.slow
def test_a_cycle_is_proved_with_its_multiplier():
    proof = orbits.prove(_cycle())
    assert proof.proved
    assert (proof.verdict, proof.verdict_proved) == ("stable", True)
    (real, imaginary) = proof.multipliers[0]
    assert imaginary.mid == "0"
    linear = orbits.stability(_cycle())
    assert abs(float(real.mid) - linear.nontrivial[0].real) < linear.bars[0] + float(real.rad)


@pytest.mark.slow
def test_a_forced_oscillator_has_the_exact_period_of_its_drive():
    def rate(t, y):
        return [y[1], 0.3 * jnp.cos(1.25 * t) - 0.5 * y[1] - y[0] - y[0] ** 3]

    scene = jaxdyn.ode(rate, [0.2, 0.0], 2 * np.pi / 1.25)
    settled = jaxdyn.solve(scene, 30 * scene.t1).y1
    proof = orbits.prove(orbits.find(scene, settled))
    assert (proof.proved, proof.verdict) == (True, "stable")
    with mpmath.workdps(60):
        assert _contains(proof.period, 2 * mpmath.pi / mpmath.mpf(1.25))


def _box_about(orbit, moved: float, radius: float, digits=30, bits=None):
    system = equations_of(orbit)
    numbers, lost = solve(system, digits)
    numbers[system.unknowns[0]] += arb(moved)
    return certify(orbit, system, numbers, radius, digits + lost, bits=bits)


@pytest.mark.slow
def test_a_box_without_the_orbit_is_not_proved():
    assert _box_about(_cycle(), 0.0, 1e-12).proved
    assert not _box_about(_cycle(), 1e-8, 1e-12).proved


@pytest.mark.slow
def test_a_box_that_is_too_narrow_for_its_centre_is_widened():
    orbit = _cycle()
    system = equations_of(orbit)
    numbers, lost = solve(system, 36.0)
    off = list(numbers)
    with precision(300):
        off[system.unknowns[0]] = off[system.unknowns[0]] + arb(3e-20)
    proof = certify(orbit, system, off, 1e-20, 30 + lost)
    assert proof.proved
    assert 3e-20 < float(proof.radius) < 1e-17
    # A stored certificate is checked with its own radius.
    again = certify(orbit, system, off, 1e-20, 30 + lost, bits=proof.bits)
    assert not again.proved


def test_too_few_bits_prove_nothing():
    proof = _box_about(_cycle(), 0.0, 1e-20, bits=53)
    assert not proof.proved
    assert "bits" in proof.reason or "Krawczyk" in proof.reason


def test_a_near_return_is_not_proved():
    # A spiral that closes to 1e-7 a turn, and never.
    scene = jaxdyn.ode(lambda t, y: [y[1], -y[0] - 1e-8 * y[1]], [1.0, 0.0], 2 * np.pi)
    near = dataclasses.replace(_cycle(), scene=scene)
    proof = orbits.prove(near)
    assert not proof.proved
    assert proof.reason
    with pytest.raises(orbits.SearchError):
        orbits.prove(near, throw=True)


@pytest.mark.slow
def test_a_symmetry_that_the_rate_has_only_to_rounding_proves_nothing():
    # An even term below the rounding: half of a period later the state is the opposite one in
    # doubles, and never exactly.
    def rate(t, y):
        return [y[1], (1 - y[0] ** 2) * y[1] - y[0] + 1e-18 * y[0] ** 2]

    half = orbits.Return(symmetry=orbits.Symmetry(signs=(-1, -1)), parts=2, name="half")
    orbit = orbits.find(jaxdyn.ode(rate, [2.0, 0.0], 6.66), closing=half)
    proof = orbits.prove(orbit)
    assert not proof.proved
    assert "symmetry of the closing condition" in proof.reason


@pytest.mark.slow
def test_cycles_about_a_centre_have_no_other_multipliers_than_1():
    rate = lambda t, y: [y[0] * (1.5 - y[1]), y[1] * (y[0] - 1.0)]  # noqa: E731
    level = lambda t, y: y[0] - jnp.log(y[0]) + y[1] - 1.5 * jnp.log(y[1])  # noqa: E731
    scene = jaxdyn.ode(rate, [2.0, 1.0], 5.5, integrals={"level": level})
    proof = orbits.prove(orbits.find(scene, hold="y0"))
    assert (proof.proved, proof.multipliers, proof.verdict) == (True, (), "stable")


def test_what_is_no_orbit_is_refused():
    for claim in (orbits.prove, orbits.refine):
        message = r"orbit: expected an Orbit, got a Scene\. Find one first"
        with pytest.raises(ValueError, match=message):
            claim(scenes.pendulum())


@pytest.mark.slow
def test_without_python_flint_there_is_one_clear_line():
    told = run_python(
        """
import sys
sys.modules["flint"] = None
import jaxdyn, orbits
for name in ("prove", "refine"):
    try:
        getattr(orbits, name)(None)
    except ValueError as error:
        print(error)
"""
    )
    line = "proof: expected the package python-flint, got none. Install it: "
    assert told.splitlines() == [f"{line}pip install 'jaxdyn[proof]'."] * 2


@pytest.mark.slow
def test_an_energy_that_is_conserved_only_in_doubles_is_not_taken():
    def energy(t, y):
        return 0.5 * y[1] ** 2 + 0.25 * y[0] ** 4 * (3 * (1 / 3 + 1e-16))

    # 1/3 is a float, so the sum is not the potential of the force exactly.
    scene = jaxdyn.ode(lambda t, y: [y[1], -(y[0] ** 3)], [1.0, 0.0], 7.4, energy=energy)
    orbit = orbits.find(scene, hold="y0")
    exact = jaxdyn.ode(
        lambda t, y: [y[1], -(y[0] ** 3)],
        [1.0, 0.0],
        7.4,
        energy=lambda t, y: 0.5 * y[1] ** 2 + 0.25 * y[0] ** 4,
    )
    assert orbits.prove(orbits.find(exact, hold="y0")).proved
    assert orbits.prove(orbit).proved == (3 * (1 / 3 + 1e-16) == 1.0)


@pytest.mark.slow
def test_a_record_that_was_edited_does_not_come_out_again():
    proof, digits = (f(_swing()).as_json() for f in (orbits.prove, orbits.refine))
    assert checking.certificate_mismatch(_swing(), proof) == ""
    assert checking.refined_mismatch(_swing(), digits) == ""
    period = proof["period"]
    for edit in (
        {"period": period | {"mid": period["mid"][:-9] + "9" * 9}},
        {"period": period | {"rad": "1e-60"}},
        {"verdict": "unstable"},
        {"reason": "By inspection."},
        {"centre": ["1*2^1", *proof["centre"][1:]]},
    ):
        assert checking.certificate_mismatch(_swing(), proof | edit).startswith(
            "proved" if "centre" in edit else next(iter(edit))
        )
    shorter = {name: proof[name][1:] for name in ("centre", "units")}
    assert checking.certificate_mismatch(_swing(), proof | shorter) == "centre"
    edited = digits | {"period": digits["period"][:30]}
    assert checking.refined_mismatch(_swing(), edited) == "period"


@pytest.mark.slow
def test_files_keep_digits_and_proofs(tmp_path):
    path = tmp_path / "swing.json"
    for found in (orbits.refine(_swing(), 40), orbits.prove(_swing())):
        orbits.save(path, found)
        assert orbits.verify(path)[1] == []
    record = json.loads(path.read_text())
    record["claims"]["certificate"]["period"]["rad"] = "1e-60"
    forge(path, record)
    assert [m.name for m in orbits.verify(path)[1]] == ["certificate: period"]


def test_decimal_enclosures_contain_the_ball_and_keep_its_digits():
    with precision(4000):
        for mid, rad in (
            (1, "1e-20"),
            (-3, "9.995e-7"),
            (1e9, "0.3"),
            (1e-5, 0),
            (0, "1e-9"),
            (7, "1e-900"),
        ):
            ball = arb(mid) / 3 + arb(0, arb(rad))
            told = decimal(ball)
            assert arb(told.mid, told.rad).contains(ball)
            assert arb(told.rad) < max(1.2 * arb(rad), arb("1e-33"))
            assert arb(told.rad) > arb(rad)


def test_a_claim_that_is_taken_out_is_not_what_is_proved():
    told = {"mid": "1.0", "rad": "1e-9"}
    assert checking._contains(told, told)
    assert not checking._contains(None, told)
    assert not checking._contains(told, None)
    assert not checking._contains(told | {"rad": "nan"}, told)


def test_states_on_constraints_are_refused():
    body = dataclasses.replace(_swing(), scene=scenes.free_body())
    with pytest.raises(ValueError, match="constraints"):
        orbits.prove(body)


@pytest.mark.slow
def test_the_eight_is_proved_to_exist_and_to_be_stable():
    eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    proof = orbits.prove(eight)
    assert (proof.proved, proof.choreography, proof.verdict_proved) == (True, True, True)
    assert proof.verdict == "stable"
    assert "4 on the unit circle" in repr(proof)
    assert all(float(x.rad) < 1e-15 for x in proof.exponents)
    known = sorted(orbits.stability(eight).exponents)
    found = sorted(float(x.mid) for x in proof.exponents)
    assert np.allclose(found, known, atol=1e-9)


@pytest.mark.long
def test_the_neighbour_of_the_eight_is_proved_to_be_another_orbit():
    plain = orbits.find(scenes.three_body(), scenes.EIGHT_GUESS, scenes.EIGHT_GUESS_PERIOD)
    proof = orbits.prove(plain)
    assert (proof.proved, proof.choreography) == (True, False)
    assert (proof.verdict, proof.verdict_proved) == ("unstable", True)


@pytest.mark.long
def test_the_eight_is_proved_as_a_plain_return():
    eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    plain = orbits.find(scenes.three_body(), eight.y0, eight.period)
    proof = orbits.prove(plain)
    assert (proof.proved, proof.verdict, proof.verdict_proved) == (True, "stable", True)
    assert proof.choreography is None  # bodies meet the places of others, as far as balls tell


@pytest.mark.long
def test_the_rotation_numbers_of_the_eight_are_enclosed_to_many_digits():
    eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    proof = orbits.prove(eight, digits=40)
    assert all(float(x.rad) < 1e-25 for x in proof.exponents)
    known = orbits.refine(eight, 30).exponents
    with mpmath.workdps(40):
        for exact in known:
            gaps = [abs(mpmath.mpf(x.mid) - mpmath.mpf(exact)) for x in proof.exponents]
            assert min(gaps) < mpmath.mpf(10) ** -24


@pytest.mark.slow
def test_multipliers_that_are_nearly_equal_take_more_digits():
    """A swing in a quartic potential, on two ridges whose rates of escape agree to nine digits."""

    def rate(t, y, squares):
        return [y[1], -(y[0] ** 3), y[3], squares[0] * y[2], y[5], squares[1] * y[4]]

    def energy(t, y, squares):
        over = squares[0] * y[2] ** 2 + squares[1] * y[4] ** 2
        return 0.5 * (y[1] ** 2 + y[3] ** 2 + y[5] ** 2 - over) + 0.25 * y[0] ** 4

    squares = [0.1, 0.1 * (1 + 1e-9)]
    scene = jaxdyn.ode(rate, [1.0, 0, 0, 0, 0, 0], 7.4, energy=energy, params=jnp.array(squares))
    proof = orbits.prove(orbits.find(scene, hold="y0"), 15)
    assert (proof.proved, proof.verdict, proof.verdict_proved) == (True, "unstable", True)
    assert proof.digits > 25
    with mpmath.workdps(60):
        # The integral of 4 sqrt(2 / (1 - x^4)) from 0 to 1.
        period = mpmath.sqrt(2 * mpmath.pi) * mpmath.gamma("0.25") / mpmath.gamma("0.75")
        growths = [mpmath.exp(mpmath.sqrt(mpmath.mpf(square)) * period) for square in squares]
        exact = [*growths[::-1], 1 / growths[0], 1 / growths[1]]
        for known, (real, _) in zip(exact, proof.multipliers, strict=True):
            assert _contains(real, known)
