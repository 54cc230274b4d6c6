"""The command `jaxdyn fit`: a track of a pendulum, a scene of one's own, what is refused."""

import functools
import json

import numpy as np
import pytest

import jaxdyn
from jaxdyn import scenes
from jaxdyn.drawing import fits

MINE = """
from jaxdyn import scenes

def swing(g=9.0, length=1.0):
    return scenes.pendulum(g=g, length=length)
"""


@pytest.fixture
def fit(command):
    return functools.partial(command, "jaxdyn", "fit")


@pytest.fixture(scope="module")
def track(tmp_path_factory):
    motion = jaxdyn.simulate(scenes.pendulum(damping=0.1, g=9.7), 8.0, samples=80)
    noise = 0.002 * np.random.default_rng(0).standard_normal((2, 80))
    x, y = np.sin(motion["theta"]) + noise[0], -np.cos(motion["theta"]) + noise[1]
    path = tmp_path_factory.mktemp("track") / "track.csv"
    lines = [f"{t:.9g},{a:.6f},{b:.6f}" for t, a, b in zip(motion.ts, x, y, strict=True)]
    path.write_text("\n".join(["time (s),x [m],y [m]", *lines]))
    return path


@pytest.mark.slow
def test_g_and_damping_of_a_track(fit, track, tmp_path, monkeypatch):
    code, out, _ = fit(
        "pendulum",
        str(track),
        "--free",
        "g",
        "--free",
        "damping=0.2",
        "--plot",
        str(tmp_path / "fit.png"),
    )
    assert code == 0
    assert "g " in out
    assert "+-" in out
    assert (tmp_path / "fit.png").exists()
    drawn = []
    monkeypatch.setattr(fits, "fit", lambda *args, **options: drawn.append(options["interval"]))
    for more in ((), ("--interval", "prediction")):
        plot = ("--plot", str(tmp_path / "fit.png"))
        assert fit("pendulum", str(track), "--free", "g", *plot, *more)[0] == 0
    assert drawn == ["confidence", "prediction"]
    mine = tmp_path / "mine.py"
    mine.write_text(MINE)
    code, out, _ = fit(f"{mine}:swing", str(track), "--free", "g", "--free", "length", "--json")
    found = json.loads(out)
    assert code == 0
    assert "correlated in time" in found["warning"]  # it has no damping
    code, out, _ = fit(f"{mine}:swing", str(track), "--free", "g", "--column", "y", "--json")
    assert json.loads(out)["estimates"].keys() == {"g", "theta(t0)", "theta_dot(t0)"}


BAD = """
import jaxdyn

def rate(t, y, c):
    return [c[0] * y[0] ** c[1]]

def grows(c=(50.0, 3.0), x=1.0):
    return jaxdyn.ode(rate, [x], 1.0, params=c, names=["x"])
"""


@pytest.mark.slow
def test_a_bad_guess_is_shown_with_the_options_that_change_it(fit, tmp_path):
    mine, data = tmp_path / "bad.py", tmp_path / "decay.csv"
    mine.write_text(BAD)
    data.write_text("t,x\n" + "".join(f"{t},{np.exp(-t):.6f}\n" for t in np.linspace(0, 1, 6)))
    code, out, _ = fit(f"{mine}:grows", str(data), "--free", "c", "--free", "x=1.1")
    assert code == 1
    assert "NO_MOTION" in out
    assert "It began at c = 50,3, x = 1.1, with 1 segment." in " ".join(out.split())
    assert "nearer to the data: --free c=A,B,... --free x=A; for more" in " ".join(out.split())
    code, out, _ = fit(f"{mine}:grows", str(data), "--free", "c=-1.2,1.1", "--free", "x=1.1")
    assert code == 0
    assert "It began" not in out


def test_misuse_is_refused(fit, track):
    for words, said in {
        (): "--free: expected a number to be estimated",
        ("--free", "gg"): "Did you mean 'g'",
        ("--free", "g", "--set", "g=3"): "fix, got --set g=3. To begin with that guess, write",
        ("--free", "g", "--title", "a"): "--plot with it",
        ("--free", "g=x"): "expected a number",
        ("--free", "g", "--interval", "mean"): "--interval: expected one of confidence, prediction",
        ("--free", "g", "--interval", "prediction"): "--interval: expected --plot with it",
    }.items():
        code, _, err = fit("pendulum", str(track), *words)
        assert code == 2
        assert said in err
    code, _, err = fit("pendulum", "none.csv", "--free", "g")
    assert code == 2
    assert "readable file" in err
