"""Proofs of orbits of other scenes, against published periods and second computations."""

import functools

import mpmath
import numpy as np
import odes
import pytest

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.ball_arithmetic.arithmetic import arb, precision
from jaxdyn.ball_arithmetic.field import ball_field, scene_formulas
from jaxdyn.ball_arithmetic.tube import tube

#: Viswanathan 2004, Physica D 190, 115: periods of cycles of the Lorenz system by their words. Here
#: 8/3 is a float, so that 13 digits can agree.
LORENZ = {
    "AB": ((-13.763610682134, -19.578751942452, 27.0), 1.5586522107162),
    "AAB": ((-12.595115397689, -16.970525307084, 27.0), 2.3059072639398),
    "AABB": ((-3.3557511562672, 0.3636893823070, 27.0), 3.0842767758221),
}


@pytest.mark.parametrize(
    "word",
    [
        pytest.param("AB", marks=pytest.mark.slow),
        *(pytest.param(word, marks=pytest.mark.long) for word in ("AAB", "AABB")),
    ],
)
def test_cycles_of_lorenz_are_proved_to_be_unstable(word):
    start, period = LORENZ[word]
    orbit = orbits.find(scenes.lorenz(y0=start, t1=period), hold="z")
    proof = orbits.prove(orbit, digits=25)
    assert (proof.proved, proof.verdict, proof.verdict_proved) == (True, "unstable", True)
    assert abs(float(proof.period.mid) - period) < 1e-12
    assert float(proof.period.rad) < 1e-19
    # Expanding along the cycle, contracting across: their product is exp(-(sigma + 1 + beta) T).
    product = float(proof.multipliers[0][0].mid) * float(proof.multipliers[1][0].mid)
    assert abs(product - np.exp(-(11 + 8 / 3) * period)) < 1e-9


@pytest.mark.slow
def test_the_cycle_of_van_der_pol_has_its_published_digits():
    # Hairer, Norsett, Wanner 1993, Solving Ordinary Differential Equations I, section I.16; there
    # the amplitude lacks the 6 of 50964, and its later digits agree.
    amplitude, period = "2.008619860874843136509640188", "6.6632868593231301896996820305"
    scene = jaxdyn.ode(odes.van_der_pol, [2.0, 0.0], 6.66, params=1.0)
    proof = orbits.prove(orbits.find(scene, hold="y1"), digits=32)
    assert (proof.proved, proof.verdict, proof.verdict_proved) == (True, "stable", True)
    with mpmath.workdps(40):
        assert abs(mpmath.mpf(proof.period.mid) - mpmath.mpf(period)) < 1e-28
        assert abs(mpmath.mpf(proof.y0[0].mid) - mpmath.mpf(amplitude)) < 1e-26
        assert max(mpmath.mpf(x.rad) for x in (proof.period, proof.y0[0])) < 1e-28


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "start", "period", "params"),
    [
        (odes.van_der_pol, [2.0, 0.0], 11.6, 5.0),
        (odes.brusselator, [1.0, 2.5], 7.2, (1.0, 3.0)),
    ],
)
def test_dissipative_cycles_are_proved_to_be_stable(rate, start, period, params):
    found = orbits.find(jaxdyn.ode(rate, start, period, params=params))
    proof = orbits.prove(found)
    assert (proof.proved, proof.verdict, proof.verdict_proved) == (True, "stable", True)
    assert "1 inside the unit circle" in repr(proof)
    assert abs(float(proof.period.mid) - found.period) < 1e-12
    assert float(proof.period.rad) < 1e-25


@pytest.mark.slow
def test_a_swing_of_the_double_pendulum_is_proved():
    low, _ = orbits.discovery.seeds.modes(scenes.double_pendulum(), np.zeros(4), 0.3)
    start = np.round(low.y0, 9)
    closing = orbits.reversal(orbits.time_reversal(4))
    found = orbits.find(scenes.double_pendulum(), start, low.period, closing=closing, hold="theta2")
    proof = orbits.prove(found, digits=20)
    assert proof.proved
    assert abs(float(proof.period.mid) - found.period) < 1e-9
    assert dict(proof.held)["theta2"] == found.y0[1]


@pytest.mark.slow
def test_an_orbit_of_henon_and_heiles_is_proved_to_be_unstable():
    found = orbits.find(scenes.henon_heiles(), [0.0, 0.0, 0.3, 0.0], 6.5, hold="vx")
    proof = orbits.prove(found, digits=20)
    assert (proof.proved, proof.verdict, proof.verdict_proved) == (True, "unstable", True)
    assert "energy" in proof.reason
    known = orbits.stability(found).nontrivial
    assert abs(float(proof.multipliers[0][0].mid) - max(known.real)) < 1e-8


@pytest.mark.long
def test_a_halo_orbit_is_proved():
    # K. Howell, Celestial Mechanics 32 (1984) 53, table of the L1 family for mu = 0.04.
    mirror = orbits.Symmetry(None, (1, -1, 1, -1, 1, -1), reversing=True)
    scene = jaxdyn.ode(odes.restricted, [0.723, 0.0, 0.04, 0.0, 0.198, 0.0], 2.6, params=0.04)
    halo = orbits.find(scene, closing=orbits.reversal(mirror), hold=orbits.Section(2, 0.04))
    proof = orbits.prove(halo)
    assert (proof.proved, proof.verdict, proof.verdict_proved) == (True, "unstable", True)
    assert abs(float(proof.period.mid) / 2 - 1.300177) < 1e-6
    assert abs(float(proof.multipliers[0][0].mid) - 2 * 1181.69) < 1.0


@functools.cache
def _eight():
    return orbits.find(scenes.three_body(), closing=orbits.choreography(3))


@pytest.mark.slow
def test_the_eight_is_enclosed_where_another_program_finds_it():
    """mpmath's Taylor integrator follows the same floats with recurrences of its own."""
    span, digits = 0.5, 30
    y0 = np.asarray(_eight().y0).tolist()
    field = ball_field(scene_formulas(scenes.three_body())[0])
    with precision(200):
        start = [arb(x) for x in y0]
        found = tube(field, arb(0), start, start, (arb(span), arb(span)), digits, 200)

    def rate(t, y):
        r = [(y[2 * i], y[2 * i + 1]) for i in range(3)]
        pull = [[mpmath.mpf(0), mpmath.mpf(0)] for _ in r]
        for i, a in enumerate(r):
            for b in (r[j] for j in range(3) if j != i):
                cubed = mpmath.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) ** 3
                for axis in (0, 1):
                    pull[i][axis] += (b[axis] - a[axis]) / cubed
        return [*y[6:], *(x for row in pull for x in row)]

    with mpmath.workdps(digits + 6):
        exact = mpmath.odefun(rate, 0, [mpmath.mpf(x) for x in y0])(mpmath.mpf(span))
        with precision(200):
            for ball, x in zip(found.centre, exact, strict=True):
                other = arb(mpmath.nstr(x, digits + 5))
                assert (ball + arb(0, arb(10) ** -digits)).contains(other)
                assert float(ball.rad()) < 1e-26
