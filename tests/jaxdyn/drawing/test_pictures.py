"""Pictures and animations of motions: what is drawn and named, their files, what is refused."""

import itertools
import math
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from matplotlib.collections import LineCollection, PolyCollection
from PIL import Image

from jaxdyn import Scene, Status, Trajectory, drawing, scenes, simulate, vibration
from jaxdyn.drawing import animate, paths
from jaxdyn.drawing.animation import _pace
from jaxdyn.drawing.curves import CURVE_SAMPLES
from jaxdyn.drawing.figures import PALETTE
from jaxdyn.drawing.panels import colours, limits
from jaxdyn.drawing.solid import _extent
from jaxdyn.effects import LinearDrag, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.events import Reaches
from jaxdyn.integrate.phases import Exit, Phase, simulate_phases
from orbits.drawing import orbits as orbit_picture


@pytest.fixture(scope="module")
def ball():
    return simulate(scenes.cannonball(), samples=90)


@pytest.fixture(scope="module")
def eight():
    return simulate(scenes.three_body(), samples=90)


@pytest.fixture(scope="module")
def stopped(eight):
    return _failed(eight, 31, Status.STEP_LIMIT)


@pytest.fixture(scope="module")
def throws():
    """Motions straight up by dimension 1, 2 and 3."""
    return {d: simulate(_up(d), samples=40) for d in (1, 2, 3)}


@pytest.fixture(scope="module")
def pendulum():
    """A rod that hangs and swings: its hinge is above all its points."""
    angle = np.linspace(-0.5, 0.5, 9)
    ys = jnp.stack([angle, np.ones(9)], axis=1)
    none = np.array(0)
    return Trajectory(scenes.pendulum(), jnp.asarray(angle), ys, none, none, none)


@pytest.fixture(scope="module")
def bounce():
    """A ball thrown up that bounces once."""
    ball = scenes.cannonball()
    lands = Exit(Reaches(1, 0.0, -1), "fly", Bounced())
    return simulate_phases({"fly": Phase(ball, (lands,))}, "fly", ball.y0, 2.0, samples=9)


class Bounced(eqx.Module):
    def __call__(self, t, y):
        return y * np.array([1.0, 1.0, 1.0, -0.8])


def _up(d):
    rest = np.zeros(d)
    return Scene(FreePoints(1.0, d=d), (UniformGravity(9.81),), y0=[*rest, *rest[1:], 8.0])


def _failed(motion, reached, status):
    """The motion as a run leaves it that got to so many samples."""
    ys = motion.ys.at[reached:].set(np.nan)
    return Trajectory(motion.scene, motion.ts, ys, motion.steps, motion.rejected, status)


def _sampled(motion, index):
    return Trajectory(
        motion.scene,
        motion.ts[index],
        motion.ys[index],
        motion.steps,
        motion.rejected,
        motion.status,
    )


def _made_up(scene, ys):
    """States that were not integrated."""
    none = np.array(0)
    return Trajectory(scene, jnp.linspace(0.0, 1.0, len(ys)), jnp.asarray(ys), none, none, none)


def _lines(ax, marker):
    return [line for line in ax.lines if line.get_marker() == marker]


def _strokes(ax):
    return [x for x in ax.collections if isinstance(x, LineCollection)]


def _is_pin(line):
    return isinstance(line.get_marker(), matplotlib.path.Path)


def _legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_trajectory_draws_every_body_once_with_start_and_end(eight):
    figure = drawing.trajectory(eight, title="eight")
    (ax,) = figure.axes
    assert len(_lines(ax, "o")) == 2 * 3
    (curves,) = [x for x in _strokes(ax) if len(x.get_segments())]
    colours = {tuple(c) for c in curves.get_colors()}
    assert len(colours) == 3
    # The pieces of one colour are the path of one body, every sample of it.
    first = matplotlib.colors.to_rgba(PALETTE[0])
    own = [
        piece
        for piece, c in zip(curves.get_segments(), curves.get_colors(), strict=True)
        if tuple(c) == first
    ]
    joined = np.concatenate([own[-1][:1], *[piece[1:] for piece in own[::-1]]])
    drawn = paths(eight)
    np.testing.assert_array_equal(joined, drawn.xyz[:, 0])
    np.testing.assert_array_equal(drawn.xyz[:: len(drawn.ts) // 89], eight.r)
    assert _legend(figure) == ["body 1", "body 2", "body 3", "start", "end"]
    assert ax.get_title() == "eight"


@pytest.mark.slow
def test_in_space_only_simple_bodies_are_drawn_at_later_times():
    # Several poses of a satellite, a cube with balls, would be a tangle of lines.
    figures = [
        drawing.trajectory(simulate(scene, samples=9))
        for scene in (scenes.box(), scenes.satellite())
    ]
    widths = [[x.get_linewidth()[0] for x in figure.axes[0].collections] for figure in figures]
    springs = 1  # an artist of the same width, which has nothing to draw here
    assert [all_of.count(1.1) - springs for all_of in widths] == [2, 0]


@pytest.mark.slow
def test_the_turntable_is_seen_in_its_picture():
    drawn = paths(simulate(scenes.turntable(), samples=20))
    (rim,) = (at for kind, at in drawn.shapes if kind == "area")
    assert 2 * np.ptp(rim[0]) > np.ptp(drawn.xyz, axis=0).max()


def test_a_filled_body_does_not_hide_its_later_poses():
    (ax,) = drawing.trajectory(simulate(scenes.turntable(), samples=20)).axes
    (table,) = (x for x in ax.collections if isinstance(x, PolyCollection) and x.get_paths())
    rims = [len(table.get_paths()[0].vertices)]
    later = [x for x in _strokes(ax) if {len(s) for s in x.get_segments()} & {*rims, rims[0] - 1}]
    assert len(later) == 5
    assert all(x.get_zorder() > table.get_zorder() for x in later)


@pytest.mark.slow
def test_no_body_on_skates_looks_like_the_mark_of_an_end():
    drawn = paths(simulate(scenes.two_skates(), samples=5))
    assert all(at.shape[2] == 4 for kind, at in drawn.shapes if kind == "area")


def test_rods_are_drawn_where_they_start_and_later(pendulum):
    figure = drawing.trajectory(pendulum)
    (ax,) = figure.axes
    rods = [x for x in _strokes(ax) if len(x.get_segments()) == 1]
    first, *later = sorted(rods, key=lambda x: -x.get_linewidth()[0])
    np.testing.assert_allclose(first.get_segments()[0], [[0, 0], pendulum.r[0, 0]], atol=1e-12)
    assert len(later) == 5
    ends = [x.get_segments()[0][1] for x in later]
    np.testing.assert_allclose(ends[-1], pendulum.r[-1, 0], atol=1e-12)
    assert ax.get_ylim()[1] > 0  # room for the hinge
    (hinge,) = [line for line in ax.lines if len(line.get_xdata()) and _is_pin(line)]
    np.testing.assert_array_equal(hinge.get_xydata(), [[0, 0]])
    assert hinge.get_marker().vertices[:, 1].max() > 0  # it hangs
    assert _legend(figure) == ["start", "end"]


@pytest.mark.slow
def test_springs_and_anchors_are_drawn():
    (ax,) = drawing.trajectory(simulate(scenes.two_springs(), 0.1, samples=3)).axes
    (pins,) = [line for line in ax.lines if _is_pin(line)]
    np.testing.assert_array_equal(pins.get_xydata(), [[-1, 0], [1, 0]])
    (springs,) = [x for x in _strokes(ax) if len(x.get_segments()) == 2]
    for zigzag, anchor in zip(springs.get_segments(), pins.get_xydata(), strict=True):
        assert len(zigzag) > 10
        np.testing.assert_array_equal(zigzag[[0, -1]], [[0.2, -1.0], anchor])


@pytest.mark.slow
def test_a_motion_that_comes_back_is_shown_on_its_way():
    (ax,) = drawing.trajectory(simulate(scenes.moved_box(), samples=60)).axes
    ax.figure.draw_without_rendering()
    boxes = [np.array(x._segments3d) for x in ax.collections if len(x._segments3d) == 12]
    assert len(boxes) == 3
    apart = [np.abs(one - other).max() for one, other in itertools.combinations(boxes, 2)]
    assert min(apart) > 0.5


def test_a_narrow_picture_holds_its_legend():
    scene = Scene(FreePoints(np.ones(3)), y0=np.arange(12.0) * np.tile([0.01, 1.0], 6), t1=9.0)
    figure = drawing.trajectory(simulate(scene, samples=3))
    figure.canvas.draw()
    assert figure.get_figwidth() < 4
    box, whole = figure.legends[0].get_window_extent(), figure.bbox
    assert box.x0 >= 0
    assert box.x1 <= whole.x1
    assert len(_legend(figure)) == 5


def test_many_bodies_have_a_colour_each():
    scene = Scene(FreePoints(np.ones(12)), y0=np.arange(48.0))
    drawn = paths(simulate(scene, samples=3))
    shades = colours(drawn)
    assert len(set(shades)) == 12
    # None so light that it is lost on white.
    assert max(min(matplotlib.colors.to_rgb(c)) for c in shades) < 0.5
    assert _legend(drawing.trajectory(simulate(scene, samples=3))) == ["start", "end"]


@pytest.mark.slow
def test_a_chain_is_drawn_with_its_phases(bounce, tmp_path):
    figure = drawing.trajectory(bounce)
    (ax,) = figure.axes
    (corner,) = _lines(ax, "D")
    np.testing.assert_allclose(corner.get_xydata()[0], bounce.pieces[1].r[0, 0], atol=1e-12)
    (end,) = [x for x in _lines(ax, "o") if x.get_markersize() == 12]
    np.testing.assert_allclose(end.get_xydata()[0], bounce.pieces[1].r[-1, 0], atol=1e-12)
    assert _legend(figure) == ["start", "next phase", "end"]
    landing, line = drawing.time_series(bounce, names=["y"]).axes[0].lines
    assert landing.get_xdata()[0] == bounce.times[0]
    height = line.get_xydata()
    sampled = np.concatenate([piece.ts for piece in bounce.pieces])
    assert len(height) > 1000
    assert (np.diff(height[:, 0]) >= 0).all()
    assert set(sampled) <= set(height[:, 0])
    with Image.open(animate(bounce, tmp_path / "b.gif", seconds=0.2)) as gif:
        assert gif.n_frames == 7


def test_a_plane_has_one_scale_and_everything_is_inside(ball):
    (ax,) = drawing.trajectory(ball).axes
    assert ax.get_aspect() == 1
    for i, (low, high) in enumerate([ax.get_xlim(), ax.get_ylim()]):
        assert low < ball.r[:, 0, i].min()
        assert high > ball.r[:, 0, i].max()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")


@pytest.mark.slow
def test_space_has_one_scale(throws):
    (ax,) = drawing.trajectory(throws[3]).axes
    assert ax.name == "3d"
    spans = [np.ptp(ends) for ends in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())]
    box = ax.get_box_aspect()
    np.testing.assert_allclose(box / box[0], spans / spans[0], rtol=1e-12)
    assert ax.get_zlabel() == "z [m]"


def test_a_line_is_drawn_against_time(throws):
    (ax,) = drawing.trajectory(throws[1]).axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("t [s]", "x [m]")
    assert ax.get_aspect() == "auto"
    (end,) = [line for line in _lines(ax, "o") if line.get_xdata()[0] > 0]
    np.testing.assert_array_equal(end.get_xydata()[0], [throws[1].ts[-1], throws[1]["x"][-1]])


def test_the_box_of_a_body_at_rest_is_a_box():
    box = limits(np.full((5, 1, 2), 3.0), True)
    np.testing.assert_allclose(box.mean(axis=1), 3.0)
    assert (np.diff(box) > 1).all()


def test_a_run_that_stopped_shows_where_and_why(stopped):
    figure = drawing.trajectory(stopped, title="eight")
    (ax,) = figure.axes
    crosses = [line.get_xydata()[0] for line in _lines(ax, "x")]
    np.testing.assert_array_equal(crosses, stopped.r[30])
    assert len(_lines(ax, "o")) == 3
    assert ax.get_title().startswith("eight\nThe integration stopped at its limit of steps (t = ")
    assert _legend(figure)[-1] == "stop"
    assert "limit of steps" in drawing.time_series(stopped).axes[0].get_title()


def test_a_run_that_never_started_is_a_picture_that_says_so(ball, tmp_path):
    motion = _failed(ball, 0, Status.NOT_FINITE)
    figure = drawing.trajectory(motion, tmp_path / "nan.png", title="")
    title = figure.axes[0].get_title().replace("\n", " ")
    assert "NaN or infinite" in title
    assert motion.message.startswith(title)
    assert not any(len(line.get_xdata()) for line in figure.axes[0].lines)
    with pytest.raises(ValueError, match="motion: expected at least 2 samples, got 0"):
        animate(motion, tmp_path / "nan.gif")


def test_time_series_has_a_panel_a_unit(eight):
    figure = drawing.time_series(eight)
    assert [ax.get_ylabel() for ax in figure.axes] == ["", ""]  # G = 1
    assert [len(ax.lines) for ax in figure.axes] == [6, 6]
    line = figure.axes[1].lines[3]
    assert line.get_label() == "vy2"
    step = (len(line.get_ydata()) - 1) // (len(eight.ts) - 1)
    np.testing.assert_array_equal(line.get_ydata()[::step], eight["vy2"])


def test_time_series_say_the_units():
    figure = drawing.time_series(simulate(scenes.cannonball(), 1.0, samples=3))
    assert [ax.get_ylabel() for ax in figure.axes] == ["[m]", "[m/s]"]
    assert figure.axes[-1].get_xlabel() == "t [s]"


def test_a_title_above_axes_at_a_side_is_not_cut_off(tmp_path):
    scene = scenes.restricted_three_body_in_space(system="earth-moon")
    figure = drawing.trajectory([simulate(scene, t1) for t1 in (3.0, 2.0)], tmp_path / "moon.png")
    box = figure.axes[0].title.get_window_extent()
    assert figure.axes[0].get_title().startswith("restricted_three_body_in_space")
    assert 0 < box.x0 < box.x1 < figure.bbox.width


def test_a_conserved_energy_is_drawn_flat_however_few_the_samples():
    motion = simulate(scenes.double_pendulum(), samples=100)
    (ax,) = drawing.time_series(motion, names=["kinetic", "potential", "total"]).axes
    drawn = {line.get_label(): np.asarray(line.get_ydata()) for line in ax.lines}
    assert np.ptp(drawn["total"]) < 1e-9
    both = drawn["kinetic"] + drawn["potential"]
    np.testing.assert_allclose(both, drawn["total"], rtol=0, atol=1e-12)
    assert np.ptp(drawn["kinetic"]) > 2


def test_time_series_of_energies_by_name():
    v, angle, g = 10.0, math.pi / 4, 9.81
    motion = simulate(scenes.cannonball(speed=v, angle=angle, m=2.0, g=g), 1.0, samples=3)
    upper, lower = drawing.time_series(motion, names=["y", "total", "kinetic", "potential"]).axes
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("[m]", "energy [J]")
    values = {line.get_label(): line.get_xydata().T for line in lower.lines}
    assert list(values) == ["total", "kinetic", "potential"]
    t, kinetic = values["kinetic"]
    up = v * math.sin(angle) - g * t
    np.testing.assert_allclose(kinetic, (v * math.cos(angle)) ** 2 + up**2, rtol=1e-12)
    np.testing.assert_allclose(values["total"][1], v**2, rtol=1e-12)
    np.testing.assert_allclose(values["potential"][1], v**2 - kinetic, rtol=0, atol=1e-11)


def test_time_series_of_functions():
    scene = scenes.oscillator(k=4.0, x=1.0)

    def acceleration_of_x(t, y):
        return scene.rate(t, y)[1]

    names = ["x", acceleration_of_x, lambda t, y: t * y[1]]
    figure = drawing.time_series(simulate(scene, 2.0), names=names)
    curves = [(ax.lines[0].get_label(), *ax.lines[0].get_xydata().T) for ax in figure.axes]
    assert [name for name, *_ in curves] == ["x", "acceleration of x", "quantity"]
    t, acceleration = curves[1][1:]
    np.testing.assert_allclose(acceleration, -4 * np.cos(2 * t), atol=1e-9)
    np.testing.assert_allclose(curves[2][2], -2 * t * np.sin(2 * t), atol=1e-9)


@pytest.mark.parametrize(
    ("functions", "message"),
    [
        ([lambda t, y: y[0], lambda t, y: y[1]], "functions with different names, got two 'quant"),
        ([lambda t, y: y], r"names: expected shape \(\), got shape \(2,\)"),
        ([lambda y: y[0]], r"names: expected a function of \(t, y\)"),
    ],
)
def test_functions_that_cannot_be_drawn_are_refused(functions, message):
    motion = simulate(scenes.oscillator(), 1.0, samples=3)
    with pytest.raises(ValueError, match=message):
        drawing.time_series(motion, names=functions)


def test_energies_that_a_scene_does_not_have_are_refused():
    motion = simulate(scenes.lorenz(t1=1.0), samples=3)
    with pytest.raises(ValueError, match=r"scene: expected one with an energy, .* energy= to"):
        drawing.time_series(motion, names=["kinetic"])
    with pytest.raises(ValueError, match=r"'kinetik'\. Did you mean 'kinetic'"):
        drawing.time_series(simulate(scenes.cannonball(), samples=3), names=["kinetik"])


def test_time_series_of_some_entries(eight):
    (ax,) = drawing.time_series(eight, names=["x1", "y3"]).axes
    assert [line.get_label() for line in ax.lines] == ["x1", "y3"]


def test_time_series_say_what_they_are_of():
    motion = simulate(scenes.cannonball(), 1.0, samples=3)
    assert drawing.time_series(motion).axes[0].get_title() == TITLE
    assert drawing.time_series(motion, title="a throw").axes[0].get_title() == "a throw"


TITLE = "cannonball (m = 1), uniform gravity (g = 9.81)"


def test_a_picture_says_what_it_is_of(ball):
    assert drawing.trajectory(ball).axes[0].get_title() == TITLE
    assert drawing.trajectory(ball, title="").axes[0].get_title() == ""


def test_a_long_title_is_folded_and_inside():
    scene = scenes.two_springs(c_a=0.1, c_b=0.2, c_d=0.3)
    figure = drawing.trajectory(_made_up(scene, scene.y0[None]))
    figure.draw_without_rendering()
    (ax,) = figure.axes
    title, whole = ax.title.get_window_extent(), figure.bbox
    assert ax.get_title().count("\n") >= 2
    assert title.x0 >= 0
    assert title.x1 <= whole.x1
    assert title.y1 <= whole.y1


def test_a_notebook_shows_the_picture(ball):
    # IPython asks an object for its PNG file by this name.
    for figure in (drawing.trajectory(ball), drawing.time_series(ball)):
        assert figure._repr_png_().startswith(b"\x89PNG")


def test_several_motions_are_drawn_on_the_same_axes():
    throws = [simulate(scenes.cannonball(speed=v), samples=30) for v in (5.0, 12.0)]
    figure = drawing.trajectory(throws, names=["slow", "fast"])
    (ax,) = figure.axes
    assert _legend(figure) == ["slow", "fast", "start", "end"]
    assert ax.get_title() == TITLE
    ends = [line.get_xydata()[0] for line in _lines(ax, "o") if line.get_markersize() == 12]
    np.testing.assert_array_equal(ends, [motion.r[-1, 0] for motion in throws])
    assert ax.get_xlim()[1] > float(throws[1].r[-1, 0, 0])
    assert len({line.get_color() for line in _lines(ax, "o")}) == 2


def test_motions_that_do_not_fit_together_are_refused(ball, throws):
    with pytest.raises(ValueError, match="motion: expected motions in one space, got several"):
        drawing.trajectory([ball, throws[3]])
    with pytest.raises(ValueError, match="names: expected one for each of 1 motions, got 2"):
        drawing.trajectory([ball], names=["a", "b"])
    with pytest.raises(ValueError, match="motion: expected at least one motion, got none"):
        drawing.trajectory([])


@pytest.mark.parametrize("stretch", [(1, 1, 1), (1, 1, 0), (0, 0, 1), (5, 1, 1)])
def test_solid_figures_fill_their_space(stretch):
    scene = scenes.hanging_spring()
    places = np.random.default_rng(3).uniform(size=(CURVE_SAMPLES + 1, 6)) * np.tile(stretch, 2)
    figure = drawing.trajectory(_made_up(scene, places))
    figure.draw_without_rendering()
    (ax,) = figure.axes
    taken, whole = _extent(ax), figure.bbox
    assert taken.x0 >= 0
    assert taken.x1 <= whole.x1
    assert taken.y0 >= figure.legends[0].get_window_extent().y1
    assert taken.y1 <= ax.title.get_window_extent().y0
    assert ax.title.get_window_extent().y1 <= whole.y1
    # As wide as the figure, unless that made it too high.
    assert taken.width > 0.9 * whole.width or taken.height > 1.1 * whole.width


def test_projections_are_to_one_scale(throws):
    figure = drawing.projections(throws[3])
    figure.draw_without_rendering()
    scales = [ax.get_window_extent().width / np.ptp(ax.get_xlim()) for ax in figure.axes]
    np.testing.assert_allclose(scales, scales[0], rtol=0.02)
    for ax, plane in zip(figure.axes, [(0, 2), (1, 2), (0, 1)], strict=True):
        (start,) = _lines(ax, "o")
        np.testing.assert_array_equal(start.get_xydata()[0], throws[3].r[0, 0, list(plane)])
    with pytest.raises(ValueError, match="motion: expected a motion in space, got one in x"):
        drawing.projections(throws[2])


@pytest.mark.parametrize(
    ("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".SVG", b"<?xml")]
)
def test_files_are_of_their_kind(ball, tmp_path, suffix, magic):
    path = tmp_path / f"ball{suffix}"
    drawing.trajectory(ball, path)
    assert path.read_bytes().startswith(magic)


def test_png_is_whole_and_not_blank(eight, tmp_path):
    drawing.time_series(eight, path=tmp_path / "series.png")
    with Image.open(tmp_path / "series.png") as image:
        assert len(image.convert("RGB").getcolors(1 << 20)) > 10


def test_settings_are_left_alone(throws):
    before = dict(matplotlib.rcParams)
    drawing.trajectory(throws[3])
    assert dict(matplotlib.rcParams) == before


def test_wrong_files_are_refused(ball, tmp_path):
    with pytest.raises(ValueError, match=r"path: expected a file name ending in .png, .pdf, .svg"):
        drawing.trajectory(ball, "ball.jpg")
    with pytest.raises(ValueError, match=r"path: expected a file in a folder that exists"):
        drawing.time_series(ball, path=tmp_path / "none" / "ball.png")
    with pytest.raises(ValueError, match=r"path: expected a file name ending in .gif, .mp4"):
        animate(ball, tmp_path / "ball.png")


def test_wrong_motions_and_names_are_refused(ball):
    batch = jax.tree.map(lambda x: jnp.stack([x, x]), ball)
    for draw in (drawing.trajectory, drawing.time_series, drawing.projections):
        with pytest.raises(ValueError, match="motion: expected one motion, got a batch"):
            draw(batch)
    with pytest.raises(ValueError, match=r"names: expected one of .*Did you mean 'vx'"):
        drawing.time_series(ball, names=["vxx"])
    with pytest.raises(ValueError, match=r"names: expected one of .*, got none"):
        drawing.time_series(ball, names=[])


@pytest.mark.parametrize("d", [1, 2, 3])
def test_gif_has_the_asked_frames_and_length(throws, tmp_path, d):
    path = animate(throws[d], tmp_path / "up.gif", seconds=1.0, fps=10)
    with Image.open(path) as gif:
        assert gif.n_frames == 10
        frames, length = [], 0
        for i in range(10):
            gif.seek(i)
            length += gif.info["duration"]
            frames.append(np.asarray(gif.convert("RGB"), dtype=int))
    assert length == 1000
    high, wide, _ = frames[0].shape
    clock = frames[0][: high // 12, : wide // 4]
    assert (clock.max(axis=2) < 100).sum() > 20
    # Dots and clock move over a ground that stays: the labels below never change.
    low = frames[0].shape[0] * 9 // 10
    for old, new in itertools.pairwise(frames):
        assert (abs(new - old).max(axis=2) > 100).sum() > 20
        np.testing.assert_allclose(new[low:], old[low:], atol=40)


@pytest.mark.parametrize(
    ("span", "seconds", "note"),
    [
        (5.0, 5.0, ""),
        (1.0, 1.0, ""),
        (10.0, 10.0, ""),
        (60.0, 6.0, "  (10 x faster)"),
        (1e5, 10.0, "  (1e+04 x faster)"),
        (0.3, 6.0, "  (20 x slower)"),
        (1e-6, 5.0, "  (5e+06 x slower)"),
    ],
)
def test_an_animation_runs_in_real_time_or_says_how_fast(span, seconds, note):
    pace = _pace(span, None)
    np.testing.assert_allclose(pace.seconds, seconds)
    assert pace.note == note
    assert _pace(span, span / 3).note == "  (3 x faster)"
    assert _pace(span, span).note == ""


def test_a_gif_takes_as_long_as_the_motion(throws, tmp_path):
    path = animate(throws[2], tmp_path / "up.gif", fps=5)
    with Image.open(path) as gif:
        lengths = []
        for i in range(gif.n_frames):
            gif.seek(i)
            lengths.append(gif.info["duration"])
    span = float(throws[2].ts[-1])
    assert sum(lengths) == pytest.approx(1000 * _pace(span, None).seconds, rel=0.05)


def test_thirty_frames_a_second_keep_the_length(ball, tmp_path):
    # 1/30 s is no whole hundredth of a second; cut to 0.03 s it takes one frame in ten more.
    path = animate(ball, tmp_path / "ball.gif", seconds=0.6, fps=30)
    with Image.open(path) as gif:
        assert gif.n_frames == 20
        assert gif.info["duration"] == 30


@pytest.mark.slow
def test_few_or_uneven_samples_make_all_frames(throws, stopped, tmp_path):
    few = _sampled(throws[2], np.array([0, 10, 39]))
    for i, motion in enumerate((few, stopped)):
        with Image.open(animate(motion, tmp_path / f"{i}.gif", seconds=0.5)) as gif:
            assert gif.n_frames == 17  # of 0.03 s, which is what 1/30 s is in a GIF


def test_mp4_without_ffmpeg_is_refused(ball, tmp_path, monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(ValueError, match=r"path: expected a .gif .* Install ffmpeg or use .gif"):
        animate(ball, tmp_path / "ball.mp4")


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="ffmpeg is not installed")
def test_mp4(ball, tmp_path):
    path = animate(ball, tmp_path / "ball.mp4", seconds=1.0)
    assert path.read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"seconds": 0.0}, "seconds: expected > 0"),
        ({"fps": -1}, "fps: expected > 0"),
        ({"trail": 1.5}, "trail: expected a share between 0 and 1"),
    ],
)
def test_wrong_numbers_are_refused(ball, tmp_path, numbers, message):
    with pytest.raises(ValueError, match=message):
        animate(ball, tmp_path / "ball.gif", **numbers)


def test_a_single_sample_is_refused(ball, tmp_path):
    with pytest.raises(ValueError, match="motion: expected at least 2 samples"):
        animate(_sampled(ball, np.array([3])), tmp_path / "ball.gif")


def _orbit(y0=scenes.nbody.EIGHT, period=scenes.nbody.EIGHT_PERIOD):
    return SimpleNamespace(scene=scenes.three_body(), y0=np.array(y0), period=period, solver=None)


@pytest.mark.slow
def test_orbits_stand_side_by_side_to_one_scale(tmp_path):
    other = _orbit(np.array(scenes.nbody.EIGHT) * np.repeat([1.1, 1.1**-0.5], 6), 7.3)
    path = tmp_path / "row.png"
    figure = orbit_picture([_orbit(), other], path, ["one\nline more", "two"])
    left, right = figure.axes
    assert (left.get_title(), right.get_title()) == ("one\nline more", "two")
    assert left.get_xlim() == right.get_xlim()
    assert left.get_position().y0 == pytest.approx(right.get_position().y0)
    for ax in figure.axes:
        assert ax.get_aspect() == 1
        assert len(_lines(ax, "o")) == 3
        arrows = ax.collections[1:]
        assert len(arrows) == 3
        # The eight's bodies start with velocities v, v and -2v.
        u = np.array([[a.U[0], a.V[0]] for a in arrows])
        np.testing.assert_allclose(u[2], -2 * u[0], rtol=1e-7)
    with Image.open(path) as image:
        assert image.width > 2 * image.height


def test_wrong_orbits_are_refused():
    with pytest.raises(ValueError, match="found: expected at least one orbit"):
        orbit_picture([])
    with pytest.raises(ValueError, match="titles: expected one for each of 1 orbits, got 2"):
        orbit_picture([_orbit()], titles=["a", "b"])
    with pytest.raises(ValueError, match="path: expected a file name ending in"):
        orbit_picture([_orbit()], "orbit.bmp")
    solid = SimpleNamespace(scene=_up(3), y0=_up(3).y0, period=1.0, solver=None)
    with pytest.raises(ValueError, match="found: expected orbits in one space"):
        orbit_picture([_orbit(), solid])
    # Bodies at rest have no direction: no arrows, no division by zero.
    still = Scene(FreePoints(1.0, d=2), y0=np.zeros(4))
    figure = orbit_picture([SimpleNamespace(scene=still, y0=still.y0, period=1.0, solver=None)])
    assert len(figure.axes[0].collections) == 1


@pytest.mark.slow
def test_a_title_of_two_lines_is_within_the_picture(tmp_path):
    windy = LinearDrag(0.1, (3.0, 0.5))
    motion = simulate(scenes.cannonball(drag=0.05, angle=1.0472) + windy, 2.0)
    figure = drawing.trajectory(motion, tmp_path / "throw.png")
    title = figure.axes[0].title
    assert title.get_text().count("\n") == 1
    assert title.get_window_extent().ymax < figure.bbox.ymax


def test_what_drives_a_scene_is_drawn_by_its_name():
    rest = scenes.oscillator(k=4.0, x=0.0)
    once = vibration.drive(rest, "x", vibration.Harmonic(0.5, 2.0))
    twice = vibration.drive(once, "x", vibration.Step(3.0, t_on=0.5))
    motion = simulate(twice, 1.0, samples=11)
    names = ["x", "force on x", "force on x (2)"]
    upper, lower = drawing.time_series(motion, names=names).axes
    assert [upper.get_ylabel(), lower.get_ylabel()] == ["[m]", "[N]"]
    harmonic, step = lower.lines
    ts = harmonic.get_xdata()
    np.testing.assert_allclose(harmonic.get_ydata(), 0.5 * np.cos(2.0 * ts), atol=1e-12)
    off = ts != 0.5
    expected = np.where(ts > 0.5, 3.0, 0.0)
    np.testing.assert_array_equal(step.get_ydata()[off], expected[off])


def test_a_base_that_accelerates_is_drawn_and_another_input_refused():
    rest = scenes.oscillator(k=4.0, x=0.0)
    shaken = vibration.drive(rest, vibration.Base([1.0]), vibration.Step(1.0))
    motion = simulate(shaken, 1.0, samples=3)
    shown = drawing.time_series(motion, names=["acceleration of the base"])
    assert shown.axes[0].get_ylabel() == "[m/s^2]"
    with pytest.raises(ValueError, match="names: expected one of acceleration of the base, kin"):
        drawing.time_series(motion, names=["force on x"])


def test_a_drive_without_a_known_unit_has_a_panel_of_its_own():
    def moved(height, rate):
        return scenes.spring_chain(m=[1.0], wall=height, wall_velocity=rate)

    wall = vibration.Motion(moved)
    chain = vibration.drive(scenes.spring_chain(m=[1.0]), wall, vibration.Harmonic(0.1, 3.0))
    axes = drawing.time_series(simulate(chain, 1.0), names=["x", "displacement"]).axes
    assert [ax.get_ylabel() for ax in axes] == ["[m]", ""]
    assert axes[1].get_legend().get_texts()[0].get_text() == "displacement"
