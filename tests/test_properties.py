"""Random numbers thrown at everything public: no crash but a ValueError in words, no wrong number.

Scenes come from a short list, since each kind is compiled once; their numbers and starts are
drawn. What comes out is held to a law or to a second method: energy, a run back, another pair.
"""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

import orbits
from jaxdyn import scenes
from jaxdyn.analysis.energy import energy, potential
from jaxdyn.analysis.equilibria import equilibria
from jaxdyn.analysis.linearize import linearize
from jaxdyn.cli.app import app as jaxdyn_app
from jaxdyn.integrate.simulation import simulate, solve
from jaxdyn.solvers import DOPRI8
from orbits.cli.app import app as orbits_app

#: Scenes that keep their energy, made of two numbers > 0.
KEPT = {
    "pendulum": lambda a, b: scenes.pendulum(length=a, g=b),
    "double_pendulum": lambda a, b: scenes.double_pendulum(g=b, length=(a, 1.0)),
    "two_body": lambda a, b: scenes.two_body(m1=a, m2=b),
    "oscillator": lambda a, b: scenes.oscillator(k=a, m=b),
}
#: Others, whose starts lie on a surface: a rod's ends, a unit quaternion, a rolling contact.
TIED = {
    "rod": lambda a, b: scenes.pendulum(length=a, g=b, formulation="constrained"),
    "body": lambda a, b: scenes.box(sides=(a, 1.0, 2.0), m=b),
    "disk": lambda a, b: scenes.rolling_disk(m=a, g=b),
}
NAMES = st.sampled_from(sorted(KEPT))
QUICK = st.sampled_from(["double_pendulum", "pendulum"])
SIZES = st.floats(0.01, 100.0)
ENTRIES = st.lists(st.floats(-3.0, 3.0), min_size=16, max_size=16)
#: Anything that might be given for a number.
WILD = st.one_of(
    st.floats(),
    st.integers(-(10**30), 10**30),
    st.sampled_from([None, "1", "x", True, [], [1.0], 1j, np.nan, -0.0, 5e-324, 1.7e308]),
)
# How long a draw takes on a loaded machine decides nothing.
FEW = settings(
    max_examples=25,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
MANY = settings(FEW, max_examples=250)
STEPS = 3000
CHAOTIC = 1e4  # growth of differences above which nothing is left to compare


def scene_of(name, a, b, entries):
    scene = (KEPT | TIED)[name](a, b)
    return scene.starting(onto(scene, np.array(entries)[: len(scene.y0)]))


def onto(scene, y):
    return scene.system.project(jnp.zeros(()), jnp.asarray(y))


def refused(call):
    """What a call returns; None if it refuses in one line of words, as it may."""
    try:
        return call()
    except ValueError as error:
        message = str(error)
        assert "expected" in message, message
        assert "\n" not in message
        return None


def run(scene, t1, t0=0.0, **how):
    """Five samples; one program for each kind of scene and method."""
    return simulate(scene, t1, t0=t0, samples=5, max_steps=STEPS, throw=False, **how)


def deepest(a, b, y) -> float:
    """Potential energy of two bodies where they are nearest on their conic, without its sign."""
    r, v = y[2:4] - y[:2], y[6:] - y[4:6]
    swept = r[0] * v[1] - r[1] * v[0]
    energy_of_one = 0.5 * v @ v - (a + b) / np.hypot(*r)
    e = np.sqrt(max(0.0, 1 + 2 * energy_of_one * (swept / (a + b)) ** 2))
    return a * b * (a + b) * (1 + e) / swept**2 if swept else np.inf


def sound(name, a, b, entries, t1):
    """A motion keeps its energy, leads back and is another pair's too; or a status says why not."""
    scene = scene_of(name, a, b, entries)
    motion = refused(lambda: run(scene, t1))
    if motion is None:
        return
    ys = np.asarray(motion.ys)
    assert motion.ok == bool(np.isfinite(ys).all())
    if not motion.ok:
        assert np.isnan(ys[-1]).all()
        return
    parts = [[float(f(scene, jnp.zeros(()), y)) for y in motion.ys] for f in (energy, potential)]
    total, v = map(np.array, parts)
    # Errors of 1e-10 a step add up; a potential that is steep makes them large.
    allowed = 1e-8 * (1 + int(motion.steps))
    slope = max(float(np.abs(scene.rate(0.0, y)).max()) for y in motion.ys)
    # The absolute tolerance equals the relative one: what is far below 1 is not resolved.
    resolved = max(np.abs(ys).max(), 1.0)
    size = np.abs(total - v).max() + np.abs(v).max() + slope * resolved
    if name == "two_body":  # an encounter between samples
        size += deepest(a, b, ys[0])
    assert np.abs(total - total[0]).max() <= allowed * size
    end, size = ys[-1], resolved + slope * abs(t1)
    other = run(scene, t1, rtol=1e-12, solver=DOPRI8)
    back = run(scene.starting(motion.ys[-1]), 0.0, t0=t1)
    # Two runs cannot agree better than neighbours stay together, there and back.
    near = run(scene.starting(onto(scene, scene.y0 * (1 + 1e-7) + 1e-7)), t1)
    stretch = 1.0 + np.abs(np.asarray(near.ys) - ys).max() / (1e-7 * (1 + np.abs(ys[0]).max()))
    if not np.isfinite(stretch) or stretch > CHAOTIC:
        return
    if other.ok:
        assert np.abs(other.ys[-1] - end).max() <= allowed * stretch**2 * size
    if back.ok:
        assert np.abs(back.ys[-1] - ys[0]).max() <= allowed * stretch**2 * size


@pytest.mark.slow
@FEW
@given(QUICK, SIZES, SIZES, ENTRIES, st.floats(-5.0, 5.0))
def test_a_motion_is_right_or_says_why_not(name, a, b, entries, t1):
    sound(name, a, b, entries, t1)


@pytest.mark.slow
@MANY
@given(NAMES, SIZES, SIZES, ENTRIES, st.floats(-30.0, 30.0))
def test_many_motions_are_right_or_say_why_not(name, a, b, entries, t1):
    sound(name, a, b, entries, t1)


@pytest.mark.slow
@MANY
@given(st.sampled_from(sorted(TIED)), SIZES, SIZES, ENTRIES, st.floats(-10.0, 10.0))
def test_many_tied_motions_are_right_or_say_why_not(name, a, b, entries, t1):
    sound(name, a, b, entries, t1)


@FEW
@given(WILD, WILD, WILD, WILD)
def test_whatever_is_given_to_simulate_is_refused_or_run(t1, t0, rtol, limit):
    for options in (
        *({"t1": t1}, {"t1": 1.0, "t0": t0}, {"t1": 1.0, "rtol": rtol}, {"t1": 1.0, "atol": rtol}),
        *({"t1": 1.0, "max_steps": limit}, {"t1": 1.0, "samples": [t0]}, {"t1": 1.0, "dt": t0}),
    ):
        if options["t1"] is None or (isinstance(options.get("max_steps"), int) and limit > 0):
            continue  # the scene's own span; a limit of its own, which compiles again
        known = {"samples": 2, "max_steps": STEPS, "throw": False} | options
        motion = refused(lambda known=known: simulate(scenes.pendulum(), **known))
        if motion is not None and not motion.ok:
            assert np.isnan(np.asarray(motion.ys)[-1]).all()


@pytest.mark.slow
@FEW
@given(NAMES, SIZES, SIZES, ENTRIES)
def test_a_linearisation_is_that_of_differences(name, a, b, entries):
    scene = scene_of(name, a, b, entries)
    found = refused(lambda: linearize(scene, scene.y0))
    if found is None:
        return
    assert np.isfinite(found.eigenvalues).all()
    assert np.isfinite(found.bars).all()
    rounding = 1e-9 * (np.abs(scene.rate(0.0, scene.y0)).max() + np.abs(found.jacobian).max())
    for i in range(len(scene.y0)):
        fine, coarse = (slope(scene, i, h) for h in (1e-5, 2e-5))
        # Differences of order two: three times the error of the fine one is between them.
        gap = np.abs(fine - found.jacobian[:, i]).max()
        assert gap <= np.abs(fine - coarse).max() + rounding + 1e-9


def slope(scene, i, h):
    up, down = (scene.rate(0.0, scene.y0.at[i].add(sign * h)) for sign in (1, -1))
    return (up - down) / (2 * h)


@FEW
@given(SIZES, SIZES, st.floats(-3.0, 0.0), st.floats(0.01, 3.0), st.sampled_from([-1, 0, 40]))
def test_equilibria_of_a_pendulum_are_at_rest_and_all_there(a, b, low, high, starts):
    scene = scenes.pendulum(length=a, g=b)
    found = refused(lambda: equilibria(scene, [low], [high], starts=starts))
    if found is None:
        assert starts < 1
        return
    for state, error in zip(found.states, found.residuals, strict=True):
        assert abs(np.sin(state[0])) < 1e-8
        assert error <= 1e-7 * b / a
    assert len(found) <= 1  # angles below 3 in size: only the lower one


@FEW
@given(SIZES, st.floats(0.1, 2.9), st.floats(0.5, 2.0))
def test_an_orbit_is_a_swing_of_the_right_period_or_none(length, angle, off):
    scene = scenes.pendulum(length=length, angle=angle)
    guess = off * 2 * np.pi * np.sqrt(length / 9.81)
    orbit = orbits.find(scene, period=guess, max_iterations=12, throw=False)
    if not orbit.ok:
        return
    end = solve(orbit.scene, orbit.period, rtol=1e-13, solver=DOPRI8).y1
    assert np.abs(orbit.scene.system.difference(end, jnp.asarray(orbit.y0))).max() < 1e-8
    # No swing is faster than a small one, and what turns over is: it has the energy to.
    level = float(energy(orbit.scene, jnp.zeros(()), jnp.asarray(orbit.y0)))
    if level < 9.81 * length:
        assert orbit.period > 2 * np.pi * np.sqrt(length / 9.81) * (1 - 1e-9)


WORDS = st.sampled_from(
    ["0", "-1", "1e-320", "1e400", "nan", "inf", "x", "", "1,2", "2", "0.5", "1e300", "=", "-"]
)
OPTIONS = st.sampled_from(["--t1", "--samples", "--rtol", "--solver", "--set"])
KEYS = st.sampled_from(["m", "speed", "angle", "drag", "g", "t1", "mass", ""])


@FEW
@given(OPTIONS, KEYS, WORDS)
def test_any_words_on_the_command_line_are_an_answer_or_a_refusal(option, key, word):
    value = f"{key}={word}" if option == "--set" else word
    words = ["run", "cannonball", "--json", option, value]
    if option != "--samples":
        words += ["--samples", "3"]
    said = CliRunner().invoke(jaxdyn_app, words)
    _answered(said)
    if said.exit_code == 0:
        answer = json.loads(said.stdout)
        assert all(x is not None for x in answer["y"][-1])
        drift = answer["energy_drift"]
        if drift is not None and key != "drag":
            assert drift < 1e-9


@FEW
@given(st.sampled_from(["--period", "--energy", "--segments", "--closing"]), WORDS)
@example("--energy", "1e300")
@pytest.mark.slow
def test_any_words_after_orbits_find_are_an_answer_or_a_refusal(option, word):
    start = [] if option == "--period" else ["--period", "2.5"]
    if option == "--segments" and word == "2":
        return
    _answered(CliRunner().invoke(orbits_app, ["find", "pendulum", "--json", *start, option, word]))


def _answered(said) -> None:
    """Exit code 0, 1 or 2, or a ValueError, which `main` prints in one line."""
    if isinstance(said.exception, ValueError):
        assert str(said.exception)
    else:
        assert said.exception is None or isinstance(said.exception, SystemExit)
        assert said.exit_code in (0, 1, 2)
