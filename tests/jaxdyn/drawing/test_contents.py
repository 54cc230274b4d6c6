"""What is drawn of a motion: smooth curves, named paths, shapes, units; little is integrated."""

from collections import Counter

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap

import jaxdyn
from jaxdyn import Trajectory, drawing, effects, scenes, simulate
from jaxdyn.analysis import work_by_effect
from jaxdyn.analysis.regularized import LogarithmicTime
from jaxdyn.drawing.contents import in_time, paths
from jaxdyn.drawing.curves import CURVE_SAMPLES
from jaxdyn.drawing.strokes import coil, dashpot, grounds
from jaxdyn.integrate.events import Reaches
from jaxdyn.integrate.phases import END, Exit, Phase, simulate_phases
from jaxdyn.scenes.satellites import ANTENNAS, SatelliteSketch, antenna_trace


def _motion(scene, ys):
    """Samples that were not integrated."""
    ts = jnp.linspace(0.0, 1.0, len(ys))
    return Trajectory(scene, ts, jnp.asarray(ys), jnp.array(1), jnp.array(0), jnp.array(0))


def _at_start(scene):
    return paths(_motion(scene, np.asarray(scene.y0)[None]))


def _poses(scene):
    """Any states that the system can be in: rigid bodies stay rigid."""
    some = np.random.default_rng(2).normal(size=(12, len(scene.y0)))
    states = jax.jit(jax.vmap(scene.system.project))(jnp.zeros(12), jnp.asarray(some))
    return _motion(scene, states.at[0].set(scene.y0))


def _circle(samples):
    """One turn on the unit circle."""
    scene = scenes.hanging_spring(k=1.0, m=1.0, g=0.0)
    t = np.linspace(0.0, 2 * np.pi, samples)
    zero = 0 * t
    states = np.stack([np.cos(t), np.sin(t), zero, -np.sin(t), np.cos(t), zero], axis=1)
    return Trajectory(scene, jnp.asarray(t), states, jnp.array(1), jnp.array(0), jnp.array(0))


@pytest.mark.parametrize(("samples", "missed"), [(4, 3e-3), (7, 4e-5), (61, 1e-10)])
def test_the_curve_between_few_samples_is_the_motion(samples, missed):
    motion = _circle(samples)
    drawn = paths(motion)
    assert CURVE_SAMPLES <= len(drawn.ts) < CURVE_SAMPLES + samples
    exact = np.stack([np.cos(drawn.ts), np.sin(drawn.ts), 0 * drawn.ts], axis=1)
    assert gap(drawn.xyz[:, 0], exact) < missed
    every = (len(drawn.ts) - 1) // (samples - 1)
    assert gap(drawn.xyz[::every], motion.r) == 0
    assert gap(drawn.ts[::every], motion.ts) == 0


def test_as_many_samples_as_a_curve_needs_stay_as_they_are():
    motion = _circle(CURVE_SAMPLES + 1)
    assert gap(paths(motion).xyz, motion.r) == 0


@pytest.mark.sample(
    "double_pendulum-names0",
    "four_bar-names1",
    "n_pendulum-names2",
    "cart_pendulum-names3",
    "cylinder_on_ramp-names6",
    "turntable-names10",
    "three_body-names11",
    "pendulum-names12",
)
@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("double_pendulum", ("hinge 1", "tip")),  # not the hinge that rests, not the bars' middles
        ("four_bar", ("hinge 1", "hinge 2")),
        ("n_pendulum", ("hinge 1", "hinge 2", "hinge 3", "tip")),
        ("cart_pendulum", ("cart", "mass")),
        ("car", ("front axle", "rear axle")),
        ("two_skates", ("skate 1", "skate 2")),
        ("cylinder_on_ramp", ("centre of mass", "mark on the rim")),
        ("rolling_disk", ("contact with the ground", "centre")),
        ("satellite", ("antenna 1", "antenna 2")),
        ("top", ("tip of the axis",)),
        ("turntable", ("mass",)),  # which slides along the table
        ("three_body", ("body 1", "body 2", "body 3")),
        ("pendulum", ()),  # nothing to tell apart
    ],
)
def test_the_paths_that_are_drawn_have_names(name, names):
    drawn = _at_start(getattr(scenes, name)())
    assert drawn.names == names
    assert drawn.xyz.shape[1] == max(len(names), 1)


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("spring_mass", {"spring": 1, "pin": 1}),
        ("two_springs", {"spring": 2, "pin": 2}),
        ("pendulum", {"line": 1, "pin": 1}),
        ("shaken_pendulum", {"line": 1, "area": 1}),
        ("cart_pendulum", {"line": 1, "area": 1, "ground": 1}),
        ("pinned_chain", {"line": 1, "pin": 2}),
        ("skate_chain", {"line": 1, "pin": 1, "solid": 1}),
        ("car", {"area": 1, "solid": 4}),
        ("two_skates", {"area": 1, "line": 2, "solid": 2}),
        ("cylinder_on_ramp", {"ground": 1, "area": 1, "line": 1}),
        ("rolling_disk", {"area": 1, "line": 2}),
        ("turntable", {"area": 1, "line": 1, "pin": 1}),
        ("plate", {"ground": 2, "line": 2, "pin": 1}),
        ("box", {"line": 12}),
        ("satellite", {"line": 12 + 2 * 3 + 2}),  # the cube, three circles a ball, two antennas
        ("top", {"line": 1 + 1 + 4}),
        ("two_body", {}),
    ],
)
def test_what_moves_is_drawn_as_it_is(name, kinds):
    drawn = _at_start(getattr(scenes, name)())
    found = Counter()
    for kind, at in drawn.shapes:
        found[kind] += at.shape[1]
    assert found == kinds


def test_the_slot_of_a_turntable_ends_at_its_rim_or_where_the_mass_is():
    scene = scenes.turntable(d=0.5)
    table, slot, *_ = scene.system.sketch(jnp.zeros(()), scene.y0)
    rim = np.linalg.norm(table.at, axis=-1)
    np.testing.assert_allclose(np.linalg.norm(slot.at, axis=-1), rim.max(), rtol=1e-12)
    out = scene.y0.at[1].set(7.0)
    _, slot, _, mass = scene.system.sketch(jnp.zeros(()), out)
    ends, there = (np.asarray(shape.at).reshape(-1, 2) for shape in (slot, mass))
    assert np.linalg.norm(ends - there, axis=-1).min() < 1e-12


def test_the_parts_of_a_car_are_where_they_are():
    scene = scenes.car(to_front=1.0, to_rear=2.0)
    turned = _motion(scene, np.array([[5.0, 1.0, np.pi / 2, 0.0, 0.0, 0.0]]))
    drawn = paths(turned)
    np.testing.assert_allclose(drawn.xyz[0], [[5.0, 2.0], [5.0, -1.0]], atol=1e-12)
    body, *wheels = (at[0, 0] for _, at in drawn.shapes)
    middles = np.array([wheel.mean(axis=0) for wheel in wheels])
    np.testing.assert_allclose(sorted(middles[:, 1]), [-1.0, -1.0, 2.0, 2.0], atol=1e-12)
    inside = (body.min(axis=0) < middles) & (middles < body.max(axis=0))
    assert inside.all()
    # They point along the car.
    assert all(np.ptp(wheel[:, 1]) > 2 * np.ptp(wheel[:, 0]) for wheel in wheels)


@pytest.mark.sample("matrix")
@pytest.mark.parametrize("representation", ["quaternion", "matrix", "euler"])
def test_antennas_are_drawn_where_their_tips_are(representation):
    scene = scenes.satellite("B", representation=representation, t1=3.0)
    motion = simulate(scene, samples=CURVE_SAMPLES + 1)
    for i, tip in enumerate(ANTENNAS):
        assert gap(paths(motion).xyz[:, i], antenna_trace(motion, "B", tip)) < 100 * EXACT


def test_a_rigid_body_keeps_its_shape_on_the_curve():
    drawn = paths(_poses(scenes.box()))
    ((_, edges),) = drawn.shapes
    lengths = np.linalg.norm(edges[:, :, 1] - edges[:, :, 0], axis=-1)
    sampled = lengths[:: (len(lengths) - 1) // 11]
    assert gap(sampled, np.broadcast_to(lengths[0], sampled.shape)) < 10 * EXACT


def test_a_drawing_of_a_ledger_and_of_logarithmic_time_is_that_of_their_system():
    scene = scenes.double_pendulum()
    plain, more = (
        _at_start(scene),
        _at_start(work_by_effect.with_work(scene, effects.UniformGravity)),
    )
    for one, other in zip(plain.shapes, more.shapes, strict=True):
        assert gap(one.at, other.at) == 0
    bound = scenes.spring_mass(position=(1.0, 0.0), g=0.0)
    system = LogarithmicTime(bound.system)
    assert system.sketch(jnp.zeros(()), jnp.append(bound.y0, jnp.zeros(2))) == ()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cylinder_on_cylinder", "cylinder_on_ramp"])
def test_rims_move_with_the_cylinder_and_touch_what_they_roll_on(name):
    scene = getattr(scenes, name)(t1=0.6)
    drawn = paths(simulate(scene, samples=20))
    r = float(scene.system.r)
    (_, surfaces), (_, rims), (_, arms) = drawn.shapes
    for sample in (0, 700, len(drawn.ts) - 1):
        surface, rim, arm = (at[sample, 0] for at in (surfaces, rims, arms))
        np.testing.assert_allclose(np.linalg.norm(rim - arm[0], axis=1), r, rtol=1e-6)
        if name == "cylinder_on_ramp":
            across = surface[1] - surface[0]
            gap_to_ramp = abs(
                across @ np.array([[0.0, 1.0], [-1.0, 0.0]]) @ (arm[0] - surface[0])
            ) / np.linalg.norm(across)
            np.testing.assert_allclose(gap_to_ramp, r, rtol=1e-6)
        else:
            fixed = np.linalg.norm(surface, axis=1)
            np.testing.assert_allclose(np.linalg.norm(arm[0]) - fixed, r, rtol=1e-6)


def test_a_ramp_is_drawn_as_far_as_the_motion_goes():
    scene = scenes.cylinder_on_ramp(t1=2.0)
    drawn = paths(simulate(scene, samples=20))
    (ramp,) = grounds(drawn)
    assert ramp[0, 0] < drawn.xyz[..., 0].min()
    assert ramp[1, 0] > drawn.xyz[..., 0].max()
    slope = (ramp[1] - ramp[0])[1] / (ramp[1] - ramp[0])[0]
    np.testing.assert_allclose(slope, -np.tan(0.2), rtol=1e-9)


@pytest.mark.slow
def test_the_disk_touches_the_ground_where_its_contact_path_is():
    scene = scenes.rolling_disk(t1=1.0)
    drawn = paths(simulate(scene, samples=30))
    ((_, rims), _) = drawn.shapes
    contact = drawn.xyz[:, 0]
    assert np.abs(contact[:, 2]).max() < 1e-6  # on the curve; 0 at samples
    nearest = np.linalg.norm(rims[:, 0] - contact[:, None], axis=-1).min(axis=1)
    assert nearest.max() < 0.04  # half a side of the polygon that the rim is drawn as


def test_springs_reach_from_end_to_end_with_coils_that_stretch():
    for end in ([3.0, 4.0], [1.0, 2.0, 2.0]):
        ends = np.array([np.zeros(len(end)), end])
        short, long = coil(ends, 0.1), coil(2 * ends, 0.1)
        np.testing.assert_array_equal(short[[0, -1]], ends)
        assert short.shape == long.shape
        along = ends[1] / np.linalg.norm(ends[1])
        off = short - (short @ along)[:, None] * along
        np.testing.assert_allclose(np.linalg.norm(off, axis=1).max(), 0.1, rtol=1e-9)
    assert np.isfinite(coil(np.zeros((2, 2)), 0.1)).all()


def test_a_dashpot_joins_its_ends():
    ends = np.array([[0.0, 0.0], [2.0, 1.0]])
    near, far, *_ = dashpot(ends, 0.1)
    np.testing.assert_array_equal([near[0], far[-1]], ends)


@pytest.mark.slow
def test_what_acts_in_one_phase_only_is_left_out():
    pulled = scenes.spring_mass(g=0.0)
    gone = pulled.without(effects.Spring)
    phases = {
        "held": Phase(pulled, (Exit(Reaches(0, 0.5, -1), "free"),)),
        "free": Phase(gone, (Exit(Reaches(0, -9.0, -1), END),)),
    }
    chain = simulate_phases(phases, "held", pulled.y0, 1.0, samples=5)
    drawn = paths(chain)
    assert drawn.shapes == ()
    assert len(drawn.corners) == 1


def test_units_are_said_unless_the_scene_has_none():
    eight = scenes.three_body()
    drawn = paths(_poses(eight))
    assert (drawn.labels, drawn.second) == (("x", "y"), "")
    solar = eight.without(effects.PairGravity) + effects.PairGravity(6.674e-11)
    drawn = paths(_poses(solar))
    assert (drawn.labels, drawn.second) == (("x [m]", "y [m]"), " s")


def test_a_state_without_points_is_drawn_itself():
    motion = simulate(scenes.lorenz(), 1.0, samples=5)
    drawn = paths(motion)
    assert (drawn.labels, drawn.second) == (("x", "y", "z"), "")
    assert gap(drawn.xyz[:: (len(drawn.ts) - 1) // 4, 0], motion.ys) == 0


def test_even_times_of_uneven_samples():
    uneven = simulate(scenes.cannonball(), samples=[0.0, 0.05, 0.1, 1.0])
    drawn = paths(uneven)
    at = in_time(drawn, 5)
    assert (at[0], at[-1]) == (0, len(drawn.ts) - 1)
    assert gap(drawn.ts[at], np.linspace(0, 1, 5)) < 1.0 / 666
    backwards = paths(simulate(scenes.cannonball(), -1.0, samples=20))
    assert gap(backwards.ts[in_time(backwards, 3)], np.array([0.0, -0.5, -1.0])) < 1e-3


def test_a_satellite_of_no_known_name_is_refused_where_it_is_drawn():
    with pytest.raises(ValueError, match="name: expected one of A, B, C, got 'Z'"):
        SatelliteSketch("Z")(np.zeros((6, 3)))


def test_chosen_entries_of_a_state_are_drawn():
    def rate(t, y):
        return [y[1], -y[0], y[3], -4.0 * y[2]]

    labels = [("a", "m"), ("va", "m/s"), ("b", "m"), ("vb", "m/s")]
    scene = jaxdyn.ode(rate, [1.0, 0.0, 0.5, 0.0], 3.0, names=labels)
    motion = simulate(scene, samples=50)
    with pytest.raises(ValueError, match="Choose some with entries="):
        drawing.trajectory(motion)
    (panel,) = drawing.trajectory(motion, entries=("a", "b")).axes
    assert [panel.get_xlabel(), panel.get_ylabel()] == ["a [m]", "b [m]"]
    assert panel.get_aspect() == 1.0
    xyz = paths(motion, ("a", "b")).xyz[:, 0]
    ts = paths(motion, ("a", "b")).ts
    assert np.abs(xyz - np.stack([np.cos(ts), 0.5 * np.cos(2 * ts)], axis=1)).max() < 1e-8
    assert drawing.trajectory(motion, entries=("a", "va")).axes[0].get_aspect() == "auto"
    assert len(drawing.projections(motion, entries=("a", "b", "va")).axes) == 3
    swing = simulate(scenes.pendulum(), samples=20)
    (panel,) = drawing.trajectory(swing, entries=("theta", "theta_dot")).axes
    assert panel.get_xlabel() == "theta [rad]"
    for entries in (("a",), ("a", "c"), "ab", ("a", "b", "va", "vb")):
        with pytest.raises(ValueError, match="entries: expected"):
            drawing.trajectory(motion, entries=entries)


@pytest.mark.parametrize(
    ("centre", "radius", "near"),
    [(-0.01215, 0.02, ["Earth"]), (0.98785, 0.02, ["Moon"]), (0.5, 0.01, []), (0.5, 0.3, 2)],
)
def test_bodies_near_the_path_are_drawn_with_their_names(centre, radius, near):
    near = ["Earth", "Moon"] if near == 2 else near
    scene = scenes.restricted_three_body_in_space(system="earth-moon")
    angle = np.linspace(0.0, 6.0, 30)
    x, y = centre + radius * np.cos(angle), radius * np.sin(angle)
    ys = np.stack([x, y, 0 * x, 0 * x, 0 * x, 0 * x], axis=1)
    motion = _motion(scene, 389703.264829278 * ys)
    drawn = paths(motion)
    assert [name for name, _ in drawn.marks] == near
    xs = {"Earth": -0.01215058560962404, "Moon": 1 - 0.01215058560962404}
    for name, at in drawn.marks:
        np.testing.assert_allclose(at, [389703.264829278 * xs[name], 0.0, 0.0], rtol=1e-15)
    for figure in (drawing.trajectory(motion), drawing.projections(motion)):
        for ax in figure.axes:
            texts = {text.get_text().strip() for text in ax.texts}
            assert set(near) <= texts
