"""What a run is asked for: spans, samples and limits, refused in words or done right."""

import resource
import subprocess
import sys

import numpy as np
import pytest
from helpers import gap, refusal

from jaxdyn import scenes, simulate, solvers
from jaxdyn.integrate.simulation import solve

BALL = scenes.cannonball()
SWING = scenes.pendulum()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: simulate(BALL, max_steps=np.nan),
            "max_steps: expected a whole number, at least 1",
        ),
        (lambda: simulate(BALL, max_steps=1e6), "max_steps: expected a whole number, at least 1"),
        (lambda: simulate(BALL, max_steps="3"), "max_steps: expected a whole number, at least 1"),
        (lambda: simulate(BALL, max_steps=True), "max_steps: expected a whole number, at least 1"),
        (lambda: simulate(BALL, atol=5e-324), "atol: expected > 0, got 5e-324"),
        (lambda: simulate(BALL, max_steps=0), "max_steps: expected a whole number, at least 1"),
        (
            lambda: simulate(BALL, max_steps=2**70),
            "max_steps: expected at most 4611686018427387904",
        ),
    ],
)
def test_an_invalid_limit_is_refused_by_name(call, message):
    assert message in refusal(call)


def test_no_samples_are_no_samples():
    assert simulate(BALL, 1.0, samples=[]).ys.shape == (0, 4)


@pytest.mark.parametrize("how", [{}, {"solver": solvers.GAUSS8, "dt": 0.01}], ids=["pair", "Gauss"])
def test_there_and_back_again_also_from_a_late_start(how):
    there = solve(SWING.starting([1.0, 0.3]), 7.0, t0=5.0, **how)
    back = solve(SWING.starting(there.y1), 5.0, t0=7.0, **how)
    assert gap(back.y1, [1.0, 0.3]) < 1e-8
    still = solve(SWING.starting([1.0, 0.3]), 5.0, t0=5.0, **how)
    np.testing.assert_array_equal(still.y1, [1.0, 0.3])


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
