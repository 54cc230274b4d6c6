"""What is asked for at the edge of sense: refused in words, or done right."""

import resource
import subprocess
import sys

import numpy as np
import pytest
from helpers import gap

import orbits
from jaxdyn import Effect, Scene, scenes, simulate, solvers
from jaxdyn.analysis import equilibria
from jaxdyn.analysis.linearize import linearize, modes
from jaxdyn.effects import PairGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.simulation import solve

BALL = scenes.cannonball()
SWING = scenes.pendulum()
OSCILLATOR = scenes.oscillator(k=4.0)
ROWS = orbits.Rows([[1.0, 0.0]])
COLLIDED = scenes.two_body().starting(np.zeros(8))


class WithoutValue(Effect):
    """A field whose strength is not a number."""

    def potential(self, t, r, m):
        return np.nan * (r * r).sum()


def no_bodies(*effects):
    return Scene(FreePoints([]), effects, y0=[])


def rest(**options):
    return equilibria.equilibria(SWING, [-1.0, 0.0], [1.0, 1.0], **options)


def swing(**options):
    return orbits.find(SWING, **({"y0": [1.0, 0.0], "period": 2.0} | options))


def searched(**options):
    return orbits.search(OSCILLATOR, **({"sampler": ROWS, "samples": 1, "longest": 5.0} | options))


REFUSED = [
    (lambda: simulate(no_bodies()), "system: expected a system with a state"),
    (lambda: simulate(no_bodies(PairGravity())), "system: expected a system with a state"),
    (lambda: linearize(no_bodies(), []), "system: expected a system with a state"),
    (lambda: equilibria.equilibria(no_bodies(), [], []), "system: expected a system with a state"),
    (lambda: orbits.find(no_bodies()), "system: expected a system with a state"),
    (lambda: Scene(FreePoints([1.0]), y0=[0, 0, 1j, 2]), "y0: expected numbers"),
    (lambda: Scene(FreePoints([1.0]), y0="a"), "y0: expected numbers, got 'a'"),
    (lambda: Scene(FreePoints([1.0]), y0=None), "y0: expected numbers, got None"),
    (lambda: simulate(BALL, max_steps=np.nan), "max_steps: expected a whole number, at least 1"),
    (lambda: simulate(BALL, max_steps=1e6), "max_steps: expected a whole number, at least 1"),
    (lambda: simulate(BALL, max_steps="3"), "max_steps: expected a whole number, at least 1"),
    (lambda: simulate(BALL, max_steps=True), "max_steps: expected a whole number, at least 1"),
    (lambda: simulate(BALL, atol=5e-324), "atol: expected > 0, got 5e-324"),
    (lambda: simulate(BALL, max_steps=0), "max_steps: expected a whole number, at least 1"),
    (lambda: simulate(BALL, max_steps=2**70), "max_steps: expected at most 4611686018427387904"),
    (lambda: linearize(scenes.pendulum, [0.0, 0.0]), "scene: expected a Scene, got pendulum"),
    (lambda: linearize(SWING, [np.nan, 0.0]), "y: expected finite numbers"),
    (lambda: linearize(SWING, [0.0, 0.0], "now"), "t: expected numbers, got 'now'"),
    (lambda: linearize(SWING, [0.0, 0.0], np.nan), "t: expected finite numbers"),
    (lambda: linearize(SWING, [0.0]), "y: expected shape"),
    (
        lambda: linearize(SWING + WithoutValue(), [0.0, 0.0]),
        "The rate has no derivative there",
    ),
    (lambda: linearize(scenes.pendulum(m=0.0), [0.0, 0.0]), "mass: expected > 0"),
    (lambda: linearize(COLLIDED, COLLIDED.y0), "y0: expected bodies at different points"),
    (lambda: modes(scenes.pendulum, [0.0, 0.0]), "scene: expected a Scene, got pendulum"),
    (
        lambda: modes(SWING + WithoutValue(), [0.0, 0.0]),
        "stiffness: expected finite numbers",
    ),
    (lambda: equilibria.equilibria(scenes.pendulum, [0], [1]), "scene: expected a Scene"),
    (lambda: rest(starts=0), "starts: expected a whole number, at least 1, got 0"),
    (lambda: rest(starts=1.5), "starts: expected a whole number, at least 1, got 1.5"),
    (lambda: rest(starts=10**12), "starts: expected at most 1000000, got 1000000000000"),
    (lambda: rest(t=np.nan), "t: expected finite numbers"),
    (lambda: swing(segments=10**6), "segments: expected at most 256, got 1000000"),
    (lambda: swing(segments=True), "segments: expected a whole number, at least 1, got True"),
    (lambda: swing(max_iterations=np.nan), "max_iterations: expected a whole number, at least 0"),
    (lambda: swing(max_iterations=-1), "max_iterations: expected a whole number, at least 0"),
    (lambda: swing(period="a"), "period: expected numbers, got 'a'"),
    (lambda: swing(period=True), "period: expected numbers, got True"),
    (lambda: swing(y0="a"), "y0: expected numbers, got 'a'"),
    (lambda: swing(hold=3.0), "hold: expected a Condition, got 3.0"),
    (lambda: swing(closing="plain"), "closing: expected a Closing, got 'plain'"),
    (lambda: searched(samples=1.5), "samples: expected a whole number, at least 1, got 1.5"),
    (lambda: searched(seed=-1), "seed: expected a whole number, at least 0, got -1"),
    (lambda: searched(seed=2**60), "seed: expected at most 9007199254740992"),
    (lambda: searched(rtol=np.nan), "rtol: expected between"),
    (lambda: searched(limit=np.nan), "limit: expected finite numbers"),
    (lambda: orbits.search_plane(1, longest=np.nan), "longest: expected finite numbers"),
]


@pytest.mark.parametrize(("call", "message"), REFUSED, ids=[m[:40] for _, m in REFUSED])
def test_what_makes_no_sense_is_refused_by_name(call, message):
    with pytest.raises(ValueError, match="expected") as refused:
        call()
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_nothing_acts_and_the_points_go_straight_on():
    motion = simulate(Scene(FreePoints([1.0, 2.0]), y0=[0, 0, 1, 1, 1, 2, -3, 0.5]), 2.0, samples=3)
    np.testing.assert_allclose(motion.ys[-1], [2, 4, -5, 2, 1, 2, -3, 0.5], rtol=1e-15)


def test_no_samples_are_no_samples():
    assert simulate(BALL, 1.0, samples=[]).ys.shape == (0, 4)


@pytest.mark.parametrize("how", [{}, {"solver": solvers.GAUSS8, "dt": 0.01}], ids=["pair", "Gauss"])
def test_there_and_back_again_also_from_a_late_start(how):
    there = solve(SWING.starting([1.0, 0.3]), 7.0, t0=5.0, **how)
    back = solve(SWING.starting(there.y1), 5.0, t0=7.0, **how)
    assert gap(back.y1, [1.0, 0.3]) < 1e-8
    still = solve(SWING.starting([1.0, 0.3]), 5.0, t0=5.0, **how)
    np.testing.assert_array_equal(still.y1, [1.0, 0.3])


def test_a_million_steps_of_an_oscillator():
    motion = simulate(OSCILLATOR, 1e4, samples=2, solver=solvers.GAUSS8, dt=0.01)
    assert int(motion.steps) == 1_000_000
    x, v = OSCILLATOR.y0
    c, s = np.cos(2e4), np.sin(2e4)
    assert gap(motion.ys[-1], [x * c + v * s / 2, v * c - 2 * x * s]) < 1e-9


_MANY = """
import resource, numpy as np, jaxdyn
from jaxdyn import scenes, simulate
jaxdyn.configure()
ball = scenes.cannonball(drag=0.0)
simulate(ball, 1.0, samples=10)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
motion = simulate(ball, 1.0, samples=10**7)
y = 10 * np.sqrt(0.5) * motion.ts - 0.5 * 9.81 * motion.ts**2
print(float(abs(motion["y"] - y).max()))
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 / 1e7)
"""


@pytest.mark.slow
def test_ten_million_samples_take_a_few_times_their_own_memory():
    done = subprocess.run(
        [sys.executable, "-c", _MANY], capture_output=True, text=True, check=True, timeout=300
    )
    error, bytes_each = map(float, done.stdout.split())
    assert error < 1e-13
    assert bytes_each < 4 * 8 * 5 + 40  # four copies of time and state, and this test's own


def test_more_samples_than_fit_are_refused_at_once():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ValueError, match="samples: expected at most"):
        simulate(BALL, 1.0, samples=10**9)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss == before
