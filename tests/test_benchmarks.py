"""The benchmarks run, and read the right number off a work-precision curve. No time is asserted."""

import importlib.util
import json

import numpy as np
import pytest
from helpers import gap
from scipy import integrate, linalg, optimize
from typer.testing import CliRunner

from benchmarks import __main__ as command_line
from benchmarks import (
    calls,
    classics,
    compile_time,
    default_method,
    device,
    effects_cost,
    ensembles,
    figure_eight,
    gradient,
    monodromy,
    nonsmooth,
    picture,
    problems,
    published,
    switched,
    systems,
    verdicts,
)
from benchmarks._timing import Method, Row, Times, at_error, interleave, work_precision
from jaxdyn.integrate.simulation import solve
from jaxdyn.scenes import three_body

EXACT = 1e-14  # relative, two formulas for one number


def _same(seconds):
    return Times(seconds, seconds)


def test_time_at_an_error_is_linear_in_the_logarithms():
    # time = error^(-1/11): what a method of order 11 does.
    errors = [1e-6, 1e-9, 1e-13]
    times = [_same(e ** (-1 / 11)) for e in errors]
    assert at_error(errors, times, 1e-12).median == pytest.approx(1e12 ** (1 / 11), rel=EXACT)


def test_a_run_that_another_beats_in_both_does_not_count():
    best = at_error([1e-6, 1e-12], [_same(1.0), _same(4.0)], 1e-9)
    more = at_error([1e-6, 1e-8, 1e-12], [_same(1.0), _same(5.0), _same(4.0)], 1e-9)
    assert best == more
    assert best.minimum == pytest.approx(2.0, rel=EXACT)


def test_questions_that_are_not_about_time_have_options_of_their_own():
    ask = command_line.command_of
    assert ask(["published", "halo"]) == (published.main, ["halo"])
    assert ask(["verdicts", "--count", "3"]) == (verdicts.main, ["--count", "3"])
    assert ask(["digits", "--quick"]) == (command_line.main, ["digits", "--quick"])
    assert ask([]) == (command_line.main, [])


def test_an_error_that_no_run_reaches_has_no_time():
    runs = [1e-6, 1e-9], [_same(1.0), _same(2.0)]
    assert np.isnan(at_error(*runs, 1e-10)).all()
    assert at_error(*runs, 1e-3) == _same(1.0)


def test_a_method_without_runs_has_no_time():
    assert np.isnan(at_error([], [], 1e-3)).all()


def test_slow_runs_take_part_in_fewer_rounds():
    calls = {"slow": 0, "quick": 0}

    def run(name):
        calls[name] += 1

    interleave({name: lambda name=name: run(name) for name in calls}, rounds=8, slow=1e9)
    assert calls["slow"] == calls["quick"]
    before = calls["slow"]
    interleave({"slow": lambda: run("slow")}, rounds=8, slow=1e-12)
    assert calls["slow"] - before < 8


@pytest.mark.slow
def test_our_three_ways_reach_the_true_end_and_give_rows():
    methods = figure_eight.ours((1e-7, 1e-13))
    for method in methods.values():
        end = method.build(method.tolerances[1])()
        assert np.max(np.abs(end - np.array(figure_eight.END))) < 1e-12
    truth = np.array(figure_eight.END)
    rows = work_precision("eight", methods, truth, (1e-6, 1e-12), rounds=1).rows
    assert [row.name.split(": ")[1] for row in rows] == [
        "build and first run",
        "error 1e-06",
        "error 1e-12",
    ]
    assert all(np.isfinite(list(row.times.values())).all() for row in rows)


def test_methods_built_side_by_side_are_timed_but_for_their_building():
    def method(wrong):
        return Method(lambda tol: lambda: np.ones(3) * (1.0 + wrong * tol), (1e-3, 1e-6))

    methods = {name: method(i + 1.0) for i, name in enumerate("abc")}
    made = work_precision("line", methods, np.ones(3), (1e-2,), 2, side_by_side={"b", "c"})
    assert made.compiling.keys() == {"a"}
    assert list(made.points) == ["a", "b", "c"]
    for i, points in enumerate(made.points.values()):
        smallest = points[0].error
        assert smallest == pytest.approx((i + 1.0) * 1e-6, rel=1e-6)


def test_a_run_that_fails_is_left_out_of_its_curve():
    broken = Method(
        lambda tol: lambda: np.array([tol, np.nan if tol < 1e-4 else 0.0]), (1e-3, 1e-6)
    )
    made = work_precision("line", {"a": broken}, np.array([0.0, 1.0]), (1.0,), 1)
    assert [p.error for p in made.points["a"]] == [1.0]


def test_what_got_slower_is_said():
    now = command_line.as_json([Row("a", {"x": _same(1.4), "y": _same(1.2)})])
    before = command_line.as_json([Row("a", {"x": _same(1.0), "y": _same(1.0)})])
    assert command_line.slower(now, before) == ["a, x: 1.40 times as long"]
    assert command_line.slower(before, now) == []


def _finite(rows):
    return all(np.isfinite(times).all() for row in rows for times in row.times.values())


@pytest.mark.sample(
    "figure-eight",
    "Kepler, e = 0.9",
    "cannonball",
    "van der Pol",
    "Lorenz",
    "Arenstorf",
    "spherical pendulum",
    "Toda",
    "Duffing",
    "Chua",
    "Lotka-Volterra",
    "magnetic bottle",
)
@pytest.mark.parametrize("name", default_method.PROBLEMS)
def test_formulas_and_scenes_are_the_same_equations(name):
    problem = default_method.PROBLEMS[name]()
    noise = np.random.default_rng(1).standard_normal(problem.y0s.shape[1])
    y = problem.y0s[-1] + 0.1 * noise
    assert gap(np.array(problem.formulas(np)(y)), problem.scene.rate(0.0, y)) < EXACT


@pytest.mark.parametrize("name", switched.SWITCHED)
def test_a_rate_with_switches_is_that_of_its_pieces(name):
    problem = switched.SWITCHED[name]()
    for leg in switched.scipy_legs(problem, 1e-10)()[:5]:
        t = 0.5 * (leg.t0 + leg.t1)
        rate = problem.piece(np)
        y = integrate.solve_ivp(rate, (leg.t0, t), leg.y0, args=(leg.mode,)).y[:, -1]
        assert all(value >= 0 for value in problem.guards(t, y, leg.mode))
        piece = np.array(rate(t, y, leg.mode))
        room = EXACT * max(np.abs(piece).max(), 1.0)
        assert gap(piece, problem.scene.rate(t, y)) < room
        assert gap(piece, np.array(problem.rate(np)(t, y))) < room


@pytest.mark.parametrize("name", switched.SWITCHED)
def test_two_integrators_find_the_same_switches(name):
    pytest.importorskip("heyoka")
    problem = switched.SWITCHED[name]()
    first = switched.heyoka_legs(problem, 1e-18, np.longdouble)()
    second = switched.scipy_legs(problem, 1e-13)()
    assert [leg.mode for leg in first] == [leg.mode for leg in second]
    # Play lets errors grow a thousandfold.
    assert gap([leg.t1 for leg in first], [leg.t1 for leg in second]) < 1e-9
    assert gap(first[-1].y1, second[-1].y1) < 1e-9


def test_ends_of_motions_with_switches_are_those_of_closed_forms():
    # Where the pendulum turns, the energy is less by the work of friction on the arc.
    angle, way = 2.05, -1.0
    while np.sin(abs(angle)) > 0.1:
        lost = lambda x, a=angle: np.cos(x) - np.cos(a) - 0.1 * abs(a - x)  # noqa: E731
        angle, way = optimize.brentq(lost, -way * 1e-9, way * abs(angle), xtol=1e-15), -way
    assert abs(nonsmooth.true_legs(switched.pendulum())[-1].y1[0] - angle) < 1e-12
    matrix, y = np.array([[0.0, -100.0], [100.0, -50.0]]), np.zeros(2)
    for _ in range(50):
        for rest, time in ((np.array([0.5, 1.0]), 2.5e-3), (np.zeros(2), 7.5e-3)):
            y = rest + linalg.expm(matrix * time) @ (y - rest)
    assert gap(nonsmooth.true_legs(switched.converter())[-1].y1, y) < 1e-13


@pytest.mark.slow
def test_switches_cost_no_steps_beside_smooth_pieces():
    problem = switched.ball()
    legs = nonsmooth.true_legs(problem)
    ours, pieces = nonsmooth.whole(problem, legs), nonsmooth.as_smooth(problem, legs)
    curves = nonsmooth.curves("ball", problem, ours, 1, (1e-6, 1e-12))
    assert min(p.error for p in curves.points["jaxdyn"]) < 1e-11
    assert {"diffrax Dopri8", "diffrax Tsit5"} <= curves.points.keys()
    counted = [each.counted() for each in (ours, pieces)]
    steps = np.array([[one.steps for one in way] for way in counted])
    # Those to a switch are shorter than the method would take.
    assert (steps[0] - steps[1]).max() <= len(legs)
    assert "8 switches" in nonsmooth.beside_pieces("ball", ours, pieces, 1).note


def _short(problem):
    return problem._replace(scene=problem.scene.starting(problem.scene.y0, 1.0))


@pytest.mark.slow
def test_the_default_is_held_to_every_other_method():
    curves = default_method.curves("short", _short(classics.lorenz()), 1, (1e-5, 1e-13))
    default, *others = curves.points
    assert default == "default, Taylor 16 and Taylor 20"
    peers = {"heyoka"} if importlib.util.find_spec("heyoka") else set()
    assert {"Verner 9(8)", "Taylor 16", "Taylor 20", *peers} <= set(others)
    assert set(curves.rows[1].bars) == set(others)
    assert all(min(p.error for p in points) < 1e-10 for points in curves.points.values())


@pytest.mark.slow
def test_curves_give_rows_and_are_stored_and_drawn(tmp_path):
    problem = _short(problems.henon_heiles())
    curves = systems.curves("short", problem, 1, (1e-5, 1e-13))
    assert [row.name for row in curves.rows[1:]] == [
        f"short: error {e:.0e}" for e in systems.ERRORS
    ]
    assert min(p.error for p in curves.points["jaxdyn"]) < 1e-12
    assert curves.rows[1].bars["heyoka"] == 1.0
    stored = command_line.merge({"curves": {"old": {}}}, command_line.as_json([curves]))
    assert set(stored["curves"]) == {"old", "short"}
    points = stored["curves"]["short"]["jaxdyn"]
    assert 1 <= len(points) <= 2
    picture.draw(stored, tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 1000


def test_many_starts_are_one_run():
    problem = problems.cannonball()
    few = problem._replace(y0s=problem.y0s[::33])
    ends = systems.compile_solve(few, (1e-12,)).build(1e-12)()
    for y0, end in zip(few.y0s, ends, strict=True):
        one = solve(few.scene.starting(y0), few.t1, rtol=1e-12).y1
        # Each is right to 2e-14 against order 9 at 1e-15: numbers that are known round otherwise.
        assert gap(end, one) < 4e-14 * np.abs(one).max()


@pytest.mark.slow
def test_the_gradient_is_that_of_the_loss():
    scene = problems.sheet().scene
    k, h = scene.effects[0].k, 1e-4

    def loss(k):
        return 0.5 * np.sum(np.square(gradient.end(k, scene, 1.0, 1e-13)))

    numeric = (loss(k.at[3].add(h)) - loss(k.at[3].add(-h))) / (2 * h)
    assert abs(gradient.gradient(k, scene, 1.0, 1e-13)[3] - numeric) < 1e-7  # h^2


@pytest.mark.slow
def test_the_slowest_vibration_repeats():
    scene = problems.sheet().scene
    rest = np.array([(i // 3, i % 3) for i in range(9)], float)
    square = np.linalg.eigvalsh(_stiffness(rest))[3]  # the first three are motions as a whole
    assert abs(gradient.slowest_period(scene) - 2 * np.pi / np.sqrt(square)) < 1e-12


def _stiffness(rest):
    """From each spring's direction e: k e e^T between its ends."""
    total = np.zeros((18, 18))
    for i, j in problems.SPRINGS:
        e = (rest[i] - rest[j]) / np.linalg.norm(rest[i] - rest[j])
        row = np.zeros((9, 2))
        row[i], row[j] = e, -e
        total += np.outer(row.ravel(), row.ravel())
    return total


@pytest.mark.slow
def test_calls_take_no_step():
    scene = three_body()
    out = solve(scene, 0.0)
    assert int(out.steps) == 0
    assert (out.y1 == scene.y0).all()
    assert _finite(calls.run(quick=True))


def test_first_results_are_timed():
    seconds = compile_time.first_results(["oscillator"])
    assert list(seconds) == ["oscillator"]
    assert min(seconds["oscillator"]) > 0


@pytest.mark.slow
def test_ensembles_give_rows():
    rows = ensembles.work_precision(1, (1e-6, 1e-14), 64, 8)
    assert [row.name for row in rows] == [f"a motion: error {e:.0e}" for e in ensembles.ERRORS]
    assert all(np.isfinite(row.times["jaxdyn"]).all() for row in rows)
    assert _finite([ensembles.unequal(1, 40)])


@pytest.mark.slow
def test_motions_on_a_device_are_those_of_the_ensemble():
    (row,) = device.run("cpu", 0.05, quick=True, lanes=(10,))
    assert row.name.startswith("10 motions on cpu")
    y1, steps = device.ends(three_body(), ensembles.starts(10))
    alone = ensembles.ensemble.run(three_body(), ensembles.starts(10), rtol=1e-12)
    assert gap(y1, alone.y1) < 1e-12
    assert (np.asarray(steps) > 10).all()


def test_operations_of_a_step_are_counted():
    # 17 stages of three pairs with at least 15 operations each.
    assert 17 * 3 * 15 < device.operations_of_a_step(three_body()) < 10_000


def test_without_a_gpu_it_says_so():
    with pytest.raises(ValueError, match="--device: expected a kind of device that JAX sees"):
        device.run("no such thing", 34.0)
    with pytest.raises(ValueError, match="--peak: expected above 0"):
        device.run("cpu", 0.0)
    with pytest.raises(ValueError, match="expected cpu for all but ensembles, got gpu"):
        next(command_line.measure(["calls"], "gpu", 34.0, quick=True))


def test_misuse_is_exit_code_2():
    app = command_line.typer.Typer()
    app.command()(command_line.main)
    result = CliRunner().invoke(app, ["ensembles", "--device", "nothing"])
    assert result.exit_code == command_line.MISUSE
    assert "expected a kind of device" in result.output
    result = CliRunner().invoke(app, ["ensemble"])
    assert result.exit_code == command_line.MISUSE
    assert "Did you mean 'ensembles'?" in result.output


def test_a_file_that_no_benchmark_has_written_is_refused_before_anything_is_measured(
    monkeypatch, tmp_path
):
    monkeypatch.setattr(command_line, "RUNS", {"first": lambda quick: 1 / 0})
    app = command_line.typer.Typer()
    app.command()(command_line.main)
    other = tmp_path / "other.json"
    for text in ("not JSON", "[1]"):
        other.write_text(text)
        result = CliRunner().invoke(app, ["--json", str(other)])
        assert result.exit_code == command_line.MISUSE
        assert "results of benchmarks" in result.output
        assert other.read_text() == text
    result = CliRunner().invoke(app, ["--json", str(tmp_path / "none" / "x.json")])
    assert result.exit_code == command_line.MISUSE
    assert "--json: expected a file in a folder that exists" in result.output


def test_results_are_printed_and_stored_as_they_come(monkeypatch, tmp_path):
    def stopped(quick):
        raise KeyboardInterrupt

    row = Row("a", {"x": _same(1.5)}, note="A remark.")
    monkeypatch.setattr(command_line, "RUNS", {"first": lambda quick: [row], "second": stopped})
    app = command_line.typer.Typer()
    app.command()(command_line.main)
    stored = tmp_path / "stored.json"
    result = CliRunner().invoke(app, ["--json", str(stored)])
    assert result.exit_code != 0
    assert "a: A remark." in result.output
    assert "first: 0 s from the start" in result.output
    assert json.loads(stored.read_text())["seconds"]["a"]["x"]["minimum"] == 1.5


def test_a_missed_bar_is_said():
    times = {"ours": _same(2.0), "theirs": _same(1.0)}
    assert command_line._target(Row("a", times, {"theirs": 3.0}), "theirs") == "3 kept"
    assert command_line._target(Row("a", times, {"theirs": 1.5}), "theirs") == "1.5 missed"
    assert command_line._target(Row("a", times), "theirs") == ""


#: Benchmarks of which other tests run one problem: all take minutes.
_LONG = ("systems", "default", "nonsmooth")


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in command_line.RUNS if n not in _LONG])
def test_every_benchmark_runs(name):
    ((_, found),) = command_line.measure([name], "cpu", 34.0, quick=True)
    assert all(
        min(t)[0] > 0 for each in found for row in each.rows for t in [[*row.times.values()]]
    )


@pytest.mark.slow
def test_the_pendulums_by_hand_are_the_composed_ones():
    composed = problems.double_pendulum().scene
    by_hand = effects_cost.by_hand(composed)
    assert gap(solve(by_hand, 2.0).y1, solve(composed, 2.0).y1) < 1e-8


@pytest.mark.slow
def test_the_monodromy_ways_agree():
    one, two = (m.build(1e-13)() for m in monodromy.ours((1e-13,)).values())
    assert gap(one, two) < 1e-9
