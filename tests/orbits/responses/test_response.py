"""Response curves of forced vibrations, against harmonic balance and the linear theory."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from harmonics import Balance
from numpy.testing import assert_allclose

import jaxdyn
import orbits
from jaxdyn import scenes, vibration
from orbits.analysis import quantities
from orbits.responses.response import in_order
from orbits.shooting.segment import compiled_end


def rate(t, y, beta):
    x, v = y
    return [v, -0.1 * v - x - beta * x**3]


def duffing(beta=0.25):
    return jaxdyn.ode(rate, [0.0, 0.0], names=["x", "v"], params=beta)


def balance(level, beta=0.25):
    def force(phase, x, v):
        return level * jnp.cos(phase) - 0.1 * v - x - beta * x**3

    return Balance(force, 1, 15)


@pytest.fixture(scope="module")
def found():
    return orbits.frequency_response(duffing(), "x", (1.2, 2.3), levels=[0.1, 1.0])


@pytest.mark.slow
def test_the_folds_of_duffings_equation_are_those_of_harmonic_balance(found):
    small, large = found.folds
    assert small == ()
    assert [round(fold.parameter, 5) for fold in large] == [2.21194, 1.43867]
    for fold, inside in zip(large, (0.998, 1.002), strict=True):
        amplitude, lag = (of(fold.orbit, "x") for of in (quantities.amplitude, quantities.phase))
        first = [[amplitude * np.cos(lag)], [amplitude * np.sin(lag)]]
        known = balance(1.0)
        omega = known.fold(inside * fold.parameter, known.start(first))
        assert_allclose(fold.parameter, omega, rtol=1e-9)


def test_every_branch_is_that_of_harmonic_balance(found):
    for curve in found.curves:
        assert_allclose(curve.parameters[[0, -1]], [1.2, 2.3], rtol=1e-12)
    known = balance(1.0)
    assert {m.stability.verdict for m in curve.members} == {"stable", "unstable"}
    for member in curve.members[3::12]:
        amplitude, lag = (of(member.orbit, "x") for of in (quantities.amplitude, quantities.phase))
        first = [[amplitude * np.cos(lag)], [amplitude * np.sin(lag)]]
        c = known.at(member.parameter, known.start(first))
        x, _ = known.motion(jnp.asarray(c), member.parameter)
        cosine, sine = np.asarray(c).reshape(15, 2)[0]
        assert_allclose(lag, np.arctan2(sine, cosine), atol=1e-8)
        assert_allclose(amplitude, np.abs(x).max(), rtol=2e-4)  # that of samples
        assert_allclose(member.orbit.y0[0], c.reshape(15, 2)[:, 0].sum(), rtol=1e-8)


def test_responses_between_the_folds_are_unstable_and_no_others(found):
    curve = found.curves[1]
    ordered = in_order(curve)
    up, down = (next(i for i, m in enumerate(ordered) if m is fold) for fold in found.folds[1])
    verdicts = [m.stability.verdict for m in ordered]
    assert set(verdicts[:up]) == set(verdicts[down + 1 :]) == {"stable"}
    assert set(verdicts[up + 1 : down]) == {"unstable"}


@pytest.mark.slow
def test_a_linear_scene_responds_by_its_receptance():
    rest = scenes.oscillator(k=1.0, m=1.0, c=0.2, x=0.0)
    curve = orbits.frequency_response(rest, "x", (0.5, 2.0), levels=3.0, step=0.3).curves[0]
    omega = curve.parameters
    h = 3.0 * np.asarray(vibration.receptance(rest, "x", "x", omega))
    amplitude = [quantities.amplitude(m.orbit, "x") for m in curve.members]
    assert_allclose(amplitude, np.abs(h), rtol=1e-9)
    assert_allclose(
        [quantities.phase(m.orbit, "x") for m in curve.members], -np.angle(h), atol=1e-9
    )
    assert not curve.special
    found = orbits.frequency_response(rest, "x", (0.5, 2.0), levels=3.0)
    (peak,) = found.peaks()
    assert_allclose(peak.parameter, np.sqrt(1 - 2 * 0.1**2), rtol=1e-5)
    height = quantities.amplitude(peak.orbit, "x")
    # The curve in the picture passes through it.
    lines = orbits.drawing.frequency_response(found).axes[0].lines
    assert max(np.max(line.get_ydata()) for line in lines) == pytest.approx(height, rel=1e-12)
    assert_allclose(height, 3 / (0.2 * np.sqrt(1 - 0.1**2)), rtol=1e-9)


@pytest.mark.slow
def test_the_driven_entry_is_shown_by_default():
    scene = scenes.spring_chain(k=(2.0, 3.0), c=(0.1,))
    found = orbits.frequency_response(scene, "x2", (0.3, 0.4), members=3)
    columns, omega = found.table().variables, found.table().variables["frequency"].array
    known = vibration.receptance(scene, "x2", "x2", np.array(omega))
    assert_allclose(columns["amplitude"].array, np.abs(known), rtol=1e-9)
    other = vibration.receptance(scene, "x2", "x1", np.array(omega))
    assert_allclose(found.table("x1").variables["amplitude"].array, np.abs(other), rtol=1e-9)
    assert orbits.drawing.frequency_response(found).axes[0].get_ylabel() == "amplitude x2 [m]"


@pytest.mark.slow
def test_a_resonance_far_above_its_drive_is_passed():
    m, k, c = 0.01, 1e6, 0.03  # a damping ratio of 1.5e-4, near 1.6 kHz

    def swings(t, y):
        return [y[1], -(c * y[1] + k * y[0]) / m]

    rest = jaxdyn.ode(swings, [0.0, 0.0], names=[("x", "m"), ("v", "m/s")])
    (curve,) = orbits.frequency_response(rest, "x", (8e3, 12e3), levels=100.0).curves
    assert curve.end.startswith("the bounds")
    assert len(curve.members) < 80
    for member in curve.members:
        w = member.parameter
        x = 100.0 / (k / m - w**2 + 1j * w * c / m)
        assert_allclose(member.orbit.y0, [x.real, -w * x.imag], atol=1e-8 * abs(x) * w)
        assert_allclose(quantities.amplitude(member.orbit, "x"), abs(x), rtol=1e-8)


@pytest.mark.slow
@pytest.mark.slow
def test_a_picture_passes_the_antiresonance_of_a_mass_with_an_absorber():
    rest = scenes.spring_chain(m=(1.0, 0.2), k=(1.0, 0.2), c=(0.05, 0.004))
    found = orbits.frequency_response(rest, "x1", (0.5, 1.6), levels=1.0, step=0.3)
    omega = np.linspace(0.9, 1.1, 200_001)
    exact = np.abs(np.asarray(vibration.receptance(rest, "x1", "x1", omega))).min()
    least = min(quantities.amplitude(m.orbit, "x1") for m in found.curves[0].members)
    assert least > 1.1 * exact  # no member is near it
    (line, *_) = orbits.drawing.frequency_response(found).axes[0].lines
    assert np.min(line.get_ydata()) == pytest.approx(exact, rel=1e-8)


def test_an_output_without_a_value_is_no_peak():
    rest = scenes.oscillator(k=1.0, m=1.0, c=0.2, x=0.0)
    found = orbits.frequency_response(rest, "x", (0.5, 2.0), step=0.3)
    (high,) = found.peaks()
    largest = 0.5 * quantities.amplitude(high.orbit, "x")
    (peak,) = found.peaks(lambda t, y: jnp.where(jnp.abs(y[0]) < largest, y[0], jnp.nan))
    # It is known to have no value where one of its samples has none: 2048 of a cosine.
    assert quantities.amplitude(peak.orbit, "x") < largest * (1 + (2 * np.pi / 2048) ** 2 / 8)
    with pytest.raises(ValueError, match="output: expected one with a value"):
        found.peaks(lambda t, y: jnp.nan * y[0])


@pytest.mark.slow
def test_a_scene_without_damping_responds_beside_its_resonance():
    found = orbits.frequency_response(scenes.oscillator(x=0.0), "x", (1.5, 2.0), step=0.3)
    (curve,) = found.curves
    assert curve.end.startswith("the bounds")
    for member in curve.members:
        height = quantities.amplitude(member.orbit, "x")
        assert_allclose(height, 1 / (member.parameter**2 - 1), rtol=1e-11)


@pytest.mark.slow
def test_a_square_wave_drives_a_linear_scene_as_its_harmonics_do():
    def pushed(t, y, p):
        omega, level = p
        x, v = y
        return [v, -9 * x - 0.6 * v + level * jnp.sign(jnp.sin(omega * t + 0.3))]

    def forced(omega, level):
        params = jnp.stack([omega, level])
        return jaxdyn.ode(pushed, [0.0, 0.0], names=["x", "v"], params=params)

    rest = forced(jnp.asarray(1.0), jnp.asarray(0.0))
    found = orbits.frequency_response(rest, forced, (0.9, 1.2), step=0.5)
    (curve,) = found.curves
    n, phase = np.arange(1, 4001, 2), np.linspace(0, 2 * np.pi, 4001)[:, None]
    for member in curve.members:
        w = member.parameter
        terms = np.exp(1j * n * phase) / n / (9 - (n * w) ** 2 + 0.6j * n * w)
        known = np.abs(4 / np.pi * terms.imag.sum(axis=1)).max()
        assert_allclose(quantities.amplitude(member.orbit, "x"), known, rtol=1e-5)


@pytest.mark.slow
def test_a_resonance_without_damping_ends_where_the_drive_is_rounding():
    found = orbits.frequency_response(scenes.oscillator(x=0.0), "x", (0.9, 1.5), step=0.5)
    assert len(found.curves) == 2
    for curve in found.curves:
        assert curve.end == "a motion so large that its drive is rounding beside it"
        turns = np.array([m.parameter * m.orbit.period / (2 * np.pi) for m in curve.members])
        assert_allclose(turns, 1, rtol=1e-9)


@pytest.mark.slow
def test_a_function_that_drives_a_scene_gives_the_same(found):
    def forced(t, y, p):
        omega, level = p
        x, v = y
        return [v, level * jnp.cos(omega * t) - 0.1 * v - x - 0.25 * x**3]

    def drive(omega, level):
        return jaxdyn.ode(forced, [0.0, 0.0], names=["x", "v"], params=(omega, level))

    same = orbits.frequency_response(duffing(), drive, (0.7, 2.5), levels=1.0)
    assert_allclose(same.folds[0][0].parameter, found.folds[1][0].parameter, rtol=1e-10)

    def at_one(omega):
        return drive(omega, 1.0)

    once = orbits.frequency_response(duffing(), at_one, (0.7, 2.5))
    assert_allclose(once.folds[0][0].parameter, found.folds[1][0].parameter, rtol=1e-10)


@pytest.mark.slow
def test_several_levels_and_numbers_are_one_program(found):
    programs = compiled_end._cache_size()
    orbits.frequency_response(duffing(0.3), "x", (0.7, 2.5), levels=[0.2, 0.4])
    assert compiled_end._cache_size() == programs


def test_the_table_has_a_row_for_each_response_and_the_outputs_asked_for(found):
    pandas = pytest.importorskip("pandas")
    frame = found.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    members = sum(len(curve.members) + len(curve.special) for curve in found.curves)
    assert len(frame) == members
    assert list(frame["kind"][frame["kind"] != ""]) == ["fold", "fold"]
    assert frame.attrs["units"]["phase"] == "rad"
    speed = found.table(lambda t, y: y[1]).variables
    assert_allclose(
        speed["amplitude"].array, found.table("v").variables["amplitude"].array, rtol=1e-10
    )
    with pytest.raises(ValueError, match="entry: expected"):
        found.table("z")
    with pytest.raises(ValueError, match="entry: expected a function that returns"):
        found.table(lambda t, y: y)
    assert "level 1" in repr(found)
    assert "fold at 2.21194" in repr(found)


@pytest.mark.slow
@pytest.mark.parametrize("own", [False, True])
def test_a_range_may_begin_at_a_resonance_without_damping(own):
    def swing(t, y, p):
        return [y[1], -y[0] - 0.2 * y[0] ** 3 + p[1] * jnp.cos(p[0] * t)]

    def forced(omega, level):
        p = jnp.stack([jnp.asarray(omega, float), jnp.asarray(level, float)])
        return jaxdyn.ode(swing, [0.0, 0.0], names=["x", "v"], params=p)

    rest = forced(1.0, 0.0)
    drive = forced if own else "x"
    found = orbits.frequency_response(rest, drive, (1.0, 1.2), levels=0.1, members=3)
    assert found.curves[0].members[0].parameter == 1.0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"frequencies": (2.0, 1.0)}, "frequencies: expected two positive ones"),
        ({"levels": [1.0, -1.0]}, "levels: expected one amplitude"),
        ({"levels": []}, "levels: expected one amplitude"),
        ({"drive": "z"}, "Force.on: expected"),
        ({"scene": duffing().starting([1.0, 0.0])}, "y: expected an equilibrium"),
        (
            {"scene": vibration.drive(duffing(), "x", vibration.Harmonic(1.0, 2.0))},
            "scene: expected one without a forcing of its own, got one of period 3.14159. Leave",
        ),
        ({"step": 0.0}, "step: expected > 0"),
        ({"drive": lambda *, omega, level: duffing()}, "drive: expected a function of"),
        ({"drive": lambda omega, level: duffing()}, "got one that does not depend on time"),
        (
            {"drive": lambda f: vibration.drive(duffing(), "x", vibration.Harmonic(1.0, 0.7 * f))},
            "got one of period",
        ),
    ],
)
def test_misuse_is_refused_with_what_to_do(options, said):
    given = {"scene": duffing(), "drive": "x", "frequencies": (1.0, 2.0)} | options
    with pytest.raises(ValueError, match=said):
        orbits.frequency_response(**given)


@pytest.mark.slow
def test_units_are_those_of_the_scene():
    labels = [("x", "km"), ("v", "km/day")]
    slow = jaxdyn.ode(rate, [0.0, 0.0], names=labels, params=0.25)
    response = orbits.frequency_response(slow, "x", (1.2, 1.3), levels=0.1)
    table, turns = response.table().variables, response.table(hertz=True).variables
    assert [table[name].unit for name in ("frequency", "amplitude")] == ["rad/day", "km"]
    assert turns["frequency"].unit == "1/day"
    (curve,) = response.curves
    marked = dataclasses.replace(curve.members[0], kind=orbits.Kind.FOLD)
    curves = (dataclasses.replace(curve, special=(marked,)),)
    w = curve.members[0].parameter
    assert f"fold at {w:.6g} rad/day ({w / (2 * np.pi):.6g} 1/day)" in repr(
        dataclasses.replace(response, curves=curves)
    )


@pytest.mark.slow
def test_a_resonance_that_passes_the_end_of_the_range_has_both_branches(found):
    cut = orbits.frequency_response(duffing(), "x", (0.7, 1.8), levels=1.0)
    assert cut.levels == (1.0, 1.0)
    upper, lower = cut.curves
    assert not upper.special
    assert [m.kind for m in lower.special] == [orbits.Kind.FOLD]
    assert_allclose(lower.special[0].parameter, found.folds[1][1].parameter, rtol=1e-10)
    # The lower one goes on behind its fold, on the unstable branch, to the same end.
    ends = [curve.parameters[[0, -1]] for curve in cut.curves]
    assert_allclose(ends, [[0.7, 1.8], [1.8, 1.8]], rtol=1e-12)
    assert lower.members[-1].stability.verdict == "unstable"


def rubbing(t, y):
    """Linear but for its damping: an isola about resonance (Habib, Cirillo, Kerschen, 2018)."""
    x, v = y
    return [v, -0.25 * v + v**3 - v**5 - x]


def rubbed(level):
    return Balance(lambda p, x, v: level * jnp.cos(p) - 0.25 * v + v**3 - v**5 - x, 1, 9)


def damped(t, y, p):
    omega, level = p
    x, v = y
    return [v, level * jnp.cos(omega * t) - 0.25 * v + v**3 - v**5 - x]


@pytest.mark.slow
@pytest.mark.parametrize("own", [False, True])
def test_an_isola_of_nonlinear_damping_is_found(own):
    scene = jaxdyn.ode(rubbing, [0.0, 0.0], names=["x", "v"])
    level = 0.03

    def drive(omega, level):
        return jaxdyn.ode(damped, [0.0, 0.0], names=["x", "v"], params=(omega, level))

    given = drive if own else "x"
    found = orbits.frequency_response(
        scene, given, (0.7, 1.4), levels=level, isolas=1, members=150, step=0.2
    )
    main, isola = found.curves
    assert found.levels == (level, level)
    assert isola.closed
    assert not main.closed
    assert not main.special
    folds = sorted(m.parameter for m in isola.special if m.kind == orbits.Kind.FOLD)
    assert len(folds) == 2
    assert folds[0] < 1 < folds[1]
    # Amplitudes at resonance: f = 0.25 A - 3/4 A^3 + 5/8 A^5 by the first harmonic.
    roots = np.roots([5 / 8, 0, -3 / 4, 0, 0.25, -level])
    real = np.sort(roots[(np.abs(roots.imag) < 1e-12) & (roots.real > 0)].real)
    highest = max(quantities.amplitude(m.orbit, "x") for m in isola.members)
    lowest = min(quantities.amplitude(m.orbit, "x") for m in isola.members)
    assert len(real) == 3
    assert_allclose([lowest, highest], real[1:], rtol=0.02)
    # By harmonic balance along the curve, with 7 harmonics in NumPy.
    assert_allclose(folds[1], 1.01417271638, rtol=1e-6)
    # At both folds harmonic balance holds, and its Jacobian is singular.
    known = rubbed(level)
    for m in (x for x in isola.special if x.kind == orbits.Kind.FOLD):
        xs = np.asarray(jaxdyn.simulate(m.orbit.scene, m.orbit.period, samples=257).ys)[:-1, 0]
        c = np.fft.rfft(xs)[1:18:2] * 2 / 256  # odd harmonics
        place = jnp.asarray(np.stack([c.real, -c.imag], axis=1).ravel())
        assert np.abs(known.residual(place, m.parameter)).max() < 1e-8
        slopes = jax.jacfwd(known.residual)(place, m.parameter)
        values = np.linalg.svd(np.asarray(slopes))[1]
        assert values[-1] < 1e-4
        assert values[-2] > 1e-2
    without = orbits.frequency_response(scene, given, (0.7, 1.4), levels=level, step=0.2)
    assert len(without.curves) == 1


def test_isolas_need_a_drive_with_a_level():
    def alone(omega):
        return jaxdyn.ode(rubbing, [0.0, 0.0], names=["x", "v"])

    scene = alone(1.0)
    with pytest.raises(ValueError, match="drive: expected a function of"):
        orbits.frequency_response(scene, alone, (0.7, 1.4), isolas=2)
    with pytest.raises(ValueError, match="isolas: expected a whole number"):
        orbits.frequency_response(scene, "x", (0.7, 1.4), isolas=-1)


def forced_nerve(t, y, p):
    """The demo frc of AUTO: the equations of FitzHugh and Nagumo with a periodic current."""
    (v, w), (omega, level) = y, p
    return [(v * (v - 0.5) * (1 - v) - w) / 0.005, v - w - 0.5 - level * jnp.sin(omega * t)]


def periodic(omega, level):
    """The response at time 0 by collocation in SciPy, from weaker forcing on."""
    from scipy.integrate import solve_bvp

    ts = np.linspace(0, 2 * np.pi / omega, 401)
    ys = np.tile([[0.5], [0.0]], len(ts))
    for part in np.linspace(0.1, 1.0, 10):
        run = solve_bvp(
            lambda t, y, r=part * level: np.array(forced_nerve(t, y, (omega, r)), float),
            lambda start, end: end - start,
            ts,
            ys,
            tol=1e-9,
            max_nodes=100_000,
        )
        ts, ys = run.x, run.y
    assert run.success
    return run.y[:, 0]


@pytest.mark.slow
def test_the_forced_nerve_of_autos_demo_responds_without_folds():
    """AUTO follows it from a frequency of 100 to the period 5, though it is very unstable: near the
    rest disturbances grow by exp(50 t)."""

    def driven(omega, level):
        numbers = jnp.stack([jnp.asarray(omega, float), jnp.asarray(level, float)])
        return jaxdyn.ode(
            forced_nerve, [0.5, 0.0], 2 * jnp.pi / omega, names=["v", "w"], params=numbers
        )

    ends = 2 * np.pi / 5, 100.0
    found = orbits.frequency_response(driven(1.0, 0.0), driven, ends, levels=0.2, step=0.5)
    (curve,) = found.curves
    assert len(found.folds[0]) == 0
    places = [member.parameter for member in curve.members]
    assert_allclose([min(places), max(places)], ends, rtol=1e-12)
    for member in curve.members[:: len(curve.members) // 3]:
        assert_allclose(member.orbit.y0, periodic(member.parameter, 0.2), atol=1e-6)
