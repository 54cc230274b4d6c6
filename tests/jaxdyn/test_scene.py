"""Scenes: their composition, what is compiled for them, and what they refuse."""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, SOLVED, ZOO, Arm, gap, kepler, primitives, refusal

import jaxdyn
from jaxdyn import Effect, Scene, System, scenes, simulate, solve
from jaxdyn._numerics import safe_norm
from jaxdyn.accuracy.timing import Clock
from jaxdyn.analysis.work_by_effect import with_work
from jaxdyn.effects import LinearDrag, PairGravity, QuadraticDrag, UniformGravity
from jaxdyn.formulations.lagrange import Lagrange
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.scene import _rate
from jaxdyn.scenes import catalogue, skates
from orbits.orbit import Outcome

Y0 = [0.0, 0.0, 3.0, 4.0]


def _ball(*effects: Effect) -> Scene:
    return Scene(FreePoints(2.0), effects, y0=Y0)


def _program(scene: Scene) -> str:
    return jax.jit(lambda scene: scene.rate(0.0, scene.y0)).lower(scene).as_text()


def test_effects_add_up():
    gravity, drag = UniformGravity(10.0), LinearDrag(0.5)
    scene = _ball(gravity) + drag
    assert scene.effects == (gravity, drag)
    # m a = -m g e_y - c v
    assert gap(scene.rate(0.0, scene.y0), [3.0, 4.0, -0.75, -11.0]) < EXACT
    assert gap(sum([drag], _ball(gravity)).rate(0.0, scene.y0), scene.rate(0.0, scene.y0)) == 0
    np.testing.assert_array_equal(_ball().rate(0.0, scene.y0), [3.0, 4.0, 0.0, 0.0])


def test_the_rate_of_all_scenes_of_a_kind_is_one_program():
    _rate.clear_cache()
    for t, drag in ((0.0, 0.5), (np.float64(0.0), 0.7), (0, 0.9)):
        here = _ball(UniformGravity(10.0), LinearDrag(drag))
        assert gap(here.rate(t, here.y0), [3.0, 4.0, -1.5 * drag, -10 - 2 * drag]) < EXACT
    assert _rate._cache_size() == 1


def test_the_rate_notices_a_captured_number_that_has_changed():
    stiffness = 2.0

    def rate(t, y):
        return [y[1], -stiffness * y[0]]

    spring = jaxdyn.ode(rate, [1.0, 0.0], 1.0)
    np.testing.assert_array_equal(spring.rate(0.0, spring.y0), [0.0, -2.0])
    stiffness = 3.0
    with pytest.raises(ValueError, match="captured numbers that have not changed, got another val"):
        spring.rate(0.0, spring.y0)


def test_adding_leaves_the_scene_as_it_was():
    scene = _ball(UniformGravity())
    _ = scene + LinearDrag(0.5)
    assert len(scene.effects) == 1


def test_only_effects_can_be_added():
    with pytest.raises(ValueError, match=r"^effect: expected an Effect, got 3\.$"):
        _ = _ball() + 3
    with pytest.raises(ValueError, match=r"got QuadraticDrag\. Call it: QuadraticDrag\(\.\.\.\)\."):
        _ = _ball() + QuadraticDrag
    with pytest.raises(ValueError, match=r"got UniformGravity\. Call it: UniformGravity\(\)\."):
        _ = _ball() + UniformGravity
    with pytest.raises(ValueError, match=r"^effect: expected an Effect, got int\."):
        _ = _ball() + int


def test_without_leaves_out_all_of_a_kind():
    scene = _ball(LinearDrag(0.1), UniformGravity(), LinearDrag(0.2))
    assert [type(e) for e in scene.without(LinearDrag).effects] == [UniformGravity]
    assert scene.without(Effect).effects == ()


@pytest.mark.parametrize(("effects", "has"), [((), "none"), ((UniformGravity(),) * 2, "U.*, U.*")])
def test_without_refuses_what_is_not_there(effects, has):
    message = rf"^without: expected an effect of the scene \({has}\), got QuadraticDrag\.$"
    with pytest.raises(ValueError, match=message):
        _ball(*effects).without(QuadraticDrag)


def test_starting_takes_some_entries_by_name():
    scene = scenes.pendulum(angle=0.3)
    assert scene.starting({"theta_dot": 2.0}).y0.tolist() == [0.3, 2.0]
    by_name = jax.grad(lambda w: jnp.prod(scene.starting({"theta_dot": w}).y0))
    assert float(by_name(2.0)) == 0.3
    swing = jaxdyn.ode(lambda t, y: {"x": y["v"], "v": -y["x"]}, {"x": 1.0, "v": 0.0}, 2.0)
    assert swing.system.tree(swing.starting({"x": 3.0}).y0)["x"] == 3.0
    with pytest.raises(ValueError, match="y0: expected one of theta, theta_dot, got 'speed'"):
        scene.starting({"speed": 1.0})
    with pytest.raises(ValueError, match=r"theta: expected shape \(\), got shape \(2,\)"):
        scene.starting({"theta": [1.0, 2.0]})


def test_starting_takes_another_start_and_span():
    scene = Scene(FreePoints(2.0), (UniformGravity(),), y0=Y0, t1=3.0)
    other = scene.starting([1, 2, 3, 4])
    np.testing.assert_array_equal(other.y0, [1.0, 2.0, 3.0, 4.0])
    assert (float(other.t1), float(scene.starting(Y0, 5).t1)) == (3.0, 5.0)
    assert other.effects == scene.effects
    assert other.y0.dtype == jnp.float64


def test_a_scene_keeps_its_name():
    ball = scenes.cannonball(drag=0.1)
    assert ball.name == "cannonball"
    others = (ball + UniformGravity(), ball.without(QuadraticDrag), ball.starting(2 * ball.y0))
    assert {other.name for other in others} == {"cannonball"}
    assert jax.jit(lambda scene: scene.starting(2 * scene.y0))(ball).name == "cannonball"
    assert Scene(FreePoints(2.0), y0=Y0).name == ""


def test_a_name_compiles_nothing_anew_to_simulate_and_is_not_mistaken():
    one, other = (dataclasses.replace(_ball(UniformGravity()), name=name) for name in "ab")
    motions = [simulate(one, 0.3, samples=3)]
    clock = Clock()
    motions.append(simulate(other, 0.3, samples=3))
    assert clock.compiling == 0
    assert [motion.scene.name for motion in motions] == ["a", "b"]


def test_an_effect_taken_out_leaves_no_trace_in_the_program():
    plain = _ball(UniformGravity())
    assert _program((plain + QuadraticDrag(0.1)).without(QuadraticDrag)) == _program(plain)
    assert _program(scenes.cannonball(drag=0.0)) == _program(scenes.cannonball())
    assert _program(plain + QuadraticDrag(0.1)) != _program(plain)


def test_only_effects_of_the_scene_are_compiled():
    plain = _ball(UniformGravity())
    drag = plain + QuadraticDrag(0.1)
    assert "sqrt" in primitives(drag.rate, 0.0, drag.y0)
    assert "sqrt" not in primitives(plain.rate, 0.0, plain.y0)
    empty = primitives(_ball().rate, 0.0, plain.y0)
    # They only move numbers and fix the type of the time; indexing is `unstack` from JAX 0.11 on,
    # and within a `jit`, whose contents are listed too, from 0.12 on.
    moves = {"reshape", "slice", "squeeze", "broadcast_in_dim", "concatenate", "unstack", "jit"}
    assert set(empty) <= moves | {"convert_element_type"}
    # A coefficient that happens to be zero is a number like any other: the effect is there.
    zero = plain + QuadraticDrag(0.0)
    assert primitives(zero.rate, 0.0, zero.y0) == primitives(drag.rate, 0.0, drag.y0)


def test_velocity_dependence_comes_from_the_effects():
    assert _ball().second_order
    assert _ball(UniformGravity(), PairGravity()).second_order
    assert not _ball(UniformGravity(), LinearDrag(0.1)).second_order
    assert not Scene(FirstOrder(), y0=Y0).second_order


class FirstOrder(FreePoints):
    """A system that makes no promise about its state."""

    second_order: ClassVar[bool] = False

    def __init__(self):
        super().__init__([1.0])


@pytest.mark.parametrize(
    ("n", "d", "names"),
    [
        (1, 3, "x y z vx vy vz"),
        (2, 2, "x1 y1 x2 y2 vx1 vy1 vx2 vy2"),
        (3, 1, "x1 x2 x3 vx1 vx2 vx3"),
    ],
)
def test_labels_name_every_entry(n, d, names):
    labels = FreePoints(np.ones(n), d).labels()
    assert [name for name, _ in labels] == names.split()
    assert [unit for _, unit in labels] == ["m"] * (n * d) + ["m/s"] * (n * d)


def test_kinetic_energy_and_points():
    scene = kepler(0.5)
    r, v, m = scene.system.points(0.0, scene.y0)
    assert gap(r, [[-0.25, 0], [0.25, 0]]) < EXACT
    assert gap(scene.system.kinetic(0.0, scene.y0), 0.5 * np.sum(m[:, None] * v**2)) < EXACT


def test_a_scene_is_a_tree_of_its_numbers():
    scene = _ball(UniformGravity(9.0), LinearDrag(0.1))
    assert all(x.dtype == jnp.float64 for x in jax.tree.leaves(scene))
    slope = jax.grad(lambda s: s.rate(0.0, s.y0)[3])(scene)
    # a_y = -g - c v_y / m
    assert float(slope.effects[0].g) == -1.0
    assert gap(slope.effects[1].c, -4.0 / 2.0) < EXACT
    assert gap(slope.system.m, [0.1 * 4.0 / 4.0]) < EXACT
    assert gap(slope.y0, [0.0, 0.0, 0.0, -0.1 / 2.0]) < EXACT


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (_ball().starting([1.0, 2.0]), r"y0: expected shape \(4,\), got .*each of x, y, vx, vy\.$"),
        (
            _ball().starting([0, 0, np.nan, 0]),
            r"y0: expected finite numbers, got nan at index \[2\]",
        ),
        (_ball().starting(0.0), r"y0: expected shape \(4,\), got shape \(\)"),
        (
            Scene(FreePoints(0.0), y0=Y0),
            r"mass: expected one that is not 0, got no mass at all\. Test particles move among",
        ),
        (scenes.three_body(m=(1, -1, 1)), r"mass: expected >= 0, got -1\.0\. Masses are in kg; 0"),
        (scenes.three_body(m=(1, np.nan, 1)), r"mass: expected finite numbers, got nan at"),
        (scenes.three_body().starting(Y0), r"y0: expected shape \(12,\), got shape \(4,\)"),
        (scenes.three_body(np.zeros(12)), r"y0: expected bodies at different points, got bodies"),
    ],
)
def test_check_refuses(scene, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        scene.check()


def _claiming(law) -> Effect:
    class Claim(Effect):
        velocity_dependent: ClassVar[bool] = False

        def force(self, t, r, v, m):
            return law(r, v)

    return Claim()


@pytest.mark.parametrize(
    "law",
    [
        lambda r, v: -v,
        lambda r, v: safe_norm(v)[:, None] * jnp.ones_like(r),
        lambda r, v: -jnp.sign(v),
        lambda r, v: jnp.where(v > 0, -1.0, 1.0),
    ],
    ids=["linear", "speed", "sign", "where"],
)
def test_a_false_claim_about_velocity_is_refused(law):
    message = (
        r"^Claim: expected a velocity-independent force, as velocity_dependent = False says, "
        r"got one that depends on velocities\. Set velocity_dependent = True in the class\.$"
    )
    with pytest.raises(ValueError, match=message):
        (_ball() + _claiming(law)).check()


def test_a_true_claim_about_velocity_passes():
    (_ball() + _claiming(lambda r, v: -r)).check()
    (_ball() + _claiming(lambda r, v: r / 0.0 - r / 0.0)).check()  # NaN, but not from v


class Lopsided(Effect):
    """A uniform field that pulls unequally, so that a symmetric body feels it too."""

    def potential(self, t, r, m):
        return jnp.sum(r * (1.0 + jnp.arange(r.size, dtype=float)).reshape(r.shape))


class Torque(Effect):
    """1 on each coordinate, whatever it is."""

    def generalized(self, t, q, v):
        return jnp.ones_like(v)


class Fan(Torque):
    """The same, and a wind."""

    def force(self, t, r, v, m):
        return jnp.ones_like(r)


ENTRIES = catalogue.entries()
LOADS = (Lopsided(), LinearDrag(0.7), Torque())


@eqx.filter_jit
def changes(bare, loaded):
    """How much each of the loaded scenes, all of which pass their check, differs in its rate."""
    for scene in loaded:
        scene.check()
    return [jnp.abs(s.rate(0.1, s.y0) - bare.rate(0.1, bare.y0)).max() for s in loaded]


@pytest.mark.sample(*ZOO)
@pytest.mark.parametrize("name", sorted(ENTRIES))
def test_an_effect_changes_the_motion_or_is_refused(name):
    scene = ENTRIES[name].make()
    systems = [scene.system]
    if name == "two_skates":
        systems.append(skates.by_lagrange(scene).system)
    # Not at rest, or a drag does nothing; a state that obeys the ties is not asked for.
    y = scene.y0 + 0.1 * (1.0 + np.arange(len(scene.y0)) % 3)
    for system in systems:
        bare = Scene(system, scene.effects, y0=y)
        for load in LOADS:
            if not load.acts <= system.accepts:
                with pytest.raises(ValueError, match=r"It would be ignored silently\."):
                    (bare + load).check()
        loaded = [bare + load for load in LOADS if load.acts <= system.accepts]
        assert all(change > 1e-6 for change in changes(bare, loaded))


def _given(scene, effect):
    """The scene with an effect that `+` refuses."""
    return Scene(scene.system, (*scene.effects, effect), y0=scene.y0)


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (
            _given(scenes.lorenz(), UniformGravity()),
            r"UniformGravity: expected an effect that Lorenz accepts: none at all, got forces on "
            r"points\. It would be ignored silently\. Leave it out, or use another form",
        ),
        (
            _ball(Torque()),
            r"Torque: expected an effect that FreePoints accepts: forces on points, got forces on",
        ),
        (
            _ball(Fan()),
            r"Fan: expected an effect that FreePoints accepts: forces on points, got forces on",
        ),
        (Scene(FreePoints(2.0), ("drag",), y0=Y0), r"effects: expected effects, got 'drag'\. W"),
        (
            _given(skates.by_lagrange(scenes.two_skates()), LinearDrag(0.1)),
            r"LinearDrag: expected an effect that LagrangeSkates accepts: none at all, got forces",
        ),
        (
            _given(with_work(scenes.polar_particle(LinearDrag(0.1)), LinearDrag), Torque()),
            r"Torque: expected an effect that WorkByEffect accepts: forces on points, got forces",
        ),
    ],
)
def test_an_effect_that_would_be_ignored_is_refused(scene, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        scene.check()
    *_, last = scene.effects
    if isinstance(last, Effect):
        with pytest.raises(ValueError, match=f"^{message}"):
            _ = scene + last


class _Short(Effect):
    velocity_dependent: ClassVar[bool] = True

    def generalized(self, t, q, v):
        return -v[:1]


def test_forces_on_coordinates_of_another_shape_are_refused():
    wrong = r"_Short\.generalized: expected shape \(2,\), got shape \(1,\)\. One for each velocity"
    with pytest.raises(ValueError, match=wrong):
        (scenes.double_pendulum() + _Short()).check()


class _Returning(Effect):
    """A force, a potential, or both, that return what they are given."""

    f: Any = None
    V: Any = None

    @property
    def acts(self):
        return frozenset({"force"})

    def force(self, t, r, v, m):
        return super().force(t, r, v, m) if self.f is None else self.f

    def potential(self, t, r, m):
        return self.V


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        (
            _Returning(jnp.ones(2)),
            r"force: expected shape \(3, 2\), got shape \(2,\)\. One row for",
        ),
        (_Returning(jnp.ones((3, 1))), r"force: expected shape \(3, 2\), got shape \(3, 1\)\."),
        (_Returning(jnp.ones(())), r"force: expected shape \(3, 2\), got shape \(\)\."),
        (_Returning([1.0, 2.0]), r"force: expected an array of shape \(3, 2\), got list\."),
        (
            _Returning(jnp.ones((3, 2), jnp.float32)),
            r"force: expected 64-bit floats, got an array of",
        ),
        (_Returning(jnp.ones((3, 2), complex)), r"force: expected real numbers, got an array of c"),
        (
            _Returning(V=jnp.ones(1)),
            r"potential: expected shape \(\), got shape \(1,\)\. An energy",
        ),
        (_Returning(V=jnp.ones(3)), r"potential: expected shape \(\), got shape \(3,\)\."),
    ],
)
def test_what_an_effect_returns_has_its_shape(effect, message):
    scene = Scene(FreePoints(np.ones(3)), (effect,), y0=np.arange(12.0))
    with pytest.raises(ValueError, match=rf"^_Returning\.{message}"):
        scene.check()
    with pytest.raises(ValueError, match=rf"^_Returning\.{message}"):
        jax.jit(lambda y: scene.starting(y).check())(scene.y0)


@pytest.mark.parametrize("shape", [(), (2,), (3, 1), (1, 2)])
def test_a_force_of_another_shape_is_never_broadcast_where_nothing_is_checked(shape):
    scene = Scene(FreePoints(np.ones(3)), (_Returning(jnp.ones(shape)),), y0=np.arange(12.0))
    for unchecked in (
        lambda: solve(scene, 1.0),
        lambda: jax.grad(lambda x: solve(scene.starting(x * scene.y0), 1.0).y1[0])(1.0),
        lambda: scene.vector_field(0.0, scene.y0),
    ):
        with pytest.raises(ValueError, match=r"^_Returning\.force: expected shape \(3, 2\), got "):
            unchecked()
    rough = Scene(FreePoints(np.ones(3)), (_Returning(V=jnp.ones(3)),), y0=np.arange(12.0))
    with pytest.raises(ValueError, match=r"^_Returning\.potential: expected shape \(\), got "):
        solve(rough, 1.0)


class _Odd(FreePoints):
    """Three points, one of whose methods returns another shape."""

    method: str = eqx.field(static=True, default="force")

    def __init__(self, method: str):
        super().__init__(np.ones(3))
        self.method = method

    def rate(self, t, y, effects):
        return super().rate(t, y, effects)[: 1 if self.method == "rate" else None]

    def kinetic(self, t, y):
        return super().kinetic(t, y) * (jnp.ones(3) if self.method == "kinetic" else 1.0)

    def energies(self, t, y, effects):
        return (y[:2],) if self.method == "energies" else super().energies(t, y, effects)

    def integrals(self, t, y):
        return {"area": jnp.ones((2, 2))} if self.method == "integrals" else {}

    def difference(self, y1, y0):
        return (y1 - y0)[: 1 if self.method == "difference" else None]

    def points(self, t, y):
        points = super().points(t, y)
        if self.method == "points.r":
            return points._replace(r=points.r.ravel())
        if self.method == "points.v":
            return points._replace(v=points.v[:1])
        return points._replace(m=points.m[:1]) if self.method == "points.m" else points


@pytest.mark.parametrize(
    ("method", "message"),
    [
        (
            "rate",
            r"rate: expected shape \(12,\), got shape \(1,\)\. One for each entry of the state",
        ),
        ("difference", r"difference: expected shape \(12,\), got shape \(1,\)\. One for each"),
        ("kinetic", r"kinetic: expected shape \(\), got shape \(3,\)\. An energy is one number"),
        ("energies", r"energies: expected shape \(\), got shape \(2,\)\. An energy is one number"),
        ("integrals", r"integrals: expected numbers or vectors, got shape \(2, 2\) of 'area'"),
        ("points.r", r"points: expected r of shape \(n, d\), got shape \(6,\)\. One row for each"),
        (
            "points.v",
            r"points: expected v of shape \(3, 2\), got shape \(1, 2\)\. r has shape \(3, 2",
        ),
        (
            "points.m",
            r"points: expected m of shape \(3,\), got shape \(1,\)\. r has shape \(3, 2\): 3",
        ),
    ],
)
def test_what_a_system_returns_has_its_shape(method, message):
    scene = Scene(_Odd(method), y0=np.arange(12.0))
    with pytest.raises(ValueError, match=rf"^_Odd\.{message}"):
        scene.check()


def test_more_effects_than_can_be_compiled_are_refused():
    many = _ball(*(LinearDrag(0.1),) * 3000)
    message = r"^effects: expected at most 500, got 3000\. .* Write one Effect for all of a kind"
    with pytest.raises(ValueError, match=message):
        many.check()
    with pytest.raises(ValueError, match=message):
        simulate(many)


def test_what_an_effect_acts_on_follows_from_what_it_overrides():
    assert UniformGravity().acts == {"force"}
    assert Torque().acts == {"generalized"}
    assert Fan().acts == {"force", "generalized"}
    assert not Effect().acts
    assert gap(Torque().force(0.0, jnp.ones((2, 3)), None, None), np.zeros((2, 3))) == 0


def test_check_passes_what_is_traced():
    jax.jit(lambda m: Scene(FreePoints(m), y0=Y0).check())(-1.0)
    with pytest.raises(ValueError, match=r"^y0: expected shape"):
        jax.jit(lambda y: _ball().starting(y).check())(jnp.zeros(3))


def test_a_scene_that_a_jit_has_captured_is_checked_by_its_values():
    scene = scenes.oscillator(k=4.0, x=0.0)  # nothing has checked it before
    found = jax.jit(lambda w: jaxdyn.vibration.receptance(scene, "x", "x", w))(1.0)
    assert found == pytest.approx(1 / 3, rel=1e-12)
    wrong = scenes.pendulum(length=-1.0)
    with pytest.raises(ValueError, match="expected > 0"):
        jax.jit(lambda w: jaxdyn.vibration.receptance(wrong, "theta", "theta", w))(1.0)


def test_where_gravity_has_no_units_the_state_has_none():
    assert dict(scenes.three_body().labels())["x1"] == "1"
    assert dict(scenes.two_body(G=6.674e-11).labels())["x1"] == "m"
    assert scenes.cannonball().labels() == scenes.cannonball().system.labels()


class _Claims(System):
    """A state [q, v] of two that claims to be of second order; `kind` says how it is not."""

    kind: str = eqx.field(static=True)
    second_order: ClassVar[bool] = True

    def labels(self):
        return (("q", "1"), ("v", "1"), ("w", "1"))[: 3 if self.kind == "three entries" else 2]

    def rate(self, t, y, effects):
        q, v = y[0], y[1]
        if self.kind == "three entries":
            return jnp.stack([v, -q, y[2]])
        dq = 2 * v if self.kind == "twice the velocity" else v
        dv = -0.1 * v - q if self.kind == "damping" else -q
        return jnp.stack([dq, dv if self.kind != "a brake" else jnp.where(v > 0.5, -1.0, -q)])


@pytest.mark.parametrize("kind", ["three entries", "twice the velocity", "damping", "a brake"])
def test_a_system_that_is_not_of_second_order_cannot_claim_it(kind):
    scene = Scene(_Claims(kind), y0=jnp.zeros(3 if kind == "three entries" else 2))
    with pytest.raises(ValueError, match=r"^_Claims: expected a state \[q, v\] with dq/dt = v"):
        scene.check()


def test_a_system_of_second_order_may_claim_it():
    scene = Scene(_Claims("none"), y0=[1.0, 0.0])
    assert gap(simulate(scene, 1.0, rtol=1e-13).ys[-1], [np.cos(1.0), -np.sin(1.0)]) < SOLVED


def test_entries_in_radians_wrap():
    arm = Scene(Lagrange(Arm()), y0=[0.1, 0.0])
    apart = arm.system.difference(jnp.array([6.3, 7.0]), jnp.array([0.1, 0.5]))
    assert gap(apart, [6.2 - 2 * np.pi, 6.5]) < EXACT
    assert gap(_Claims("none").difference(jnp.array([6.3, 7.0]), jnp.zeros(2)), [6.3, 7.0]) == 0


def test_a_scene_that_passed_is_not_checked_again_but_another_is(monkeypatch):
    checked = []
    check = Scene.check
    monkeypatch.setattr(Scene, "check", lambda scene: (checked.append(scene), check(scene)))
    scene = scenes.cannonball()
    for _ in range(3):
        jaxdyn.simulate(scene, 0.1)
    assert len(checked) == 1
    with pytest.raises(ValueError, match="mass"):
        jaxdyn.simulate(eqx.tree_at(lambda s: s.system.m, scene, -scene.system.m), 0.1)
    # An array of NumPy may change in place.
    mutable = eqx.tree_at(lambda s: s.y0, scene, np.array(scene.y0))
    jaxdyn.simulate(mutable, 0.1)
    mutable.y0[0] = np.nan
    with pytest.raises(ValueError, match="y0"):
        jaxdyn.simulate(mutable, 0.1)


def test_a_spring_through_its_pin_is_no_collision_of_bodies():
    scene = scenes.spring_mass(position=(0.5, 0.0), g=0.0, length=0.2)
    assert scene.singular.startswith("A spring or dashpot has no direction where its ends coincide")
    assert "bod" not in Outcome.COLLISION.message
    assert (scenes.cannonball().singular, scenes.pendulum().singular) == ("", "")
    assert with_work(scenes.cannonball(drag=1.0), QuadraticDrag).singular == ""


def no_bodies(*effects):
    return Scene(FreePoints([]), effects, y0=[])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: simulate(no_bodies()), "system: expected a system with a state"),
        (lambda: simulate(no_bodies(PairGravity())), "system: expected a system with a state"),
        (lambda: Scene(FreePoints([1.0]), y0=[0, 0, 1j, 2]), "y0: expected real numbers"),
        (lambda: Scene(FreePoints([1.0]), y0="a"), "y0: expected numbers, got 'a'"),
        (lambda: Scene(FreePoints([1.0]), y0=None), "y0: expected numbers, got None"),
    ],
)
def test_an_invalid_scene_is_refused_by_name(call, message):
    assert message in refusal(call)


def test_nothing_acts_and_the_points_go_straight_on():
    motion = simulate(Scene(FreePoints([1.0, 2.0]), y0=[0, 0, 1, 1, 1, 2, -3, 0.5]), 2.0, samples=3)
    np.testing.assert_allclose(motion.ys[-1], [2, 4, -5, 2, 1, 2, -3, 0.5], rtol=1e-15)


def test_masses_may_be_a_tuple_with_a_traced_number():
    def pull(m):
        scene = scenes.three_body(m=(1.0, 1.0, m))
        return scene.rate(0.0, scene.y0)[6]

    for way in (jax.grad, lambda f: jax.jit(jax.grad(f))):
        assert abs(way(pull)(1.5) - (pull(2.0) - pull(1.0))) < EXACT  # it is linear in each mass


def test_a_wrong_number_of_an_effect_is_refused_by_the_effects_name():
    with pytest.raises(ValueError, match=r"^QuadraticDrag: c: expected >= 0, got -1\.0\."):
        scenes.cannonball(drag=-1.0).check()
