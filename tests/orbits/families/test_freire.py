"""An electronic oscillator: where its symmetric cycles fold and lose their symmetry.

Freire, Rodriguez-Luis, Gamero, Ponce (1993), Physica D 62, 230; AUTO's demonstration `tor`, and the
manual of MatCont, have the Hopf point and the branch point of cycles.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import jaxdyn
import orbits
from orbits import Kind

BETA, GAMMA, R, A, B = 0.5, -0.6, 0.6, 0.32858, 0.93358


def rate(t, u, nu):
    x, y, z = u
    coupling = B * (y - x) ** 3
    return [
        (-(BETA + nu) * x + BETA * y - A * x**3 + coupling) / R,
        BETA * x - (BETA + GAMMA) * y - z - coupling,
        y,
    ]


def make(nu):
    return jaxdyn.ode(rate, [0.0, 0.0, 0.0], 6.0, params=nu)


def breaks_symmetry(nu, guess):
    """det(N + 1), where N is minus the derivative over the half period in which a cycle turns."""

    def half(x, y, time):
        def both(t, w):
            u, m = w[:3], w[3:].reshape(3, 3)
            s = 3 * B * (u[1] - u[0]) ** 2
            slope = np.array(
                [
                    [(-(BETA + nu) - 3 * A * u[0] ** 2 - s) / R, (BETA + s) / R, 0.0],
                    [BETA + s, -(BETA + GAMMA) - s, -1.0],
                    [0.0, 1.0, 0.0],
                ]
            )
            return np.concatenate([rate(t, u, nu), (slope @ m).ravel()])

        start = np.concatenate([[x, y, 0.0], np.eye(3).ravel()])
        return solve_ivp(both, (0.0, time), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]

    found = fsolve(lambda p: half(*p)[:3] + np.array([p[0], p[1], 0.0]), guess, xtol=1e-12)
    return np.linalg.det(np.eye(3) - half(*found)[3:].reshape(3, 3))


@pytest.mark.slow
def test_cycles_lose_their_symmetry_where_half_a_turn_says():
    equilibria = jaxdyn.continue_equilibria(make, -0.9, [0.0, 0.0, 0.0], members=60)
    hopf, branch = equilibria.special
    assert abs(hopf.parameter + 0.58933644) < 5e-8
    assert abs(branch.parameter + 0.5) < 1e-9
    first, nu = orbits.from_hopf(equilibria, hopf)
    family = orbits.continue_family(first, make, nu, members=42, step=0.05)
    fold, point = family.special[:2]
    assert (fold.kind, point.kind) == (Kind.FOLD, Kind.BRANCH)
    # The family winds towards a homoclinic orbit; errors grow by 1e5 at its folds.
    folds = [x for x in family.special if x.kind == Kind.FOLD]
    assert len(folds) == 5
    for x in folds:
        off = np.abs(x.stability.nontrivial - 1)
        assert off.min() < 1e-6
        assert (off <= x.stability.bars).any()
    # The orbit from where z vanishes, as the symmetric start of half a turn.
    run = jaxdyn.simulate(point.orbit.scene, samples=np.linspace(0, point.orbit.period, 2001))
    at = np.argmin(np.abs(np.asarray(run.ys)[:, 2]))
    guess = [*np.asarray(run.ys)[at, :2], point.orbit.period / 2]
    exact = brentq(breaks_symmetry, point.parameter - 1e-5, point.parameter + 1e-5, (guess,), 1e-12)
    assert abs(point.parameter - exact) < 1e-8
