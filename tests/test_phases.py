"""run() and follow(): motions with corners."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap

from jaxdyn import Scene, Status, scenes
from jaxdyn.effects import PairGravity
from jaxdyn.events import Reaches
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.phases import END, Exit, Phase, follow, run

G, KEEPS = 10.0, 0.5


def bounce(t, y):
    """The vertical speed turns round, half of it is kept."""
    del t
    return y * jnp.array([1.0, 1.0, 1.0, -KEEPS])


LANDS = Reaches(1, 0.0, -1)
BALL = scenes.cannonball(g=G)
BOUNCING = {"fly": Phase(BALL, (Exit(LANDS, "fly", bounce), Exit(Reaches(0, 1.9, 1), END)))}
ENDLESS = {"fly": Phase(BALL, (Exit(LANDS, "fly", bounce),))}
START = jnp.array([0.0, 0.0, 1.0, 5.0])


def landings(n, vy=5.0):
    """Times of the first n landings: each flight takes 2 vy / g, and vy is halved each time."""
    return 2 * vy / G * np.cumsum(KEEPS ** np.arange(n))


@pytest.fixture(scope="module")
def bounces():
    return run(ENDLESS, "fly", START, 9.0, max_phases=20, samples=5)


def test_a_ball_bounces_at_the_closed_form(bounces):
    assert gap(bounces.times, landings(20)) < SOLVED
    assert bounces.names == ("fly",) * 20
    for before, after in zip(bounces.pieces, bounces.pieces[1:], strict=False):
        assert after.ts[0] == before.ts[-1]
        assert gap(after.ys[0], bounce(0.0, before.ys[-1])) < SOLVED
        assert np.isfinite(after.ys).all()


def test_infinitely_many_bounces_end_at_the_limit_of_phases(bounces):
    # The landings approach 2 vy / g / (1 - 1/2) = 2.
    assert abs(bounces.t - 2.0) < 2.0 * KEEPS**20 + SOLVED
    assert not bounces.ended
    assert bounces.status == Status.OK
    assert "The limit of 20 phases was reached at t = 2." in bounces.message
    assert "give the phase an exit to rest" in bounces.message


def test_the_earliest_exit_ends_the_motion():
    chain = run(BOUNCING, "fly", START, 9.0, samples=3)
    # x = t reaches 1.9 between the landings at 1.875 and 1.9375.
    assert abs(chain.t - 1.9) < SOLVED
    assert len(chain.pieces) == 5
    assert chain.ended
    assert chain.message == "Phase fly led to the end."
    assert gap(chain.pieces[-1].ys[-1], chain.y) < SOLVED


def test_the_span_ends_a_motion():
    chain = run(BOUNCING, "fly", START, 1.2, samples=3)
    assert chain.t == 1.2
    assert not chain.ended
    assert chain.message == "The span ended."
    assert gap(chain.y[:2], [1.2, 2.5 * 0.2 - G / 2 * 0.04]) < SOLVED


def test_a_failure_ends_it_without_numbers():
    fall = Scene(FreePoints([1.0, 1.0]), (PairGravity(),), y0=[-0.5, 0, 0.5, 0, 0, 0, 0, 0])
    phases = {"fall": Phase(fall, (Exit(Reaches(0, 9.0), END),))}
    chain = run(phases, "fall", fall.y0, 2.0, samples=3)
    assert chain.status == Status.STEP_COLLAPSED
    assert chain.message == f"In phase fall: {Status.STEP_COLLAPSED.message} {fall.singular}"
    assert np.isnan(chain.t)
    assert np.isnan(chain.y).all()
    assert np.isnan(chain.pieces[0].ys[-1]).all()
    assert not chain.ended


def after_two(v):
    """Time and state after two bounces."""
    y0 = jnp.concatenate([jnp.zeros(2), v])
    t, y = follow(ENDLESS, [("fly", 0)] * 2, y0, 9.0, rtol=1e-13)
    return jnp.concatenate([t[None], y])


@pytest.mark.slow
def test_a_known_sequence_is_differentiable():
    v = jnp.array([1.0, 5.0])
    total = 2 / G * 1.5  # t = total vy, x = vx t, and vy is 1/4 of what it was
    vx, vy = v
    assert gap(after_two(v), [total * vy, vx * vy * total, 0.0, vx, vy / 4]) < SOLVED
    expected = [[0, total], [vy * total, vx * total], [0, 0], [1, 0], [0, 1 / 4]]
    assert gap(jax.jit(jax.jacfwd(after_two))(v), expected) < SOLVED
    assert gap(jax.jit(jax.grad(lambda v: after_two(v)[1]))(v), expected[1]) < SOLVED


def test_another_sequence_than_expected_gives_no_numbers():
    # This start runs through the gate at 1.9 m in its first flight.
    start = START.at[2].set(2.5)
    t, y = follow(BOUNCING, [("fly", 0)], start, 9.0)
    assert np.isnan(t)
    assert np.isnan(y).all()
    t, _ = follow(BOUNCING, [("fly", 1)], start, 9.0)
    assert abs(t - 1.9 / 2.5) < SOLVED


def by_height(t, y):
    """0 over two metres, 1 below."""
    del t
    return jnp.where(y[1] > 2.0, 0, 1)


FORK = {
    "fly": Phase(BALL, (Exit(Reaches(0, 0.5, 1), ("fall", END), choose=by_height),)),
    "fall": Phase(BALL, (Exit(LANDS, END),)),
}


def test_what_comes_next_may_depend_on_the_state():
    # After half a second the height is vy / 2 - g / 8.
    high, low = (run(FORK, "fly", START.at[3].set(v), 9.0, samples=2) for v in (8.0, 5.0))
    assert high.names == ("fly", "fall")
    assert abs(high.t - 1.6) < SOLVED
    assert low.names == ("fly",)
    assert low.ended
    fast = START.at[3].set(8.0)
    t, _ = follow(FORK, [("fly", 0), ("fall", 0)], fast, 9.0)
    assert abs(t - 1.6) < SOLVED
    t, _ = follow(FORK, [("fly", 0), ("fall", 0)], START, 9.0)
    assert np.isnan(t)


def test_misuse_is_refused():
    with pytest.raises(ValueError, match=r"start: expected one of fly, got 'flyy'\. Did you"):
        run(BOUNCING, "flyy", START, 1.0)
    with pytest.raises(ValueError, match=r"t1: expected a time after t0 = 1\.0, got 1\.0"):
        run(BOUNCING, "fly", START, 1.0, t0=1.0)
    with pytest.raises(ValueError, match="max_phases: expected at least 1, got 0"):
        run(BOUNCING, "fly", START, 1.0, max_phases=0)
    with pytest.raises(ValueError, match=r"^phases: expected at least one, got none\."):
        run({}, "fly", START, 1.0)
    with pytest.raises(ValueError, match=r"^phases: expected names other than 'end', got end\."):
        run(BOUNCING | {END: BOUNCING["fly"]}, "fly", START, 1.0)
    with pytest.raises(ValueError, match=r"^exits of fly: expected a tuple, got Exit\. Write \(ex"):
        run({"fly": Phase(BALL, Exit(LANDS, END))}, "fly", START, 1.0)
    with pytest.raises(ValueError, match=r"^phase fly: expected a Phase, got Scene\. Make it"):
        run({"fly": BALL}, "fly", START, 1.0)
    with pytest.raises(ValueError, match=r"^t1: expected numbers, got '1'\."):
        run(BOUNCING, "fly", START, "1")
    astray = {"fly": Phase(BALL, (Exit(LANDS, "rol"),)), "roll": BOUNCING["fly"]}
    with pytest.raises(ValueError, match="exit of fly: expected one of end, fly, roll, got 'rol'"):
        run(astray, "fly", START, 1.0)
    with pytest.raises(ValueError, match="path: expected one of fly, got 'roll'"):
        follow(BOUNCING, [("roll", 0)], START, 1.0)
    with pytest.raises(ValueError, match="path: expected an exit of fly from 0 to 1, got 2"):
        follow(BOUNCING, [("fly", 2)], START, 1.0)
