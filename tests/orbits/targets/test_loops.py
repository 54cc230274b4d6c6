"""Closed orbits about a centre: counts, shapes and periods against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap

import jaxdyn
import orbits
from jaxdyn import scenes, simulate
from jaxdyn.effects import CentralForce, PowerLaw
from jaxdyn.formulations.newton import FreePoints
from orbits import drawing
from orbits.targets import loops


class Yukawa(CentralForce):
    def energy(self, r):
        return -jnp.exp(-r) / r


@pytest.mark.parametrize(
    ("n", "turns", "count"), [(-1.0, 2, 3), (-1.0, 3, 5), (3.0, 3, 7), (10.0, 1, 3), (-2.5, 3, 2)]
)
@pytest.mark.slow
def test_the_orbit_with_so_many_loops_and_turns(n, turns, count):
    orbit = loops.closed(PowerLaw(1.0, n), turns, count)
    assert orbit.ok
    assert orbit.residual <= 1e-12
    assert orbit.iterations <= 6
    assert loops.count(orbit) == (turns, count)
    # A second route: energy and angular momentum give the radii, those the angle.
    motion = simulate(orbit.scene, samples=4001, rtol=1e-12)
    r = np.hypot(np.asarray(motion["x"]), np.asarray(motion["y"]))
    assert np.ptp(r) > 0.02
    angle = scenes.apsidal_angle(PowerLaw(1.0, n), _nearest(orbit, n), r.max())
    assert abs(float(angle) / np.pi - turns / count) < 1e-9


def _nearest(orbit, n):
    """The smallest distance of an orbit, by bisection of the radial kinetic energy."""
    law = PowerLaw(1.0, n)
    x, y, vx, vy = np.asarray(orbit.y0)
    r, spin = np.hypot(x, y), x * vy - y * vx
    energy = 0.5 * (vx * vx + vy * vy) + float(law.energy(jnp.asarray(r)))
    low, high = 1e-3 * r, None
    for ratio in np.linspace(0.999, 0.001, 2000):
        if energy - float(law.energy(jnp.asarray(ratio * r))) - 0.5 * (spin / (ratio * r)) ** 2 < 0:
            low, high = ratio * r, ratio * r + r / 1000
            break
    assert high is not None
    for _ in range(60):
        middle = 0.5 * (low + high)
        left = energy - float(law.energy(jnp.asarray(middle))) - 0.5 * (spin / middle) ** 2
        low, high = (middle, high) if left < 0 else (low, middle)
    return high


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n", "turns", "count", "speed", "period", "closes"),
    [
        (-2.6, 2, 1, 0.43486087, 2.34159686, 1e-12),  # a nearest point at 0.005 of the farthest
        (-2.25, 5, 4, 0.27201239, 9.08214802, 1e-12),
        # Passages at 3.5e-5 with a speed of 4100: their energy is rounded by eps v^2 = 4e-9, on the
        # way in and out. The residual is 8e-10 to 1.4e-8, which changes with any rounding.
        (-2.6, 7, 3, 0.14371752, 6.31669414, 3 * 2 * 4e-9),
        (-1.5, 7, 10, 0.03673889, 23.60417853, 1e-12),
    ],
)
def test_orbits_that_pass_near_the_centre_are_found_and_their_turns_counted(
    n, turns, count, speed, period, closes
):
    orbit = loops.closed(PowerLaw(1.0, n), turns, count)
    assert orbit.residual <= closes
    assert gap(np.abs(orbit.y0), [1.0, 0.0, 0.0, speed]) < 1e-7
    # Closing leaves free where on the orbit it starts, in which direction, and of which size.
    r, v = (np.linalg.norm(part) for part in np.split(np.asarray(orbit.y0), 2))
    assert abs(v / r ** ((1 + n) / 2) - speed) < 1e-8
    assert abs(orbit.period / r ** ((1 - n) / 2) - period) < 1e-8
    assert loops.count(orbit) == (turns, count)


@pytest.mark.slow
def test_an_orbit_that_exists_but_cannot_be_followed_says_so():
    with pytest.raises(orbits.SearchError, match=r"exists: its smallest distance is 1.6.*e-16 of"):
        loops.closed(PowerLaw(1.0, -2.9), 9, 1)
    with pytest.raises(orbits.SearchError, match=r"exists, but not at ratios .*e-74"):
        loops.closed(PowerLaw(1.0, -1.0), 501, 1000)


@pytest.mark.slow
def test_turns_that_are_no_whole_number_are_not_rounded():
    ring = loops.rosette(PowerLaw(1.0, -1.0), 0.5, loops=3)
    no_orbit = orbits.Orbit(ring, orbits.PLAIN, 0.0, orbits.Outcome.FOUND, 0, 1e-12)
    with pytest.raises(orbits.SearchError, match="not a whole number"):
        loops.count(no_orbit)


@pytest.mark.slow
def test_every_orbit_of_a_spring_and_of_gravity_closes():
    spring = loops.closed(PowerLaw(4.0, 1.0), 1, 2)
    assert abs(spring.period - np.pi) < SOLVED
    kepler = loops.closed(PowerLaw(1.0, -2.0), 1, 1)
    speed = float(np.linalg.norm(kepler.y0[2:]))
    r = float(np.linalg.norm(kepler.y0[:2]))
    axis = 1 / (2 / r - speed**2)
    assert abs(kepler.period / (2 * np.pi * axis**1.5) - 1) < SOLVED
    assert loops.count(spring) == (1, 2)
    assert loops.count(kepler) == (1, 1)


@pytest.mark.slow
def test_a_law_of_ones_own_and_a_second_integrator():
    # Twice round for two loops and a bit: between circle and line of this law.
    orbit = loops.closed(Yukawa(), 5, 4, r=1.5)
    assert orbit.residual <= 1e-12
    assert loops.count(orbit) == (5, 4)
    assert orbits.recheck(orbit).closure < 1e-11


def test_what_does_not_exist_says_why():
    with pytest.raises(orbits.SearchError, match=r"monotone from 0.70.* to 0.5 near lines.*roset"):
        loops.closed(PowerLaw(1.0, -1.0), 1, 1)
    # Neither limit is reached: 1 / 3 belongs to circles alone.
    with pytest.raises(orbits.SearchError, match="reaches neither"):
        loops.closed(PowerLaw(1.0, 6.0), 1, 3)
    # For a law whose limits nobody has proved, only the shapes that were tried are known.
    with pytest.raises(orbits.SearchError, match=r"At 6. ratios of radii from .*not excluded"):
        loops.closed(Yukawa(), 1, 3, r=1.5)
    with pytest.raises(orbits.SearchError, match=r"as steep as r\^-3, where only circles close"):
        loops.closed(PowerLaw(1.0, -4.0), 1, 2)
    with pytest.raises(orbits.SearchError, match="it repels"):
        loops.closed(PowerLaw(-1.0, -2.0), 1, 1)


@pytest.mark.parametrize(("n", "only"), [(1.0, "1 / 2"), (-2.0, "1 / 1")])
def test_where_every_orbit_closes_there_is_one_choice_of_turns_and_loops(n, only):
    with pytest.raises(orbits.SearchError, match=f"every motion .* closes, .* = {only}. Choose"):
        loops.closed(PowerLaw(1.0, n), 2, 3)


def _circle(y0):
    """A circular orbit under Kepler's law from a traced start."""
    scene = jaxdyn.Scene(FreePoints(jnp.ones(1), 2), (PowerLaw(1.0, -2.0),), y0=y0, t1=2 * np.pi)
    return orbits.Orbit(scene, orbits.PLAIN, 0.0, orbits.Outcome.FOUND, 1, 1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: loops.closed(PowerLaw(), 0, 1), "turns: expected a whole number"),
        (lambda: loops.closed(PowerLaw(), 1, 1.5), "loops: expected a whole number"),
        (lambda: loops.closed(PowerLaw(), 2, 4), "turns: expected no common factor .* 1 turns"),
        (lambda: loops.closed(1.0, 2, 3), "law: expected a CentralForce"),
        (
            lambda: jax.grad(lambda k: loops.closed(PowerLaw(k), 1, 1).period)(1.0),
            "law: expected numbers, got values traced",
        ),
        (
            lambda: jax.grad(lambda r: loops.closed(PowerLaw(), 2, 3, r=r).period)(1.0),
            "r: expected numbers, got values traced",
        ),
        (
            lambda: jax.grad(lambda x: loops.rosette(PowerLaw(), x).t1)(0.5),
            "ratio: expected numbers, got values traced",
        ),
        (
            lambda: jax.grad(lambda n: loops.fewest(n).circle[0])(0.5),
            "n: expected numbers, got values traced",
        ),
        (
            lambda: jax.jit(lambda y0: loops.count(_circle(y0)))(jnp.array([1.0, 0.0, 0.0, 1.0])),
            "orbit: expected numbers, got values traced",
        ),
        (lambda: loops.closed(PowerLaw(), 2, 3, r=-1.0), "r: expected > 0"),
        (lambda: loops.fewest([1.0, np.nan]), "n: expected finite numbers"),
        (lambda: loops.fewest("two"), "n: expected numbers"),
        (lambda: drawing.loops(lowest=-3.0), "lowest: expected above -3"),
    ],
)
def test_misuse_is_refused_with_the_remedy(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_the_least_number_of_loops_against_the_exponent():
    n = np.concatenate([np.linspace(-5.0, 20.0, 251), [1.0, -2.0, 1e6]])
    found = loops.fewest(n)
    moves = n > -3
    assert (found.loops[~moves] == 0).all()
    assert "only circles close" in found.message
    low, high = np.minimum(found.circle, found.line), np.maximum(found.circle, found.line)
    for i in np.flatnonzero(moves):
        p, q = found.turns[i], found.loops[i]
        if n[i] in (1.0, -2.0):
            assert p / q == low[i] == high[i]
            continue
        assert low[i] < p / q < high[i]
        fewer = np.arange(1, q)
        assert (np.floor(fewer * low[i]) + 1 >= fewer * high[i]).all()
    assert (found.loops[n > 6.01] == 3).all()
    assert "Every exponent" in loops.fewest(0.0).message


@pytest.mark.parametrize("n", [-2.7, -2.3, -1.6, -1.0, 0.0, 0.5, 2.0, 5.0])
def test_the_angles_lie_between_their_limits(n):
    """What `fewest` rests on: near circles pi / sqrt(n + 3), and from there on one way."""
    found = loops.fewest(n)
    ratios = np.linspace(0.2, 0.97, 30)
    angles = [float(scenes.apsidal_angle(PowerLaw(1.0, n), x, 1.0)) / np.pi for x in ratios]
    low, high = sorted((float(found.circle[0]), float(found.line[0])))
    assert low < min(angles)
    assert max(angles) < high
    steps = np.diff(angles) * np.sign(found.circle - found.line)
    assert (steps > 0).all()
    assert abs(angles[-1] - found.circle[0]) < 1e-3


def test_the_picture_has_both_limits_and_the_counts(tmp_path):
    figure = drawing.loops(tmp_path / "loops.png")
    angles, counts = figure.axes
    texts = {text.get_text() for text in angles.texts}
    assert {"gravity", "spring", "2/3", "1/3"} <= texts
    assert len(counts.lines) == 1
    assert (tmp_path / "loops.png").stat().st_size > 10_000


@pytest.mark.slow
def test_what_does_not_close_fills_its_ring(tmp_path):
    ring = simulate(loops.rosette(PowerLaw(1.0, -1.0), 0.6, r=2.0), samples=4000)
    r = np.hypot(np.asarray(ring["x"]), np.asarray(ring["y"]))
    assert abs(r.max() - 2.0) < 1e-9
    assert abs(r.min() - 1.2) < 1e-5  # samples pass the nearest point
    turned = np.unwrap(np.arctan2(np.asarray(ring["y"]), np.asarray(ring["x"])))
    angle = float(scenes.apsidal_angle(PowerLaw(1.0, -1.0), 0.6, 1.0))
    assert abs(turned[-1] - 80 * angle) < 1e-7
    figure = drawing.rosette(ring.scene, tmp_path / "ring.png", "why " * 40)
    assert figure.axes[0].get_title().count("\n") == 2
    assert (tmp_path / "ring.png").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: loops.rosette(PowerLaw(), 1.0), "ratio: expected below 1"),
        (lambda: loops.rosette(PowerLaw(), 0.0), "ratio: expected > 0"),
        (lambda: loops.rosette(PowerLaw(), loops=0), "loops: expected a whole number"),
        (lambda: loops.rosette(2.0), "law: expected a CentralForce"),
    ],
)
def test_rosettes_that_make_no_sense_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_where_nothing_moves_between_two_radii_there_is_no_rosette():
    with pytest.raises(orbits.SearchError, match="only circles close"):
        loops.rosette(PowerLaw(1.0, -4.0))
