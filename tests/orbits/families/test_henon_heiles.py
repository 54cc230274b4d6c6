"""The three shortest families of Henon and Heiles: Pi_1 (straight), Pi_4 (bent), Pi_7 (loops).

Churchill, Pecelli and Rod (1979), in Casati and Ford (eds.), Stochastic Behavior in Classical and
Quantum Hamiltonian Systems, Lecture Notes in Physics 93, 76, name eight orbits Pi_1 to Pi_8 that
the symmetries of the triangle carry into these three.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import orbits
from jaxdyn import scenes
from orbits import Kind

#: Energies, in units of the saddles' 1/6, at which orbits that exist beside Pi_1 begin: Brack
#: (2001), Foundations of Physics 31, 209 (arXiv nlin/0006034).
BRACK = (0.969309, 0.986709)
SADDLE = 1 / 6
LARGEST = 0.1655  # energy of the family


def at_rest(y):
    """A straight motion along y, from where it turns."""
    return scenes.henon_heiles().starting([0.0, y, 0.0, 0.0])


@pytest.fixture(scope="module")
def straight():
    first = orbits.find(at_rest(0.6), period=7.5, hold="y")
    return orbits.continue_family(first, members=40, step=0.05, energies=(0.0, LARGEST))


def trace(scaled):
    """Trace of the transverse map over a period of Pi_1 at an energy: Hill's equation by SciPy."""
    roots = np.sort(np.roots([-1 / 3, 0.5, 0.0, -scaled * SADDLE]).real)

    def rate(t, z):
        y, v, *columns = z
        out = [v, y * y - y]
        for i in (0, 2):
            out += [columns[i + 1], -(1 + 2 * y) * columns[i]]
        return out

    def turned(t, z):
        return z[1]

    turned.terminal, turned.direction = True, 1
    start = [roots[1], 0.0, 1.0, 0.0, 0.0, 1.0]
    # Half a period, from the larger turning point to the other; the way back mirrors it.
    half = solve_ivp(rate, (0, 50), start, "DOP853", events=turned, rtol=1e-13, atol=1e-14)
    m = half.y[2:, -1].reshape(2, 2).T
    flip = np.diag([1.0, -1.0])
    return np.trace(flip @ np.linalg.inv(m) @ flip @ m)


@pytest.mark.slow
def test_straight_orbits_double_and_fork_where_hills_equation_says(straight):
    doublings, branches = (
        # The last member is beyond the bound, by part of a step.
        [x.energy / SADDLE for x in straight.special if x.kind == kind and x.energy < LARGEST]
        for kind in (Kind.DOUBLING, Kind.BRANCH)
    )
    np.testing.assert_allclose(branches, BRACK, rtol=0, atol=1e-6)
    exact = [
        brentq(lambda e: trace(e) + 2, *ends, xtol=1e-13) for ends in ((0.8, 0.82), (0.9, 0.93))
    ]
    np.testing.assert_allclose(doublings, exact, rtol=0, atol=1e-9)
    exact = [
        brentq(lambda e: trace(e) - 2, *ends, xtol=1e-13) for ends in ((0.96, 0.975), (0.98, 0.99))
    ]
    np.testing.assert_allclose(branches, exact, rtol=0, atol=1e-9)


def crossing_upwards(y, energy):
    """An orbit near (0, y) with vy = 0, at an energy."""
    vx = np.sqrt(2 * energy - y**2 + 2 * y**3 / 3)
    scene = scenes.henon_heiles().starting([0.0, y, vx, 0.0])
    return orbits.find(scene, period=6.3, hold=[orbits.Energy(energy), "x"])


@pytest.mark.slow
def test_bent_orbits_are_unstable_and_loops_double():
    low = SADDLE / 2
    bent, loop = crossing_upwards(-0.1, low), crossing_upwards(0.2, low)
    assert orbits.stability(bent).verdict == "unstable"
    # Both ways round are one orbit, with its mirror image.
    again = crossing_upwards(-0.3, low)
    assert abs(again.period - loop.period) < 1e-12
    family = orbits.continue_family(loop, members=20, step=0.05, down=True, energies=(0.0, 0.16))
    (point,) = family.special
    assert point.kind == Kind.DOUBLING
    verdicts = {m.stability.verdict for m in family.members if m.energy < point.energy}
    assert verdicts == {"stable"}
    assert family.members[-1].stability.verdict == "unstable"

    def rate(t, z):
        x, y, vx, vy, *columns = z
        out = [vx, vy, -x - 2 * x * y, -y - x * x + y * y]
        for i in range(4):
            a, b, c, d = columns[4 * i : 4 * i + 4]
            out += [c, d, -(1 + 2 * y) * a - 2 * x * b, -2 * x * a - (1 - 2 * y) * b]
        return out

    start = [*np.asarray(point.orbit.y0), *np.eye(4).ravel()]
    end = solve_ivp(rate, (0, point.orbit.period), start, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    np.testing.assert_allclose(end[:4], start[:4], rtol=0, atol=1e-11)
    # Two multipliers are 1, by the flow and the energy, and two -1.
    assert abs(np.trace(end[4:].reshape(4, 4))) < 1e-8


@pytest.mark.slow
def test_the_three_families_meet_at_the_equilibrium():
    """Both frequencies are 1 there: the closing equations are singular to all orders near it."""
    orbits_near = [
        orbits.find(at_rest(0.2), period=6.4, hold="y"),
        *(crossing_upwards(y, SADDLE / 8) for y in (-0.1, 0.1)),
    ]
    families = [
        orbits.continue_family(orbit, members=10, step=0.05, down=i == 0)
        for i, orbit in enumerate(orbits_near)
    ]
    for family in families:
        assert [point.kind for point in family.special] == [Kind.REST]
        assert abs(family.special[0].orbit.period - 2 * np.pi) < 1e-9
        assert np.abs(family.special[0].orbit.y0).max() < 2e-5
    (place,) = orbits.graph(families).places
    assert (place.kind, place.families) == ("equilibrium", (0, 1, 2))
