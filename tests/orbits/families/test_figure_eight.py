"""The figure-eight's families: in the mass of one body, and in the angular momentum.

Galan, Munoz-Almaraz, Freire, Doedel, Vanderbauwhede (2002), Phys. Rev. Lett. 88, 241101, follow it
in a mass; Chenciner, Fejoz, Montgomery (2005), Nonlinearity 18, 1407, in the angular momentum, as
orbits that close in rotating axes.
"""

import json

import numpy as np
import pytest
from helpers import SOLVED, TESTS
from rich.console import Console
from scipy.integrate import solve_ivp

import orbits
from jaxdyn import scenes
from orbits import Kind
from orbits.cli.printed import print_reports

REFERENCE = json.loads((TESTS / "references" / "figure_eight_reference.json").read_text())["orbits"]
#: Traces of the monodromy matrix, whose entries are near 1e3, and of its square, by DOP853.
TRACES = 1e-9


def of_mass(m):
    return scenes.three_body(m=(1.0, 1.0, m))


@pytest.fixture(scope="module")
def eight():
    return orbits.find(scenes.three_body())


@pytest.fixture(scope="module")
def heavier(eight):
    """Through the fold, and back past equal masses."""
    held = orbits.Period(eight.period)
    return orbits.continue_family(eight, of_mass, 1.0, hold=held, members=24, step=3e-4)


@pytest.fixture(scope="module")
def lighter(eight):
    held = orbits.Period(eight.period)
    return orbits.continue_family(
        eight, of_mass, 1.0, hold=held, members=16, step=3e-4, down=True, within=(0.9998, 1.1)
    )


@pytest.fixture(scope="module")
def turning(eight):
    """Members of one energy with an angular momentum of either sign."""
    first = orbits.find(scenes.three_body(), closing=orbits.relative())
    held = orbits.Energy(orbits.identify(first).energy)
    halves = [
        orbits.continue_family(first, hold=held, members=9, step=0.02, down=down)
        for down in (False, True)
    ]
    return [member for half in halves for member in half.members[1:]]


def by_scipy(orbit, mass=1.0):
    """The state after a period and the monodromy matrix, by SciPy's integrator."""
    masses = np.array([1.0, 1.0, mass])

    def rate(t, z):
        q, v, columns = z[:6].reshape(3, 2), z[6:12], z[12:].reshape(12, 12)
        force, slope = np.zeros((3, 2)), np.zeros((3, 2, 3, 2))
        for i in range(3):
            for j in {0, 1, 2} - {i}:
                d = q[j] - q[i]
                r = np.sqrt(d @ d)
                force[i] += masses[j] * d / r**3
                block = masses[j] * (np.eye(2) / r**3 - 3 * np.outer(d, d) / r**5)
                slope[i, :, j] += block
                slope[i, :, i] -= block
        below = slope.reshape(6, 6) @ columns[:6]
        return np.concatenate([v, force.ravel(), columns[6:].ravel(), below.ravel()])

    z0 = np.concatenate([orbit.y0, np.eye(12).ravel()])
    end = solve_ivp(rate, (0, orbit.period), z0, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    return end[:12], end[12:].reshape(12, 12)


def cosines(monodromy):
    """Cosines of the angles of the two pairs of multipliers besides the eight that are 1."""
    total = (np.trace(monodromy) - 8) / 2
    squares = (np.trace(monodromy @ monodromy) - 8) / 4 + 1
    return np.sort(np.roots([1, -total, (total**2 - squares) / 2]).real)


@pytest.mark.slow
def test_it_folds_at_a_larger_mass_and_is_its_neighbour_when_the_mass_is_1_again(heavier, eight):
    (fold,) = heavier.special
    assert fold.kind == Kind.FOLD
    assert fold.parameter >= heavier.parameters.max()
    at = int(np.argmax(heavier.parameters < 1.0 - 1e-9))
    one, two = heavier.members[at - 1 : at + 1]
    share = (1.0 - one.parameter) / (two.parameter - one.parameter)
    guess = one.orbit.y0 + share * (two.orbit.y0 - one.orbit.y0)
    held = orbits.Period(eight.period)
    met = orbits.identify(orbits.find(of_mass(1.0), guess, eight.period, hold=held))
    neighbour = float(REFERENCE["neighbour"]["scale_free_period"])
    assert abs(met.scale_free - neighbour) < SOLVED
    first, met_first = orbits.identify(eight).scale_free, met.scale_free
    assert abs(first - met_first) > 1e-7  # another orbit than the first one


@pytest.mark.slow
def test_it_is_stable_between_two_masses_by_scipy_too(heavier, lighter):
    (fold,), (branch,) = heavier.special, lighter.special
    assert branch.kind == Kind.BRANCH
    low, high = branch.parameter, fold.parameter
    assert low < 1.0 < high
    for family, end in ((heavier, fold), (lighter, branch)):
        verdicts = [m.stability.verdict for m in family.members]
        turns = verdicts.index("unstable")
        assert set(verdicts[:turns]) == {"stable"}
        assert set(verdicts[turns:]) == {"unstable"}
        y1, monodromy = by_scipy(end.orbit, end.parameter)
        assert np.abs(y1 - np.asarray(end.orbit.y0)).max() < 1e-10
        assert abs(cosines(monodromy)[1] - 1) < TRACES
        inside, outside = (
            cosines(by_scipy(m.orbit, m.parameter)[1])[1] for m in family.members[turns - 1 :][:2]
        )
        assert inside < 1 - 10 * TRACES
        assert outside > 1 + 10 * TRACES


@pytest.mark.slow
def test_at_equal_masses_the_multipliers_are_stationary(heavier, lighter):
    # By the choreography all three masses change them alike, and all together not at all.
    _, monodromy = by_scipy(heavier.members[0].orbit)
    numbers = np.arccos(cosines(monodromy)) / (2 * np.pi)
    # Simo (2002), Contemp. Math. 292, 209.
    np.testing.assert_allclose(numbers, [0.29809253, 0.00842272], atol=1e-8)
    near = [*heavier.members[:4], *lighter.members[1:4]]
    x = np.array([m.parameter - 1 for m in near]) / 1e-5
    larger = [max(m.stability.exponents) for m in near]
    powers = np.polynomial.polynomial.polyfit(x, larger, 5)
    assert abs(powers[1]) < 1e-4 * abs(powers[2])


@pytest.mark.slow
def test_rotating_eights_come_in_mirror_images_and_obey_the_law_of_the_action(turning):
    energy = turning[0].energy
    momenta = np.array([orbits.identify(m.orbit).angular_momentum for m in turning])
    angles = np.array([m.orbit.angle for m in turning])
    periods = np.array([m.orbit.period for m in turning])
    assert momenta.min() < -0.01 < 0.01 < momenta.max()
    # A mirror turns the angle and the momentum round and keeps the period.
    scale = np.abs(momenta).max()
    x = momenta / scale
    powers = x[:, None] ** np.arange(12)
    turned, lasting = (np.linalg.lstsq(powers, y)[0] for y in (angles, periods))
    assert np.abs(turned[0::2]).max() < 1e-9
    assert np.abs(lasting[1::2]).max() < 1e-9
    # The action J(E, L) has dJ = T dE + angle dL, and is |E|^(-1/2) f(L |E|^(1/2)) by the scaling
    # of gravity: along one energy dT = L / (2 |E|) d(angle).
    degree = np.arange(1, 4)
    wanted = scale * turned[degree] * degree / (2 * abs(energy) * (degree + 1))
    np.testing.assert_allclose(lasting[degree + 1][::2], wanted[::2], rtol=1e-7)
    for member in (turning[0], turning[-1]):
        y1, _ = by_scipy(member.orbit)
        c, s = np.cos(member.orbit.angle), np.sin(member.orbit.angle)
        turn = np.kron(np.eye(6), np.array([[c, -s], [s, c]]))
        assert np.abs(y1 - turn @ np.asarray(member.orbit.y0)).max() < 1e-10


@pytest.mark.slow
def test_the_centre_of_mass_is_no_reason_against_the_stability_of_a_rotating_eight(turning, capsys):
    for member in (turning[2], turning[-1]):
        linear = member.stability
        _, monodromy = by_scipy(member.orbit)
        c, s = np.cos(member.orbit.angle), np.sin(member.orbit.angle)
        m = np.kron(np.eye(6), np.array([[c, s], [-s, c]])) @ monodromy
        assert (linear.verdict, len(linear.nontrivial), linear.unit) == ("stable", 4, 4)
        # Traces of powers of all twelve: four are 1, and four exp(+-i angle).
        for power in (1, 2, 3):
            whole = np.trace(np.linalg.matrix_power(m, power))
            rest = whole - 4 - 4 * np.cos(power * member.orbit.angle)
            assert abs(rest - (linear.nontrivial**power).sum()) < 1e-7
            assert abs(whole - (linear.multipliers**power).sum()) < 1e-7
    orbit = turning[-1].orbit
    print_reports({"rotating": orbits.report(orbit)}, Console(width=100), orbit)
    shown = capsys.readouterr().out
    assert "4 of the centre of mass, which turns" in shown
    assert "and 4 times 1" in shown
