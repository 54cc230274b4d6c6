"""A scene that runs in a real browser: dragged, changed, switched, also on a phone and by keys."""

import functools
import json
import time

import browser as chromium
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import crossings, player, scenes, simulate
from jaxdyn.analysis import momenta
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate import events

_WAIT = 20.0  # [s] for a motion to get somewhere, on a slow machine


@pytest.fixture(scope="module")
def window():
    driver = chromium.start()
    yield driver
    driver.quit()


def opened(window, scene, path):
    scene.live(path / "page.html")
    chromium.opened(window, path / "page.html")


def live(window, call):
    """The value of an expression such as ``state()`` of the scene on the page."""
    found = f"document.querySelector('.live').live.{call}"
    return json.loads(window.execute_script(f"return JSON.stringify({found} ?? null)"))


def type_into(window, label, text):
    """Type a number into the field with a label, as a person does."""
    labels = window.find_elements("css selector", ".live label")
    (found,) = [one for one in labels if one.text == label]
    field = window.find_element("id", found.get_attribute("for"))
    field.send_keys("\ue009a\ue009" + text)  # Ctrl and a: all of it


def marks(scene, y):
    """(n, d) the points of a scene that leave a path."""
    shapes = scene.sketch(jnp.zeros(()), jnp.asarray(y))
    return np.concatenate([shape.at for shape in shapes if shape.kind == "trace"])


def _still(d, t, points):
    """The origin of a plane or of space, as a point that does not move."""
    return jnp.zeros(d)


def ends(scene, t):
    return np.asarray(simulate(scene, t, samples=2, rtol=1e-13).ys[-1])


def test_it_runs_by_the_button_and_its_numbers_are_the_librarys(window, tmp_path):
    scene = scenes.pendulum(angle=2.0)
    opened(window, scene, tmp_path)
    assert live(window, "state()")["now"][0] == scene.y0.tolist()
    button = window.find_element("css selector", ".live .controls button")
    button.click()
    until = time.monotonic() + _WAIT
    while live(window, "t") < 1.0 and time.monotonic() < until:
        time.sleep(0.05)
    button.click()
    state = live(window, "state()")
    assert not state["playing"]
    assert state["t"] >= 1.0
    # It stops within a step: this is its dense output.
    np.testing.assert_allclose(state["now"][0], ends(scene, state["t"]), rtol=0, atol=1e-11)
    points = marks(scene, state["now"][0])
    np.testing.assert_allclose(state["points"][0], points, rtol=0, atol=1e-12)
    said = window.find_element("css selector", ".live .said").text
    assert f"theta = {state['now'][0][0]:.5g} rad" in said
    assert window.find_element("css selector", ".live .status").text.startswith("Paused at t = ")


def test_a_body_is_dragged_to_the_start(window, tmp_path):
    scene = scenes.pendulum(angle=1.0)
    opened(window, scene, tmp_path)
    live(window, "seek(2)")
    stage = window.find_element("css selector", ".live .stage")
    at, to = (
        live(window, f"view.map([{size} * Math.sin({angle}), -{size} * Math.cos({angle})])")
        for size, angle in ((1.0, live(window, "state()")["now"][0][0]), (0.9, -0.6))
    )
    middle = window.execute_script(
        "return [arguments[0].clientWidth, arguments[0].clientHeight]", stage
    )
    chains = pytest.importorskip("selenium.webdriver.common.action_chains")
    chains.ActionChains(window).move_to_element_with_offset(
        stage, *(round(x - size / 2) for x, size in zip(at, middle, strict=False))
    ).click_and_hold().move_by_offset(
        *(round(x) - round(y) for x, y in zip(to[:2], at[:2], strict=True))
    ).release().perform()
    # The nearest place on its circle to one within it.
    state = live(window, "state()")
    assert state["t"] == 0.0
    assert state["start"] == pytest.approx([-0.6, 0.0], abs=0.02)  # pixels
    assert (
        f"theta {state['start'][0]:.4g} rad"
        in window.find_element("css selector", ".live .status").text
    )


def test_a_finger_drags_a_body_moves_a_slider_and_scrolls_the_page(window, tmp_path):
    scene = scenes.pendulum(angle=1.0)
    with chromium.as_phone(window):
        opened(window, scene, tmp_path)
        assert window.execute_script("return document.documentElement.scrollWidth") == 390
        stage = window.find_element("css selector", ".live .stage")
        at, to = live(window, "view.map([Math.sin(1), -Math.cos(1)])")[:2], [110.0, 180.0]
        chromium.swipe(window, stage, at, to)
        # The place under the finger, in the picture as it is now.
        (left, top, _), (right, _, _) = (live(window, f"view.map([{x}, 0])") for x in (0, 1))
        x, y = (to[0] - left) / (right - left), (top - to[1]) / (right - left)
        start = live(window, "state()")["start"]
        assert start == pytest.approx([np.arctan2(x, -y), 0.0], abs=1e-5)
        assert start[0] < 0.5
        assert window.execute_script("return scrollY") == 0
        # Beside the body the same gesture scrolls.
        chromium.swipe(window, stage, (at[0], at[1] + 80), (at[0], at[1] - 60))
        chromium.wait(window, "scrollY > 40")
        assert live(window, "state()")["start"] == start
        slider = window.find_element("css selector", "[aria-label='g [m/s^2], slider']")
        middle = slider.size["width"] / 2, slider.size["height"] / 2
        chromium.swipe(window, slider, middle, (0.0, middle[1]))
        assert live(window, "state()")["parameters"][-1] == 0.0
        window.find_element("css selector", ".live .controls button").click()
        chromium.wait(window, "document.querySelector('.live').live.t > 0.5")


@pytest.mark.parametrize("mark", [0, 1])
def test_dragging_is_the_inverse_of_the_points(window, tmp_path, mark):
    scene = scenes.double_pendulum(rates=(0.3, -0.2))
    opened(window, scene, tmp_path)
    live(window, "seek(1.5)")
    live(window, "grab()")
    place = [0.6, -0.8] if mark == 0 else [0.7, -1.1]
    live(window, f"drag({mark}, {place})")
    start = jnp.asarray(live(window, "state()")["start"])
    np.testing.assert_allclose(marks(scene, start)[mark], place, rtol=0, atol=1e-9)
    assert start[2:].tolist() == [0.3, -0.2]  # the velocities stay those of the start


def test_a_body_is_dragged_to_a_displacement_from_rest(window, tmp_path):
    opened(window, scenes.spring_chain(x=(0.1, 0.0)), tmp_path)
    live(window, "grab()")
    assert live(window, "state()")["points"][0][1][0] == 2.0
    live(window, "drag(1, [2.3])")
    start = live(window, "state()")["start"]
    np.testing.assert_allclose(start, [0.1, 0.3, 0.0, 0.0], rtol=0, atol=1e-9)


def test_dragging_keeps_constraints(window, tmp_path):
    scene = scenes.four_bar()
    opened(window, scene, tmp_path)
    live(window, "grab()")
    first = live(window, "state()")["points"][0][0]
    live(window, f"drag(0, [{first[0] + 0.3}, {first[1] - 0.2}])")
    state = live(window, "state()")
    start = jnp.asarray(state["start"])
    assert np.abs(np.subtract(state["points"][0][0], first)).max() > 0.1
    np.testing.assert_allclose(scene.system.nearest(0.0, start), start, rtol=0, atol=1e-12)


def test_parameters_start_and_effects_are_changed_in_their_fields(window, tmp_path):
    opened(window, scenes.spring_mass(), tmp_path)
    type_into(window, "k [N/m]", "7.5")
    type_into(window, "x [m]", "0.4")
    boxes = window.find_elements("css selector", ".live .check")
    assert [box.text for box in boxes[:2]] == ["spring", "uniform gravity"]
    boxes[1].click()
    live(window, "seek(2)")
    state = live(window, "state()")
    made = scenes.spring_mass(k=7.5).without(jaxdyn.effects.UniformGravity)
    made = made.starting(made.y0.at[0].set(0.4))
    np.testing.assert_allclose(state["now"][0], ends(made, 2.0), rtol=0, atol=1e-10)
    # In the middle of a motion a change holds from there on.
    type_into(window, "k [N/m]", "3")
    live(window, "seek(3)")
    onwards = scenes.spring_mass(k=3.0).without(jaxdyn.effects.UniformGravity)
    onwards = onwards.starting(state["now"][0])
    np.testing.assert_allclose(live(window, "state()")["now"][0], ends(onwards, 1.0), atol=1e-10)
    window.find_element("xpath", "//button[text()='Original']").click()
    assert boxes[1].find_element("css selector", "input").is_selected()
    live(window, "seek(1)")
    wanted = ends(scenes.spring_mass(), 1.0)
    np.testing.assert_allclose(live(window, "state()")["now"][0], wanted, rtol=0, atol=1e-10)


@pytest.mark.parametrize("text", ["\ue017", "abc", "-1", "1e"])
def test_what_is_not_a_number_of_its_kind_is_refused(window, tmp_path, text):
    opened(window, scenes.spring_mass(), tmp_path)
    type_into(window, "m [kg]", text)
    field = window.switch_to.active_element
    assert field.get_attribute("aria-invalid") == "true"
    field.send_keys("\ue004")  # Tab: the field is left
    said = window.find_element("css selector", ".live .status").text
    assert said == "m [kg]: a number >= 0 is expected; it is still 1."
    assert (field.get_attribute("value"), field.get_attribute("aria-invalid")) == ("1", "false")
    bounds = {one["name"]: one["bound"] for one in live(window, "data.parameters")}
    assert bounds["k"] == ""
    live(window, "set('m[0]', -1)")
    assert live(window, "state()")["parameters"][0] == 1.0


def test_a_start_is_shown_on_the_constraints(window, tmp_path):
    opened(window, scenes.pendulum(formulation="constrained"), tmp_path)
    type_into(window, "x [m]", "0.5\ue004")
    x, y, *_ = live(window, "state()")["start"]
    assert x**2 + y**2 == pytest.approx(1.0, abs=1e-14)
    (label,) = [x for x in window.find_elements("css selector", "label") if x.text == "x [m]"]
    shown = window.find_element("id", label.get_attribute("for")).get_attribute("value")
    assert float(shown) == pytest.approx(x, abs=1e-6)
    assert abs(x - 0.5) > 1e-3


def test_where_constraints_cannot_be_satisfied_nothing_moves(window, tmp_path):
    bars = {"m": [1.0, 1.0, 1.0], "length": [1.0, 2.0, 2.0]}
    start = scenes.four_bar(angle=2.0, formulation="loop").y0[:3]
    chain = scenes.pinned_chain(**bars, rates=[0.0] * 3, angles=start, span=2.0)
    opened(window, chain, tmp_path)
    before = live(window, "state()")["start"]
    type_into(window, "end x [m]", "9\ue004")  # the bars have 5 m
    status = window.find_element("css selector", ".live [role=status]")
    assert status.text.startswith("No state near this one satisfies the constraints")
    window.find_element("css selector", ".live .controls button").click()
    time.sleep(0.2)
    state = live(window, "state()")
    assert state["t"] == 0
    assert state["start"] == state["now"][0] == before
    type_into(window, "end x [m]", "2\ue004")
    live(window, "seek(0.1)")
    state = live(window, "state()")
    assert state["start"] == pytest.approx(before, abs=1e-13)
    np.testing.assert_allclose(state["now"][0], ends(chain, 0.1), atol=1e-9)


def test_the_start_of_a_car_stays_on_its_constraint(window, tmp_path):
    scene = scenes.car()
    opened(window, scene, tmp_path)
    live(window, "enter(2, 0.3)")
    start = jnp.asarray(live(window, "state()")["start"])
    assert start[2] == pytest.approx(0.3, abs=0.1)
    scene.starting(start).check()


def test_the_vector_of_the_momentum_of_a_single_point(window, tmp_path):
    opened(window, scenes.cannonball(), tmp_path)
    window.find_element("xpath", "//summary[text()='Vectors']").click()
    window.find_elements("css selector", ".live .check")[-1].click()
    live(window, "seek(0.5)")
    y = live(window, "state()")["now"][0]
    ((_, spin),) = live(window, "arrows().at(-1)")
    np.testing.assert_allclose(spin, [y[0] * y[3] - y[1] * y[2]], rtol=1e-14)
    assert window.get_log("browser") == []


@pytest.mark.slow
def test_several_motions_begin_beside_each_other(window, tmp_path):
    scene = scenes.double_pendulum()
    opened(window, scene, tmp_path)
    live(window, "several(3)")
    live(window, "seek(2)")
    now = live(window, "state()")["now"]
    for i, y in enumerate(now):
        other = scene.starting(scene.y0.at[0].add(1e-3 * i))
        np.testing.assert_allclose(y, ends(other, 2.0), rtol=0, atol=1e-10)


def test_motions_beside_one_that_begins_at_a_stop_are_before_it(window, tmp_path):
    opened(window, scenes.impact_oscillator(), tmp_path)
    live(window, "several(2)")
    live(window, "seek(1)")
    state = live(window, "state()")
    assert (state["t"], state["failure"]) == (1.0, "")
    assert live(window, "offset.size") < 0
    legend = window.find_element("css selector", ".live .scene .legend").text
    assert legend.split() == ["start", "-", "0.001"]


def test_a_section_is_drawn_while_it_runs(window, tmp_path):
    scene = scenes.henon_heiles()
    opened(window, scene, tmp_path)
    window.find_element("xpath", "//summary[text()='Section']").click()
    live(window, "seek(120)")
    found = live(window, "state()")["crossings"][0]
    wanted = crossings(scene, events.Reaches(0, 0.0, 1), 120.0, rtol=1e-14)
    assert len(found) == len(wanted.ts) > 10
    np.testing.assert_allclose([one["t"] for one in found], wanted.ts, rtol=0, atol=1e-9)
    np.testing.assert_allclose([one["y"] for one in found], wanted.ys, rtol=0, atol=1e-9)
    (canvas,) = window.find_elements("css selector", "details.plot canvas")
    window.execute_script("arguments[0].scrollIntoView()", canvas)
    label = f"vy over y at {len(found)} crossings"
    chromium.wait(window, f"document.querySelector('details.plot canvas').ariaLabel == '{label}'")
    # Another one is seen from its choice on.
    live(window, "cut({entry: 2, level: 0.1, way: -1})")
    assert live(window, "state()")["crossings"] == [[]]
    live(window, "seek(150)")
    found = live(window, "state()")["crossings"][0]
    wanted = crossings(scene, events.Reaches(2, 0.1, -1), 150.0, rtol=1e-14)
    later = wanted.ts > 120.0
    np.testing.assert_allclose([one["t"] for one in found], wanted.ts[later], rtol=0, atol=1e-9)


def test_a_stroboscope_of_a_driven_scene(window, tmp_path):
    scene = scenes.shaken_pendulum()
    opened(window, scene, tmp_path)
    live(window, "cut({entry: -1, level: 0.05})")
    live(window, "seek(1)")
    found = live(window, "state()")["crossings"][0]
    assert [one["t"] for one in found] == pytest.approx(0.05 * np.arange(1, 21), abs=1e-14)
    wanted = simulate(scene, 1.0, samples=21, rtol=1e-13).ys[1:]
    np.testing.assert_allclose([one["y"] for one in found], wanted, rtol=0, atol=1e-9)


def test_an_angle_crosses_a_level_at_each_turn(window, tmp_path):
    scene = scenes.pendulum(angle=0.0).starting([0.0, 8.0])  # it turns over
    opened(window, scene, tmp_path)
    live(window, "cut({entry: 0, level: 0.5, way: 0})")
    live(window, "seek(4)")
    found = live(window, "state()")["crossings"][0]
    turns = [(one["y"][0] - 0.5) / (2 * np.pi) for one in found]
    assert len(turns) >= 4
    np.testing.assert_allclose(turns, np.arange(len(turns)), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_effects_and_impacts_are_switched_off_where_there_are_corners(window, tmp_path):
    scene = scenes.cylinder_on_cylinder(theta=0.5)
    opened(window, scene, tmp_path)
    boxes = window.find_elements("css selector", ".live .check")[:4]
    assert [box.text for box in boxes] == ["uniform gravity", "slipping", "lift-off", "landing"]
    for box in boxes[1:]:
        box.click()
    # What rolls ideally, and may be pulled at, is the scene without its phases.
    live(window, "seek(0.9)")
    np.testing.assert_allclose(live(window, "state()")["now"][0], ends(scene, 0.9), atol=1e-10)
    boxes[0].click()
    before = live(window, "state()")["now"][0]
    live(window, "seek(1.2)")
    onwards = scene.without(jaxdyn.effects.UniformGravity).starting(before)
    np.testing.assert_allclose(live(window, "state()")["now"][0], ends(onwards, 0.3), atol=1e-10)


def test_vectors_of_momenta(window, tmp_path):
    for scene in (scenes.top(), scenes.double_pendulum(rates=(1.0, 2.0))):
        opened(window, scene, tmp_path)
        window.find_element("xpath", "//summary[text()='Vectors']").click()
        boxes = window.find_elements("css selector", ".live .check")
        for box in boxes[-2:]:
            box.click()
        assert [box.text.partition(" about ")[2] for box in boxes[-2:]] == [
            "the origin",
            "the mass centre",
        ]
        live(window, "seek(0.4)")
        t, y = live(window, "t"), jnp.asarray(live(window, "state()")["now"][0])
        origin, centre = (live(window, f"arrows().at({i})")[0] for i in (-2, -1))
        still = functools.partial(_still, scene.system.points(t, y).r.shape[1])
        wanted = momenta.angular_momentum_about(scene, t, y, still, "absolute")
        np.testing.assert_allclose(np.squeeze(origin[1]), wanted, rtol=0, atol=1e-12)
        wanted = momenta.angular_momentum_about(scene, t, y, momenta.centre_of_mass, "relative")
        np.testing.assert_allclose(np.squeeze(centre[1]), wanted, rtol=0, atol=1e-12)
        at = momenta.centre_of_mass(t, scene.system.points(t, y))
        np.testing.assert_allclose(centre[0], at, rtol=0, atol=1e-13)


def test_scenes_to_choose_from_and_questions(window, tmp_path):
    swings = {str(angle): scenes.pendulum(angle=angle, length=angle) for angle in (1.0, 2.0)}
    fewer = scenes.pendulum(angle=0.5).without(jaxdyn.effects.UniformGravity)
    question = player.Ask("What happens without weight?", "It stays where it is.", fewer)
    player.live(swings, tmp_path / "page.html", choose="angle [rad]", asks=[question])
    chromium.opened(window, tmp_path / "page.html")
    slider = window.find_element("css selector", ".live .chooser input")
    slider.send_keys("\ue014")  # the right arrow
    assert slider.get_attribute("aria-valuetext") == "2.0"
    live(window, "seek(1.5)")
    wanted = ends(scenes.pendulum(angle=2.0, length=2.0), 1.5)
    np.testing.assert_allclose(live(window, "state()")["now"][0], wanted, rtol=0, atol=1e-10)
    answer = window.find_element("css selector", ".live .ask details")
    assert answer.get_attribute("open") is None
    window.find_element("css selector", ".live .ask button").click()
    live(window, "seek(1)")
    assert live(window, "state()")["now"][0] == [0.5, 0.0]
    box = window.find_element("css selector", ".live .check input")
    assert not box.is_selected()


def test_starts_that_run_beside_each_other(window, tmp_path):
    both = {"angle": (0.5, 1.0), "m": (1.0, 3.0), "speed": (9.0, 10.0)}

    def shots(**changed):
        numbers = [dict(zip(both, row, strict=True)) for row in zip(*both.values(), strict=True)]
        made = [scenes.cannonball(**one | changed, drag=0.2) for one in numbers]
        return dict(zip(("low", "high"), made, strict=True))

    player.live(shots(), tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    live(window, "seek(0.7)")
    for y, scene in zip(live(window, "state()")["now"], shots().values(), strict=True):
        np.testing.assert_allclose(y, ends(scene, 0.7), rtol=0, atol=1e-12)
    # A number that is changed is changed for all; the others stay those of each.
    live(window, "reset()")
    type_into(window, "g [m/s^2]", "5")
    live(window, "seek(0.7)")
    for y, scene in zip(live(window, "state()")["now"], shots(g=5.0).values(), strict=True):
        np.testing.assert_allclose(y, ends(scene, 0.7), rtol=0, atol=1e-12)
    assert window.find_element("css selector", ".live .scene .legend").text.split() == [
        "low",
        "high",
    ]


def test_thirty_seconds_and_the_numbers_are_the_librarys(window, tmp_path):
    scene = scenes.two_springs()
    opened(window, scene, tmp_path)
    live(window, "seek(30)")
    np.testing.assert_allclose(live(window, "state()")["now"][0], ends(scene, 30.0), atol=1e-9)
    said = window.find_element("css selector", ".live .said").text
    assert all(f"{x:.5g}" in said for x in ends(scene, 30.0))


def test_axes_of_millions_of_metres(window, tmp_path):
    far = jaxdyn.Scene(FreePoints(m=[1.0], d=2), y0=[-7e6, 0.0, 7e3, 7e3], t1=2000.0)
    opened(window, far, tmp_path)  # a message of the console fails
    assert live(window, "box")[1][0] > 7e6


def test_keys_play_step_and_reset(window, tmp_path):
    opened(window, scenes.pendulum(), tmp_path)
    stage = window.find_element("css selector", ".live .stage")
    stage.send_keys("s")
    assert live(window, "t") == pytest.approx(1 / 30)
    stage.send_keys(" ")
    assert live(window, "playing")
    stage.send_keys("r")
    state = live(window, "state()")
    assert (state["t"], state["playing"]) == (0.0, False)


def test_a_motion_that_ends_says_where_and_why(window, tmp_path):
    opened(window, scenes.two_body().starting([1.0, 0, -1.0, 0, 0, 0, 0, 0]), tmp_path)
    live(window, "seek(50)")
    said = window.find_element("css selector", ".live [role=status]").text
    assert said.startswith("The motion ends at t = ")
    assert "singularity" in said


@pytest.mark.parametrize(("width", "dark"), [(390, False), (1280, True)])
def test_it_fits_and_can_be_read(window, tmp_path, width, dark):
    size = {"width": width, "height": 800, "deviceScaleFactor": 2, "mobile": width < 500}
    window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
    window.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": scheme})
    try:
        opened(window, scenes.two_springs(), tmp_path)
        assert window.execute_script("return document.documentElement.scrollWidth") <= width
        assert chromium.faint(window) == []
        # Every control has a name for those who hear the page.
        unnamed = window.execute_script(
            "return [...document.querySelectorAll('button, select, input, canvas')].filter((x) => "
            "!x.ariaLabel && !x.textContent && !x.labels?.length).length"
        )
        assert unnamed == 0
        requests = window.execute_script("return performance.getEntriesByType('resource').length")
        assert requests == 0
    finally:
        window.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        window.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
