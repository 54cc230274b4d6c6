"""Free-body diagrams: what is written and drawn, whether labels are apart, and what is refused."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.transforms import Bbox

from jaxdyn import drawing, effects, scenes, simulate
from jaxdyn.analysis.free_body import free_body
from jaxdyn.integrate.phases import simulate_phases
from jaxdyn.scene import Effect


def _texts(ax) -> list[str]:
    return [text.get_text() for text in ax.texts if text.get_text()]


def _tips(ax) -> list[np.ndarray]:
    """Tail and tip of every arrow."""
    return [np.array([a.xyann, a.xy]) for a in ax.texts if getattr(a, "arrow_patch", None)]


def test_every_body_has_a_panel_with_its_forces_and_numbers():
    figure = drawing.free_body(scenes.double_pendulum())
    whole, *alone = figure.axes
    assert [text for text in _texts(whole) if "bar" in text] == ["bar 1", "bar 2"]
    for ax, body in zip(alone, free_body(scenes.double_pendulum()).bodies, strict=True):
        said = "\n".join(_texts(ax))
        assert ax.get_title().startswith(body.name)
        for force in body.forces:
            assert f"{force.name}" in said
            assert f"{np.linalg.norm(force.force):.4g} N" in said
        assert "sum of forces = m a = " in said
        assert "sum of moments = dL/dt = " in said
    above = figure.texts[0].get_text()
    assert "add up to m a" in above
    assert "* found from the balance" in above


def test_arrows_have_one_scale_and_the_direction_of_their_forces():
    scene = scenes.cart_pendulum()
    figure = drawing.free_body(scene)
    found = free_body(scene)
    for ax, body in zip(figure.axes[1:], found.bodies, strict=True):
        arrows = _tips(ax)
        assert len(arrows) == len(body.forces)
        for (tail, tip), force in zip(arrows, body.forces, strict=True):
            scaled = (tip - tail) * found.largest
            np.testing.assert_allclose(scaled, 0.85 * force.force, atol=1e-12 * found.largest)


@pytest.mark.parametrize(
    "name", ["four_bar", "cart_pendulum", "rolling_disk", "n_body", "plate", "cylinder_on_ramp"]
)
def test_labels_are_apart_and_inside(name):
    figure = drawing.free_body(scenes.catalogue.entry(name).make(), motion=True)
    figure.draw_without_rendering()
    for ax in figure.axes:
        texts = [text for text in ax.texts if text.get_text()]
        boxes = [text.get_window_extent() for text in texts]
        for one, other in itertools.combinations(boxes, 2):
            both = Bbox.intersection(one, other)
            assert both is None or both.width * both.height < 0.02 * one.width * one.height
        for box in boxes:
            assert box.x0 >= 0
            assert box.x1 <= figure.bbox.width


@pytest.mark.parametrize(
    "scene",
    [
        scenes.bead_on_parabola(x=2.0),
        scenes.bead_on_parabola(c=0.3, formulation="constrained"),
        scenes.bead_on_cycloid(),
    ],
)
def test_a_wire_is_drawn_through_its_bead(scene):
    whole = drawing.free_body(scene).axes[0]
    (wire,) = (path.vertices for lines in whole.collections for path in lines.get_paths())
    bead = np.asarray(scene.system.points(0.0, scene.y0).r[0])
    assert wire[0, 0] < bead[0] < wire[-1, 0]
    assert np.interp(bead[0], *wire.T) == pytest.approx(bead[1], abs=0.01)


def test_velocity_and_acceleration_are_drawn_if_asked():
    scene = scenes.cannonball()
    plain, moving = (drawing.free_body(scene, motion=motion) for motion in (False, True))
    assert len(_tips(moving.axes[1])) == len(_tips(plain.axes[1])) + 2
    said = _texts(moving.axes[1])
    assert any(text.startswith("a = 9.81 m/s^2") for text in said)
    assert not any(text.startswith("a = ") for text in _texts(plain.axes[1]))


def test_a_motion_at_a_time_between_its_samples():
    scene = scenes.pendulum(angle=1.0)
    motion = simulate(scene, 2.0, samples=5)
    t = 0.7
    figure = drawing.free_body(motion, t)
    exact = simulate(scene, t, samples=2, rtol=1e-13)
    stick = free_body(scene, t, exact.ys[-1]).bodies[0].forces[1]
    assert f"{np.linalg.norm(stick.force):.4g} N" in "\n".join(_texts(figure.axes[1]))
    with pytest.raises(ValueError, match=r"^t: expected a time of the motion, from 0 s to 2 s"):
        drawing.free_body(motion, 3.0)
    with pytest.raises(ValueError, match=r"^y: expected none with a motion"):
        drawing.free_body(motion, 0.5, scene.y0)


@pytest.mark.slow
def test_a_phase_has_its_own_forces():
    scene = scenes.cylinder_on_ramp(slope=0.9, mu=0.1)
    chain = simulate_phases(scenes.phases_of(scene), None, scene.y0, 0.5)
    figure = drawing.free_body(chain, 0.2)
    assert "friction" in "\n".join(_texts(figure.axes[1]))


def test_too_many_bodies_are_refused():
    with pytest.raises(ValueError, match=r"^scene: expected at most 8 bodies, got 9"):
        drawing.free_body(
            scenes.n_pendulum(m=(1.0,) * 9, length=(1.0,) * 9, angles=(0.1,) * 9, rates=(0.0,) * 9)
        )


def test_a_couple_is_an_arc(tmp_path):
    class Motor(Effect):
        """A torque of 0.3 N m on each bar."""

        def generalized(self, t, q, v):
            return 0.3 * jnp.ones_like(v)

    scene = scenes.double_pendulum() + Motor() + effects.LinearDrag(0.2)
    scene = scene.starting([0.5, 1.0, 2.0, -1.0])
    figure = drawing.free_body(scene, path=tmp_path / "motor.png")
    assert (tmp_path / "motor.png").stat().st_size > 10_000
    said = _texts(figure.axes[1])
    assert "motor\n0.3 N m" in said  # without a force of 0 N
    account = said[-1].splitlines()
    assert "motor: 0.3 N m" in account
    # The drag of a turning bar is a force and a moment.
    (drag,) = (i for i, line in enumerate(account) if line.startswith("linear drag: ("))
    assert account[drag + 1].startswith("its moment: -")
    arcs = [line for line in figure.axes[1].lines if len(line.get_xdata()) > 30]
    radii = [np.linalg.norm(line.get_xydata() - line.get_xydata().mean(axis=0)) for line in arcs]
    assert len(arcs) == 2
    assert radii[0] != pytest.approx(radii[1], rel=0.1)


def test_no_head_is_longer_than_its_arrow():
    scene = scenes.cart_pendulum() + effects.LinearDrag(0.5)
    figure = drawing.free_body(scene.starting([0.0, 1.0, 0.5, 0.6]))
    figure.draw_without_rendering()
    for ax in figure.axes[1:]:
        for a in ax.texts:
            if getattr(a, "arrow_patch", None):
                ends = ax.transData.transform([a.xyann, a.xy])
                length = np.linalg.norm(ends[1] - ends[0]) * 72 / figure.dpi
                assert 0.45 * a.arrow_patch.get_mutation_scale() < 0.6 * length


def test_rounding_is_not_drawn_as_a_moment_or_a_force():
    # The weight of a bar far from the origin has no moment about its centre.
    scene = scenes.n_pendulum()
    far = simulate(scene, 1.37, samples=2)
    assert not any(
        f.couple for body in free_body(scene, 1.37, far.ys[-1]).bodies for f in body.forces
    )
    tumbling = scenes.box()
    later = simulate(tumbling, 8.22, samples=2)
    said = "\n".join(_texts(drawing.free_body(later, 8.22).axes[1]))
    assert "sum of forces = m a = (0, 0, 0) N" in said


def test_no_label_is_on_the_name_of_its_body():
    scene = scenes.pinned_chain()
    figure = drawing.free_body(simulate(scene, 1.37, samples=2), 1.37)
    figure.draw_without_rendering()
    for ax in figure.axes[1:]:
        above = ax.title.get_window_extent()
        for text in ax.texts:
            if text.get_text():
                assert Bbox.intersection(above, text.get_window_extent()) is None
