"""Pages of the course in a real browser: their scenes run, with questions beside them."""

import json

import browser as chromium
import numpy as np
import pytest

from jaxdyn import scenes, simulate, solvers
from jaxdyn.course.page import Page, displays, one_file, problems

PENDULUM = problems()[22]


@pytest.fixture(scope="module")
def window():
    driver = chromium.start()
    yield driver
    driver.quit()


@pytest.fixture
def page():
    """A page that plays two swings and asks one question."""
    made = Page()
    swings = {a: simulate(scenes.pendulum(angle=a), 2.0, samples=200) for a in (0.5, 1.0)}
    made.play(swings, "Wider swings take longer.", choose="amplitude [rad]")
    made.ask("What happens to a long one?", "It is slow.", scenes.pendulum(length=9.81))
    return made


def live(window, call):
    """The value of an expression of the scene on the page."""
    found = f"document.querySelector('.live').live.{call}"
    return json.loads(window.execute_script(f"return JSON.stringify({found} ?? null)"))


def test_the_scene_of_a_page_runs_in_one_file(window, page, tmp_path):
    one_file(PENDULUM, page, tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    live(window, "choose(1)")
    live(window, "seek(2)")
    wanted = simulate(scenes.pendulum(angle=1.0), 2.0, samples=2, rtol=1e-13).ys[-1]
    np.testing.assert_allclose(live(window, "state()")["now"][0], wanted, rtol=0, atol=1e-11)
    window.find_element("css selector", ".ask button").click()
    live(window, "seek(6)")
    wanted = simulate(scenes.pendulum(length=9.81), 6.0, samples=2, rtol=1e-13).ys[-1]
    np.testing.assert_allclose(live(window, "state()")["now"][0], wanted, rtol=0, atol=1e-11)
    # All answers are folded, and nothing else is asked for.
    open_ones = "return document.querySelectorAll('.folded[open], .ask details[open]').length"
    assert window.execute_script(open_ones) == 0
    assert window.execute_script("return performance.getEntriesByType('resource').length") == 0


@pytest.mark.parametrize(("width", "dark"), [(390, True), (1280, False)])
def test_it_fits_and_can_be_read(window, page, tmp_path, width, dark):
    size = {"width": width, "height": 800, "deviceScaleFactor": 2, "mobile": width < 500}
    window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
    window.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": scheme})
    try:
        one_file(PENDULUM, page, tmp_path / "page.html")
        chromium.opened(window, tmp_path / "page.html")
        window.execute_script("for (const x of document.querySelectorAll('details')) x.open = true")
        assert window.execute_script("return document.documentElement.scrollWidth") <= width
        assert chromium.faint(window) == []
    finally:
        window.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        window.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_what_cannot_run_is_played(page):
    assert [one.runs for one in displays(page)] == [True]
    # Scenes of two kinds: each would be another program.
    mixed = Page()
    motions = [simulate(make(), 1.0, samples=50) for make in (scenes.pendulum, scenes.cannonball)]
    mixed.play(dict(zip(("swing", "shot"), motions, strict=True)), "Two.")
    # A motion whose scene has corners that it leaves out.
    rolling = simulate(scenes.cylinder_on_cylinder(), 0.5, samples=50)
    mixed.play(rolling, "One.")
    # It began later.
    mixed.play(simulate(scenes.pendulum(), 2.0, t0=1.0, samples=50), "Three.")
    # Its errors are what there is to see; its steps are those of a method.
    mixed.play(simulate(scenes.pendulum(), 2.0, rtol=1e-2, samples=50), "Four.", inexact=True)
    stepped = simulate(scenes.pendulum(), 2.0, solver=solvers.GAUSS12, dt=0.1, samples=50)
    mixed.play(stepped, "Five.")
    assert [one.runs for one in displays(mixed)] == [False] * 5
    assert all('class="player"' in one.html for one in displays(mixed))
