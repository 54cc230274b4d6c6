"""One motion by several routes: agreement to 1e-10, or to what chaos allows."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap

from benchmarks.effects_cost import by_hand
from jaxdyn import simulate
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes import guides, linkages, pendula

AGREE = 1e-10

#: Regular motions over their spans: the scene, its other formulations, and the material points
#: in free and in tied coordinates that are the same.
REGULAR = {
    "pendulum": (pendula.pendulum, ("lagrange", "constrained"), (0,), (0,)),
    "shaken stick": (pendula.shaken_pendulum, ("constrained",), (0, 2), (0, 2)),
    "cart": (pendula.cart_pendulum, ("constrained",), (0, 1), (0, 1)),
    "bead on a parabola": (guides.bead_on_parabola, ("lagrange", "constrained"), (0,), (0,)),
    "turntable": (guides.turntable, ("lagrange",), (0,), (0,)),
    "rod on a line": (linkages.rod_on_line, ("constrained",), (0, 1), (0, 1)),
    # Hinges 0 to 3 of the row; near ends 0 to 2 and last far end 5 of the bodies.
    "four bars": (linkages.four_bar, ("constrained",), (0, 1, 2, 3), (0, 1, 2, 5)),
    "four bars in a loop": (linkages.four_bar, ("loop",), (0, 1, 2, 3), (0, 1, 2, 3)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", REGULAR)
def test_regular_motions_agree_by_every_route(name):
    make, others, free_points, tied_points = REGULAR[name]
    free = simulate(make(formulation="newton_euler"), samples=9, rtol=1e-13).r
    for formulation in others:
        other = simulate(make(formulation=formulation), samples=9, rtol=1e-13).r
        points = free_points if formulation == "lagrange" else tied_points
        assert gap(free[:, free_points], other[:, points]) < AGREE


@pytest.mark.slow
def test_pinned_chain_moves_alike_in_angles_and_as_bodies():
    # Three bars: the programs of the four-bar linkage.
    numbers = {"m": (1.0, 0.5, 2.0), "length": (1.0, 1.5, 1.2), "angles": (0.3, 1.5, 2.4)}
    numbers |= {"rates": (0.5, 0.0, 0.0), "t1": 3.0}
    loop, bodies = (
        simulate(linkages.pinned_chain(**numbers, formulation=f), samples=9, rtol=1e-13).r
        for f in ("loop", "constrained")
    )
    assert gap(loop[:, :3], bodies[:, :3]) < AGREE


@pytest.mark.parametrize(
    ("make", "span", "rate"),
    # The course's 30 time units for the double pendulum.
    [(pendula.double_pendulum, 30.0, 0.38), (pendula.triple_pendulum, 10.0, 0.89)],
)
@pytest.mark.slow
def test_chaotic_pendulums_agree_to_what_their_growth_rate_allows(make, span, rate):
    scene = make()
    end = lambda y: solve(scene.starting(y), span, rtol=1e-13).y1  # noqa: E731
    growth = float(jnp.abs(jax.jit(jax.jacfwd(end))(scene.y0)).max())
    # Errors grow like exp(rate t): stated here, to two digits.
    assert abs(np.log(growth) / span - rate) < 0.006

    n = scene.y0.size // 2
    ends = []
    for formulation in ("newton_euler", "lagrange", "constrained"):
        other = make(formulation=formulation)
        out = solve(other, span, rtol=1e-14)
        ends.append(other.system.points(jnp.asarray(span), out.y1).r[-n:])
    # The rounding of some hundred steps, grown.
    allowed = 1e-14 * growth
    assert allowed < 1e-8
    assert gap(ends[0], ends[1]) < allowed
    assert gap(ends[0], ends[2]) < allowed


@pytest.mark.parametrize("make", [pendula.double_pendulum, pendula.triple_pendulum])
def test_composed_pendulums_have_the_rates_of_hand_derived_ones(make):
    scene = make()
    states = jax.random.normal(jax.random.key(6), (8, scene.y0.size))
    rates = [
        jax.jit(jax.vmap(lambda y, s=s: s.rate(jnp.zeros(()), y)))(states)
        for s in (scene, by_hand(scene))
    ]
    assert gap(*rates) < SOLVED
