"""What a command says of a function's message: its own options, and nothing of Python."""

import pytest

import orbits
from jaxdyn.cli.messages import in_options, settings_of

OPTIONS = [
    "--start",
    "--energy",
    "--within",
    "--column",
    "--solver",
    "--rtol",
    "--max-step",
    "--set",
    "--drive",
]


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ("start: expected 3 entries, got 2.", "--start: expected 3 entries, got 2."),
        ("columns: expected one of t, got 'y'.", "--column: expected one of t, got 'y'."),
        ("Force.on: expected one of x, got 'q'.", "--drive: expected one of x, got 'q'."),
        ("make: expected one without time, got t.", "scene: expected one without time, got t."),
        ("mass: expected > 0, got -1.", "mass: expected > 0, got -1."),  # of the scene
        ("rtol: expected > 0, got 0.", "rtol: expected > 0, got 0."),  # given by --set rtol=0
        ("x: expected 1, got 2. Widen within=.", "x: expected 1, got 2. Widen --within."),
        (
            "x: expected 1, got 2. Use columns=[...], or not.",
            "x: expected 1, got 2. Use --column, or not.",
        ),
        (
            "x: expected 1, got 2. Pass rtol=1e-13, or max_step=.",
            "x: expected 1, got 2. Pass --rtol 1e-13, or --max-step.",
        ),
        (
            "x: expected 1, got 2. Pass solver=solvers.GAUSS12.",
            "x: expected 1, got 2. Pass --solver gauss12.",
        ),
        (
            "x: expected 1, got 2. Or use solvers.GAUSS12 for it.",
            "x: expected 1, got 2. Or use gauss12 for it.",
        ),
        (
            'x: expected 1, got 2. Try formulation="lagrange".',
            "x: expected 1, got 2. Try --set formulation=lagrange.",
        ),
        (
            "x: expected 1, got 2. Rename it. Others are observe={...}.",
            "x: expected 1, got 2. Rename it.",
        ),
        (
            "x: expected 1, got 2. See jaxdyn.simulate. find() one first. vibration.Force is one.",
            "x: expected 1, got 2.",
        ),
        (
            "x: expected 1, got f(y)=2. Use --set rho=, or --within.",
            "x: expected 1, got f(y)=2. Use --set rho=, or --within.",
        ),
        (
            "E: expected 1, got 2. Pass energy= to jaxdyn.ode.",
            "E: expected 1, got 2. Pass energy= to jaxdyn.ode.",
        ),
    ],
)
def test_messages_name_options(message, said):
    assert in_options(message, OPTIONS, ["formulation"], {"rtol": "0"}) == said


def test_settings_are_found_in_the_arguments():
    assert settings_of(["pendulum", "--set", "g=1", "--set=m=2"]) == {"g": "1", "m": "2"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("jaxdyn fit pendulum SWING --free g --start q", "error: --start: expected one of theta"),
        (
            "jaxdyn fit pendulum FILE --free g",
            "got 'a'. Rename it, or name the columns to use, --c",
        ),
        (
            "jaxdyn fit pendulum SWING --free g --noise -1",
            "error: --noise: expected > 0, got -1.0.",
        ),
        (
            "jaxdyn vibration pendulum --start 1",
            "error: --start: expected shape (2,), got shape (1",
        ),
        ("jaxdyn vibration pendulum --start a,b", "error: --start: expected comma-separated numb"),
        ("jaxdyn vibration cannonball", "got the start of the scene, near which none was found."),
        ("jaxdyn run pendulum --solver stoermer14", "or use gauss12 for a long run that conserves"),
        ("jaxdyn run pendulum --set length=0", "error: length: expected"),
        ("jaxdyn run ODE", 'error: file: expected parameters, starts and rates, got "x'),
        ("jaxdyn runn pendulum", "No such command 'runn'. Did you mean 'run'? See --help."),
        ("jaxdyn run MINE:swing", "got swing, which is none. Write `swing = lambda: ...`, or a"),
    ],
)
def test_a_command_names_its_options(command, tmp_path, words, said):
    path = tmp_path / "track.csv"
    path.write_text("t,a\n0,1\n1,2\n")
    swing = tmp_path / "swing.csv"
    swing.write_text("t,theta\n0,1\n1,2\n2,1\n3,2\n4,1\n")
    (tmp_path / "model.ode").write_text("par a=1\nx'=a*\n")
    (tmp_path / "mine.py").write_text("from jaxdyn import scenes\nswing = scenes.pendulum()\n")
    words = words.replace("FILE", str(path)).replace("SWING", str(swing))
    words = words.replace("ODE", f"{tmp_path}/model.ode").replace("MINE", f"{tmp_path}/mine.py")
    ran = command(*words.split())
    assert ran.code == 2
    assert said in ran.err


def test_a_message_about_a_line_of_a_file_stays_as_it_is(command, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "import jaxdyn\n\ndef mine(k=1.0):\n    return jaxdyn.scenes.cannonball(t1=[k, k])\n"
    )
    ran = command("jaxdyn", "run", path)
    assert ran.code == 2
    assert "error: t1: expected" in ran.err


def test_a_failed_search_is_one_line(command, monkeypatch):
    def fail(*args, **kwargs):
        raise orbits.orbit.SearchError(
            "No response was found. Widen frequencies=. Or quality=. See orbits.find."
        )

    monkeypatch.setattr(orbits, "backbone", fail)
    ran = command("orbits", "backbone", "pendulum", "--set", "angle=0")
    assert (ran.code, ran.out) == (1, "")
    assert ran.err == "error: No response was found. Widen --within.\n"
