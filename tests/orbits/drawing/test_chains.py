"""Pictures of chains of legs: the path of all legs, with their jumps dashed."""

import jax.numpy as jnp
import numpy as np
import pytest

import orbits
from jaxdyn import drawing, scenes
from jaxdyn.integrate import events, phases


def _found(scene):
    return orbits.find_hybrid(scenes.phases_of(scene), scene.y0)


def _dashed(figure):
    lines = []
    for collection in figure.axes[0].collections:
        (_, pattern), *_ = collection.get_linestyles()
        lines += collection.get_segments() if pattern else []
    return lines


def _solid(figure):
    found = []
    for collection in figure.axes[0].collections:
        if hasattr(collection, "get_segments") and collection.get_linestyles()[0][1] is None:
            found += [x for x in collection.get_segments() if len(x)]
    return found


def _legend(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


@pytest.mark.slow
def test_the_jump_of_a_wheel_to_its_next_spoke_is_dashed(tmp_path):
    roll = _found(scenes.rimless_wheel())
    path = tmp_path / "roll.png"
    figure = orbits.drawing.orbits([roll], path, title="A rimless wheel")
    assert path.stat().st_size > 10_000
    (jump,) = _dashed(figure)
    # From the hub over one foot to the hub over the next: by a chord of the wheel.
    assert abs(np.linalg.norm(jump[1] - jump[0]) - 2 * np.sin(np.pi / 8)) < 1e-5
    assert "jump" in _legend(figure)


@pytest.mark.slow
def test_a_bounce_jumps_nowhere():
    bounce = _found(scenes.ball_on_table(phase=1.2, velocity=3.0))
    figure = orbits.drawing.orbits([bounce], title="")
    assert _dashed(figure) == []
    assert "jump" not in _legend(figure)
    high = max(float(line[:, 1].max()) for line in _solid(figure))
    # The path goes up to where the ball turns.
    top = float(bounce.y0[0]) + float(bounce.y0[1]) ** 2 / (2 * 9.81)
    assert abs(high - top) < 1e-3


def _aside(t, y):
    return y + jnp.array([0.5, 0.0, 0.0, 0.0])


def _back(t, y):
    return jnp.array([0.0, 5.0, 0.0, 0.0]) + 0.0 * y


@pytest.mark.slow
def test_a_jump_between_legs_is_no_part_of_the_path():
    ball = scenes.cannonball(g=10.0)
    first = orbits.Leg(ball, (events.Reaches(1, 2.0),), _aside)
    chain = [first, orbits.Leg(ball, (events.Reaches(1, 0.0),), _back)]
    found = orbits.find_hybrid(chain, [0.0, 5.0, 0.0, 0.0], [0.7, 0.3])
    figure = orbits.drawing.orbits([found], title="")
    jumps = sorted((jump.tolist() for jump in _dashed(figure)), key=lambda jump: jump[0][1])
    np.testing.assert_allclose(jumps, [[[0.5, 0], [0, 5]], [[0, 2], [0.5, 2]]], atol=1e-9)
    for line in _solid(figure):
        assert np.abs(np.diff(line[:, 0])).max() < 1e-9  # straight down, on either side


def test_jumps_are_dashed_in_any_picture_of_phases():
    walker = scenes.simplest_walker()
    steps = phases.simulate_phases(scenes.phases_of(walker), None, walker.y0, 9.0)
    assert len(_dashed(drawing.trajectory(steps, title=""))) == 4  # two points, two steps


@pytest.mark.sample("scene1")
@pytest.mark.parametrize("scene", [scenes.impact_oscillator(), scenes.simplest_walker()])
def test_a_notebook_shows_a_chain(scene):
    assert "<img" in _found(scene)._repr_html_()
