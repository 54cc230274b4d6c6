"""Scenes as programs in JavaScript: their motions in Node against the library's."""

import dataclasses
import json
import shutil
import subprocess
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import refusal
from scipy.integrate import solve_ivp

import jaxdyn
from jaxdyn import Effect, effects, player, scenes, simulate
from jaxdyn.gallery import poster
from jaxdyn.integrate.events import Reaches
from jaxdyn.integrate.phases import simulate_phases
from jaxdyn.player import choices, pages
from jaxdyn.player.choices import Choices
from jaxdyn.player.model import _drawing, _parameters, model
from jaxdyn.scenes import catalogue, walkers
from jaxdyn.scenes.corners import has_corners
from orbits.discovery import seeds

needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
SMOOTH = [name for name, entry in catalogue.entries().items() if not has_corners(entry.make())]
#: Largest difference of an end state, in the sizes of the motion.
CLOSE = 1e-9
#: Over its span distances of nearby motions grow a millionfold, and so do rounding errors.
CHAOTIC = {"double_pendulum": 1e-8}

_RUN = """
// The motion of a model, gone to a time.
function run(model, t = model.data.span, on = 2 ** model.data.switches.length - 1) {
  const { start, parameters } = model.data.starts[0];
  const motion = new JaxdynMotion(model, parameters, on, 0, start);
  motion.arrived = motion.to(t);
  return motion;
}
"""
NAMES = "model.data.switches.map((x) => x.name)"


def node(expression, scene=None, **options):
    """The value of an expression in Node, with the integrator, `run` and the `model` of a scene."""
    source = pages.script("dop853", "motion") + _RUN
    source += "" if scene is None else f"const model = {model(scene, **options)};\n"
    source += f"console.log(JSON.stringify({expression}, (_, x) => x === undefined ? null : x))"
    done = subprocess.run(["node", "-"], input=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def _sizes(scene, ys):
    """(k,) sizes of the entries of a motion."""
    sizes = np.asarray(scene.field.groups.largest(jnp.asarray(np.abs(ys).max(axis=0))))
    return np.where(sizes > 0, sizes, 1.0)


@needs_node
@pytest.mark.sample("pendulum", "top", "rod_on_line")
@pytest.mark.parametrize("name", SMOOTH)
def test_motions_end_where_the_library_ends_them(name):
    scene = catalogue.entries()[name].make()
    there = node("run(model).at(model.data.span)", scene)
    ys = np.asarray(simulate(scene, samples=50, rtol=1e-14).ys)
    off = np.abs(np.array(there) - ys[-1]) / _sizes(scene, ys)
    assert off.max() < CHAOTIC.get(name, CLOSE)


@needs_node
@pytest.mark.sample("ball_on_table-5.0")
@pytest.mark.parametrize(
    ("name", "span"),
    [
        ("ball_on_table", 5.0),
        ("impact_oscillator", 12.0),
        ("rimless_wheel", 5.0),
        ("simplest_walker", 12.0),
        ("cylinder_on_cylinder", 2.0),
        ("cylinder_on_ramp", 3.0),
        ("car", 10.0),
    ],
)
def test_motions_through_phases_are_those_of_the_library(name, span):
    entry = catalogue.entries()[name]
    scene = entry.make()
    scene = scene.starting(scene.y0, span)
    there, path = node(
        """(() => {
        const leave = JaxdynMotion.prototype.leave, path = [];
        JaxdynMotion.prototype.leave = function () {
          path.push([this.phase.name, this.pending.exit]);
          return leave.call(this);
        };
        return [run(model).at(model.data.span), path];
        })()""",
        scene,
    )
    wanted = entry.motion(scene, samples=20, rtol=1e-13)
    assert [tuple(step) for step in path] == list(wanted.path)
    ys = np.concatenate([piece.ys for piece in wanted.pieces])
    assert (np.abs(np.array(there) - wanted.y) / _sizes(scene, ys)).max() < CLOSE


_BUMPS = np.array([0.0, 5.0, 6.0, 7.5, 20.0]), np.array([0.0, 0.0, 0.1, -0.05, 0.0])


@needs_node
def test_a_road_given_by_a_table():
    knots, heights = _BUMPS

    def rate(t, y):
        height = jnp.interp(8.0 * t, knots, heights, period=30.0)
        return [y[1], 50.0 * (height - y[0]) - 3.0 * y[1]]

    scene = jaxdyn.ode(rate, [0.0, 0.2], t1=10.0)
    there = node("run(model).at(model.data.span)", scene)
    wanted = simulate(scene, samples=2, rtol=1e-13).ys[-1]
    np.testing.assert_allclose(there, wanted, rtol=0, atol=1e-10)


@needs_node
def test_a_force_that_is_held_between_times():
    times, values = jnp.linspace(0.0, 9.0, 19), jnp.sin(2.0 * jnp.arange(20.0))

    def rate(t, y):
        return [y[1], values[jnp.searchsorted(times, t)] - y[0]]

    scene = jaxdyn.ode(rate, [0.0, 0.2], t1=10.0)
    there = node("run(model).at(model.data.span)", scene)
    wanted = simulate(scene, samples=2, rtol=1e-13).ys[-1]
    np.testing.assert_allclose(there, wanted, rtol=0, atol=1e-9)


_KNOTS = np.linspace(0.0, 10.0, 41)
_FORCES = {  # of time alone, with conditions
    "step": lambda t: jnp.where(t > 1.2345, 1.0, 0.0),
    "from the start": lambda t: jnp.where(t > 0, 1.0, 0.0),
    "pulse": lambda t: jnp.where((t > 5.0101) & (t < 5.0151), 100.0, 0.0),
    "pulses": lambda t: jnp.where(jnp.mod(t, 1.0) < 0.01, 50.0, 0.0),
    "square wave": lambda t: jnp.sign(jnp.sin(7.0 * t)),
    "rectified": lambda t: jnp.maximum(0.0, jnp.sin(3.0 * t)),
    "stairs": lambda t: jnp.floor(3.0 * t),
    "table": lambda t: jnp.interp(t, _KNOTS, np.sin(_KNOTS**2)),
    "clamped": lambda t: jax.lax.clamp(-0.5, jnp.sin(t), 0.5),
}


@needs_node
@pytest.mark.parametrize("name", _FORCES)
def test_steps_end_where_a_condition_on_time_changes(name):
    scene = jaxdyn.ode(lambda t, y: [y[1], _FORCES[name](t) - y[0]], [0.0, 0.0], t1=10.0)
    there, steps = node("[run(model)].map((s) => [s.at(10), s.solver.steps])[0]", scene)
    wanted = simulate(scene, samples=2, rtol=1e-13).ys[-1]
    np.testing.assert_allclose(there, wanted, rtol=0, atol=2e-12)
    assert steps < 200  # a jump that is not foreseen takes twenty


@needs_node
def test_without_its_friction_a_car_rolls_on():
    # A car without friction has no phases, and no end.
    scene = scenes.car()
    found = f"[run(model, 60, 0)].map((s) => [s.at(60), s.ended, {NAMES}])[0]"
    (y, ended, names) = node(found, scene)
    assert ended is None
    assert names == ["locked axle"]
    wanted = simulate(scenes.car(mu=0.0), 60.0, samples=2, rtol=1e-13).ys[-1]
    np.testing.assert_allclose(y, wanted, rtol=0, atol=1e-9 * 1200)


@needs_node
@pytest.mark.parametrize(
    ("name", "called"),
    [
        ("ball_on_table", "impact on the table"),
        ("impact_oscillator", "impact on the stop"),
        ("rimless_wheel", "impact of the next spoke"),
        ("simplest_walker", "heel strike"),
    ],
)
def test_an_impact_that_is_off_does_not_happen(name, called):
    scene = catalogue.entries()[name].make()
    t = 0.5 * float(scene.t1)
    y, names = node(f"[run(model, {t}, 0).at({t}), {NAMES}]", scene)
    assert names == [called]
    # The equations of the scene without its phases.
    wanted = solve_ivp(
        lambda t, y: np.asarray(scene.rate(t, jnp.asarray(y))),
        (0, t),
        scene.y0,
        "DOP853",
        rtol=1e-12,
        atol=1e-12,
    ).y[:, -1]
    np.testing.assert_allclose(y, wanted, rtol=1e-8, atol=1e-8)


@needs_node
def test_bounces_that_get_lower_end_at_rest():
    still = scenes.ball_on_table(amplitude=0.0, restitution=0.5, velocity=1.0)
    run = "[run(model)].map((s) => [s.failed, s.t, s.at(3)])[0]"
    failed, t, (y, v, _) = node(run, still)
    assert (failed, t >= 3, y, v) == ("", True, 0, 0)


@needs_node
def test_a_wheel_of_spokes_rocks_to_rest():
    wheel = scenes.rimless_wheel(slope=0.0)
    run = "[run(model, 20)].map((s) => [s.failed, s.t, s.at(20)])[0]"
    failed, t, (angle, rate) = node(run, wheel)
    assert (failed, t >= 20, rate) == ("", True, 0)
    assert abs(angle) == pytest.approx(np.pi / 8, rel=1e-12)


@needs_node
def test_impacts_without_end_end_a_motion(monkeypatch):
    # A wheel that cannot rest on two spokes.
    monkeypatch.setattr(walkers.RimlessWheel, "room", lambda wheel: jnp.asarray(-1.0))
    wheel = scenes.rimless_wheel(slope=0.0, spokes=9)
    failed, t = node("[run(model, 20)].map((s) => [s.failed, s.t])[0]", wheel)
    assert failed == "impacts without end"
    rocks = simulate_phases(
        scenes.phases_of(wheel), None, wheel.y0, 20.0, samples=1, max_phases=200
    )
    assert t == pytest.approx(float(rocks.t), abs=1e-4)


@needs_node
def test_the_pair_has_order_8_and_its_dense_output_order_7():
    # Steps of equal length of a linear rate, whose error is that of the exponential.
    steps = """[20, 40].map((n) => {
      const s = new Dop853((t, y) => [y[1], -y[0]], 0, [1, 0], { span: 50 * n, rtol: 1 });
      let off = 0, between = 0;
      for (let i = 1; i <= n; i++) {
        s.h = 8 / n; s.step(i * 8 / n);
        off = Math.max(off, Math.abs(s.y[0] - Math.cos(s.t)));
        const t = (s.before + s.t) / 2;
        between = Math.max(between, Math.abs(s.at(t)[0] - Math.cos(t)));
      }
      return [off, between];
    })"""
    (coarse, inside), (fine, finer) = node(steps)
    assert 7.8 < np.log2(coarse / fine) < 9.2
    assert 6.8 < np.log2(inside / finer) < 9.2


@needs_node
def test_its_steps_are_those_of_hairers_code():
    # SciPy has the same pair with the same dense output.
    found = node("""(() => {
        const rate = (t, y) => [y[1], (1 - y[0] * y[0]) * y[1] - y[0]];
        const s = new Dop853(rate, 0, [2, 0], { span: 50, rtol: 1 });
        s.h = 0.3;
        s.step(0.3);
        return [s.at(0.1), s.at(0.2), s.y];
    })()""")

    def rate(t, y):
        return [y[1], (1 - y[0] * y[0]) * y[1] - y[0]]

    run = solve_ivp(
        rate, (0, 0.3), [2.0, 0.0], "DOP853", first_step=0.3, rtol=1, atol=1, dense_output=True
    )
    assert len(run.t) == 2
    np.testing.assert_allclose(np.array(found).T, run.sol([0.1, 0.2, 0.3]), rtol=0, atol=1e-13)


@needs_node
def test_an_effect_that_is_off_is_absent():
    scene = scenes.spring_mass() + effects.LinearDrag(0.3)
    named = node(NAMES, scene)
    ends = node("model.variants.map((_, on) => run(model, 3, on).at(3))", scene)
    assert named == ["spring", "uniform gravity", "linear drag"]
    for on in (0b000, 0b101, 0b010, 0b111):
        kept = tuple(e for i, e in enumerate(scene.effects) if on >> i & 1)
        fewer = jaxdyn.Scene(scene.system, kept, y0=scene.y0)
        wanted = simulate(fewer, 3.0, samples=2, rtol=1e-13).ys[-1]
        np.testing.assert_allclose(ends[on], wanted, rtol=0, atol=1e-10)


@needs_node
def test_many_effects_are_switched_by_their_kind():
    many = scenes.two_springs() + effects.LinearDrag(0.3) + effects.LinearDrag(0.1)
    assert node(NAMES, many) == ["spring", "uniform gravity", "linear drag"]


@needs_node
def test_energies_places_and_parameters():
    scene = scenes.double_pendulum()
    y, p = [0.3, -0.4, 1.0, 2.0], [2.0, 1.0, 0.5, 1.5, 9.81]
    energies, places, units = node(
        f"[model.variants[1].energies(0, {y}, {p}), model.places(0, {y}, {p}), "
        "model.data.parameters.map((x) => [x.name, x.unit])]",
        scene,
    )
    other = scenes.double_pendulum(m=[2.0, 1.0], length=[0.5, 1.5], g=9.81)
    wanted = other.system.energies(jnp.zeros(()), jnp.array(y), other.effects)
    np.testing.assert_allclose(energies, wanted, rtol=1e-13)
    first = 0.5 * np.array([np.sin(0.3), -np.cos(0.3)])
    np.testing.assert_allclose(places[:2], first, rtol=0, atol=1e-14)
    assert units[1:] == [["m[1]", "kg"], ["l[0]", "m"], ["l[1]", "m"], ["g", "m/s^2"]]


@pytest.mark.sample("turntable", "satellite")
@pytest.mark.parametrize("name", SMOOTH)
def test_all_corners_follow_from_those_that_are_computed(name):
    scene = catalogue.entries()[name].make()
    if not scene.has_points:
        pytest.skip("it has no shapes")
    outlines, marks, places = _drawing(scene)
    rng = np.random.default_rng(5)
    y = scene.y0 + 0.5 * rng.standard_normal(len(scene.y0))
    shapes = scene.sketch(jnp.asarray(0.7), y)
    d = scene.system.points(jnp.zeros(()), y).r.shape[1]
    found = np.asarray(places(scene, jnp.asarray(0.7), y)).reshape(-1, d)[len(marks) :]
    for outline, shape in zip(outlines, [x for x in shapes if x.kind != "trace"], strict=True):
        known, found = found[: len(outline.computed)], found[len(outline.computed) :]
        corners = known if outline.weights is None else outline.weights @ known
        at = np.asarray(shape.at).reshape(-1, d)
        np.testing.assert_allclose(corners, at, rtol=0, atol=1e-8 * np.abs(at).max())


@needs_node
def test_a_force_that_sets_in_and_friction_that_sticks():
    switched = jaxdyn.ode(lambda t, y: [y[1], jnp.where(t > 1.2345, 1.0, 0.0)], [0.0, 0.0], t1=5.0)
    (x, v), crawled = node(
        "(() => { const s = run(model); return [s.at(5), s.crawled]; })()", switched
    )
    assert crawled is None
    assert [x, v] == pytest.approx([3.7655**2 / 2, 3.7655], abs=1e-10)
    # Each half swing takes 0.6 of the amplitude: 2.05, 1.45, 0.85, and it sticks at -0.25.
    rubbing = jaxdyn.ode(lambda t, y: [y[1], -y[0] - 0.3 * jnp.sign(y[1])], [2.05, 0.0], t1=20.0)
    (x, v), crawled = node(
        "(() => { const s = run(model); return [s.at(20), s.crawled]; })()", rubbing
    )
    assert crawled == pytest.approx(3 * np.pi, abs=1e-6)
    assert [x, v] == pytest.approx([-0.25, 0.0], abs=1e-3)


@needs_node
def test_a_close_encounter_is_passed():
    # A published orbit of three bodies in which two come to 1e-4 of each other.
    row = poster.starts()[26]
    start = seeds.rows(np.array([[row["a"], row["b"]]]))[0]
    scene = scenes.three_body().starting(start, row["T"])
    failed, crawled, y = node(
        "[run(model)].map((s) => [s.failed, s.crawled, s.at(model.data.starts[0].span)])[0]", scene
    )
    assert (failed, crawled) == ("", None)
    # Nearby motions depart ten million times.
    np.testing.assert_allclose(y, start, rtol=0, atol=1e-5)


@needs_node
def test_a_singularity_ends_a_motion_and_is_not_stepped_over():
    fall = scenes.power_law().starting([1.0, 0.0, 0.0, 0.0], 5.0)
    arrived, failed, t = node("[run(model)].map((s) => [s.arrived, s.failed, s.t])[0]", fall)
    assert not arrived
    assert failed == "too small steps"
    assert t < 5.0


class Winding(Effect):
    """A force found by a loop of unknown length."""

    def force(self, t, r, v, m):
        return jax.lax.while_loop(lambda x: jnp.sum(x * x) > 1.0, lambda x: 0.5 * x, r)


def test_what_cannot_run_on_a_page_is_refused_with_what_to_do():
    said = refusal(lambda: (scenes.cannonball() + Winding()).live())
    assert said.startswith("live: expected a scene with formulas, got while")
    assert said.endswith("Play a computed motion instead: jaxdyn.simulate(scene).play(path).")
    long = scenes.n_body(*np.random.default_rng(0).normal(size=(2, 24, 3)), m=np.ones(24))
    assert "live: expected a page of at most 200 kB, got" in refusal(lambda: long.live())
    assert ".html" in refusal(lambda: scenes.pendulum().live("swing.png"))
    assert "scene" in refusal(lambda: player.live(3))


def test_what_is_not_one_scene_is_refused_with_what_to_do():
    swing, other = scenes.pendulum(), scenes.double_pendulum()
    said = refusal(lambda: player.live({"one": swing, "two": other}, choose="kind"))
    assert said == (
        "scenes: expected scenes that differ in their numbers, their starts and in effects left "
        "out, got another kind. Put it on a page of its own."
    )
    assert "at least one scene" in refusal(lambda: player.live({}))
    weightless = swing.without(effects.UniformGravity)
    said = refusal(lambda: player.live({"on Earth": swing, "in space": weightless}))
    assert said.endswith("Name the parameter in which they differ: choose=.")
    assert "at most 20, got 21" in refusal(lambda: player.live(swing, motions=21))


def _lambda(mu):
    return jaxdyn.ode(lambda t, y, p: [y[1], p * (1 - y[0] ** 2) * y[1] - y[0]], [2, 0], params=mu)


def _nested(mu):
    def rate(t, y, p):
        return [y[1], p["mu"] * (1 - y[0] ** 2) * y[1] - y[0]]

    return jaxdyn.ode(rate, [2, 0], params={"mu": mu})


def _captured(mu):
    return jaxdyn.ode(lambda t, y: [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]], [2, 0])


@pytest.mark.parametrize("make", [_lambda, _nested])
def test_scenes_whose_functions_are_made_at_each_call_are_of_one_kind(make):
    named = {"half": make(0.5), "two": make(2.0)}
    found = choices.starts(named["half"], named)
    assert [one["parameters"] for one in found] == [[0.5], [2.0]]
    decay = jaxdyn.ode(lambda t, y, p: -p * y, [2, 0], params=1.0)
    said = refusal(lambda: choices.start(_lambda(0.5), decay, ""))
    assert said.endswith("got other formulas. Put it on a page of its own.")


def test_numbers_that_functions_captured_must_be_the_same_on_a_page():
    player.live({"one": _captured(0.5), "again": _captured(0.5)})
    said = refusal(lambda: player.live({"half": _captured(0.5), "two": _captured(2.0)}))
    assert said.startswith(
        "scenes: expected functions that captured the same numbers, got another value of 'mu'. "
        "Pass them as params: "
    )
    other = jaxdyn.ode(lambda t, y: [y[1], -y[0]], [2, 0])
    said = refusal(lambda: player.live({"half": _captured(0.5), "other": other}))
    assert said.endswith("got other formulas. Put it on a page of its own.")


class Push(Effect):
    """A horizontal force of a given size."""

    size: jax.Array
    course: Callable = eqx.field(static=True)

    def force(self, t, r, v, m):
        return jnp.zeros_like(r).at[:, 0].set(self.size * self.course(t))


def test_effects_whose_functions_are_made_at_each_call_are_of_one_kind():
    def pushed(size):
        return scenes.pendulum() + Push(jnp.asarray(size), lambda t: jnp.sin(2 * t))

    named = {"weak": pushed(0.1), "strong": pushed(2.0), "none": scenes.pendulum()}
    found = choices.starts(named["weak"], named)
    assert [one["off"] for one in found] == [[], [], [1]]
    assert [one["parameters"][-1] for one in found] == [0.1, 2.0, 0.1]
    other = scenes.pendulum() + Push(jnp.asarray(0.1), lambda t: jnp.cos(2 * t))
    assert "got other formulas" in refusal(lambda: choices.start(named["weak"], other, ""))


def test_a_name_cannot_break_out_of_the_page():
    named = jaxdyn.ode(lambda t, y: [-y[0]], [1.0], names=["</script>x\n!--"])
    scene = dataclasses.replace(named, name="</script><b>")
    text = scene.live().text
    assert text.count("</script>") == 2
    assert "<b>" not in text


@needs_node
def test_a_motion_ends_where_it_is_told_to():
    throw = scenes.cannonball(drag=0.0, g=10.0, speed=10.0, angle=np.pi / 6)
    lands = Choices({"": throw}, ends=Reaches(1, 0.0, -1))
    ended = node("run(model, 5).ended", throw, choices=lands)
    np.testing.assert_allclose(ended["t"], 1.0, rtol=1e-12)
    np.testing.assert_allclose(ended["y"], [10 * 0.75**0.5, 0, 10 * 0.75**0.5, -5], atol=1e-11)
    assert node("run(model, 5).ended", throw) is None


def test_places_in_arrays_are_counted_as_people_do():
    def labels(scene):
        return [one["label"] for one in _parameters(scene)]

    assert labels(scenes.two_skates())[2:-1] == [
        *("at 1, x", "at 1, y", "at 2, x", "at 2, y"),
        *("headings 1", "headings 2"),
    ]
    assert labels(scenes.one_skate())[2:-1] == ["at x", "at y", "headings"]
    assert labels(scenes.cart_pendulum()) == ["m 1", "m 2", "l", "g"]
    assert labels(scenes.cannonball())[0] == "m"


def test_parameters_have_their_units_and_meanings():
    found = {one["label"]: one for one in _parameters(scenes.pendulum(damping=0.1))}
    assert (found["c"]["unit"], found["c"]["meaning"]) == ("N m s", "damping of the hinge")
    assert (found["l"]["unit"], found["l"]["meaning"]) == ("m", "length")
    (own,) = _parameters(jaxdyn.ode(lambda t, y, p: [-p * y[0]], [1.0], params=2.0))
    assert (own["unit"], own["meaning"]) == ("", "")
    cart = {one["name"]: one["meaning"] for one in _parameters(scenes.cart_pendulum())}
    assert (cart["m[0]"], cart["m[1]"]) == ("mass of the cart", "mass of the point")


@pytest.mark.parametrize(
    ("params", "names"),
    [
        ([4.0, 0.1], ["params[0]", "params[1]"]),
        (np.array([4.0, 0.1]), ["params[0]", "params[1]"]),
        ({"k": [4.0, 0.1], "c": 0.2}, ["c", "k[0]", "k[1]"]),
        ({"k": np.array([4.0, 0.1])}, ["k[0]", "k[1]"]),
        (({"a": 1.0}, [2.0, 3.0]), ["a", "params[1][0]", "params[1][1]"]),
        ({"A": np.eye(2)}, ["A[0,0]", "A[0,1]", "A[1,0]", "A[1,1]"]),
        (4.0, ["p"]),
    ],
)
def test_numbers_of_users_are_named_as_in_python(params, names):
    scene = jaxdyn.ode(lambda t, y, p: -y, [1.0], params=params)
    found = _parameters(scene)
    assert [one["label"] for one in found] == [one["name"] for one in found] == names
