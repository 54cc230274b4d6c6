"""What `print` shows of orbits, families, searches and aims."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import orbits
from jaxdyn import equilibria, scenes
from orbits.targets import aim, loops

SHAPES = re.compile(r"\b[fi]\d\d\[")


def lines(x) -> list[str]:
    """The lines that are printed of something, none of them long."""
    text = str(x)
    assert not SHAPES.search(text)
    found = text.split("\n")
    assert max(map(len, found)) <= 100
    return found


@pytest.fixture(scope="module")
def swing():
    return orbits.find(scenes.pendulum(angle=2.0), period=2.7)


def test_an_orbit_is_shown(swing):
    head, period, closing, *rest = lines(swing)
    assert (head, period) == ("Orbit of pendulum", f"  period   {swing.period:.14g} s")
    assert re.match(
        r"  closing  plain closing, residual \S+ after \d+ steps? at rtol 1e-\d+$", closing
    )
    assert rest == [
        "  outcome  FOUND: The orbit closes.",
        "  start    theta = 2 rad, theta_dot = 0 rad/s",
    ]
    assert repr(jax.tree.map(lambda x: None, swing)).startswith("Orbit")


def test_what_an_orbit_is_and_its_stability_are_shown(swing):
    assert lines(orbits.stability(swing)) == [
        "Stability: stable",
        "  equal to 1  2: energy, flow",
    ]
    what = orbits.identify(swing)  # one body: nothing is said about choreographies
    assert lines(what) == ["Identity", f"  energy  {what.energy:.6g} J"]


@pytest.mark.slow
def test_multipliers_are_shown_with_their_bars():
    eight = orbits.find(scenes.three_body(), closing=orbits.choreography(3))
    assert "choreography of 3, residual " in lines(eight)[2]
    text = str(orbits.stability(eight))
    # Simo (2002), Contemp. Math. 292, 209: rotation numbers 0.00842272 and 0.29809253.
    assert "rotation     0.00842272471, 0.298092529" in text
    assert re.search(r"0\.9985999\d+\+0\.05289\d+j \(\+-\de-1\d\)", text)
    assert "equal to 1   8: angular momentum, energy" in text


@pytest.mark.slow
def test_a_family_and_a_search_are_shown(swing):
    family = orbits.continue_family(swing, members=3)
    head, period, energy, *rest = lines(family)
    assert head == "Family of 3 orbits of pendulum"
    assert period == f"  period     {family.periods[0]:.6g} to {family.periods[-1]:.6g} s"
    assert energy == f"  energy     {family.energies[0]:.6g} to {family.energies[-1]:.6g} J"
    assert rest[0] == "  stability  3 stable"
    assert lines(family.members[0]) == [
        "Member of a family of pendulum",
        f"  period     {family.periods[0]:.6g} s",
        f"  energy     {family.energies[0]:.6g} J",
        "  stability  stable",
    ]
    assert "<img" in family.members[0]._repr_html_()
    starts = orbits.discovery.Starts([[1.0, 0.0]])
    found = orbits.search(scenes.oscillator(k=4.0), starts, 1, longest=5)
    head, counts, row = lines(found)
    assert head == "SearchResult: 1 orbit of oscillator"
    assert counts.startswith("  counts  1 samples, ")
    assert row == f"  1       period {np.pi:.6g}, stable"


def test_equilibria_are_shown_with_what_they_are():
    head, *rows = lines(equilibria(scenes.pendulum(), [-4.0], [4.0]))
    assert head == "Equilibria: 2 equilibria"
    assert rows[0] == "  1          (-3.14159, 0): isolated, unstable, saddle"
    assert rows[1] == "  2          (0, 0): isolated, stable, centre"
    assert rows[2].startswith("  certainty  complete")


def test_aims_are_shown_in_the_units_of_their_scene():  # which may be km, so none is named
    hits = lines(aim.hit(scenes.cannonball(), 5.0, 10.0))
    # sin(2 a) = g x / v^2.
    low = 0.5 * np.arcsin(9.81 * 5.0 / 100.0)
    assert hits[:5] == [
        "Hits",
        "  x        5",
        "  speed    10",
        "  height   0",
        f"  angles   ({low:.6g}, {np.pi / 2 - low:.6g}) rad",
    ]
    assert hits[-2:] == ["  outcome  FOUND", "  message  The aim was found."]
    throws = lines(aim.farthest(scenes.cannonball(), np.linspace(1.0, 9.0, 9)))
    assert throws[1] == "  speed    shape (9,)"
    fewest = lines(loops.fewest(jnp.array([-1.0, 1.0])))
    assert fewest[:2] == ["FewestLoops", "  n        (-1, 1)"]


def test_a_traced_orbit_is_shown_by_its_shapes(swing):
    seen = []
    jax.jit(lambda orbit: seen.append(repr(orbit)))(swing)
    assert seen[0].startswith("Orbit(")
    assert "y0=f64[2]" in seen[0]
