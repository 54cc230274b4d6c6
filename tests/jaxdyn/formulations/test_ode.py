"""Differential equations as scenes: held to closed forms, through all that takes a scene."""

from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import odes
import pytest
from helpers import EXACT, SOLVED, gap

import jaxdyn
from jaxdyn import ensemble, scenes, simulate, solve
from jaxdyn.analysis import energy
from jaxdyn.analysis.linearize import modes
from jaxdyn.drawing import contents, time_series
from jaxdyn.drawing.titles import describe
from jaxdyn.files.tables import columns, write_csv
from jaxdyn.integrate.events import Reaches
from jaxdyn.solvers import NYSTROM12, TAYLOR20
from jaxdyn.solvers.choice import default_solver

TRACED = []


def fade(t, y, p):
    """y' = -k y, with a note of each time that it is traced."""
    TRACED.append(1)
    return -p["k"] * y


def turn(t, y):
    """q'' = -q."""
    return [y[1], -y[0]]


def half_square(t, y):
    """The energy of `turn`."""
    return 0.5 * (y[0] ** 2 + y[1] ** 2)


FADING = jaxdyn.ode(fade, [2.0, 3.0], 1.5, params={"k": 0.7})
TURNING = jaxdyn.ode(turn, [0.6, 0.8], 5.0, energy=half_square, names=["q", ("v", "1/s")])
HUNT = jaxdyn.ode(
    odes.populations,
    [2.0, 1.0],
    6.0,
    names=["prey", "predators"],
    params=(1.5, 1.0, 1.0, 0.8),
    integrals={"level": odes.populations_integral},
)


@pytest.mark.slow
def test_lorenz_is_the_scene_of_that_name():
    params = {"sigma": 10.0, "rho": 28.0, "beta": 8 / 3}
    scene, own = jaxdyn.ode(odes.lorenz, [1.0, 1.0, 1.0], 2.0, params=params), scenes.lorenz()
    y = jnp.array([1.0, -2.0, 20.0])
    assert gap(scene.rate(0.0, y), own.rate(0.0, y)) < EXACT * 100
    assert gap(simulate(scene, rtol=1e-13).ys[-1], simulate(own, 2.0, rtol=1e-13).ys[-1]) < 1e-11


def test_new_numbers_never_recompile():
    solve(FADING, 1.0)
    scenes_ = [jaxdyn.ode(fade, [1, 2], 3, params={"k": k}) for k in (0.1, np.float64(2), 3)]
    before = len(TRACED)
    ends = [solve(scene, 1.0).y1 for scene in scenes_]
    assert len(TRACED) == before
    assert gap(ends[2], np.exp(-3.0) * np.array([1.0, 2.0])) < 1e-9


@pytest.mark.slow
def test_derivatives_and_batches_go_through_the_parameters():
    def end(k):
        return solve(jaxdyn.ode(fade, FADING.y0, params={"k": k}), 1.5, rtol=1e-13).y1

    ks = jnp.array([0.2, 0.7, 1.3])
    wanted = np.exp(-1.5 * np.asarray(ks))[:, None] * np.array([2.0, 3.0])
    assert gap(jax.vmap(end)(ks), wanted) < SOLVED
    assert gap(jax.jacfwd(end)(ks[0]), -1.5 * wanted[0]) < SOLVED
    assert gap(jax.jacrev(end)(ks[1]), -1.5 * wanted[1]) < SOLVED
    motions = jax.vmap(lambda k: simulate(jaxdyn.ode(fade, FADING.y0, params={"k": k}), 1.5))(ks)
    assert motions["y1"].shape == (3, 200)
    assert gap(motions["y1"][:, -1], wanted[:, 1]) < 1e-9


STRENGTH = 1.0


def _strength():
    return STRENGTH


def pulled(t, y):
    """y' = -k y, with a number from around it by way of another function."""
    return -_strength() * y


def test_numbers_from_around_a_function_are_not_stale(monkeypatch):
    first = jaxdyn.ode(pulled, [1.0])
    assert gap(simulate(first, rtol=1e-13).ys[-1], [np.exp(-1.0)]) < SOLVED
    monkeypatch.setitem(globals(), "STRENGTH", 2.0)
    with pytest.raises(ValueError, match=r"^Ode: .* another value of 'STRENGTH'\. Make the scene"):
        simulate(first)
    again = jaxdyn.ode(pulled, [1.0])
    assert gap(simulate(again, rtol=1e-13).ys[-1], [np.exp(-2.0)]) < SOLVED
    numbers = (np.array([3.0]), 2.0)
    held = jaxdyn.ode(partial(lambda t, y, x: -x * numbers[0] * y, x=1.0), [1.0])
    held.check()
    numbers[0][0] = 4.0
    with pytest.raises(ValueError, match="another value of 'numbers'"):
        held.check()


def test_a_function_may_count_its_calls():
    count = 0

    def rate(t, y):
        nonlocal count
        count += 1
        return -y

    scene = jaxdyn.ode(rate, [1.0])
    before = count
    assert simulate(scene).ok
    assert count > before
    scene.check()  # which does not refuse it for that


def test_parameters_are_any_pytree_of_numbers():
    class Law(eqx.Module):
        k: jax.Array
        power: int = eqx.field(static=True)

        def __call__(self, t, y):
            return -self.k * y**self.power

    def rate(t, y, law):
        return law(t, y)

    scene = jaxdyn.ode(rate, [1.0], params=Law(jnp.asarray(0.5), 2))
    # y' = -k y^2
    assert gap(solve(scene, 3.0, rtol=1e-13).y1, [1 / 2.5]) < SOLVED
    none = jaxdyn.ode(partial(rate, law=Law(jnp.asarray(0.5), 2)), [1.0])
    assert gap(solve(none, 3.0, rtol=1e-13).y1, [1 / 2.5]) < SOLVED


@pytest.mark.slow
def test_events_ensembles_and_backward_time():
    half = jaxdyn.until(FADING, Reaches(0, 1.0), 9.0, rtol=1e-13)
    assert abs(float(half.t) - np.log(2) / 0.7) < SOLVED
    y0s = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    ends = ensemble.run(FADING, y0s, 1.5, rtol=1e-13)
    assert gap(ends.y1, np.exp(-1.05) * y0s) < SOLVED
    back = simulate(FADING, -1.0, rtol=1e-13)
    assert gap(back.ys[-1], np.exp(0.7) * np.array([2.0, 3.0])) < SOLVED


def test_equilibria_and_what_is_near_them():
    # Prigogine and Lefever: an equilibrium at (a, b / a); unstable from b = 1 + a^2 on.
    scene = jaxdyn.ode(odes.brusselator, [1.0, 1.0], params=(1.0, 2.5))
    found = jaxdyn.equilibria(scene, [0.1, 0.1], [4.0, 4.0], starts=32)
    assert gap(found.states, [[1.0, 2.5]]) < SOLVED
    assert found.complete
    (linear,) = found.linearizations
    # The trace is b - 1 - a^2, the determinant a^2.
    assert gap(np.sort_complex(linear.eigenvalues), np.sort_complex(np.roots([1, -0.5, 1]))) < EXACT
    assert (linear.verdict, linear.portrait) == ("unstable", "spiral")
    calm = jaxdyn.ode(odes.brusselator, [1.0, 1.0], params=(1.0, 1.5))
    assert jaxdyn.linearize(calm, [1.0, 1.5]).verdict == "stable"
    with pytest.raises(
        ValueError, match=r"canonical momenta, got Ode.*`vibration.modes` takes any"
    ):
        modes(scene, [1.0, 2.5])


def test_an_energy_and_integrals_are_checked_along_a_motion():
    motion = simulate(TURNING, rtol=1e-13)
    assert float(energy.energy(TURNING, 0.0, TURNING.y0)) == 0.5
    assert gap(energy.along(energy.energy, motion), np.full(200, 0.5)) < SOLVED
    assert float(energy.drift(motion)) < SOLVED
    assert jaxdyn.energy_change(motion).causes == ()
    hunt = simulate(HUNT, rtol=1e-13)
    assert energy.integrals(HUNT, 0.0, HUNT.y0).keys() == {"level"}
    assert float(energy.drift(hunt, "level")) < SOLVED
    with pytest.raises(ValueError, match="one with an energy, got Ode"):
        energy.drift(hunt)
    with pytest.raises(ValueError, match=r"of: expected one of level, got 'lewel'\. Did you mean"):
        energy.drift(hunt, "lewel")


def test_an_energy_that_changes_is_said_to():
    def damped(t, y):
        return [y[1], -y[0] - 0.1 * y[1]]

    def pushed(t, y):
        return [y[1], jnp.cos(2 * t) - y[0]]

    for rate, cause in ((damped, "the system itself"), (pushed, "the drive")):
        change = jaxdyn.energy_change(simulate(jaxdyn.ode(rate, [1.0, 0.0], energy=half_square)))
        assert change.causes == (cause,)
        assert change.size > 0.01


def test_a_drift_has_the_size_of_what_changes_where_the_energy_is_zero():
    def swing(t, y):
        return [y[1], -jnp.sin(y[0])]

    def height(t, y):
        return 0.5 * y[1] ** 2 - jnp.cos(y[0])

    # From the horizontal the energy is 0: relative to that, rounding would be all of it.
    scene = jaxdyn.ode(swing, [np.pi / 2, 0.0], 10.0, energy=height)
    motion = simulate(scene, rtol=1e-13)
    assert abs(float(energy.energy(scene, 0.0, scene.y0))) < 1e-16
    assert float(energy.drift(motion)) < SOLVED
    # Its size is that of the terms omega^2 / 2 and cos theta, which are 1 at most.
    bad = eqx.tree_at(lambda m: m.ys, motion, motion.ys.at[100, 1].add(1e-3))
    speed = abs(float(motion.ys[100, 1]))
    assert 0.2e-3 * speed < float(energy.drift(bad)) < 2e-3 * speed


def test_a_second_order_rate_takes_the_nystrom_pair_for_tangents():
    claimed = jaxdyn.ode(turn, [0.6, 0.8], second_order=True)
    assert default_solver(claimed).for_tangents is NYSTROM12
    assert default_solver(TURNING) is TAYLOR20
    end = np.array([[np.cos(2), np.sin(2)], [-np.sin(2), np.cos(2)]]) @ [0.6, 0.8]
    assert gap(solve(claimed, 2.0, rtol=1e-13).y1, end) < SOLVED


def test_entries_in_radians_are_angles():
    scene = jaxdyn.ode(turn, [0.0, 0.0], names=[("angle", "rad"), ("rate", "rad/s")])
    apart = scene.system.difference(jnp.array([6.3, 6.3]), jnp.zeros(2))
    assert gap(apart, [6.3 - 2 * np.pi, 6.3]) < EXACT
    assert gap(TURNING.system.difference(jnp.array([6.3, 6.3]), jnp.zeros(2)), [6.3, 6.3]) == 0


def test_a_state_is_drawn_and_written_by_its_names(tmp_path):
    motion = simulate(TURNING, samples=20)
    drawn = contents.paths(motion)
    assert (drawn.labels, drawn.equal) == (("q", "v [1/s]"), False)
    assert contents.paths(simulate(HUNT, samples=20)).labels == ("prey", "predators")
    assert (describe(HUNT), describe(FADING)) == ("populations", "fade (k = 0.7)")
    assert columns(motion) == ["q", "v [1/s]"]
    assert write_csv(tmp_path / "turn.csv", motion).read_text().startswith("t [s],q,v [1/s]\n0.0,")
    many = simulate(jaxdyn.ode(fade, np.ones(4), params={"k": 1.0}), samples=5)
    with pytest.raises(ValueError, match=r"got no points and a state of 4\. .*time_series"):
        contents.paths(many)
    assert len(time_series(many).axes) > 0
    with pytest.raises(ValueError, match="scene: expected one with material points, got Ode"):
        energy.momentum(HUNT, 0.0, HUNT.y0)


def _in_closure(k):
    return jaxdyn.ode(lambda t, y: -k * y, [1.0]).y0[0]


class _Odd:
    """Not hashable, since it can be equal to others."""

    def __eq__(self, other):
        return self is other

    def __call__(self, t, y):
        return y


def plain(t, y):
    return -y


def indexed(t, y, p):
    return -jnp.array([1.0, 2.0])[p][:1] * y


ode = jaxdyn.ode


def _filled(zeros):
    def rate(t, y):
        d = zeros(2)
        d[0] = y[1]
        return d

    return rate


_OF_Y_T = r"^rate: expected a function of \(t, y\), got one of \(y, t\), as for scipy"
_FILLED = r"^rate: .* got one that fills an array .*Return a list such as \[y\[1\], -y\[0\]\]"
MISUSE = [
    (lambda: ode(lambda y, t: [y[1], -y[0]], [1.0, 0.0]), _OF_Y_T),
    (lambda: ode(lambda y, t: -y, [1.0]), _OF_Y_T),
    (lambda: ode(_filled(np.zeros), [1.0, 0.0]), _FILLED),
    (lambda: ode(_filled(jnp.zeros), [1.0, 0.0]), _FILLED),
    (lambda: ode(lambda t, y: "fast", [1.0]), "^rate: .* a list of numbers, got 'fast'"),
    (lambda: ode(3, [1.0]), r"^rate: expected a function of \(t, y\), got 3"),
    (lambda: ode(fade, [1.0]), r"rate: .* of \(t, y\), got one of \(t, y, p\)\. It gets `params`"),
    (lambda: ode(plain, [1.0], params=2.0), r"function of \(t, y, params\), got one of \(t, y\)"),
    (lambda: ode(_Odd(), [1.0]), "rate: expected a hashable function"),
    (lambda: ode(lambda t, y: y[:1], [1.0, 2.0]), r"^rate: expected shape \(2,\), got shape \(1,"),
    (lambda: ode(lambda t, y: None, [1.0]), r"^rate: .* got None\. Does it `return` them"),
    (
        lambda: ode(lambda t, y: y.astype(complex), [1.0]),
        "^rate: expected real numbers, got",
    ),
    (
        lambda: ode(lambda t, y: -y.astype(jnp.float32), [1.0]),
        "^rate: expected 64-bit floats, got an array of float32. Compute it in 64 bits.",
    ),
    (
        lambda: ode(lambda t, y: [y[1], -y[0].astype(jnp.bfloat16)], [1.0, 0.0]),
        "^rate: expected 64-bit floats, got an array of bfloat16",
    ),
    (lambda: ode(lambda t, y: np.sin(y), [1.0]), "^rate: .* needs their values .* Use jax.numpy"),
    (lambda: ode(lambda t, y: y if y[0] > 0 else -y, [1.0]), "^rate: .* jnp.where instead of `if`"),
    (lambda: ode(plain, 1.0), r"^y0: expected shape \(any,\), got shape \(\)"),
    (lambda: ode(plain, []), "^y0: expected at least one entry, got none"),
    (lambda: ode(plain, [1.0, np.nan]), "^y0: expected finite numbers, got nan"),
    (lambda: ode(plain, [1.0], np.inf), "^t1: expected finite numbers, got inf"),
    (lambda: ode(plain, [1.0, 2.0], names=["a"]), "^names: expected 2, got 1"),
    (lambda: ode(plain, [1.0, 2.0], names="ab"), "^names: expected a list, got 'ab'"),
    (lambda: ode(plain, [1.0, 2.0], names=["a", "a"]), "^names: expected different ones"),
    (
        lambda: ode(plain, [1.0], names=[("a", 1)]),
        r"^names: .* a pair \(name, unit\), got",
    ),
    (lambda: ode(fade, [1.0], params="k"), "^params: expected numbers, got 'k'"),
    (lambda: ode(fade, [1.0], params={"k": 1.0, "on": True}), "got True.*flags may be static fi"),
    (lambda: ode(indexed, [1.0], params=np.array([0, 1])), "^params: .*got integers.*array, or m"),
    (lambda: ode(indexed, [1.0], params=np.array(["a"])), "^params: expected numbers, got array"),
    (lambda: ode(plain, np.ones((2, 2))), r"^y0: expected shape \(any,\), got.*pytree with arrays"),
    (lambda: ode(plain, 1.0), r"^y0: expected shape \(any,\), got shape \(\)\. A list of numbers"),
    (lambda: ode(plain, [1j]), "^y0: expected real numbers, got complex ones. Pass their real"),
    (lambda: ode(fade, [1.0], params={}), r"^params: expected numbers, got none in \{\}"),
    (lambda: ode(fade, [1.0], params=jnp.sin), "^params: expected numbers"),
    (lambda: simulate(ode(fade, [1.0], params={"k": np.nan})), "^params: expected finite numbers"),
    (lambda: ode(plain, [1.0], energy=plain), r"^energy: expected shape \(\), got shape \(1,\)"),
    (lambda: ode(plain, [1.0], energy=2), r"^energy: expected a function of \(t, y\), got 2"),
    (lambda: ode(plain, [1.0], integrals=[plain]), "^integrals: expected functions by name"),
    (lambda: ode(plain, [1.0], integrals={"a": fade}), "^integrals 'a': expected a function of"),
    (lambda: ode(plain, [1.0], integrals={"energy": plain}), "other names, got 'energy'. Pass it"),
    (
        lambda: simulate(ode(plain, [1.0], integrals={"a": lambda t, y: jnp.ones((2, 2))})),
        r"integrals: expected numbers or vectors, got shape \(2, 2\) of 'a'",
    ),
    (lambda: ode(plain, [1.0], generators=[plain]), "^generators: expected functions by name"),
    (lambda: ode(plain, [1.0], generators={"a": plain}), r"^generators 'a': .* of \(y\), got"),
    (
        lambda: ode(plain, [1.0], generators={"a": lambda y: jnp.ones(2)}),
        r"^generators 'a': expected shape \(1,\), got shape \(2,\)",
    ),
    (lambda: ode(plain, [1.0, 2.0], second_order=True), r"^Ode: expected a state \[q, v\] with dq"),
    (
        lambda: jax.grad(_in_closure)(1.0),
        "^Ode: expected no captured values that are traced.*params",
    ),
    (
        lambda: simulate(FADING + jaxdyn.effects.UniformGravity()),
        "^UniformGravity: expected an effect that Ode accepts: none at all, got forces on points",
    ),
]


@pytest.mark.parametrize(("misuse", "message"), MISUSE)
def test_misuse_is_refused(misuse, message):
    with pytest.raises(ValueError, match=message):
        misuse()


def test_a_network_is_a_parameter():
    net = eqx.nn.MLP(1, 1, 4, 1, jnp.tanh, key=jax.random.key(0))
    scene = jaxdyn.ode(_learned, [0.5], params=net)
    assert abs(float(scene.rate(0.0, scene.y0)[0]) - float(net(scene.y0)[0])) < 1e-15
    slope = eqx.filter_grad(
        lambda net: jaxdyn.ode(_learned, [0.5], params=net).rate(0.0, jnp.array([0.5]))[0]
    )(net)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(slope))
    assert float(slope.layers[-1].bias[0]) == 1.0


def _learned(t, y, net):
    return net(y)


def orbiting(t, y, p):
    r = y["r"]
    return {"v": -p * r / jnp.sum(r * r) ** 1.5, "r": y["v"]}


def energy_of_orbit(t, y, p):
    return 0.5 * jnp.sum(y["v"] ** 2) - p / jnp.sqrt(jnp.sum(y["r"] ** 2))


def turned(y, p):
    return {key: [-x[1], x[0]] for key, x in y.items()}


def as_tree(mu=1.0, x=1.0):
    start = {"v": [0.0, 1.2], "r": jnp.array([x, 0.0])}
    return jaxdyn.ode(
        *(orbiting, start, 5.0),
        params=mu,
        energy=energy_of_orbit,
        generators={"turn in xy": turned},
    )


def flat(t, y, p):
    rate = orbiting(t, {"r": y[:2], "v": y[2:]}, p)
    return jnp.concatenate([rate["r"], rate["v"]])


def test_a_state_may_be_a_pytree():
    scene = as_tree()
    assert [name for name, _ in scene.labels()] == ["r[0]", "r[1]", "v[0]", "v[1]"]
    motion = jaxdyn.simulate(scene)
    same = jaxdyn.simulate(jaxdyn.ode(flat, [1.0, 0.0, 0.0, 1.2], 5.0, params=1.0))
    np.testing.assert_allclose(motion.ys, same.ys, rtol=1e-12, atol=1e-13)
    states = scene.system.tree(motion.ys)
    np.testing.assert_array_equal(states["r"][:, 1], motion["r[1]"])
    assert states["v"].shape == (200, 2)
    assert float(energy.drift(motion)) < 1e-12

    def end(mu, x):
        return jaxdyn.solve(as_tree(mu, x), 5.0).y1[0]

    slopes = jax.grad(end, argnums=(0, 1))(1.0, 1.0)
    for i, slope in enumerate(slopes):
        off = [1e-5 * (i == j) for j in range(2)]
        up, down = (end(1.0 + s * off[0], 1.0 + s * off[1]) for s in (1, -1))
        np.testing.assert_allclose(slope, (up - down) / 2e-5, rtol=1e-6)
    assert jaxdyn.analysis.energy.integrals(scene, 0.0, scene.y0).keys() == {"energy"}
    turn = scene.system.generators(scene.y0)["turn in xy"]
    np.testing.assert_array_equal(turn, [0.0, 1.0, -1.2, 0.0])


class Pair(NamedTuple):
    q: float
    v: float


def swing(t, y):
    return Pair(q=y.v, v=-y.q)


def test_a_named_tuple_keeps_its_order():
    scene = jaxdyn.ode(swing, Pair(1.0, 0.0), 2.0, second_order=True)
    assert [name for name, _ in scene.labels()] == ["q", "v"]
    motion = jaxdyn.simulate(scene)
    np.testing.assert_allclose(motion["q"], np.cos(motion.ts), atol=1e-9)
    nested = jaxdyn.ode(halves, ({"a": 1.0}, jnp.ones(2)), names=["x", "y", "z"])
    assert [name for name, _ in nested.labels()] == ["x", "y", "z"]
    assert jax.tree.map(jnp.shape, nested.system.tree(nested.y0)) == ({"a": ()}, (2,))


def halves(t, y):
    return jax.tree.map(lambda x: -0.5 * x, y)


@pytest.mark.parametrize(
    ("y0", "rate", "said"),
    [
        (
            {"x": 1.0, "v": 0.0},
            lambda t, y: {"x": y["v"]},
            r"rate: expected a pytree like y0, .*'v'",
        ),
        ({"x": 1.0}, lambda t, y: [y["x"]], r"rate: expected a pytree like y0, {'x': \*}, got \*"),
        (
            {"x": 1.0},
            lambda t, y: {"x": jnp.ones(2)},
            r"rate: expected shape \(\), got shape \(2,\)",
        ),
        ({"x": 1.0}, lambda t, y: None, "rate: expected an array .* got None"),
        ({"x": "a"}, halves, "y0 x: expected numbers, got 'a'"),
        ({"x": {"y": 1j}}, halves, r"y0 x\.y: expected real numbers"),
        ({"x": jnp.nan}, halves, "y0: expected finite numbers"),
        ({}, halves, "y0: expected at least one entry, got {}"),
    ],
)
def test_wrong_pytrees_are_refused(y0, rate, said):
    with pytest.raises(ValueError, match=said):
        jaxdyn.ode(rate, y0)
