"""What accuracy costs: curves, recommendations, command, pictures. Times only have to be there."""

import functools
import json
import re

import numpy as np
import pytest

from jaxdyn import drawing, scenes, solvers
from jaxdyn.accuracy import quantities
from jaxdyn.accuracy import work_precision as work
from jaxdyn.accuracy.timing import Times
from jaxdyn.course import two_masses_and_rod
from jaxdyn.integrate import events

TOLERANCES = (1e-4, 1e-8, 1e-12)
FEW = {"tolerances": TOLERANCES, "rounds": 1}
OSCILLATOR = scenes.oscillator(c=0.1)


FIT = ["Taylor 16", "Taylor 20", "Verner 9(8)", "Dopri8", "Taylor 12", "Taylor 14"]


def errors(found) -> np.ndarray:
    return np.array([[rung.error for rung in curve.rungs] for curve in found.curves])


@pytest.fixture(scope="module")
def damped():
    return work.work_precision(OSCILLATOR, **FEW)


@pytest.mark.slow
def test_errors_of_the_end_are_true_errors(damped):
    w = np.sqrt(1 - 0.0025)
    exact = np.exp(-0.5) * (np.cos(10 * w) + 0.05 / w * np.sin(10 * w))
    assert [curve.solver for curve in damped.curves] == FIT
    assert np.all(errors(damped)[:, 0] > 1e3 * errors(damped)[:, 1])
    assert damped.uncertainty < 1e-13
    from_end = quantities.END.of(OSCILLATOR, 10.0, solver=solvers.VERNER9, rtol=1e-8, dt=None)
    true = abs(float(from_end[0]) - exact)
    assert true <= 1.01 * errors(damped)[FIT.index("Verner 9(8)"), 1]


@pytest.mark.slow
def test_right_hand_sides_are_steps_times_stages(damped):
    stages = {"Verner 9(8)": 16, "Dopri8": 14}
    for curve in damped.curves:
        for rung in curve.rungs:
            if curve.solver in stages:
                assert rung.evaluations % stages[curve.solver] == 0
                assert rung.evaluations >= stages[curve.solver] * rung.steps
            else:
                assert np.isnan(rung.evaluations)
            assert rung.times.median >= rung.times.minimum > 0
        assert curve.compiling > 0


def curve(name, seconds, found):
    rungs = [
        work.Rung(tol, e, Times(s, s), 1, 1.0)
        for tol, e, s in zip(TOLERANCES, found, seconds, strict=True)
    ]
    return work.Curve(name, 1.0, tuple(rungs), adaptive=True)


def test_the_fastest_with_enough_digits_is_recommended():
    quick = curve("quick", (1.0, 2.0, 9.0), (1e-3, 1e-6, 1e-10))
    sharp = curve("sharp", (1.5, 3.0, 4.0), (1e-5, 1e-9, 1e-13))
    found = work.WorkPrecision("end", 1e-16, (quick, sharp))
    assert found.recommend(3) == work.Choice("quick", 1e-4, 1e-3, 1.0)
    assert found.recommend(9) == work.Choice("sharp", 1e-8, 1e-9, 3.0)
    assert found.recommend(10).solver == "sharp"
    assert found.recommend(14) is None
    assert found.at(1e-6)["quick"].median == pytest.approx(2.0)
    assert np.isnan(found.at(1e-11)["quick"].median)


@pytest.mark.parametrize(
    ("scene", "quantity"),
    [
        (scenes.pendulum(), quantities.ENERGY_DRIFT),
        (scenes.pendulum(), quantities.GRADIENT),
        (scenes.pendulum(), quantities.event_time(events.Reaches(0, 0.0))),
        (scenes.pendulum(formulation="constrained", drift="raw"), quantities.CONSTRAINTS),
    ],
    ids=lambda x: x.name if isinstance(x, quantities.Quantity) else "",
)
@pytest.mark.slow
def test_other_quantities_get_better_with_the_tolerance(scene, quantity):
    found = work.work_precision(scene, 1.0, solvers=[solvers.VERNER9], quantity=quantity, **FEW)
    assert found.quantity == quantity.name
    (row,) = errors(found)
    assert row[0] > 100 * row[1] > 1e3 * row[2]
    assert row[2] < 1e-11


def _fixed():
    steps = (100, 200, 400)
    free = scenes.oscillator()
    return work.work_precision(free, solvers=[solvers.VERLET], steps=steps, rounds=1)


@pytest.mark.slow
def test_solvers_of_fixed_step_have_their_curve():
    found = _fixed()
    (row,) = errors(found)
    assert np.abs(np.log2(row[:-1] / row[1:]) - 2).max() < 0.1
    assert found.curves[0].rungs[1].fineness == 10.0 / 200


def test_a_stiff_scene_gets_implicit_solvers():
    stiff = scenes.oscillator(k=1.0, c=1e6)
    assert work.fit_solvers(stiff) == (solvers.RADAU9, solvers.RADAU5)
    assert work.fit_solvers(scenes.oscillator())[0] is solvers.NYSTROM12
    scene = scenes.henon_heiles()
    names = {solver.name for solver in work.fit_solvers(scene)}
    assert {solvers.default_solver(scene, rtol=r).name for r in (1e-6, 1e-10, 1e-13)} <= names


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: work.work_precision(OSCILLATOR, solvers=[]), "solvers: expected at least one"),
        (
            lambda: work.work_precision(OSCILLATOR, quantity=quantities.CONSTRAINTS, **FEW),
            "scene: expected one with constraints",
        ),
        (lambda: drawing.judgement({}), "found: expected at least one scene"),
        (lambda: drawing.judgement({"a": _fixed()}), "found: expected solvers with a tolerance"),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def _renamed(found):
    """Thrice as many curves, with long names."""
    curves = found.curves * 3
    names = (f"A solver with number {i}" for i in range(len(curves)))
    renamed = (x._replace(solver=n) for x, n in zip(curves, names, strict=True))
    return found._replace(curves=tuple(renamed))


def _legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.slow
def test_pictures_are_drawn(damped, tmp_path):
    drawing.work_precision(damped, tmp_path / "work.png", title="damped")
    figure = drawing.judgement({"one": damped, "two": damped}, tmp_path / "j.png")
    assert [ax.get_title() for ax in figure.axes] == ["one", "two"]
    # A step is no tolerance.
    both = damped._replace(curves=(*damped.curves, *_fixed().curves))
    assert _legend(drawing.judgement({"one": both})) == _legend(figure)
    assert "Verlet 2" in _legend(drawing.work_precision(both))
    dopri8 = damped._replace(curves=damped.curves[1:])
    figure = drawing.judgement({"both": damped, "one": dopri8})
    shades = [
        {line.get_label(): line.get_color() for line in ax.lines if line.get_label() == "Dopri8"}
        for ax in figure.axes
    ]
    assert shades[0] == shades[1] != {}
    names = [curve.solver for curve in damped.curves]
    some, every = (
        {line.get_label(): line.get_color() for line in figure.axes[0].lines}
        for figure in (drawing.work_precision(one, solvers=names) for one in (dopri8, damped))
    )
    assert some.items() < every.items()
    for width in (1, 3):
        many = drawing.judgement({str(i): _renamed(damped) for i in range(width)})
        many.draw_without_rendering()
        box = many.legends[0].get_window_extent()
        assert box.x0 >= 0
        assert box.x1 <= many.bbox.x1
        assert len(many.legends[0].get_texts()) == 3 * len(damped.curves) + 1
    for file in ("work.png", "j.png"):
        assert (tmp_path / file).stat().st_size > 1000


@pytest.fixture
def accuracy_command(command):
    return functools.partial(command, "jaxdyn", "accuracy")


@pytest.mark.slow
def test_the_command_prints_what_digits_cost(accuracy_command, tmp_path):
    picture = tmp_path / "work.png"
    words = ("oscillator", "--set", "c=0.1", "--digits", "10", "--plot", picture)
    code, out, _ = accuracy_command(*words)
    assert code == 0
    assert " 9 digits: " in out
    assert "oscillator: time for each number of correct digits (end state)" in out
    assert re.search(r"^recommended for 10 digits: .+ with rtol 1e-\d+, which takes", out, re.M)
    said = "the default at rtol 1e-10 is Taylor 20, since the Taylor series of the rate needs "
    assert said in out
    assert picture.stat().st_size > 1000
    code, out, _ = accuracy_command("oscillator", "--set", "c=0.1", "--json")
    found = json.loads(out)
    assert found["digits"] == 9
    assert found["default"] == "Taylor 20"
    assert found["reason"].startswith("the Taylor series of the rate needs ")
    assert found["recommended"]["error"] <= 1e-9
    assert {c["solver"] for c in found["curves"]} == set(FIT)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("oscillator", "--digits", "20"), "digits: expected above 0, at most 15, got 20"),
        (("oscillatr",), "Did you mean 'oscillator'?"),
        (("oscillator", "--set", "c"), "--set: expected NAME=VALUE"),
        (("oscillator", "--plot", "x.txt"), "--plot: expected a file name ending in"),
    ],
)
def test_the_command_refuses_in_one_line(accuracy_command, words, message):
    code, _, err = accuracy_command(*words)
    assert code == 2
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_problem_21_the_rod_takes_less_than_a_stiff_spring():
    rows = {row.name: row for row in two_masses_and_rod.compare((1e2, 1e4), t1=10.0, rounds=1)}
    for row in rows.values():
        assert row.error <= 1e-9
        assert row.seconds > 0
    rod, soft, hard = rows["rod, projection"], rows["spring, k = 100"], rows["spring, k = 10000"]
    assert hard.evaluations > 5 * soft.evaluations
    assert hard.evaluations > 10 * rod.evaluations
    assert rod.stretch < 1e-14 < 1e-9 < hard.stretch < 0.02 * soft.stretch
    assert rows["rod, raw"].stretch < 1e-13  # the constraint is linear: no drift
