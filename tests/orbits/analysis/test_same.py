"""Orbits that are the same but for what changes no motion, and words that say so."""

import csv
import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import TESTS

import jaxdyn
import orbits
from jaxdyn import scenes
from jaxdyn.analysis import energy
from jaxdyn.effects import LinearDrag, PairGravity
from jaxdyn.integrate.simulation import solve
from orbits import Orbit, Outcome
from orbits.analysis.words import canonical, spell
from orbits.discovery.plane import IN_LINE
from orbits.discovery.seeds import row
from orbits.motion import gravitates

#: 53 orbits of three equal masses from the tables of X. Li and S. Liao, Sci. China Phys. Mech.
#: Astron. 60, 129511 (2017), with the free-group words given there.
ROWS = list(csv.DictReader((TESTS / "published_three_body.csv").read_text().splitlines()))


def published(row):
    a, b = float(row["v1"]), float(row["v2"])
    y0 = [-1, 0, 1, 0, 0, 0, a, b, a, b, -2 * a, -2 * b]
    scene = scenes.three_body(y0, t1=float(row["period"]))
    return Orbit(scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)


def disguised(orbit, *, late=0.0, angle=0.0, mirror=1.0, order=(0, 1, 2), scale=1.0, back=False):
    y = np.asarray(solve(orbit.scene, late, rtol=1e-14).y1 if late else orbit.y0)
    x = y.reshape(2, 3, 2)[:, list(order)]
    c, s = np.cos(angle), np.sin(angle)
    x = (x * np.array([1.0, mirror])) @ np.array([[c, s], [-s, c]])
    x = x * np.array([scale, scale**-0.5 * (-1 if back else 1)])[:, None, None]
    scene = scenes.three_body(x.ravel(), t1=orbit.period * scale**1.5)
    return Orbit(scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)


@pytest.fixture(scope="module")
def orbit():
    """A published row is right to 1e-9 only, and the motion grows that."""
    closing = orbits.reversal(orbits.point_symmetry([1, 0, 2], (-1, -1), reversing=True))
    return orbits.find(published(ROWS[1]).scene, closing=closing)


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        {"late": 1.7},
        {"angle": 0.9},
        {"mirror": -1.0, "late": 3.1},
        {"order": (2, 0, 1), "late": 5.0},
        {"scale": 1.7},
        {"back": True},
        {"late": 2.2, "angle": 2.0, "mirror": -1.0, "order": (1, 2, 0), "scale": 0.6, "back": True},
    ],
    ids=lambda change: "+".join(change),
)
def test_what_changes_no_motion(change, orbit):
    found = orbits.analysis.match(orbit, disguised(orbit, **change))
    assert found.distance < 1e-6
    assert abs(found.scale - change.get("scale", 1.0)) < 1e-8
    assert orbits.analysis.word(disguised(orbit, **change)) == orbits.analysis.word(orbit)


@pytest.mark.slow
def test_others_differ():
    first, second, third = (published(row) for row in ROWS[:3])
    assert not orbits.same_orbit(first, second)
    assert not orbits.same_orbit(second, third)
    swing = orbits.find(scenes.pendulum(angle=1.0), period=2.2)
    assert not orbits.same_orbit(first, swing)
    level = orbits.Energy(energy.energy(swing.scene, jnp.zeros(()), swing.y0))
    later = swing.scene.starting(solve(swing.scene, 0.7).y1)
    assert orbits.same_orbit(swing, orbits.find(later, period=2.2, hold=level))


@pytest.mark.slow
def test_an_orbit_of_one_point_is_compared_as_it_is():
    """It has no centre of mass to be seen from: only shifts in time leave it the same."""
    well = orbits.find(scenes.henon_heiles(), period=6.5, hold=orbits.Energy(1 / 8))
    late = solve(well.scene, 1.7, rtol=1e-14).y1
    again = orbits.find(well.scene, late, well.period, hold=orbits.Energy(1 / 8))
    assert orbits.same_orbit(well, again)
    # The loop, which turns by a third leave as it is, and its mirror image, run through backwards.
    mirrored = well.y0 * jnp.array([-1.0, 1.0, -1.0, 1.0])
    back = orbits.find(well.scene, mirrored, well.period, hold=orbits.Energy(1 / 8))
    assert abs(back.period - well.period) < 1e-10
    assert not orbits.same_orbit(well, back)


@pytest.mark.slow
def test_the_neighbour_is_not_the_eight():
    guess = scenes.EIGHT_GUESS, scenes.EIGHT_GUESS_PERIOD
    neighbour = orbits.find(scenes.three_body(), *guess)
    eight = orbits.find(neighbour.scene, closing=orbits.choreography(3))
    assert not orbits.same_orbit(neighbour, eight)
    assert orbits.analysis.word(neighbour) == orbits.analysis.word(
        eight
    )  # the topology cannot tell them apart


def test_a_state_of_rest_under_a_drive_has_the_period_of_the_drive():
    scene, drive = scenes.shaken_pendulum(angle=0.0), 2 * np.pi / 60
    orbit = orbits.find(scene, scene.y0, 3 * drive)
    assert orbits.minimal_period(orbit) == (pytest.approx(drive, rel=1e-14), 3)


@pytest.mark.slow
def test_a_state_of_rest_under_a_drive_is_found():
    drive = 2 * np.pi / 60
    assert orbits.search_near(scenes.shaken_pendulum()).period == pytest.approx(drive, rel=1e-14)


def test_periods_that_hold_the_motion_more_than_once():
    eight = published(ROWS[0])
    thrice = Orbit(
        eight.scene.starting(eight.y0, 3 * eight.period), orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13
    )
    period, times = orbits.minimal_period(thrice)
    assert (times, round(period, 6)) == (3, 6.325914)
    assert orbits.same_orbit(eight, thrice)


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS[:3] + ROWS[21:23] + ROWS[31:33], ids=lambda row: row["name"])
def test_words_are_those_published(row):
    assert orbits.analysis.word(published(row)) == canonical(row["word"])


@pytest.mark.long
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["name"])
def test_every_published_row_has_its_word(row):
    closing = orbits.reversal(orbits.point_symmetry([1, 0, 2], (-1, -1), reversing=True))
    orbit = orbits.find(published(row).scene, closing=closing, throw=False)
    if not orbit.residual < 1e-9:
        pytest.skip(f"does not close from its published digits: {orbit.outcome.name}")
    whole = Orbit(orbit.scene, orbits.PLAIN, 0.0, Outcome.FOUND, 0, 1e-13)
    assert orbits.analysis.word(whole) == canonical(row["word"])


def test_words():
    assert orbits.analysis.syzygies(published(ROWS[0])) == (2, 3, 1, 2, 3, 1)
    assert spell((1, 3)) == "a"
    assert canonical("") == canonical("aA") == canonical("abBA") == ""
    assert canonical("BabA") == "ABab"
    with pytest.raises(ValueError, match="word: expected letters a, b, A, B"):
        canonical("abc")
    with pytest.raises(ValueError, match="three free points in the plane"):
        orbits.analysis.word(dataclasses.replace(published(ROWS[0]), scene=scenes.pendulum()))


@pytest.mark.slow
def test_yin_yang_two_is_one_orbit_from_both_of_its_published_starts():
    # So unstable that its second period is 1e-5 off its first.
    starts = (0.416822143554688, 0.330333312988282, 55.789829), (0.417343, 0.3131, 54.2076)
    one, other = (
        orbits.find(scene, seed.y0, seed.period, closing=orbits.reversal(IN_LINE))
        for scene, seed in (row(*start) for start in starts)
    )
    assert orbits.same_orbit(one, other)
    assert orbits.same_orbit(other, one)


def test_only_bodies_under_their_own_gravity_alone_are_scaled_by_keplers_third_law():
    scene = scenes.three_body()
    assert gravitates(scene)
    assert not gravitates(scene + LinearDrag(0.1))
    assert not gravitates(scene + PairGravity(1.0))
    assert not gravitates(scenes.oscillator())


def test_an_orbit_that_rests_where_it_starts_is_itself():
    """Under a drive the rate may vanish at the start, exactly or to rounding."""

    def follows(t, y, offset):
        return [100.0 * (offset - y[0] + jnp.cos(t)) - jnp.sin(t)]

    for offset in (0.0, 1e-17):
        scene = jaxdyn.ode(follows, [1.0], 2 * np.pi, params=offset)
        orbit = orbits.find(scene, [1.0], 2 * np.pi)
        found = orbits.analysis.same.match(orbit, orbit)
        assert found.distance < 1e-14
        assert orbits.same_orbit(orbit, orbit)
