"""Pages on which orbits and families run, in a real browser."""

import dataclasses
import json

import browser as chromium
import numpy as np
import pytest
from helpers import refusal

import orbits
from jaxdyn import scenes, simulate
from jaxdyn.continuation.kinds import Kind
from orbits.drawing import pages
from orbits.files import family_files


@pytest.fixture(scope="module")
def window():
    driver = chromium.start()
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def swings():
    """Swings of a pendulum by its energy."""
    swing = orbits.find(scenes.pendulum(angle=0.5), period=2.1)
    return orbits.continue_family(swing, members=6)


def live(window, call):
    """The value of an expression of the scene on the page."""
    found = f"document.querySelector('.live').live.{call}"
    return json.loads(window.execute_script(f"return JSON.stringify({found} ?? null)"))


def test_each_orbit_of_a_family_runs_closes_and_says_what_it_is(window, swings, tmp_path):
    swings.live(tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    said = window.find_element("css selector", ".live .chosen")
    for i in (0, 3, 5):
        live(window, f"choose({i})")
        member = swings.members[i]
        shown = f"energy = {member.energy:.6g} J: period {member.orbit.period:.8g} s, stable"
        assert said.text == f"{i + 1}, {shown}"
        half, period = member.orbit.period / 2, member.orbit.period
        live(window, f"seek({half})")
        ys = simulate(member.orbit.scene, half, samples=2, rtol=1e-13).ys
        np.testing.assert_allclose(live(window, "state()")["now"][0], ys[-1], rtol=0, atol=1e-9)
        live(window, f"seek({period})")
        start = np.asarray(member.orbit.y0)
        np.testing.assert_allclose(live(window, "state()")["now"][0], start, rtol=0, atol=1e-9)
        # Its path is drawn as a whole, and a motion aside runs beside it.
        assert live(window, "loop.length") == 601
        assert len(live(window, "state()")["now"]) == 2


def test_an_orbit_of_a_family_is_chosen_in_its_picture_and_by_keys(window, swings, tmp_path):
    listed = family_files.listing(swings)
    listed.live(tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    slider = window.find_element("css selector", ".live .chooser input")
    slider.send_keys("\ue014\ue014")  # the right arrow
    assert live(window, "choice") == 2
    assert slider.get_attribute("aria-valuetext").startswith("3, energy = ")
    canvas = window.find_element("css selector", ".live .plot canvas")
    window.execute_script("arguments[0].scrollIntoView()", canvas)
    chromium.wait(window, "document.querySelector('.live').live.plots[0].at")
    x, y = live(window, "plots[0].at(4)")
    chains = pytest.importorskip("selenium.webdriver.common.action_chains")
    width, height = window.execute_script(
        "return [arguments[0].clientWidth, arguments[0].clientHeight]", canvas
    )
    aside = round(x - width / 2), round(y - height / 2)
    chains.ActionChains(window).move_to_element_with_offset(canvas, *aside).click().perform()
    assert live(window, "choice") == 4
    assert slider.get_attribute("value") == "4"


def test_a_long_family_says_how_many_of_it_are_shown(swings):
    listed = family_files.listing(swings)
    many = family_files.Listing(None, listed.members * 40, (), listed.end)
    text = many.live().text
    assert "<h1>Family of 240 orbits of pendulum, 150 of them</h1>" in text
    assert len(text) < 200_000


def _chain(scene):
    return orbits.find_hybrid(scenes.phases_of(scene), scene.y0)


@pytest.mark.parametrize(
    "scene", [scenes.simplest_walker(), scenes.ball_on_table(phase=1.2, velocity=3.0)]
)
def test_a_chain_runs_through_its_phases_and_closes(window, scene, tmp_path):
    chain = _chain(scene)
    chain.live(tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    live(window, f"seek({chain.period / 2})")
    half = simulate(chain.legs[0].scene, chain.period / 2, samples=2, rtol=1e-13).ys
    np.testing.assert_allclose(live(window, "state()")["now"], [half[-1]], rtol=0, atol=1e-9)
    later = 1.5 * chain.period  # a phase of a drive grows by a whole turn
    live(window, f"seek({later})")
    (again,) = live(window, "state()")["now"]
    np.testing.assert_allclose(np.sin(again), np.sin(half[-1]), rtol=0, atol=1e-8)


def test_a_chain_of_other_legs_is_refused(tmp_path):
    chain = _chain(scenes.rimless_wheel())
    legs = orbits.find_hybrid(chain.legs, chain.y0, chain.spans)
    assert "got other legs. Draw it with orbits.drawing.orbits." in refusal(legs.live)
    assert ".html" in refusal(lambda: chain.live(tmp_path / "page.png"))


def test_a_family_of_chains_is_refused(tmp_path):
    roll = _chain(scenes.rimless_wheel())
    listed = family_files.Listing(None, (family_files.Entry(roll, 0.0, 1.0, "stable"),), (), "")
    said = refusal(lambda: listed.live())
    assert said.startswith("family: expected orbits of one smooth motion, got chains of legs.")
    assert ".html" in refusal(lambda: listed.live(tmp_path / "page.png"))
    assert "family" in refusal(lambda: pages.family_page(3))


@pytest.mark.slow
def test_special_points_have_marks_in_their_places(window, swings, tmp_path):
    listed = family_files.listing(swings)
    fold = dataclasses.replace(listed.members[2], kind=Kind.FOLD)
    last = dataclasses.replace(listed.members[-1], kind=Kind.REST)
    members = (*listed.members[:2], *listed.members[3:-1])
    dataclasses.replace(listed, members=members, special=(last, fold)).live(tmp_path / "page.html")
    chromium.opened(window, tmp_path / "page.html")
    starts = [entry.orbit.y0.tolist() for entry in listed.members]
    assert live(window, "data.starts.map((one) => one.start)") == starts
    ticks = window.find_elements("css selector", ".live .chooser option")
    assert [one.get_attribute("value") for one in ticks] == ["2", "5"]
    (mark,) = [
        one for one in window.find_elements("css selector", ".live button") if one.text == "fold"
    ]
    mark.click()
    assert live(window, "choice") == 2
    said = window.find_element("css selector", ".live .chosen").text
    assert said.startswith("fold 1, energy = ")
    assert ": period " in said
    shown = ["stable", "stable", "fold", "stable", "stable", "equilibrium"]
    assert live(window, "data.curve.kinds") == shown
