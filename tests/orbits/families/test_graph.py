"""Which families meet, where, and how often the one traces the other; their picture."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from odes import pitchfork_of_cycles, roessler

import jaxdyn
import orbits
from orbits.families.graph import Graph, Place
from orbits.shooting.equations import Equations


def _roessler(c):
    return jaxdyn.ode(roessler, jnp.zeros(3), 6.0, params=c)


@pytest.fixture(scope="module")
def pitchfork():
    def make(mu):
        return jaxdyn.ode(pitchfork_of_cycles, jnp.zeros(3), 6.0, params=mu)

    return orbits.diagram(
        make, -0.1, jnp.zeros(3), within=(-0.2, 0.4), orbit_members=14, orbit_step=0.1
    )


@pytest.mark.slow
def test_cycles_meet_at_their_pitchfork_and_begin_at_the_hopf_point(pitchfork, tmp_path):
    found = orbits.graph(pitchfork)
    hopf, branch = found.places
    assert (hopf.kind, hopf.families, hopf.equilibria) == ("Hopf point", (0,), (0,))
    assert (branch.kind, branch.families, branch.times) == ("branch point", (0, 1, 2), (1, 1, 1))
    assert abs(hopf.parameter) < 1e-9
    assert abs(branch.parameter - 0.2) < 1e-9
    assert abs(branch.period - 2 * np.pi) < 1e-9
    assert found.components == [(0, 1, 2)]
    assert "branch point  families 1, 2, 3 at parameter 0.2" in repr(found)
    path = tmp_path / "graph.png"
    orbits.drawing.graph(found, path, parameter="mu")
    assert path.stat().st_size > 10_000


@pytest.mark.slow
def test_families_that_do_not_meet_are_not_joined(pitchfork):
    one, *_ = pitchfork.orbits
    # The half of the other family that stops before the point, and none of its ends near it.
    two = pitchfork.orbits[1]
    far = orbits.families.Family(two.members[8:], (), two.end, two.equations)
    found = orbits.graph([one, far])
    assert found.places == ()
    assert found.components == [(0,), (1,)]


@pytest.mark.long
def test_a_doubled_family_traces_the_first_one_twice():
    options = {"within": (0.1, 3.2), "depth": 1, "orbit_step": 0.2, "orbit_members": 60}
    found = orbits.graph(orbits.diagram(_roessler, 0.5, [0.1, -0.5, 0.5], **options))
    doubling = next(place for place in found.places if place.kind == "period doubling")
    assert (doubling.families, doubling.times) == ((0, 1), (1, 2))
    assert "families 1, 2 (twice)" in repr(found)


def test_components_are_joined_through_places():
    def place(*families):
        return Place("branch point", None, 0.0, 0.0, families, (1,) * len(families))

    found = Graph(
        families=(None,) * 5, equilibria=(), places=(place(0, 3), place(1, 2), place(3, 4))
    )
    assert found.components == [(0, 3, 4), (1, 2)]


def test_misuse():
    with pytest.raises(ValueError, match="families: expected at least one family of orbits"):
        orbits.graph([])
    swing = orbits.find(jaxdyn.scenes.pendulum(angle=0.5), period=2.0)
    equations = Equations.of(swing)
    other = dataclasses.replace(equations, make=lambda g: jaxdyn.scenes.pendulum(g=g))
    families = [orbits.families.Family((), (), "", each) for each in (equations, other)]
    with pytest.raises(ValueError, match="families: expected all with a parameter, or all without"):
        orbits.graph(families)
