"""simulate(): samples, directions of time, how runs end, what is refused, what recompiles."""

from typing import ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, gap, kepler, kepler_state

from jaxdyn import Effect, IntegrationError, Scene, Status, drawing, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.analysis.energy_change import energy_change
from jaxdyn.effects import PairGravity, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.events import Reaches, until
from jaxdyn.integrate.phases import pieces_of
from jaxdyn.integrate.simulation import solve
from jaxdyn.integrate.trajectory import explanation, raise_unless_ok
from jaxdyn.scenes.particles import straightness
from jaxdyn.scenes.springs import wildness
from jaxdyn.solvers import (
    NYSTROM12,
    RK4,
    STOERMER18,
    TAYLOR16,
    VERNER9,
    default_solver,
    from_diffrax,
)

BALL = scenes.cannonball(drag=0.1)
EIGHT = scenes.three_body()
#: Two bodies at rest, which fall into each other at t = pi / 4.
COLLISION = Scene(FreePoints([1.0, 1.0]), (PairGravity(),), y0=[-0.5, 0, 0.5, 0, 0, 0, 0, 0])


@pytest.fixture(scope="module")
def eight():
    return simulate(EIGHT, samples=101, rtol=1e-15)


def test_the_motion_is_the_closed_form():
    times = np.linspace(0.0, 5.0, 11)
    motion = simulate(kepler(0.3), 5.0, samples=times, rtol=1e-14)
    assert gap(motion.ys, [kepler_state(0.3, t) for t in times]) < SOLVED
    assert gap(motion["x2"], motion.ys[:, 2]) == 0
    assert gap(motion.r, motion.ys[:, :4].reshape(-1, 2, 2)) == 0
    assert motion.ok
    assert motion.message == Status.OK.message


def test_a_throw_without_drag_is_a_parabola():
    motion = simulate(scenes.cannonball(speed=5.0, g=10.0), 1.0, samples=5)
    t = np.asarray(motion.ts)
    assert gap(t, [0, 0.25, 0.5, 0.75, 1]) == 0
    v = 5.0 / np.sqrt(2)
    assert gap(motion["x"], v * t) < EXACT
    assert gap(motion["y"], v * t - 5 * t * t) < EXACT


@pytest.mark.slow
def test_samples_are_as_accurate_as_the_steps(eight):
    motion = simulate(EIGHT, samples=101, rtol=1e-12)
    # An interpolant between 48 steps would be wrong by 1e-8.
    assert motion.steps < 60
    assert gap(motion.ys, eight.ys) < SOLVED
    # The first sample is exactly the start, and the last one is the end.
    np.testing.assert_array_equal(eight.ys[0], EIGHT.y0)
    assert gap(eight.ys[-1], solve(EIGHT, EIGHT.t1, rtol=1e-15).y1) < EXACT


def test_backward_in_time_returns_along_the_same_states(eight):
    back = simulate(EIGHT.starting(eight.ys[-1]), 0.0, t0=EIGHT.t1, samples=101, rtol=1e-15)
    assert gap(back.ts[::-1], eight.ts) < EXACT
    assert gap(back.ys[::-1], eight.ys) < SOLVED


def test_a_span_of_zero_stays_at_the_start():
    motion = simulate(BALL, 2.0, t0=2.0, samples=3)
    np.testing.assert_array_equal(motion.ys, [BALL.y0] * 3)
    np.testing.assert_array_equal(solve(BALL, 2.0, t0=2.0).y1, BALL.y0)
    assert (int(motion.steps), motion.ok) == (0, True)


def test_samples_by_number():
    assert simulate(BALL).ts.shape == (200,)
    np.testing.assert_array_equal(simulate(BALL, 0.5, samples=1).ts, [0.5])
    # Those of a span are kept, until a program to which they are donated has deleted them.
    simulate(BALL, 0.5, samples=7).ts.delete()
    np.testing.assert_array_equal(simulate(BALL, 0.5, samples=7).ts, np.linspace(0.0, 0.5, 7))
    np.testing.assert_array_equal(simulate(BALL, 0.5, samples=np.int64(1)).ts, [0.5])


def test_samples_may_repeat_and_leave_out_the_ends():
    motion = simulate(BALL, 0.5, samples=[0.1, 0.1, 0.3])
    np.testing.assert_array_equal(motion.ys[0], motion.ys[1])
    assert gap(motion.ys[2], solve(BALL, 0.3).y1) < 1e-9  # two solves at rtol 1e-10


def test_programs_do_not_contain_what_step_control_does_itself():
    # In particular not a hundred times the floating-point number before another.
    program = jax.jit(lambda t1: solve(EIGHT, t1).y1).lower(1.0).as_text()
    assert "while" in program
    assert "nextafter" not in program
    assert "next_after" not in program


@pytest.mark.sample("options1")
@pytest.mark.parametrize("options", [{"ts": [0.5]}, {}])
def test_a_start_of_integers_inside_jit(options):
    scene = eqx.tree_at(lambda scene: scene.y0, BALL, jnp.arange(4))
    by_jit = jax.jit(lambda: solve(scene, 1.0, **options).y1)()
    assert gap(by_jit, solve(BALL.starting(jnp.arange(4.0)), 1.0).y1) < SOLVED


def test_a_step_is_asked_for_inside_jit():
    by_jit = jax.jit(lambda t1: solve(EIGHT, t1, solver=RK4, dt=0.01).y1)(1.0)
    assert gap(by_jit, solve(EIGHT, 1.0, solver=RK4, dt=0.01).y1) < SOLVED


@pytest.mark.slow
def test_the_method_follows_the_effects():
    assert default_solver(EIGHT) is STOERMER18
    assert default_solver(EIGHT, rtol=1e-12) is NYSTROM12
    assert default_solver(BALL) is TAYLOR16
    by_choice = simulate(EIGHT, 1.0, samples=2, rtol=1e-14, solver=VERNER9)
    assert gap(by_choice.ys, simulate(EIGHT, 1.0, samples=2, rtol=1e-14).ys) < SOLVED


# How runs end ------------------------------------------------------------------------------


def _ends(motion, status: Status, reached: int) -> None:
    assert int(motion.status) == status
    assert not motion.ok
    assert motion.message == explanation(status, motion.scene)
    assert jnp.isfinite(motion.ys[:reached]).all()
    assert jnp.isnan(motion.ys[reached:]).all()


def test_a_collision_ends_as_step_collapsed():
    motion = simulate(COLLISION, 2.0, samples=21, throw=False)
    _ends(motion, Status.STEP_COLLAPSED, 8)  # samples 0, 0.1 .. 0.7, collision at 0.785
    # Free fall from rest at distance 1: t = (theta + sin theta) / 4, r = (1 + cos theta) / 2
    theta = np.pi / 2
    t = (theta + 1) / 4
    y = solve(COLLISION, t, rtol=1e-13).y1
    assert abs(float(y[2] - y[0]) - 0.5) < SOLVED
    with pytest.raises(
        IntegrationError, match=r"singularity, .* Bodies that meet attract each other"
    ):
        simulate(COLLISION, 2.0, samples=21)


def test_too_many_steps_end_as_step_limit():
    motion = simulate(EIGHT, 20.0, samples=21, max_steps=20, throw=False)
    assert int(motion.steps) + int(motion.rejected) == 20
    reached = int(jnp.isfinite(motion.ys).all(axis=1).sum())
    assert 1 < reached < 21
    _ends(motion, Status.STEP_LIMIT, reached)
    whole = simulate(EIGHT, 20.0, samples=21)
    assert gap(motion.ys[:reached], whole.ys[:reached]) < EXACT
    with pytest.raises(IntegrationError, match="Raise max_steps, loosen rtol"):
        simulate(EIGHT, 20.0, samples=21, max_steps=20)


@pytest.mark.parametrize("t1", [1.0, -1.0])
def test_a_nan_parameter_ends_as_not_finite(t1):
    scene = scenes.lorenz(rho=np.nan)
    motion = simulate(scene, t1, samples=[0.5 * t1], throw=False)
    _ends(motion, Status.NOT_FINITE, 0)
    with pytest.raises(IntegrationError, match="start, its rate, a time or a tolerance is NaN"):
        simulate(scene, t1, samples=[0.5 * t1])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["rtol", "atol", "t0", "t1", "y0"])
def test_what_a_trace_cannot_refuse_ends_as_not_finite(name, bad):
    out = _traced(**{"rtol": 1e-10, "atol": 1e-10, "t0": 0.0, "t1": 1.0, "y0": 4.0} | {name: bad})
    assert int(out.status) == Status.NOT_FINITE
    assert jnp.isnan(out.y1).all()


@pytest.mark.parametrize("bad", [0.0, -1.0])
@pytest.mark.parametrize("name", ["rtol", "atol"])
def test_traced_tolerances_that_are_not_positive_end_as_not_finite(name, bad):
    out = _traced(**{"rtol": 1e-10, "atol": 1e-10, "t0": 0.0, "t1": 1.0, "y0": 4.0} | {name: bad})
    assert int(out.status) == Status.NOT_FINITE
    assert jnp.isnan(out.y1).all()


@jax.jit
def _traced(rtol, atol, t0, t1, y0):
    start = jnp.stack([0.0, 0.0, y0, 1.0])
    return solve(BALL.starting(start), t1, t0=t0, rtol=rtol, atol=atol, max_steps=200)


@pytest.mark.slow
def test_a_batch_keeps_a_status_for_each_run():
    def run(x):
        y0 = jnp.array([-0.5, 0, 0.5, 0, 0, 0, 0, 0]).at[5].set(x)
        return simulate(COLLISION.starting(y0), 2.0, samples=3, throw=False)

    batch = jax.vmap(run)(jnp.array([0.0, 0.4]))
    assert batch.status.tolist() == [Status.STEP_COLLAPSED, Status.OK]
    assert not batch.ok
    assert jnp.isfinite(batch.ys[1]).all()
    with pytest.raises(IntegrationError, match="singularity"):
        raise_unless_ok(batch.status, COLLISION)
    raise_unless_ok(batch.status[1:], COLLISION)


ANGLES = jnp.array([0.5, 1.0])


@pytest.fixture(scope="module")
def swings():
    """Pendulums from two angles, and each of two angles with each of three lengths."""

    def swing(angle, length):
        scene = scenes.pendulum(angle=angle, length=length, formulation="newton_euler")
        return simulate(scene, 1.0, samples=5, rtol=1e-8)

    row = jax.vmap(swing, in_axes=(None, 0))
    return jax.vmap(swing, in_axes=(0, None))(ANGLES, 1.0), jax.vmap(row, in_axes=(0, None))(
        ANGLES, jnp.array([0.5, 1.0, 2.0])
    )


@pytest.mark.sample("r")
@pytest.mark.parametrize(
    "quantity",
    [
        lambda motion: motion["theta"],
        lambda motion: motion.r,
        lambda motion: energy.along(energy.energy, motion),
        lambda motion: energy.along(energy.momentum, motion),
        energy.drift,
        straightness,
    ],
    ids=["label", "r", "energy", "momentum", "drift", "straightness"],
)
def test_a_batch_gives_what_each_of_its_motions_gives(swings, quantity):
    batch, grid = swings
    of_batch, of_grid = quantity(batch), quantity(grid)
    assert (of_batch.shape[:1], of_grid.shape[:2]) == ((2,), (2, 3))
    for i in range(2):
        assert gap(of_batch[i], quantity(batch.one(i))) < EXACT
        for j in range(3):
            assert gap(of_grid[i, j], quantity(grid.one(i, j))) < EXACT


def test_what_a_batch_says_of_itself(swings):
    batch, grid = swings
    assert (batch.batch_shape, grid.batch_shape, batch.one(1).batch_shape) == ((2,), (2, 3), ())
    assert gap(batch["theta"][:, 0], ANGLES) == 0
    assert gap(grid["theta"][:, 1, 0], ANGLES) == 0
    assert (batch.status.shape, batch.ok, batch.warning) == ((2,), True, "")
    assert batch.message == batch.status_code.message == Status.OK.message
    with pytest.raises(ValueError, match=r"^label: expected one of theta, theta_dot, got 'phi'"):
        batch["phi"]
    with pytest.raises(
        ValueError,
        match=r"^index: expected a number for each axis of the batch, \(2, 3\), got \(1,\)\.",
    ):
        grid.one(1)


#: The method that compiles fastest.
QUICK = {"solver": RK4, "dt": 0.1}
#: Ways to a batch of pendulums: over the numbers of the scene, scenes, starts, ends of the span.
BATCHES = {
    "scenes": lambda of: jax.vmap(of)(jax.vmap(lambda x: scenes.pendulum(angle=x))(ANGLES)),
    "scenes within jit": lambda of: jax.jit(jax.vmap(of))(
        jax.vmap(lambda x: scenes.pendulum(angle=x))(ANGLES)
    ),
    "starts": lambda of: jax.vmap(lambda y: of(scenes.pendulum().starting(y)))(
        jnp.stack([ANGLES, 0 * ANGLES], axis=1)
    ),
    "one after the other": lambda of: jax.lax.map(lambda x: of(scenes.pendulum(angle=x)), ANGLES),
}


@pytest.mark.slow
@pytest.mark.parametrize("way", BATCHES)
def test_all_ways_to_a_batch_give_its_motions(way):
    def swing(scene):
        return simulate(scene, 1.0, samples=5, **QUICK)

    batch = BATCHES[way](swing)
    assert (batch.batch_shape, batch["theta"].shape, batch.r.shape) == ((2,), (2, 5), (2, 5, 1, 2))
    for i, angle in enumerate(ANGLES):
        alone = swing(scenes.pendulum(angle=angle))
        assert gap(batch.one(i).ys, alone.ys) < EXACT
        assert gap(batch["theta"][i], alone["theta"]) < EXACT
        assert abs(energy.drift(batch)[i] - energy.drift(alone)) < EXACT


@pytest.mark.slow
def test_a_batch_of_spans_has_times_of_its_own():
    ends = jnp.array([0.5, -2.0])
    batch = jax.vmap(lambda t1: simulate(scenes.pendulum(), t1, samples=5, **QUICK))(ends)
    for i, end in enumerate(ends):
        alone = simulate(scenes.pendulum(), end, samples=5, **QUICK)
        assert gap(batch.ts[i], alone.ts) < EXACT
        assert gap(batch["theta"][i], alone["theta"]) < EXACT


@pytest.mark.slow
def test_a_batch_with_too_long_steps_says_so():
    def orbit(dt):
        return simulate(kepler(0.9), 6.0, samples=9, solver=RK4, dt=dt)

    batch = jax.vmap(orbit)(jnp.array([0.001, 0.3]))
    assert "too long for parts of the motion" in batch.warning
    assert (batch.one(0).warning, batch.one(1).warning) == ("", batch.warning)


@pytest.mark.slow
def test_a_batch_of_scenes_with_points_keeps_their_names():
    def fall(m):
        scene = Scene(FreePoints(m * jnp.ones(3)), (UniformGravity(),), y0=jnp.ones(12))
        return simulate(scene, 0.1, samples=2)

    batch = jax.vmap(fall)(jnp.arange(1.0, 6.0))
    assert (batch["y3"].shape, batch.r.shape) == ((5, 2), (5, 2, 3, 2))


@pytest.mark.parametrize("look", [pieces_of, energy_change, wildness, drawing.trajectory])
def test_a_batch_where_one_motion_is_wanted_is_refused(swings, look):
    message = r"^motion: expected one motion, got a batch of them, \(2,\)\. Take .*batch\.one\(0\)"
    with pytest.raises(ValueError, match=message):
        look(swings[0])


def test_every_status_has_a_message_with_a_remedy():
    assert len({status.message for status in Status}) == len(Status)
    for status in set(Status) - {Status.OK}:
        verbs = ("Raise", "Stop", "Check", "Choose", "Add ", "add ")
        assert any(verb in status.message for verb in verbs)


# What is refused ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rtol": 0.0}, r"rtol: expected between 1e-16 and 0\.01, got 0\.0\. It is the rel"),
        ({"rtol": 1.0}, r"rtol: expected .* got 1\.0\. It is the .* Errors of steps add up\.$"),
        ({"rtol": 0.011}, r"rtol: expected between 1e-16 and 0\.01, got 0\.011\."),
        ({"rtol": np.nan}, r"rtol: expected between 1e-16 and 0\.01, got nan\."),
        ({"atol": 0.0}, r"atol: expected > 0, got 0\.0\. It is in units of the state\.$"),
        ({"atol": np.inf}, r"atol: expected > 0, got inf\."),
        ({"atol": np.nan}, r"atol: expected > 0, got nan\."),
        (
            {"samples": 0},
            r"samples: expected a whole number, at least 1, got 0\. Or an array of times\.$",
        ),
        (
            {"samples": True},
            r"samples: expected numbers, got True\. Pass an array of times, or",
        ),
        (
            {"samples": 10**8},
            r"samples: expected at most 2\.\de\+07 of them, got 100000000, which need 14\.\d Gi"
            r"B\. Take fewer, or simulate in pieces, each from where the last one ended\.$",
        ),
        (
            {"samples": np.zeros(3 * 10**7)},
            r"samples: expected at most 2\.\de\+07 of them, got 30000000,",
        ),
        ({"t1": "1"}, r"t1: expected numbers, got '1'\.$"),
        ({"samples": [[0.0]]}, r"samples: expected shape \(any,\), got shape \(1, 1\)\. Pass"),
        (
            {"samples": [0.2, 0.1]},
            r"samples: expected times in order .* Sort them, or move t0 or t1",
        ),
        ({"samples": [0.2, 1.1]}, r"samples: expected times in order from t0 = 0\.0 to t1 = 1\.0,"),
        ({"samples": [-0.1]}, r"samples: expected times in order from"),
        ({"samples": [0.1], "t1": -1.0}, r"samples: expected times in order from"),
        ({"samples": [0.1], "t1": 0.0}, r"samples: expected times in order from"),
        ({"samples": [np.nan]}, r"samples: expected finite numbers, got nan at index \[0\]"),
        (
            {"samples": "all"},
            r"samples: expected numbers, got 'all'\. Pass an array of times, or",
        ),
        ({"t1": np.inf}, r"t1: expected finite numbers, got inf\.$"),
        ({"t1": [1.0]}, r"t1: expected shape \(\), got shape \(1,\)\.$"),
        ({"t0": np.nan}, r"t0: expected finite numbers, got nan\.$"),
        ({"t0": "now"}, r"t0: expected numbers, got 'now'\.$"),
        (
            {"solver": "tsit5"},
            r"solver: expected one of jaxdyn\.solvers, or a Runge-Kutta solver .*, got 'tsit5'\.",
        ),
        (
            {"solver": 9},
            r"solver: expected one of jaxdyn\.solvers, or a Runge-Kutta solver of diffrax, got 9\.",
        ),
        (
            {"solver": diffrax.SRA1()},
            r"solver: expected a Runge-Kutta .*, got SRA1, which has no Butcher tableau",
        ),
        (
            {"solver": diffrax.Tsit5},
            r"solver: expected a Runge-Kutta .*, got Tsit5, which is not a solver\.",
        ),
        (
            {"solver": NYSTROM12},
            r"solver: expected one for forces that may depend on velocity, got Nystrom 12\(10\), "
            r"which requires velocity-independent forces\.",
        ),
    ],
)
def test_simulate_refuses(options, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        simulate(BALL, **({"t1": 1.0} | options))


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ({"ts": 0.5}, r"ts: expected shape \(any,\), got shape \(\)\."),
        ({"ts": [[0.2, 0.5]]}, r"ts: expected shape \(any,\), got shape \(1, 2\)\."),
        ({"ts": "ab"}, r"ts: expected numbers, got 'ab'\."),
        ({"t1": [1.0, 2.0]}, r"t1: expected shape \(\), got shape \(2,\)\."),
        ({"t0": [0.0]}, r"t0: expected shape \(\), got shape \(1,\)\."),
    ],
)
def test_solve_refuses_times_of_another_shape(times, message):
    """A matrix of times gave the states at its first column, with the status OK."""
    with pytest.raises(ValueError, match=f"^{message}"):
        solve(BALL, **({"t1": 1.0} | times))


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (
            BALL.starting([0.0, 0.0, np.nan, 1.0]),
            r"y0: expected finite numbers, got nan at index \[2\]",
        ),
        (BALL.starting([0.0]), r"y0: expected shape \(4,\), got shape \(1,\)\."),
        (scenes.three_body(np.zeros(12)), r"y0: expected bodies at different points"),
        (scenes.cannonball(m=-1.0), r"mass: expected >= 0, got -1\.0\."),
        (
            scenes.cannonball,
            r"scene: expected a Scene, got cannonball\. Call it: cannonball\(\)\.$",
        ),
        (3.0, r"scene: expected a Scene, got 3\.0\.$"),
    ],
)
def test_simulate_checks_the_scene(scene, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        simulate(scene)


def test_a_mistyped_label_is_answered_with_the_nearest(eight):
    message = r"^label: expected one of vx1, .*, got 'vx11'\. Did you mean 'vx1'\?$"
    with pytest.raises(ValueError, match=message):
        eight["vx11"]


def test_32_bit_floats_are_refused():
    with jax.enable_x64(False), pytest.raises(ValueError, match=r"^floats: expected 64-bit"):
        simulate(BALL)


# What recompiles ---------------------------------------------------------------------------


class Counting(Effect):
    """A drag that counts how often Python looks at it."""

    c: jax.Array
    velocity_dependent: ClassVar[bool] = True
    traces: ClassVar[list] = []

    def __init__(self, c):
        self.c = jnp.asarray(c, dtype=float)

    def force(self, t, r, v, m):
        self.traces.append(1)
        return -self.c * v


def _counted(c=0.1, m=1.0, y0=(0.0, 0.0, 1.0, 1.0)):
    return Scene(FreePoints(m), (Counting(c),), y0=y0)


def test_new_numbers_never_recompile():
    solve(_counted(), 1.0, ts=[0.5])
    before = len(Counting.traces)
    assert before > 0
    for scene in (
        _counted(c=0.2),
        _counted(m=2),
        _counted(y0=np.ones(4)),
        _counted(y0=[1, 2, 3, 4]),
    ):
        solve(scene, 1.0, ts=[0.5])
    solve(_counted(), 2, t0=1, ts=np.array([1.5]))
    solve(_counted(), -1.0, ts=jnp.array([-0.5]), rtol=1e-8, atol=1e-3)
    solve(_counted(), jnp.array(3.0), ts=[0.5], rtol=np.float64(1e-9))
    assert len(Counting.traces) == before
    solve(_counted(), 1.0, ts=np.linspace(0.1, 1.0, 65))  # more than 64 take another program
    assert len(Counting.traces) > before


@pytest.mark.slow
def test_limits_of_steps_and_numbers_of_samples_share_programs():
    simulate(_counted(), samples=20, max_steps=50)
    simulate(_counted(), samples=20, dt=0.1, solver=RK4)
    until(_counted(), Reaches(0, 0.5), max_steps=50)
    before = len(Counting.traces)
    for n, most in ((1, 1000), (25, 40), (64, 10**9)):
        motion = simulate(_counted(), samples=n, max_steps=most)
        assert motion.ys.shape == (n, 4)
        simulate(_counted(), samples=n, max_steps=most, dt=0.1, solver=RK4)
        until(_counted(), Reaches(0, 0.5), max_steps=most)
    assert len(Counting.traces) == before
    simulate(_counted(), samples=600)
    assert len(Counting.traces) > before


def test_nothing_at_all_is_compiled_for_another_number_of_samples(caplog):
    scene = _counted()
    simulate(scene, samples=20)
    with jax.log_compiles(), caplog.at_level("WARNING"):
        assert simulate(scene, samples=21)["x"].shape == (21,)
        simulate(scene, samples=np.linspace(0.0, 1.0, 22))
    assert [record.message for record in caplog.records if "Compiling" in record.message] == []


@jax.jit
def _alone(scene, t1, ts):
    return solve(scene, t1, ts=ts, rtol=1e-11)


@pytest.mark.parametrize("t1", [5.0, -5.0])
def test_samples_that_fill_an_array_up_change_nothing(t1):
    for n in (5, 8):
        ts = np.linspace(0.0, t1, n)
        filled = solve(kepler(0.3), t1, ts=ts, rtol=1e-11)
        assert gap(filled.ys, _alone(kepler(0.3), t1, ts).ys) < EXACT
        assert gap(filled.ys, [kepler_state(0.3, t) for t in ts]) < 1e-8
        assert jnp.isfinite(filled.y1).all()


@pytest.mark.parametrize("how", [{}, {"dt": 0.1, "solver": RK4}], ids=["adaptive", "fixed"])
def test_the_limit_is_the_number_of_steps_that_may_be_taken(how):
    scene = scenes.pendulum(angle=1.0)
    needed = simulate(scene, 2.0, samples=3, **how)
    count = int(needed.steps + needed.rejected)
    just = simulate(scene, 2.0, samples=3, max_steps=count, **how)
    assert gap(just.ys, needed.ys) == 0
    short = simulate(scene, 2.0, samples=3, max_steps=count - 1, throw=False, **how)
    assert short.status_code == Status.STEP_LIMIT
    assert int(short.steps + short.rejected) == count - 1
    assert jnp.isnan(short.ys[-1]).all()


def test_new_numbers_never_recompile_derivatives():
    jacobian = jax.jit(jax.jacfwd(lambda scene, t1: solve(scene, t1).y1))
    jacobian(_counted(), 1.0)
    before = len(Counting.traces)
    jacobian(_counted(c=0.2, m=3.0, y0=np.ones(4)), 2.0)
    assert len(Counting.traces) == before


@pytest.mark.sample("False")
@pytest.mark.parametrize("adjoint", [False, True])
def test_derivatives_outside_of_jit_are_compiled_once_too(caplog, adjoint):
    def slope(c):
        return jax.grad(lambda c: solve(_counted(c=c), 1.0, adjoint=adjoint).y1[0])(c)

    slope(0.1)
    before = len(Counting.traces)
    with jax.log_compiles(), caplog.at_level("WARNING"):
        slope(0.2)
    assert [record.message for record in caplog.records if "Compiling" in record.message] == []
    assert len(Counting.traces) == before


def test_a_pair_from_diffrax_solves():
    tsit5 = from_diffrax(diffrax.Tsit5())
    assert (
        gap(solve(BALL, 0.5, rtol=1e-11, solver=tsit5).y1, solve(BALL, 0.5, rtol=1e-13).y1) < 1e-9
    )
