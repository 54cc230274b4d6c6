"""Orbits with close encounters: in logarithmic time, against high precision and plain time."""

import csv
import json

import equinox as eqx
import jax
import numpy as np
import pytest
from helpers import SOLVED, TESTS, forge, gap, kepler

import orbits
from jaxdyn import scenes
from jaxdyn.analysis.regularized import logarithmic_span, solve_regularized
from jaxdyn.integrate.simulation import solve
from jaxdyn.status import Status
from orbits.analysis import evidence
from orbits.discovery.plane import IN_LINE
from orbits.motion import logarithmic_period
from orbits.orbit import relocate
from orbits.shooting.equations import Equations
from orbits.shooting.segmentation import with_segments

pytestmark = pytest.mark.usefixtures("optimised")

HERE = TESTS
#: From the tables of X. Li and S. Liao, Sci. China Phys. Mech. Astron. 60, 129511 (2017).
ROWS = {
    row["name"]: [float(row[key]) for key in ("v1", "v2", "period")]
    for row in csv.DictReader((HERE / "published_three_body.csv").read_text().splitlines())
}
EXACT = json.loads((HERE / "references" / "three_body_rows_reference.json").read_text())
#: Its largest multiplier is 1e12: no digit of the ten printed ones is left after a period.
HOPELESS = "II.C^ic_46"
UNIT = np.finfo(float).eps


def polished(name, **how):
    scene, seed = orbits.discovery.seeds.row(*ROWS[name])
    how = {"closing": orbits.reversal(IN_LINE), "throw": False} | how
    return orbits.find(scene, seed.y0, seed.period, **how)


@pytest.fixture(scope="module")
def close():
    """Bodies that meet at 1/50 of their distance.

    In plain time it closes to 1e-13 or 6e-13 as rounding has it, and only the latter is followed in
    logarithmic time; with segments it always is.
    """
    return polished("I.A^ic_7", segments=2)


def misses(orbit) -> tuple[float, float]:
    return orbits.analysis.closure(orbit), orbits.recheck(orbit).closure


def test_an_orbit_with_encounters_closes_over_its_whole_period(close):
    assert close.ok
    assert close.s_period is not None
    assert close.iterations <= 6
    assert close.residual < 1e-13
    assert max(misses(close)) < 1e-11  # 3e-11 in plain time
    exact = float(EXACT["I.A^ic_7"]["scale_free"])
    assert abs(orbits.identify(close).scale_free / exact - 1) < SOLVED


def test_an_orbit_without_encounters_stays_in_plain_time():
    eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    assert eight.s_period is None
    assert eight.residual < 1e-14


@pytest.mark.slow
def test_an_orbit_far_from_its_guess_is_cut_again_where_it_is():
    guess = 1.01 * np.asarray(kepler(0.9).y0)  # in logarithmic time, a tenth of the orbit
    far = orbits.find(kepler(0.9), guess, 6.2)
    there = logarithmic_span(far.scene, far.period)
    assert abs(far.s_period / float(there) - 1) < 1e-9
    assert far.residual < 1e-13  # 5e-13 where the cuts stay those of the guess


@pytest.mark.slow
def test_members_of_a_family_know_their_own_logarithmic_time(close):
    last = orbits.continue_family(close, members=3, step=0.3).members[-1].orbit
    assert abs(last.s_period / close.s_period - 1) > 1e-3
    assert abs(last.s_period / float(logarithmic_span(last.scene, last.period)) - 1) < 1e-9


def test_where_a_motion_has_no_logarithmic_time_its_orbit_has_none(close):
    repelling = eqx.tree_at(lambda s: s.effects[0].G, close.scene, -1.0)
    assert logarithmic_period(close.scene) == close.s_period
    assert logarithmic_period(repelling) is None
    assert logarithmic_period(close.scene.starting(close.y0, np.nan)) is None
    assert relocate(close, repelling).s_period is None


@pytest.mark.slow
def test_its_multipliers_are_those_of_plain_time(close):
    slow = orbits.stability(close)
    plain = orbits.stability(eqx.tree_at(lambda o: o.s_period, close, None))
    assert slow.verdict == plain.verdict
    assert gap(slow.nontrivial, plain.nontrivial) < 1e-7 * np.abs(plain.nontrivial).max()
    assert slow.symplectic_defect < 1e-12


@pytest.mark.slow
def test_its_file_keeps_the_time_it_is_followed_in(close, tmp_path):
    orbits.save(tmp_path / "orbit.json", close)
    loaded, claims = orbits.load(tmp_path / "orbit.json")
    assert loaded.s_period == close.s_period
    assert orbits.analysis.closure(loaded) == orbits.analysis.closure(close) == claims["closure"]
    assert orbits.verify(tmp_path / "orbit.json")[1] == []
    record = json.loads((tmp_path / "orbit.json").read_text())
    span = "expected a span of logarithmic time > 0, or null"
    for wrong, message in ((0.0, span), (-1.0, span), ("long", "s_period: expected float, got 'l")):
        forge(tmp_path / "wrong.json", record | {"s_period": wrong})
        with pytest.raises(ValueError, match=message):
            orbits.load(tmp_path / "wrong.json")


@pytest.mark.slow
def test_its_derivative_is_that_of_orbits_found_again(close):
    hold = orbits.Energy(float(-2.5 + 3 * (ROWS["I.A^ic_7"][0] ** 2 + ROWS["I.A^ic_7"][1] ** 2)))

    def found(g):
        scene = eqx.tree_at(lambda s: s.effects[0].G, close.scene, g)
        return orbits.find(scene, closing=close.closing, hold=hold).period

    def period(g):
        scene = eqx.tree_at(lambda s: s.effects[0].G, close.scene, g)
        return orbits.differentiable(scene, close, hold=hold).period

    # The two orbits have the same energy and differ in G alone.
    slope, h = jax.grad(period)(1.0), 1e-4
    assert abs(slope / ((found(1 + h) - found(1 - h)) / (2 * h)) - 1) < 1e-6


@pytest.mark.slow
def test_a_family_goes_through_encounters(close):
    family = orbits.continue_family(close, members=4, step=0.05)
    assert len(family.members) == 4
    for member in family.members:
        assert orbits.analysis.closure(member.orbit) < 1e-10
        scale_free = orbits.identify(member.orbit).scale_free  # one number along the family
        assert abs(scale_free / float(EXACT["I.A^ic_7"]["scale_free"]) - 1) < 1e-11


def test_cuts_are_where_bodies_are_far_apart(close):
    equations = Equations.of(close)
    guess = np.append(close.y0, close.period)
    whole = equations.pack(close.y0, (), 0.0, 0.0, close.period)
    cut = with_segments(equations, whole, close.rtol, 8)
    x = cut.spread(guess[:-1], guess[-1], close.rtol)
    bodies = np.asarray(cut.unpack(x).between)[:, :6].reshape(-1, 3, 2)
    sides = [
        np.linalg.norm(bodies[:, i] - bodies[:, j], axis=1) for i, j in ((0, 1), (0, 2), (1, 2))
    ]
    assert np.min(sides) > 0.2
    assert abs(sum(cut.shares) - 1) < 1e-9
    assert abs(cut.s_period / close.s_period - 1) < 1e-9
    found = cut(x, close.rtol)
    assert np.abs(found.residual).max() < SOLVED


def test_growth_says_what_doubles_permit(close):
    least = np.linalg.norm(orbits.stability(close).monodromy, 2)
    grown = evidence.growth(close)
    assert grown > 0.9 * least
    assert max(misses(close)) < 100 * UNIT * grown


@pytest.mark.slow  # a minute of one core
def test_published_rows_are_polished():
    steps = dict.fromkeys(ROWS, 0)

    def counted(name):
        def report(step):
            steps[name] = max(steps[name], step.index)

        return polished(name, report=report)

    found = {name: counted(name) for name in ROWS if name != HOPELESS}
    assert {name: orbit.outcome.name for name, orbit in found.items() if not orbit.ok} == {}
    assert max(orbit.residual for orbit in found.values()) <= 1e-12
    # In each search: rounding in plain time may ask for a second one, in logarithmic time.
    assert {name: most for name, most in steps.items() if most > 6} == {}
    closures = np.array([orbits.analysis.closure(orbit) for orbit in found.values()])
    # Rounding at encounters decides: 38 to 40 of the 52, by the last bits of where they are cut.
    assert np.mean(closures < 2e-12) > 2 / 3
    assert np.median(closures) < 1e-12
    assert closures.max() < 1e-9
    for name, orbit in found.items():
        scale_free = orbits.identify(orbit).scale_free
        assert scale_free is not None, name  # plain time would change the energy of one
        if name in EXACT:  # that one's multipliers are too large for the reference's long doubles
            assert abs(scale_free / float(EXACT[name]["scale_free"]) - 1) < 1e-11, name


@pytest.mark.slow
def test_where_doubles_keep_no_digit_the_search_says_so():
    orbit = polished(HOPELESS)
    assert orbit.outcome in (orbits.Outcome.COLLISION, orbits.Outcome.STEP_LIMIT)
    assert HOPELESS not in EXACT  # long doubles keep none either


SPAN = 9.0


def ended(e, s, rtol=1e-13, **how):
    return solve_regularized(kepler(e), SPAN, s, rtol=rtol, **how)


@pytest.mark.slow
def test_the_end_is_that_of_plain_time_wherever_logarithmic_time_ends():
    plain = solve(kepler(0.9), SPAN, rtol=1e-14).y1
    s = logarithmic_span(kepler(0.9), SPAN)
    for share in (1.0, 0.7, 1.1):  # short of the end, or beyond it: back
        run = ended(0.9, share * s)
        assert int(run.status) == Status.OK
        assert gap(run.y1, plain) < 100 * SOLVED
        assert int(run.steps) > 10


@pytest.mark.slow
def test_derivatives_are_those_of_plain_time():
    s = logarithmic_span(kepler(0.5), SPAN)

    def end(y, solved):
        return solved(kepler(0.5).starting(y)).y1[0]

    slow, plain = (
        [d(lambda y, how=how: end(y, how))(kepler(0.5).y0) for d in (jax.grad, jax.jacfwd)]
        for how in (
            lambda scene: solve_regularized(scene, SPAN, s, rtol=1e-13),
            lambda scene: solve(scene, SPAN, rtol=1e-13),
        )
    )
    assert gap(slow[0], slow[1]) < 1e-10
    assert gap(slow[0], plain[0]) < 1e-9


@pytest.mark.slow
def test_an_end_that_is_not_reached_is_nan_with_a_status():
    def end(y):
        return solve_regularized(kepler(0.9).starting(y), SPAN, 5.0, rtol=1e-13, max_steps=3)

    run = end(kepler(0.9).y0)
    assert int(run.status) == Status.STEP_LIMIT
    assert np.isnan(run.y1).all()
    # Derivatives of 0 would look like a motion that forgets its start.
    assert np.isnan(jax.jacfwd(lambda y: end(y).y1)(kepler(0.9).y0)).all()


@pytest.mark.slow
def test_a_motion_of_too_many_steps_in_one_piece_is_cut():
    # I.B^ic_189 of the same tables: its tangents take over 200,000 steps at this tolerance.
    scene, seed = orbits.discovery.seeds.row(0.3942881027, 0.0792702101, 196.8942769930)
    orbit = orbits.find(scene, seed.y0, seed.period)
    assert abs(orbit.period / seed.period - 1) < 1e-9
    linear = orbits.stability(orbit)
    assert linear.unit == 8
    # With a looser tolerance one piece suffices, in logarithmic time.
    whole = orbits.stability(orbit, rtol=1e-12)
    pair, again = (x.nontrivial[np.argmax(x.nontrivial.imag)] for x in (linear, whole))
    assert abs(pair - again) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "verdict", "exact"),
    [
        # Against heyoka's variational equations with 113 bits, where the orbit starts.
        ("I.A^ic_43", "stable", 0.9999965924 + 0.0026106371j),
        ("I.A^ic_65", "unstable", 1.0036451366),
    ],
)
def test_multipliers_next_to_one_are_decided(name, verdict, exact):
    linear = orbits.stability(polished(name))
    assert linear.verdict == verdict
    nearest = np.argmin(abs(linear.nontrivial - exact))
    # Rounding decides how much narrower: whether two tolerances suffice, or a third is asked for.
    assert linear.bars[nearest] < abs(exact - 1)
    assert abs(linear.nontrivial[nearest] - exact) < linear.bars[nearest]
