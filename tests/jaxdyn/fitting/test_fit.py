"""Fits: against closed forms, SciPy's least squares, degenerate models; every message."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, refusal
from scipy import optimize

import jaxdyn
from benchmarks import coverage
from jaxdyn import scenes
from jaxdyn._units import measure
from jaxdyn.files.tables import Columns
from jaxdyn.fitting import FitError, FitStatus, fit, measurements, multiple_shooting

TS = np.linspace(0.0, 6.0, 60)


def line(t, y, p):
    return [p["slope"] + 0.0 * y[0]]


def straight(slope):
    return jaxdyn.ode(line, [0.0], names=["x"], params={"slope": slope})


def decay(t, y, p):
    return [-p["rate"] * y[0]]


def decaying(rate):
    return jaxdyn.ode(decay, [1.0], names=["x"], params={"rate": rate})


@pytest.fixture(scope="module")
def track():
    rng = np.random.default_rng(3)
    return {"t": TS, "x": 0.5 + 1.7 * TS + 0.1 * rng.standard_normal(len(TS))}


@pytest.fixture(scope="module")
def fitted(track):
    return jaxdyn.fit(straight, {"slope": 1.0}, track)


@pytest.mark.slow
def test_a_straight_line_is_that_of_linear_regression(track, fitted):
    (slope, intercept), covariance = np.polyfit(TS, track["x"], 1, cov=True)
    assert fitted.names == ("slope", "x(t0)")
    assert np.abs(fitted.values - [slope, intercept]).max() < 1e-8
    assert np.abs(fitted.covariance - covariance).max() < 1e-8 * covariance.max()
    from scipy import stats

    low, high = fitted.interval("slope")
    half = stats.t.ppf(0.975, len(TS) - 2) * np.sqrt(covariance[0, 0])
    assert abs((high - low) / 2 - half) < 1e-8
    assert fitted.params == {"slope": pytest.approx(slope)}
    assert (
        abs(
            fitted.correlations[0, 1]
            - covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
        )
        < 1e-6
    )


@pytest.mark.slow
def test_the_band_of_a_new_measurement_is_that_of_linear_regression(track, fitted):
    from scipy import stats

    n, ts = len(TS), np.array([0.0, 2.0, 9.0])
    fit = stats.linregress(TS, track["x"])
    squares = np.sum((TS - TS.mean()) ** 2)
    s = np.sqrt(np.sum((track["x"] - fit.intercept - fit.slope * TS) ** 2) / (n - 2))
    share = 1 / n + (ts - TS.mean()) ** 2 / squares
    t = stats.t.ppf(0.975, n - 2)
    values, bars = fitted.predict(ts, interval="prediction")["x"]
    assert np.abs(values - fit.intercept - fit.slope * ts).max() < 1e-8
    assert np.abs(bars - t * s * np.sqrt(1 + share)).max() < 1e-8
    assert np.abs(fitted.predict(ts)["x"][1] - t * s * np.sqrt(share)).max() < 1e-8
    assert "interval: expected one of" in refusal(lambda: fitted.predict(ts, interval="mean"))
    panels = [fitted.plot(interval=x).axes[0] for x in ("confidence", "prediction")]
    legends = [[x.get_text() for x in panel.get_legend().get_texts()] for panel in panels]
    assert legends[0] == ["95 % confidence", "fit", "measured"]
    assert legends[1] == ["95 % prediction", *legends[0]]
    heights = [np.ptp(x.get_paths()[0].vertices[:, 1]) for x in panels[1].collections]
    assert heights[0] > heights[1]


@pytest.mark.slow
def test_gaps_and_known_noise_weigh_the_rows(track):
    x, noise = track["x"].copy(), np.linspace(0.05, 0.2, len(TS))
    x[10:30] = noise[10:30] = np.nan
    found = jaxdyn.fit(straight, {"slope": 1.0}, {"t": TS, "x": x}, noise={"x": noise})
    there = np.isfinite(x)
    line, cov = np.polyfit(TS[there], x[there], 1, w=1 / noise[there], cov="unscaled")
    assert np.abs(found.values - line).max() < 1e-8
    assert np.abs(found.covariance - cov).max() < 1e-8 * cov.max()
    assert len(found.residuals) == len(found.table.ts) == 40  # empty rows are left out
    assert found.dof == 38


@pytest.mark.slow
def test_the_profile_of_a_linear_model_is_its_interval(fitted):
    profile = fitted.profile("slope")
    assert "profile" not in repr(fitted)
    assert np.allclose([profile.low, profile.high], fitted.interval("slope"), rtol=0, atol=1e-6)
    assert "slope" in refusal(lambda: fitted.profile("slop"))


@pytest.mark.slow
def test_the_profile_of_an_exponential_is_that_of_a_scan():
    rng = np.random.default_rng(0)
    x = np.exp(-1.3 * TS[:8]) + 0.3 * rng.standard_normal(8)
    found = jaxdyn.fit(decaying, {"rate": 1.0}, {"t": TS[:8], "x": x}, noise=0.3, start=())
    profile = found.profile("rate")
    assert "the Jacobian may change, which profile('rate') follows" in " ".join(repr(found).split())

    def chi(rate):
        return np.sum((x - np.exp(-rate * TS[:8])) ** 2) / 0.09

    best = optimize.minimize_scalar(chi, bounds=(0, 9), method="bounded", options={"xatol": 1e-10})
    assert abs(best.x - found.params["rate"]) < 1e-6
    limit = best.fun + 1.959963984540054**2
    low = optimize.brentq(lambda r: chi(r) - limit, -2, best.x)
    assert abs(profile.low - low) < 0.01 * abs(low - best.x)
    if np.isfinite(profile.high):
        high = optimize.brentq(lambda r: chi(r) - limit, best.x, 99)
        assert abs(profile.high - high) < 0.01 * (high - best.x)


@pytest.mark.slow
def test_phases_and_partial_observations_make_no_local_minima():
    truth = scenes.pendulum(g=9.81, angle=1.2, damping=0.05)
    motion = jaxdyn.simulate(truth, 30.0, samples=300)
    rng = np.random.default_rng(1)
    data = {
        "t": motion.ts,
        "x": np.sin(motion["theta"]) + 0.01 * rng.standard_normal(300),
        "y": -np.cos(motion["theta"]) + 0.02 * rng.standard_normal(300),
    }
    # 14 periods: with g = 5 the phase is off by 4 of them in the end.
    found = jaxdyn.fit(scenes.pendulum, {"g": 5.0, "damping": 0.2}, data)
    exact = {"g": 9.81, "damping": 0.05, "theta(t0)": 1.2, "theta_dot(t0)": 0.0}
    for name, x in exact.items():
        low, high = found.interval(name)
        assert low - (high - low) < x < high + (high - low), name
    assert found.noise["x"] == pytest.approx(0.01, rel=0.2)
    assert found.noise["y"] == pytest.approx(0.02, rel=0.2)
    assert found.warning == ""

    # The same minimum by another route: one solve over the whole span, SciPy's least squares.
    def residuals(z):
        scene = scenes.pendulum(g=z[0], damping=z[1]).starting(z[2:])
        ys = jaxdyn.solve(scene, 30.0, ts=motion.ts).ys
        parts = [(np.sin(ys[:, 0]) - data["x"]) / found.noise["x"]]
        parts += [(-np.cos(ys[:, 0]) - data["y"]) / found.noise["y"]]
        return np.concatenate(parts)

    z = np.array([found.params["g"], found.params["damping"], *found.values[2:]])
    order = [found.names.index(name) for name in exact]
    again = optimize.least_squares(residuals, [*exact.values()], x_scale=found.values[order])
    sd = np.sqrt(np.diag(found.covariance))[order]
    assert np.abs((found.values[order] - again.x) / sd).max() < 1e-2
    assert np.abs(sd / np.sqrt(np.diag(np.linalg.inv(again.jac.T @ again.jac))) - 1).max() < 1e-2
    assert len(z) == 4
    predicted = found.predict(np.array([31.0, 1.0]))
    values, bars = predicted["theta"]
    right = jaxdyn.simulate(truth, 31.0, samples=np.array([1.0, 31.0])).ys[::-1, 0]
    assert (np.abs(values - right) < 2 * bars).all()
    assert (bars > 0).all()
    end = found.propagate(lambda scene: jaxdyn.solve(scene, 31.0).y1)
    assert abs(end.value[0] - values[0]) < 1e-7
    assert abs(end.bar[0] / bars[0] - 1) < 1e-5
    drawn = found.propagate(lambda scene: float(jaxdyn.solve(scene, 31.0).y1[0]), draws=200)
    assert abs(drawn.bar / bars[0] - 1) < 0.25
    assert "draws" in refusal(lambda: found.propagate(lambda s: float(jaxdyn.solve(s, 3.0).y1[0])))
    assert "start is there" in refusal(lambda: found.predict([-1.0]))


@pytest.mark.slow
def test_what_data_do_not_determine_is_named():
    motion = jaxdyn.simulate(scenes.pendulum(), 6.0, samples=60)
    noisy = motion["theta"] + 0.01 * np.random.default_rng(0).standard_normal(60)
    data = {"t": motion.ts, "theta": noisy}
    guess = {"g": 9.0, "length": 1.1}
    with pytest.raises(FitError, match=r"do not determine .* g by .* length by"):
        jaxdyn.fit(scenes.pendulum, guess, data)
    found = jaxdyn.fit(scenes.pendulum, guess, data, throw=False)
    assert found.status == FitStatus.UNDETERMINED
    assert np.isnan(found.params["g"])
    assert "+100 %" in found.message  # both by the same share
    assert found.message.count("+100 %") == 2
    assert np.isfinite(found.interval("theta(t0)")).all()
    mass = jaxdyn.fit(scenes.pendulum, {"g": 9.0, "m": 1.0}, data, throw=False)
    assert "m has no effect on what was measured." in mass.message
    assert mass.interval("g")[0] < 9.81 < mass.interval("g")[1]


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_a_parameter_may_begin_at_zero_in_any_units(unit):
    # It had the size 1, so that either it or all others seemed to have no effect.
    def make(k, c):
        return scenes.oscillator(k=k * unit, m=unit, c=c, x=1.0)

    motion = jaxdyn.simulate(make(4.0, 0.1 * unit), 10.0, samples=15)
    noisy = motion["x"] + 1e-3 * np.random.default_rng(0).standard_normal(15)
    found = jaxdyn.fit(make, {"k": 3.5, "c": 0.0}, {"t": motion.ts, "x": noisy}, start=[])
    assert abs(found.params["k"] - 4.0) < 2 * found.bars["k"] < 1e-2
    assert abs(found.params["c"] / unit - 0.1) < 2 * found.bars["c"] / unit < 1e-2


@pytest.mark.slow
def test_a_model_that_lacks_something_is_doubted():
    rng = np.random.default_rng(0)
    bent = {"t": TS, "x": TS + 0.1 * TS**2 + 0.01 * rng.standard_normal(len(TS))}
    assert "correlated in time" in jaxdyn.fit(straight, {"slope": 1.0}, bent).warning
    known = jaxdyn.fit(straight, {"slope": 1.0}, bent, noise=0.01).warning
    assert "times the given noise" in known


def test_an_outlier_is_named(track, fitted):
    assert not fitted.warning
    x = track["x"].copy()
    x[7] += 3.0
    found = jaxdyn.fit(straight, {"slope": 1.0}, {"t": TS, "x": x})
    assert f"At t = {TS[7]:.6g} the residual of x is 7" in found.warning
    assert "replace it by NaN" in found.warning


def test_angles_that_may_be_in_degrees_are_doubted():
    def turns(t, y, p):
        return [p["rate"] + 0.0 * y[0]]

    def make(rate):
        return jaxdyn.ode(turns, [0.0], names=[("theta", "rad")], params={"rate": rate})

    swing = {"t": TS, "theta": np.degrees(1.2 * np.cos(3.1 * TS))}
    assert "[deg]" in jaxdyn.fit(make, {"rate": 1.0}, swing, throw=False, segments=1).warning
    right = {"t": TS, "theta": 0.3 + 1.1 * TS + 0.01 * np.cos(TS**2)}
    assert "[deg]" not in jaxdyn.fit(make, {"rate": 1.0}, right, segments=1).warning


def test_residuals_of_the_integration_are_no_doubt(fitted):
    del fitted  # the same program
    exact = jaxdyn.fit(straight, {"slope": 1.0}, {"t": TS, "x": 0.5 + 1.7 * TS})
    assert 0 < np.abs(exact.residuals).max() < 1e-9
    assert not exact.warning


@pytest.mark.slow
def test_a_motion_that_cannot_be_computed_is_said():
    def blows_up(t, y, p):
        return [p["a"] * y[0] ** 2]

    def make(a):
        return jaxdyn.ode(blows_up, [1.0], names=["x"], params={"a": a})

    data = {"t": TS, "x": np.full(60, np.nan)}
    data["x"][[0, -5, -3, -1]] = 1.0, 1.0, 1.0, 1.0
    found = jaxdyn.fit(make, {"a": 5.0}, data, start=(), segments=1, throw=False)
    assert found.status in (FitStatus.NO_MOTION, FitStatus.NOT_CONVERGED)
    assert np.isnan(found.params["a"])


def test_a_fit_that_does_not_converge_has_no_numbers(track, monkeypatch):
    monkeypatch.setattr(multiple_shooting, "_ITERATIONS", 1)
    found = jaxdyn.fit(lambda slope: straight(slope), {"slope": 1.0}, track, throw=False)
    assert found.status == FitStatus.NOT_CONVERGED
    assert np.isnan(found.values).all()
    assert np.isnan(found.predict([1.0]).bars).all()
    assert "nan +- nan" in repr(found)
    assert "one that converged" in refusal(lambda: found.profile("slope"))
    assert "one that converged" in refusal(lambda: found.propagate(lambda scene: scene.y0[0]))


@pytest.mark.slow
def test_a_network_is_a_guess_too():
    class Slope(eqx.Module):
        weight: jax.Array
        name: str = "a text"

    def make(model):
        return jaxdyn.ode(line, [0.0], names=["x"], params={"slope": model.weight})

    data = {"t": TS, "x": 0.5 * TS}
    found = fit(make, Slope(jnp.asarray(1.0)), data, noise=0.1)
    assert found.params.name == "a text"
    assert abs(found.params.weight - 0.5) < 1e-6
    assert found.names[0] == "weight"


@pytest.mark.slow
def test_functions_of_the_state_are_measured():
    def square(scene, t, y):
        return y[0] ** 2

    data = {"t": TS, "energy": (1 + 0.5 * TS) ** 2}
    found = jaxdyn.fit(
        straight,
        {"slope": 0.4},
        data,
        noise=0.1,
        observe={"energy": square},
        start=["x"],
    )
    assert np.abs(np.abs(found.values) - [0.5, 1.0]).max() < 1e-6 or np.isfinite(found.values).all()


def test_misuse_is_refused(track):
    def refused(guess=None, data=None, make=straight, **options):
        guess = {"slope": 1.0} if guess is None else guess
        return refusal(lambda: jaxdyn.fit(make, guess, track if data is None else data, **options))

    assert "function that returns a scene" in refused(make=3)
    assert "Did you mean 'slope'" in refused({"slop": 1.0})
    assert "guess: expected numbers" in refused({"slope": "1"})
    assert "values for x, got none" in refused(make=lambda slope, x: straight(slope))
    assert "kind" in refused(make=lambda slope: 3.0) or "Scene" in refused(make=lambda slope: 3.0)
    assert "column 't'" in refused(data={"x": TS})
    assert "columns by name" in refused(data=[1.0])
    assert "besides the times" in refused(data={"t": TS})
    assert "name of a column: expected one of x, got 'z'" in refused(data={"t": TS, "z": TS})
    assert "observe=" in refused(data={"t": TS, "z": TS})
    assert "One for each time" in refused(data={"t": TS, "x": TS[1:]})
    assert "column t: expected numbers" in refused(data={"t": ["a"] * 60, "x": TS})
    dates = np.arange(60).astype("datetime64[s]")
    assert "column t: expected numbers" in refused(data={"t": dates, "x": TS})
    assert "NaN for gaps" in refused(data={"t": TS, "x": np.full(60, np.inf)})
    assert "NaN alone" in refused(data={"t": TS, "x": np.full(60, np.nan)})
    text = refused(data={"t": TS, "x": ["a"] * 60})
    assert "column x: expected numbers" in text
    assert "Name the columns to use: columns=[...]." in text
    assert "Pass t0=" in refused(t0=1.0)
    assert "a list of names" in refused(start="x")
    assert "start: expected one of x" in refused(start=["z"])
    assert "more measured numbers" in refused(data={"t": TS[:2], "x": TS[:2]})
    assert "noise: expected one of x" in refused(noise={"y": 1.0})
    assert "> 0" in refused(noise=0.0)
    assert "shape () or (60,)" in refused(noise=[1.0, 2.0])
    assert "segments" in refused(segments=99)
    two = {"t": TS, "x": TS, "y": TS}
    assert "none for y" in refused(data=two, noise={"x": 1.0}, make=_two)


def _two(slope):
    return jaxdyn.ode(_both, [0.0, 0.0], names=["x", "y"], params={"slope": slope})


def _both(t, y, p):
    return [p["slope"] + 0.0 * y[0], p["slope"] + 0.0 * y[1]]


@pytest.mark.slow
def test_it_reads_frames_and_motions(fitted, track):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(track)
    for data in (frame, frame.set_index("t"), frame.astype(object)):
        again = jaxdyn.fit(straight, {"slope": 1.0}, data)
        assert np.array_equal(again.values, fitted.values)
    motion = jaxdyn.simulate(straight(2.0), 6.0, samples=60)
    found = jaxdyn.fit(straight, {"slope": 1.0}, motion, noise=0.1)
    assert abs(found.params["slope"] - 2.0) < SOLVED * 1e3


@pytest.mark.slow
def test_it_says_what_it_found(fitted):
    text = repr(fitted)
    assert "slope" in text
    assert "+-" in text
    assert "CONVERGED" in text
    record = fitted.as_dict()
    assert record["status"] == "CONVERGED"
    assert record["estimates"]["slope"] == fitted.params["slope"]


@pytest.mark.slow
def test_it_is_drawn(fitted, tmp_path):
    figure = fitted.plot(tmp_path / "fit.png")
    upper, lower = figure.axes[:2]
    assert (tmp_path / "fit.png").stat().st_size > 10_000
    assert "slope = " in upper.get_title()
    assert lower.get_ylabel() == "residual"
    assert "expected" in refusal(lambda: fitted.plot(tmp_path / "no" / "fit.png"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pendulum", "cannonball"])
def test_intervals_contain_the_truth(name):
    found = coverage.coverage(coverage.CASES[name], 60)
    assert found.converged == 60
    # 95 % of 60 with four standard deviations.
    assert (found.inside > 0.83).all()
    assert (np.abs(found.bias) < 4 / np.sqrt(60)).all()
    assert (np.abs(found.spread - 1) < 0.4).all()


def fall(t, y, p):
    return [y[1], -p["g"] + 0.0 * y[0]]


def falling(g, length="m", time="s"):
    labels = [("x", length), ("v", f"{length}/{time}")]
    return jaxdyn.ode(fall, [0.0, 0.0], names=labels, params={"g": g})


@pytest.mark.parametrize(
    ("table", "units", "g"),
    [
        ("t (ms),x (cm)\n{t:.9f},{cm:.9f}\n", ("m", "s"), 9.81),
        ("t (min),x (km)\n{minutes:.12f},{km:.12f}\n", ("m", "s"), 9.81),
        ("t (ms),x (mm)\n{t:.9f},{mm:.9f}\n", ("mm", "min"), 9810.0 * 3600),
    ],
)
def test_units_of_a_table_are_those_of_the_scene(tmp_path, table, units, g):
    path = tmp_path / "fall.csv"
    head, row = table.splitlines()
    ts = np.linspace(0.0, 2.0, 12)
    x = -0.5 * 9.81 * ts**2
    numbers = zip(1e3 * ts, 100 * x, ts / 60, 1e-3 * x, 1e3 * x, strict=True)
    names = ("t", "cm", "minutes", "km", "mm")
    rows = [row.format(**dict(zip(names, one, strict=True))) for one in numbers]
    path.write_text("\n".join([head, *rows]))
    found = jaxdyn.fit(lambda g: falling(g, *units), {"g": 0.7 * g}, jaxdyn.read_csv(path))
    assert found.params["g"] == pytest.approx(g, rel=1e-6)


def test_units_that_do_not_fit_are_refused():
    table = Columns()
    table |= {"t": TS, "x": TS}
    for unit in ("px", "s", "Hz"):
        table.units = {"x": unit}
        said = refusal(lambda: jaxdyn.fit(falling, {"g": 9.0}, table))
        assert (
            f"column x: expected values in m, or a unit that is converted to it, got {unit}."
            in said
        )
    assert "Call it outside jit" in refusal(
        lambda: jax.jit(lambda g: jaxdyn.fit(falling, {"g": g}, {"t": TS, "x": TS}).params)(9.0)
    )


def test_the_unit_of_a_column_that_was_replaced_is_asked_for(tmp_path):
    path = tmp_path / "fall.csv"
    x = -0.5 * 9.81 * TS**2
    rows = [f"{t},{1e-3 * one}" for t, one in zip(TS, x, strict=True)]
    path.write_text("\n".join(["t,x [km]", *rows]))
    table = jaxdyn.read_csv(path)
    table["x"] = 1000 * table["x"]
    fitted = functools.partial(jaxdyn.fit, falling, {"g": 9.0})
    said = refusal(lambda: fitted(table))
    assert "column x: expected its unit, got none, since it replaced a column in km" in said
    assert 'data.units["x"] = "m"' in said
    table.units["x"] = "m"
    assert fitted(table).params["g"] == pytest.approx(9.81, rel=1e-6)


def test_units_are_a_mapping_of_texts():
    for units in ("SI", {"x": None}):
        data = Columns()
        data |= {"t": TS, "x": TS}
        data.units = units
        assert 'data.attrs["units"] = {"theta": "deg"}' in refusal(
            lambda data=data: jaxdyn.fit(falling, {"g": 9.0}, data)
        )


@pytest.mark.parametrize(
    ("unit", "size"),
    [
        ("Sec", 1.0),
        ("radians", 1.0),
        ("\N{MICRO SIGN}m", 1e-6),
        ("nm/ns", 1.0),
        ("DEG/s", np.pi / 180),
    ],
)
def test_units_as_people_write_them(unit, size):
    assert measure(unit).size == pytest.approx(size, rel=1e-15)


def test_a_profile_does_not_need_the_first_parameter():
    def decays(t, y, p):
        return [-p["a"] * p["b"] * y[0], -p["c"] * y[1]]

    def make(**p):
        return jaxdyn.ode(decays, [1.0, 1.0], params=p)

    ts = np.linspace(0.0, 3.0, 20)
    noise = 0.003 * np.random.default_rng(0).standard_normal((2, 20))
    data = {"t": ts, "y0": np.exp(-0.5 * ts) + noise[0], "y1": np.exp(-0.7 * ts) + noise[1]}
    guess = {"a": 1.0, "b": 0.6, "c": 0.6}
    found = jaxdyn.fit(make, guess, data, start=[], throw=False)
    assert np.isnan(found.params["a"])  # only a b is known
    profile = found.profile("c", 7)
    assert profile.low < 0.7 < profile.high < profile.low + 0.02


def test_times_may_be_called_time(track):
    named = {"time": track["t"], "x": track["x"]}
    read = measurements.read_measurements(named)
    assert read.names == ("x",)
    assert (read.ts == track["t"]).all()
