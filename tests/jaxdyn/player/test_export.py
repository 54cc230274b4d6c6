"""What the player gets: the positions, times and energies of a motion, in few bytes."""

import base64
import json

import jax
import numpy as np
import pytest
from helpers import refusal

from jaxdyn import player, scenes, simulate
from jaxdyn.analysis.energy import change
from jaxdyn.drawing.contents import paths

STEP = 1 / 65535  # of the box of a motion: that of its positions


@pytest.fixture(scope="module")
def swing():
    return simulate(scenes.pendulum(), 2.0, samples=50)


def doubles(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f8")


def places(one: dict, text: str, *shape: int) -> np.ndarray:
    shares = np.frombuffer(base64.b64decode(text), "<u2").reshape(*shape, len(one["lo"]))
    lo, hi = np.array(one["lo"]), np.array(one["hi"])
    return lo + (hi - lo) * shares / 65535


@pytest.mark.slow
def test_positions_and_times_are_those_of_the_motion(swing):
    (one,) = player.export(swing)["motions"]
    ts = doubles(one["ts"])
    r = places(one, one["paths"], len(ts), 1)
    assert ts[0] == swing.ts[0]
    assert ts[-1] == swing.ts[-1]
    size = np.max(np.array(one["hi"]) - one["lo"])
    np.testing.assert_allclose(r[-1], swing.r[-1], rtol=0, atol=STEP * size)
    drawn = paths(swing)
    at = np.searchsorted(drawn.ts, ts)
    np.testing.assert_array_equal(drawn.ts[at], ts)
    np.testing.assert_allclose(r, drawn.xyz[at], rtol=0, atol=STEP * size)


def test_shapes_follow_the_motion_and_those_at_rest_are_stored_once(swing):
    (one,) = player.export(swing)["motions"]
    frames = len(doubles(one["ts"]))
    by_kind = {shape["kind"]: shape for shape in one["shapes"]}
    rod = by_kind["line"]
    ends = places(one, rod["at"], frames, rod["lines"] * rod["corners"])
    np.testing.assert_allclose(ends[-1][1], swing.r[-1, 0], rtol=0, atol=3 * STEP)
    assert places(one, by_kind["pin"]["at"], -1).shape[0] == 1


def test_of_a_rigid_shape_only_the_first_frame_is_kept_and_how_it_moves():
    motion = simulate(scenes.satellite(), 2.0, samples=40)
    (one,) = player.export(motion)["motions"]
    drawn = paths(motion)
    at = np.searchsorted(drawn.ts, doubles(one["ts"]))
    size = np.max(np.array(one["hi"]) - one["lo"])
    moved = 0
    shapes = [x for x in drawn.shapes if x.kind != "ground"]
    for shape, x in zip(one["shapes"], shapes, strict=True):
        if shape["moved"]:
            first = places(one, shape["at"], -1)
            maps = np.frombuffer(base64.b64decode(shape["moved"]), "<f4").reshape(len(at), 4, 3)
            found = first.reshape(-1, 3) @ maps[:, :3] + maps[:, 3:]
            wanted = x.at[at].reshape(len(at), -1, 3)
            np.testing.assert_allclose(found, wanted, rtol=0, atol=3 * STEP * size)
            moved += 1
    assert moved > 0


def test_the_change_of_the_energy_is_exact(swing):
    (one,) = player.export(swing)["motions"]
    found = change(swing.scene, swing.ts, swing.ys)
    expected = (found.values - found.values[0]) / found.size
    assert one["energy"]["size"] == found.size
    np.testing.assert_allclose(doubles(one["energy"]["change"]), expected, rtol=1e-14, atol=0)
    assert one["energy"]["start"] == found.values[0]
    assert player.export(simulate(scenes.lorenz(), 1.0, samples=20))["motions"][0]["energy"] is None


def test_a_motion_backwards_in_time_is_shown_forwards(swing):
    back = simulate(scenes.pendulum(), -2.0, samples=50)
    (one,) = player.export(back)["motions"]
    ts = doubles(one["ts"])
    assert (ts[0], ts[-1]) == (-2.0, 0.0)
    np.testing.assert_allclose(places(one, one["paths"], len(ts), 1)[0], back.r[-1], atol=1e-4)
    assert doubles(one["energy"]["ts"])[0] == -2.0


@pytest.mark.slow
def test_corners_of_a_spinning_body_stay_in_the_box():
    motion = simulate(scenes.plate(), samples=400)
    (one,) = player.export(motion)["motions"]
    drawn = paths(motion)
    low = np.min([at.min(axis=(0, 1, 2)) for kind, at in drawn.shapes if kind != "ground"], axis=0)
    assert np.all(np.array(one["lo"]) <= low)
    for shape in one["shapes"]:
        at = places(one, shape["at"], -1, shape["lines"] * shape["corners"])
        assert np.abs(np.diff(at, axis=0)).max(initial=0.0) < 0.2 * np.ptp([one["lo"], one["hi"]])


@pytest.mark.slow
def test_a_motion_that_stopped_says_so_and_has_its_energy_up_to_there():
    fall = scenes.sideways_pendulum(rate=8.0)
    motion = simulate(fall, 5.0, samples=400, throw=False)
    assert not motion.ok
    (one,) = player.export(motion)["motions"]
    assert one["stopped"]
    assert doubles(one["energy"]["ts"])[-1] < 5.0
    assert np.isfinite(doubles(one["energy"]["change"])).all()


def test_several_motions_share_their_axes_and_the_budget(swing):
    near = simulate(scenes.pendulum(angle=1.0), 2.0, samples=50)
    shown = player.export({"far": swing, "near": near}, choose="angle [rad]")
    assert [one["name"] for one in shown["motions"]] == ["far", "near"]
    assert shown["choose"] == "angle [rad]"
    low, high = shown["box"]
    for one in shown["motions"]:
        assert np.all(np.array(low) <= one["lo"])
        assert np.all(np.array(high) >= one["hi"])


def test_an_export_is_json_of_bounded_size(tmp_path):
    motion = simulate(scenes.satellite(), samples=400)
    player.export(motion, tmp_path / "satellite.json")
    text = (tmp_path / "satellite.json").read_text()
    assert json.loads(text) == player.export(motion)
    assert len(text) < 600_000


def test_a_page_needs_no_other_file_and_escapes_names(swing, tmp_path):
    names = {"</script><b>": swing, "<!--<script>": swing}
    player.play(names, tmp_path / "page.html", title="<Swing>")
    text = (tmp_path / "page.html").read_text()
    assert "&lt;Swing&gt;" in text
    assert "</script><b>" not in text
    assert "<!--" not in text
    assert "http" not in text
    assert text.count("</script>") == 2
    assert "srcdoc" in swing.play()._repr_html_()


def test_misuse_is_refused_in_one_line(swing, tmp_path):
    batch = jax.vmap(lambda a: simulate(scenes.pendulum(angle=a), 1.0, samples=5))(
        np.array([0.1, 0.2])
    )
    three = simulate(scenes.satellite(), 0.1, samples=5)
    short = simulate(scenes.pendulum(), 1.0, samples=[1.0])
    calls = {
        "one motion": lambda: player.export(batch),
        "motions in one space": lambda: player.export({"a": swing, "b": three}),
        "at least 2 samples": lambda: player.export(short),
        "several motions to choose from": lambda: player.export(swing, choose="angle"),
        "at least one motion": lambda: player.export({}),
        ".json": lambda: player.export(swing, tmp_path / "swing.txt"),
        ".html": lambda: player.play(swing, tmp_path / "swing.txt"),
    }
    for said, call in calls.items():
        assert said in refusal(call)
