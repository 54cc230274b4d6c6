"""The player in a real browser: it plays, is scrubbed, turned and chosen from, also on a phone."""

import time

import browser as chromium
import numpy as np
import pytest

from jaxdyn import player, scenes, simulate

_WAIT = 10.0  # [s] for a picture to change, on a slow machine


@pytest.fixture(scope="module")
def window():
    driver = chromium.start()
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def swings():
    angles = (0.5, 1.0, 2.0)
    return {str(a): simulate(scenes.pendulum(angle=a), 2.0, samples=60) for a in angles}


def changed(window, before: str) -> bool:
    """Whether the picture changes within some seconds."""
    end = time.monotonic() + _WAIT
    while time.monotonic() < end:
        if chromium.picture(window) != before:
            return True
        time.sleep(0.05)
    return False


def test_it_plays_pauses_and_ends_where_the_motion_ends(window, swings, tmp_path):
    motion = swings["1.0"]
    player.play(motion, tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    chromium.player(window, "pause()")
    chromium.player(window, "seek(0)")
    start = chromium.picture(window)
    chromium.player(window, "play()")
    assert changed(window, start)
    chromium.player(window, "seek(1e9)")
    state = chromium.player(window, "state()")
    assert state["t"] == motion.ts[-1]
    np.testing.assert_allclose(state["points"][0], motion.r[-1], rtol=0, atol=1e-4)


def test_the_keyboard_and_the_slider_move_it(window, swings, tmp_path):
    player.play(swings["1.0"], tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    chromium.player(window, "pause()")
    stage = window.find_element("css selector", ".player .stage")
    for keys, expected in (("\ue010", 2.0), ("\ue011", 0.0), ("\ue014", 0.02), ("\ue012", 0.0)):
        stage.send_keys(keys)  # End, Home, arrow right, arrow left
        assert chromium.player(window, "t") == pytest.approx(expected)
    stage.send_keys(" ")
    assert chromium.player(window, "playing")
    slider = "document.querySelector('.player input[type=range]')"
    window.execute_script(f"{slider}.value = 500; {slider}.dispatchEvent(new Event('input'))")
    assert chromium.player(window, "t") == pytest.approx(1.0)
    assert not chromium.player(window, "playing")


def test_a_player_that_was_paused_before_it_came_into_sight_stays_paused(window, swings, tmp_path):
    page = tmp_path / "page.html"
    player.play(swings["1.0"], page)
    # Far below the window first, paused there, then scrolled to.
    page.write_text(page.read_text().replace("<body>", "<body><div style='height: 9000px'></div>"))
    chromium.opened(window, page)
    chromium.player(window, "pause()")
    before = chromium.picture(window)
    window.execute_script("document.querySelector('.player').scrollIntoView()")
    seen = "requestAnimationFrame(() => setTimeout(arguments[0], 300))"  # by every observer
    window.execute_async_script(seen)
    assert not chromium.player(window, "playing")
    assert chromium.picture(window) == before


def test_a_slider_chooses_a_precomputed_motion(window, swings, tmp_path):
    player.play(swings, tmp_path / "page.html", choose="angle [rad]")
    chromium.opened(window, tmp_path / "page.html")
    chromium.player(window, "pause()")
    chromium.player(window, "seek(0)")
    slider = "document.querySelector('.chooser input')"
    for i, motion in enumerate(swings.values()):
        window.execute_script(f"{slider}.value = {i}; {slider}.dispatchEvent(new Event('input'))")
        points = chromium.player(window, "state()")["points"]
        np.testing.assert_allclose(points, [motion.r[0]], rtol=0, atol=1e-4)
    assert window.find_element("css selector", ".chooser output").text == "2.0"


def test_a_picture_in_space_is_turned_by_dragging(window, tmp_path):
    player.play(simulate(scenes.satellite(), 1.0, samples=20), tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    chromium.player(window, "pause()")
    before = chromium.picture(window)
    chromium.drag(window, window.find_element("css selector", ".player .stage"), 120, 40)
    assert chromium.picture(window) != before


def test_a_small_motion_that_is_chosen_has_axes_of_its_own(window, tmp_path):
    sizes = (1e-2, 5.0, 20.0)
    throws = {str(v): simulate(scenes.cannonball(speed=v), 0.1, samples=9) for v in sizes}
    player.play(throws, tmp_path / "page.html", choose="speed [m/s]")
    chromium.opened(window, tmp_path / "page.html")
    boxes = []
    for i, motion in enumerate(throws.values()):
        chromium.player(window, f"choose({i})")
        (low, high), r = np.array(chromium.player(window, "box")), np.asarray(motion.r[:, 0])
        assert (low <= r.min(axis=0)).all()
        assert (high >= r.max(axis=0)).all()
        boxes.append((high - low).max() / np.ptp(r, axis=0).max())
    assert boxes[0] < 1.2  # nothing in the common box, which is that of the largest
    assert 1.2 < boxes[1] < 8


def test_keys_turn_and_enlarge_a_picture_in_space_and_the_page_says_so(window, tmp_path):
    player.play(simulate(scenes.satellite(), 1.0, samples=20), tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    chromium.player(window, "pause()")
    chromium.player(window, "seek(0)")
    stage = window.find_element("css selector", ".player .stage")
    before = chromium.player(window, "turn")
    for keys in ("\ue012", "\ue013", "]"):  # arrows to the left and up
        stage.send_keys(keys)
    after = chromium.player(window, "turn")
    assert {name for name in before if after[name] != before[name]} == {*before}
    assert chromium.player(window, "t") == 0.0
    for keys in ("\ue014", "\ue015", "["):  # back again
        stage.send_keys(keys)
    assert chromium.player(window, "turn") == pytest.approx(before)
    stage.send_keys("\ue008\ue014")  # Shift and the arrow to the right
    assert chromium.player(window, "t") == pytest.approx(0.01)
    hint = window.find_element("css selector", ".player .hint")
    assert hint.is_displayed()
    assert "arrows or dragging rotate the view" in hint.text


@pytest.mark.parametrize("width", [390, 1280])
def test_it_fits_the_window(window, swings, tmp_path, width):
    player.play(swings["1.0"], tmp_path / "page.html")
    # A window is never narrower than 500 px: that of the page is set instead.
    size = {"width": width, "height": 800, "deviceScaleFactor": 2, "mobile": width < 500}
    window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        chromium.opened(window, tmp_path / "page.html")
        wide = window.execute_script("return document.documentElement.scrollWidth")
        assert wide <= width
    finally:
        window.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
