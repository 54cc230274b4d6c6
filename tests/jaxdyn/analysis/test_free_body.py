"""Free bodies: the forces on each body against closed forms, other formulations and m a."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
from jaxdyn import effects, scenes, simulate
from jaxdyn.analysis import constraints
from jaxdyn.analysis.free_body import BALANCE, EFFECT, MULTIPLIER, free_body
from jaxdyn.formulations.constrained import Constrained
from jaxdyn.scene import Effect, Scene

#: Scenes whose equations are not forces on known bodies: frames that turn, prescribed motions,
#: matrices.
WITHOUT = {
    "hill",
    "linear_system",
    "lorenz",
    "moved_box",
    "moved_shape",
    "restricted_three_body",
    "restricted_three_body_in_space",
    "turned_box",
}
WITH = sorted({*scenes.catalogue.entries()} - WITHOUT)
#: Other formulations of scenes than the ones they have by default.
ROUTES = [
    *((name, {"formulation": "lagrange"}) for name in ("bead_on_cycloid", "turntable")),
    *(
        (name, {"formulation": way})
        for name in ("pendulum", "cart_pendulum", "double_pendulum", "bead_on_parabola")
        for way in ("lagrange", "constrained")
    ),
    *(("four_bar", {"formulation": way}) for way in ("newton_euler", "lagrange", "loop")),
    ("pinned_chain", {"formulation": "constrained"}),
    ("dumbbell", {"formulation": "newton_euler"}),
    ("rod_on_line", {"formulation": "newton_euler"}),
    *(
        (name, {"representation": how})
        for name in ("top", "free_body")
        for how in ("matrix", "euler")
    ),
    ("rolling_disk", {"rough": False}),
    ("double_pendulum", {"uniform": False}),
    ("double_pendulum", {"uniform": False, "formulation": "constrained"}),
]


def _moved(scene: Scene) -> tuple[float, jax.Array]:
    """A state on the way, where nothing is at rest or symmetric any more."""
    t = 0.37 * min(float(scene.t1), 1.0)
    motion = simulate(scene, t, samples=2, throw=False)
    return t, motion.ys[-1]


def _check(scene: Scene, t, y) -> None:
    found = free_body(scene, t, y)
    assert found.determined
    assert found.residual < 1e-12
    for body in found.bodies:
        off = np.linalg.norm(body.force - body.m * body.acceleration)
        nothing_acts = found.largest < 1e-14 * body.inertial[0]
        assert nothing_acts or off <= 1e-12 * found.largest


@pytest.mark.sample(
    "ball_on_table",
    "car",
    "impact_oscillator",
    "pinned_chain",
    "polar_particle",
    "rimless_wheel",
    "shaken_pendulum",
    "sideways_pendulum",
    "simplest_walker",
    "skate_chain",
    "three_body_circular",
    "two_springs",
)
@pytest.mark.parametrize("name", WITH)
def test_the_forces_on_every_body_add_up_to_what_moves_it(name):
    scene = scenes.catalogue.entry(name).make()
    _check(scene, 0.0, scene.y0)


@pytest.mark.sample("bead_on_parabola")
@pytest.mark.parametrize("name", WITH)
def test_they_do_on_the_way(name):
    scene = scenes.catalogue.entry(name).make()
    _check(scene, *_moved(scene))


@pytest.mark.parametrize(("name", "options"), ROUTES)
@pytest.mark.slow
def test_they_do_in_every_formulation(name, options):
    scene = scenes.catalogue.entry(name).make(**options)
    for t, y in ((0.0, scene.y0), _moved(scene)):
        _check(scene, t, y)


@pytest.mark.parametrize("name", sorted(WITHOUT))
def test_scenes_without_forces_on_bodies_are_refused(name):
    with pytest.raises(ValueError, match=r"^scene: expected one whose bodies are known, got "):
        free_body(scenes.catalogue.entry(name).make())


def _decay(t, y):
    return -y


def test_an_ode_is_refused():
    with pytest.raises(ValueError, match=r"bodies are known, got Ode\. .*\(an ode, "):
        free_body(jaxdyn.ode(_decay, [1.0]))


def test_a_pendulum_by_hand():
    scene = scenes.pendulum(m=2.0, length=3.0, angle=0.7, g=9.81)
    y = jnp.array([0.7, 1.3])
    (mass,) = free_body(scene, 0.0, y).bodies
    weight, stick = mass.forces
    tension = 2.0 * 3.0 * 1.3**2 + 2.0 * 9.81 * np.cos(0.7)
    to_hinge = np.array([-np.sin(0.7), np.cos(0.7)])
    np.testing.assert_allclose(stick.force, tension * to_hinge, rtol=1e-14)
    np.testing.assert_allclose(weight.force, [0.0, -19.62], rtol=1e-15)
    assert (weight.name, weight.source) == ("weight", EFFECT)
    assert (stick.name, stick.source) == ("stick", BALANCE)
    np.testing.assert_allclose(stick.at, [3.0 * np.sin(0.7), -3.0 * np.cos(0.7)], rtol=1e-15)


def test_a_rolling_disk_by_hand():
    # Upright and straight: no friction, and the normal force is the weight.
    disk = scenes.rolling_disk(jnp.pi / 2, precession=0.0, spin=3.0, m=2.0, g=9.81)
    (body,) = free_body(disk).bodies
    forces = {f.name: f for f in body.forces}
    assert forces["normal force"].source == forces["friction"].source == MULTIPLIER
    np.testing.assert_allclose(forces["normal force"].force, [0.0, 0.0, 19.62], atol=1e-14)
    np.testing.assert_allclose(forces["friction"].force, 0.0, atol=1e-14)
    np.testing.assert_allclose(forces["normal force"].at - body.centre, [0, 0, -0.5], atol=1e-15)


def test_a_cylinder_on_a_ramp_by_hand():
    # A uniform cylinder that rolls down: friction m g sin(slope) / 3, up the ramp.
    slope, m, g = 0.2, 1.5, 9.81
    scene = scenes.cylinder_on_ramp(d=0.0, slope=slope, m=m, g=g, inertia=0.5 * m, r=1.0)
    (body,) = free_body(scene).bodies
    forces = {f.name: f.force for f in body.forces}
    down, up = np.array([np.cos(slope), -np.sin(slope)]), np.array([np.sin(slope), np.cos(slope)])
    np.testing.assert_allclose(forces["friction"], -m * g * np.sin(slope) / 3 * down, rtol=1e-13)
    np.testing.assert_allclose(forces["normal force"], m * g * np.cos(slope) * up, rtol=1e-13)


def test_the_friction_of_a_locked_axle_acts_at_the_axle():
    scene = scenes.car()
    (car,) = free_body(scene).bodies
    friction = next(f for f in car.forces if f.name == "friction")
    locked = scene.effects[0]
    np.testing.assert_allclose(np.linalg.norm(friction.force), locked.mu * locked.load, rtol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(friction.at - car.centre), abs(locked.ahead))
    np.testing.assert_allclose(friction.couple, 0.0, atol=1e-10)


#: Scenes whose forces in joints are multipliers in one formulation, and found from the balance of
#: forces in another.
BOTH = ["pendulum", "cart_pendulum", "double_pendulum", "bead_on_parabola", "four_bar", "dumbbell"]


@pytest.mark.sample("pendulum", "bead_on_parabola", "four_bar")
@pytest.mark.parametrize("name", BOTH)
def test_forces_from_the_balance_are_the_multipliers(name):
    make = scenes.catalogue.entry(name).make
    free, tied = (make(formulation=way) for way in ("newton_euler", "constrained"))
    t, y = _moved(free)
    y = y if name != "dumbbell" else free.y0
    place = _in_place(name, free, tied)
    z = place(t, y) if y is not free.y0 else tied.y0
    ones, others = (free_body(scene, t, at) for scene, at in ((free, y), (tied, z)))
    sources = {f.source for body in others.bodies for f in body.forces}
    assert MULTIPLIER in sources
    for one, other in zip(ones.bodies, others.bodies, strict=True):
        wanted = {f.name.split()[0] + f.name[-1]: f for f in other.forces}
        for f in one.forces:
            twin = wanted[f.name.split()[0] + f.name[-1]] if len(wanted) > 1 else other.forces[0]
            assert f.source in (EFFECT, BALANCE)
            np.testing.assert_allclose(f.force, twin.force, atol=1e-12 * ones.largest)
            np.testing.assert_allclose(f.at, twin.at, atol=1e-13)


def _in_place(name, free, tied):
    """The state of the tied scene in that of the free one."""
    mechanism = free.system.mechanism
    maps = {
        "pendulum": lambda t, q: mechanism.end(t, q),
        "cart_pendulum": lambda t, q: mechanism.cartesian(t, q),
        "double_pendulum": lambda t, q: mechanism.free_bars(t, q),
        "four_bar": lambda t, q: mechanism.free_bars(t, q),
        "bead_on_parabola": lambda t, q: mechanism.place(t, q),
        "dumbbell": lambda t, q: mechanism.place(t, q),
    }

    def place(t, y):
        q, v = jnp.split(y, 2)
        t = jnp.asarray(t, float)
        moved = jax.jvp(lambda q: maps[name](t, q), (q,), (v,))
        return jnp.concatenate(moved)

    assert isinstance(tied.system, Constrained)
    return place


@pytest.mark.slow
def test_the_forces_in_hinges_are_what_reactions_add_up_to():
    scene = scenes.triple_pendulum()
    motion = simulate(scene, 0.5, samples=3)
    found = free_body(scene, motion.ts[-1], motion.ys[-1])
    on_ground = np.asarray(constraints.reactions(motion)[-1]).sum(axis=0)
    hinge = next(f for f in found.body("bar 1").forces if f.name == "hinge 1")
    np.testing.assert_allclose(hinge.force, on_ground, rtol=1e-12)


def test_springs_and_attractions_are_shown_one_by_one():
    system = scenes.n_body().system
    net = effects.SpringNetwork(((0, 1), (1, 2), (2, 0)), 3.0, jnp.array([0.1, 0.2, 0.3]))
    scene = Scene(system, (net,), y0=scenes.n_body().y0)
    found = free_body(scene)
    assert [f.name for f in found.bodies[0].forces] == ["spring of body 2", "spring of body 3"]
    total = net.force(0.0, *scene.points(0.0, scene.y0))
    for body, force in zip(found.bodies, np.asarray(total), strict=True):
        np.testing.assert_allclose(body.force, force, rtol=1e-13, atol=1e-15)


class Motor(Effect):
    """A torque on every coordinate."""

    torque: jax.Array

    def generalized(self, t, q, v):
        return self.torque * jnp.ones_like(v)


def test_a_torque_on_an_absolute_angle_is_a_couple_on_its_bar():
    scene = scenes.double_pendulum() + Motor(jnp.array(0.3))
    found = free_body(scene)
    assert found.residual < 1e-14
    for body in found.bodies:
        motor = next(f for f in body.forces if f.name == "motor")
        np.testing.assert_array_equal(motor.force, 0.0)
        np.testing.assert_allclose(motor.couple, 0.3)


def test_a_torque_on_a_body_in_space_is_in_its_own_axes():
    scene = scenes.top() + Motor(jnp.array(0.2))
    t, y = _moved(scene)
    (body,) = free_body(scene, t, y).bodies
    motor = next(f for f in body.forces if f.name == "motor")
    R = np.asarray(jaxdyn.formulations.rigid.pose(scene, t, y).R_wb)
    np.testing.assert_allclose(R.T @ motor.couple, [0.2, 0.2, 0.2], rtol=1e-14)
    assert free_body(scene, t, y).residual < 1e-12


def test_forces_on_other_coordinates_are_refused():
    scene = scenes.turntable() + Motor(jnp.array(0.3))
    with pytest.raises(ValueError, match=r"^motor: expected forces on points, .* got forces on "):
        free_body(scene)


def test_a_system_that_describes_its_bodies_wrongly_is_refused():
    mechanism = type(scenes.pendulum().system.mechanism)

    class Loose(mechanism):
        """A stick that forgets its hinge."""

        def joints(self, t, q):
            return ()

    stick = Loose(m=jnp.array(1.0), l=jnp.array(1.0))
    scene = Scene(
        type(scenes.pendulum().system)(stick), (effects.UniformGravity(9.81),), y0=[0.3, 0.0]
    )
    with pytest.raises(
        ValueError, match=r"forces give their accelerations, .* `bodies` and `joints`"
    ):
        free_body(scene)


def test_more_rods_than_needed_leave_the_forces_undetermined():
    from jaxdyn.mechanisms.rods import Rods

    points = jnp.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    pairs = ((0, 1), (1, 3), (3, 2), (2, 0), (0, 3), (1, 2))
    r2 = 2**0.5
    rods = Rods(jnp.ones(4), jnp.array([1.0, 1.0, 1.0, 1.0, r2, r2]), pairs)
    spin = jnp.stack([-points[:, 1], points[:, 0]], axis=1)
    y0 = jnp.concatenate([points.ravel(), spin.ravel()])
    found = free_body(Scene(Constrained(rods), y0=y0))
    assert found.residual < 1e-12


def test_what_it_says():
    text = str(free_body(scenes.pendulum(m=2.0, angle=0.0)))
    assert "weight  (0, -19.62) N at (0, -1) m" in text
    assert "found from the balance" in text
    assert "N" not in str(free_body(scenes.three_body())).replace("None", "")
    with pytest.raises(ValueError, match="bar 3"):
        free_body(scenes.double_pendulum()).body("bar 3")


@pytest.mark.slow
@pytest.mark.parametrize(("x", "friction"), [(0.2, 0.2), (-0.3, -0.3), (0.5, 0.3)])
def test_friction_holds_a_body_up_to_its_limit(x, friction):
    """A spring of 1 N/m pulls a block at rest with -x, friction holds up to 0.3 N."""
    (body,) = free_body(scenes.oscillator(x=x) + effects.DryFriction(0.3, 1.0)).bodies
    forces = {force.name: float(force.force[0]) for force in body.forces}
    assert forces == pytest.approx({"spring": -x, "dry friction": friction}, abs=1e-15)
    assert float(body.acceleration[0]) == pytest.approx(friction - x, abs=1e-15)
