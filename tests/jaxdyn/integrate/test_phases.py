"""run() and follow(): motions with corners."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap

from jaxdyn import Scene, Status, scenes, simulate
from jaxdyn._progress import progress_to
from jaxdyn.effects import PairGravity, Spring, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.hard.cases.contact import box
from jaxdyn.integrate.events import Reaches, When, stop_of
from jaxdyn.integrate.phase import END, Exit, Phase
from jaxdyn.integrate.phases import follow, simulate_phases
from jaxdyn.solvers import DOPRI8

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
    return simulate_phases(ENDLESS, "fly", START, 9.0, max_phases=20, samples=5)


def test_a_ball_bounces_at_the_closed_form(bounces):
    assert gap(bounces.times, landings(20)) < SOLVED
    assert bounces.names == ("fly",) * 20
    for before, after in zip(bounces.pieces, bounces.pieces[1:], strict=False):
        assert after.ts[0] == before.ts[-1]
        assert gap(after.ys[0], bounce(0.0, before.ys[-1])) < SOLVED
        assert np.isfinite(after.ys).all()


def test_each_phase_is_announced():
    said = []
    with progress_to(lambda what, done, total: said.append(what)):
        simulate_phases(ENDLESS, "fly", START, 9.0, max_phases=2, samples=5)
    assert said == ["phase fly from t = 0", "phase fly from t = 1"]


def test_infinitely_many_bounces_end_at_the_limit_of_phases(bounces):
    # The landings approach 2 vy / g / (1 - 1/2) = 2.
    assert abs(bounces.t - 2.0) < 2.0 * KEEPS**20 + SOLVED
    assert not bounces.ended
    assert bounces.status == Status.PHASE_LIMIT
    assert f"{bounces.status!s} {bounces.status} {bounces.status:d}" == "PHASE_LIMIT PHASE_LIMIT 14"
    assert json.dumps(bounces.status) == "14"
    start = "At t = 2, after 20 phases: The limit of phases was reached. Raise max_phases;"
    assert bounces.message.startswith(start)
    assert "add an exit to a phase of rest" in bounces.message


@pytest.mark.slow
def test_the_earliest_exit_ends_the_motion():
    chain = simulate_phases(BOUNCING, "fly", START, 9.0, samples=3)
    # x = t reaches 1.9 between the landings at 1.875 and 1.9375.
    assert abs(chain.t - 1.9) < SOLVED
    assert len(chain.pieces) == 5
    assert chain.ended
    assert chain.message == "Phase fly led to the end."
    assert gap(chain.pieces[-1].ys[-1], chain.y) < SOLVED


def test_the_span_ends_a_motion():
    chain = simulate_phases(BOUNCING, "fly", START, 1.2, samples=3)
    assert chain.t == 1.2
    assert not chain.ended
    assert chain.message == "The span ended."
    assert gap(chain.y[:2], [1.2, 2.5 * 0.2 - G / 2 * 0.04]) < SOLVED


@pytest.mark.slow
def test_a_failure_ends_it_without_numbers():
    fall = Scene(FreePoints([1.0, 1.0]), (PairGravity(),), y0=[-0.5, 0, 0.5, 0, 0, 0, 0, 0])
    phases = {"fall": Phase(fall, (Exit(Reaches(0, 9.0), END),))}
    chain = simulate_phases(phases, "fall", fall.y0, 2.0, samples=3)
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
    high, low = (
        simulate_phases(FORK, "fly", START.at[3].set(v), 9.0, samples=2) for v in (8.0, 5.0)
    )
    assert high.names == ("fly", "fall")
    assert abs(high.t - 1.6) < SOLVED
    assert low.names == ("fly",)
    assert low.ended
    fast = START.at[3].set(8.0)
    t, _ = follow(FORK, [("fly", 0), ("fall", 0)], fast, 9.0)
    assert abs(t - 1.6) < SOLVED
    t, _ = follow(FORK, [("fly", 0), ("fall", 0)], START, 9.0)
    assert np.isnan(t)


# ---- Bounds: where a phase may begin


def test_a_ball_at_rest_on_the_floor_does_not_fall_through_it():
    chain = simulate_phases(ENDLESS, "fly", START.at[3].set(0.0), 1.0, samples=3)
    assert chain.status == Status.STUCK
    assert chain.t < EXACT
    assert abs(chain.y[1]) < EXACT


def test_a_start_beyond_a_bound_is_named():
    scene = scenes.impact_oscillator(x=0.5)
    with pytest.raises(ValueError, match="a start of phase swing, got one beyond impact on"):
        simulate_phases(scenes.phases_of(scene), None, scene.y0, 20.0)
    with pytest.raises(ValueError, match=r"y0: .* beyond the event of its exit 0"):
        simulate_phases(ENDLESS, "fly", START.at[1].set(-1.0), 1.0)


def test_endless_bounces_end_above_the_floor():
    """Not below it, with "The span ended.", once they are shorter than can be seen."""
    chain = simulate_phases(ENDLESS, "fly", START, 9.0, samples=5)
    assert chain.status == Status.STUCK
    assert not chain.ended
    assert abs(chain.t - 2.0) < 10 * EXACT
    assert abs(chain.y[1]) < EXACT
    assert len(chain.pieces) > 45
    assert min(piece.ys[:, 1].min() for piece in chain.pieces) > -10 * EXACT
    assert chain.message.startswith("At t = 2, in phase fly: Exits lead from phase to phase and no")
    assert "add an exit to a phase of rest" in chain.message


def test_a_motion_beyond_a_bound_has_no_numbers(monkeypatch):
    """Should a crossing ever be missed."""

    def blind(scene, events, t1, t0, options, sides):
        never = (Reaches(0, 1e9, 1),) * len(events)
        return stop_of(scene, never, t1, t0, options)

    monkeypatch.setattr("jaxdyn.integrate.phases.stop_of", blind)
    chain = simulate_phases(ENDLESS, "fly", START, 2.0, samples=5)
    assert chain.status == Status.BOUND_PASSED
    assert np.isnan(chain.t)
    assert np.isnan(chain.y).all()
    assert gap(chain.pieces[0].ys[:2, 1], [0.0, 5 * 0.5 - 5 * 0.25]) < SOLVED
    assert np.isnan(chain.pieces[0].ys[3:]).all()
    assert chain.message.startswith("In phase fly: The motion is on the far side of a bound of its")
    assert chain.pieces[0].message == Status.BOUND_PASSED.message


@pytest.mark.slow
@pytest.mark.parametrize("one_sided", [True, False])
def test_a_ball_stays_in_its_box_though_it_meets_the_corners(one_sided):
    inside = box(one_sided)
    y0 = jnp.array([0.5, 0.5, 1.0, 1.0])
    chain = simulate_phases(inside, "box", y0, 4.25, samples=2)
    assert gap(chain.y, [0.75, 0.75, 1.0, 1.0]) < SOLVED
    # Two exits at each of the corners (1, 1), (0, 0), (1, 1), (0, 0).
    assert chain.path == (("box", 1), ("box", 3), ("box", 0), ("box", 2)) * 2
    assert gap(chain.times, [0.5, 1.5, 2.5, 3.5, 4.25]) < SOLVED
    t, y = follow(inside, chain.path[:4], y0, 4.0)
    assert abs(t - 1.5) < SOLVED
    assert gap(y, [0.0, 0.0, 1.0, 1.0]) < SOLVED
    t, _ = follow(inside, [("box", 1), ("box", 2)], y0, 4.0)
    assert np.isnan(t)


def low(t, y):
    """Positive under a height of one metre."""
    del t
    return 1.0 - y[1]


# A ball that is slower in deep air: below one metre the exit of "high" does not hold, and back.
STOREYS = {
    "high": Phase(scenes.cannonball(g=G), (Exit(When(low, 1), "deep"),)),
    "deep": Phase(scenes.cannonball(g=1.0), (Exit(When(low, -1), "high"), Exit(LANDS, END))),
}


@pytest.mark.slow
def test_a_phase_begins_where_its_bounds_hold_else_its_exit_is_taken_at_once():
    fall = jnp.array([0.0, 0.5, 0.0, 0.0])
    for start in ("high", "deep", None):
        chain = simulate_phases(STOREYS, start, fall, 9.0, samples=2)
        assert chain.names == ("deep",)
        assert chain.path == ((("high", 0),) if start == "high" else ()) + (("deep", 1),)
        assert abs(chain.t - 1.0) < SOLVED
    t, _ = follow(STOREYS, [("high", 0), ("deep", 1)], fall, 9.0)
    assert abs(t - 1.0) < SOLVED
    t, _ = follow(STOREYS, [("deep", 1)], fall.at[1].set(1.5), 9.0)
    assert np.isnan(t)  # it is not deep
    # At the bound the way it goes decides.
    up, down = (
        simulate_phases(STOREYS, None, [0.0, 1.0, 0.0, v], 9.0, samples=2) for v in (1.0, -1.0)
    )
    assert up.names[0] == "high"
    assert abs(up.times[0] - 2 / G) < SOLVED
    assert down.names == ("deep",)


def kicked(t, y):
    """One more metre a second upwards."""
    del t
    return y + jnp.array([0.0, 0.0, 0.0, 1.0])


@pytest.mark.slow
@pytest.mark.parametrize("one_sided", [True, False])
def test_a_kick_at_each_passage_is_no_bound(one_sided):
    """A spring that is kicked where it passes its middle upwards: the motion goes on beyond."""
    swing = scenes.particles.particle(Spring(1.0), position=(0.0, -1.0), velocity=(0.0, 0.0))
    kick = Exit(Reaches(1, 0.0, 1), "swing", kicked, one_sided=one_sided)
    chain = simulate_phases({"swing": Phase(swing, (kick,))}, None, swing.y0, 20.0, samples=2)
    if one_sided:
        assert chain.status == Status.STUCK
        assert "set one_sided=False on an exit whose phase may begin beyond" in chain.message
        assert abs(chain.t - np.pi / 2) < SOLVED
    else:
        assert gap(chain.times, [np.pi / 2, 5 * np.pi / 2, 9 * np.pi / 2, 20.0]) < 10 * SOLVED
        assert abs(np.hypot(*chain.y[jnp.array([1, 3])]) - 4.0) < 1e-9


def test_an_end_at_the_start_is_a_motion_of_one_sample():
    ends = {"fly": Phase(BALL, (Exit(Reaches(0, 1.0, 1), END),))}
    chain = simulate_phases(ends, "fly", START.at[0].set(2.0), 1.0)
    assert chain.ended
    assert chain.times == (0.0,)
    assert gap(chain.pieces[0].ys, START.at[0].set(2.0)[None]) == 0


def test_a_start_that_fits_no_phase_is_refused():
    rolling = scenes.cylinder_on_ramp()
    on_a_rail = {"roll": Phase(rolling, (Exit(Reaches(0, 9.0, 1), END),))}
    high = rolling.y0.at[1].add(1.0)
    with pytest.raises(ValueError, match=r"^y0: expected a state of roll, got .*Name the start\."):
        simulate_phases(on_a_rail, None, high, 1.0)
    with pytest.raises(ValueError, match=r"^y0: expected a state of roll, got \[0\. 0\.\]"):
        simulate_phases(on_a_rail, None, [0.0, 0.0], 1.0)


def time_to_fall(t, y):
    """The time until a ball at y[1] with the speed y[3] is on the floor."""
    del t
    return (y[3] + jnp.sqrt(y[3] ** 2 + 2 * G * y[1])) / G


def fallen(t, y):
    """The ball on the floor."""
    after = time_to_fall(t, y)
    return jnp.stack([y[0] + after * y[2], 0 * y[1], y[2], y[3] - G * after])


def test_the_end_of_a_phase_may_be_in_closed_form():
    last = Exit(Reaches(1, 0.5, -1), END, fallen, lasts=time_to_fall, one_sided=False)
    shortcut = {"fly": Phase(BALL, (last,))}
    chain = simulate_phases(shortcut, "fly", START, 2.0, samples=3)
    assert chain.ended
    assert abs(chain.t - 1.0) < SOLVED
    assert gap(chain.y, [1.0, 0.0, 1.0, -5.0]) < SOLVED
    assert gap(follow(shortcut, [("fly", 0)], START, 2.0)[0], chain.t) == 0
    # Where the span ends before it does, the phase goes on to there.
    short = simulate_phases(shortcut, "fly", START, 0.95, samples=3)
    assert not short.ended
    assert short.message == "The span ended."
    assert gap(short.y, [0.95, 5 * 0.95 - 5 * 0.95**2, 1.0, 5 - G * 0.95]) < SOLVED
    at_once = {"fly": Phase(BALL, (Exit(Reaches(1, 0.5, -1), END, fallen, lasts=time_to_fall),))}
    chain = simulate_phases(at_once, "fly", START, 2.0)
    assert chain.path == (("fly", 0),)
    assert abs(chain.t - 1.0) < SOLVED
    short = simulate_phases(at_once, "fly", START, 0.2, samples=3)
    assert not short.ended
    assert gap(short.y, [0.2, 0.8, 1.0, 3.0]) < SOLVED


@pytest.mark.slow
def test_tolerances_solver_and_limit_are_those_of_simulate():
    chain = simulate_phases(BOUNCING, "fly", START, 0.5, samples=2, max_steps=1)
    assert chain.status == Status.STEP_LIMIT
    assert "max_steps" in chain.message
    loose = simulate_phases(
        BOUNCING, "fly", START, 9.0, samples=2, atol=1e-3, rtol=1e-3, solver=DOPRI8
    )
    assert abs(loose.t - 1.9) < SOLVED
    with pytest.raises(ValueError, match="atol: expected > 0, got 0"):
        simulate_phases(BOUNCING, "fly", START, 9.0, atol=0.0)


def test_misuse_is_refused():
    with pytest.raises(ValueError, match=r"start: expected one of fly, got 'flyy'\. Did you"):
        simulate_phases(BOUNCING, "flyy", START, 1.0)
    with pytest.raises(ValueError, match=r"t1: expected a time after t0 = 1\.0, got 1\.0"):
        simulate_phases(BOUNCING, "fly", START, 1.0, t0=1.0)
    with pytest.raises(ValueError, match="max_phases: expected at least 1, got 0"):
        simulate_phases(BOUNCING, "fly", START, 1.0, max_phases=0)
    with pytest.raises(ValueError, match=r"^phases: expected at least one, got none\."):
        simulate_phases({}, "fly", START, 1.0)
    with pytest.raises(ValueError, match=r"^phases: expected names other than 'end', got end\."):
        simulate_phases(BOUNCING | {END: BOUNCING["fly"]}, "fly", START, 1.0)
    with pytest.raises(ValueError, match=r"^exits of fly: expected a tuple, got Exit\. Write \(ex"):
        simulate_phases({"fly": Phase(BALL, Exit(LANDS, END))}, "fly", START, 1.0)
    with pytest.raises(ValueError, match=r"^phase fly: expected a Phase, got Scene\. Write"):
        simulate_phases({"fly": BALL}, "fly", START, 1.0)
    with pytest.raises(ValueError, match=r"^t1: expected numbers, got '1'\."):
        simulate_phases(BOUNCING, "fly", START, "1")
    astray = {"fly": Phase(BALL, (Exit(LANDS, "rol"),)), "roll": BOUNCING["fly"]}
    with pytest.raises(ValueError, match="exit of fly: expected one of end, fly, roll, got 'rol'"):
        simulate_phases(astray, "fly", START, 1.0)
    with pytest.raises(ValueError, match="path: expected one of fly, got 'roll'"):
        follow(BOUNCING, [("roll", 0)], START, 1.0)
    with pytest.raises(ValueError, match="path: expected an exit of fly from 0 to 1, got 2"):
        follow(BOUNCING, [("fly", 2)], START, 1.0)


@pytest.mark.parametrize("span", [0.5, 2.0])
def test_a_phase_without_exits_lasts_to_the_end_of_the_span(span):
    resting = {
        "fly": Phase(BALL, (Exit(Reaches(1, 0.0, -1), "drift", bounce),)),
        "drift": Phase(BALL.without(UniformGravity), ()),
    }
    chain = simulate_phases(resting, "fly", START, span, samples=3)
    assert (chain.status, chain.message, chain.t) == (Status.OK, "The span ended.", span)
    flown = min(span, 1.0)
    falling = 5.0 * flown - G / 2 * flown**2
    assert gap(chain.y[:2], [span, falling + 2.5 * (span - flown)]) < SOLVED
    assert chain.names == ("fly", "drift")[: 1 + (span > 1.0)]


def test_a_phase_without_exits_that_fails_leaves_no_numbers():
    fall = Scene(FreePoints([1.0, 1.0]), (PairGravity(),), y0=[-0.5, 0, 0.5, 0, 0, 0, 0, 0])
    chain = simulate_phases({"fall": Phase(fall, ())}, "fall", fall.y0, 2.0, samples=3)
    assert chain.status == Status.STEP_COLLAPSED
    assert np.isnan(chain.t)
    assert np.isnan(chain.y).all()


def test_the_chain_of_phases_is_not_traced():
    message = r"^simulate_phases: expected numbers, got values traced .*`follow` goes through"
    for traced in (
        lambda x: simulate_phases(BOUNCING, "fly", START, x).t,
        lambda x: simulate_phases(BOUNCING, "fly", START, 1.0, rtol=1e-9 * x).t,
        lambda x: simulate_phases(BOUNCING, "fly", START * x, 1.0).t,
    ):
        with pytest.raises(ValueError, match=message):
            jax.jit(traced)(1.0)


@pytest.mark.parametrize(
    ("scene", "t1", "what", "when"),
    [
        (scenes.impact_oscillator(), 20.0, "the stop", 3.25),
        (scenes.ball_on_table(), 3.0, "the table", 0.61),
        (scenes.rimless_wheel(), 5.0, "the impact of the next spoke", 2.46),
        (scenes.simplest_walker(), 4.0, "the strike of the other foot", 3.84),
        (scenes.cylinder_on_cylinder(), 2.0, "the lift-off from its surface", 1.43),
    ],
)
def test_a_motion_beyond_a_bound_of_its_equations_has_a_warning(scene, t1, what, when):
    motion = simulate(scene, t1, throw=False)
    assert f"the motion is beyond {what}, where its equations do not hold" in motion.warning
    assert float(motion.warning.split()[3]) == pytest.approx(when, abs=0.1)


def test_phases_and_batches_have_that_warning_where_it_is_true():
    scene = scenes.impact_oscillator()
    one = simulate(scene, 20.0)
    chain = simulate_phases(scenes.phases_of(scene), None, scene.y0, 20.0)
    assert {piece.warning for piece in chain.pieces} == {""}
    batch = jax.vmap(lambda y0: simulate(scene.starting(y0), 20.0, throw=False))(scene.y0[None])
    assert batch.warning == one.warning


def test_a_motion_within_its_bounds_has_no_warning():
    assert simulate(scenes.impact_oscillator(), 3.0).warning == ""
    # It starts beyond the stop, which then is not passed.
    assert simulate(scenes.impact_oscillator(x=0.5, force=0.0, velocity=0.0), 0.5).warning == ""
