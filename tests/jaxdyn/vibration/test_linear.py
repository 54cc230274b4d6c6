"""Natural modes and transfer functions against closed forms, and against M, C and K by hand."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import eigh
from vibrating import C, K, M, one, quarter_car

import jaxdyn
from jaxdyn import effects, scenes, vibration
from jaxdyn.formulations.newton import FreePoints

OMEGA = np.linspace(0.0, 5.0, 11)


def receptance(w):
    return 1 / (K - M * w**2 + 1j * C * w)


CAR = (
    np.diag([1, 0.1]),
    np.array([[2, -2], [-2, 2.5]]),
    np.array([[20.0, -20.0], [-20.0, 220.0]]),
)


def test_a_damped_oscillator_has_its_frequency_ratio_and_matrices():
    found = vibration.modes(one())
    assert_allclose(found.frequencies, [np.sqrt(K / M)], rtol=1e-14)
    ratio = C / (2 * np.sqrt(K * M))
    assert_allclose(found.damping_ratios, [ratio], rtol=1e-13)
    assert_allclose(found.damped_frequencies, np.sqrt(K / M * (1 - ratio**2)), rtol=1e-14)
    matrices = (found.mass, found.damping, found.stiffness)
    assert_allclose(np.ravel(matrices), [M, C, K], rtol=1e-15)
    assert "2.12132 rad/s (0.337619 Hz), damping ratio 0.0707107: x 1" in repr(found)


def test_what_does_not_oscillate_has_real_eigenvalues():
    found = vibration.modes(one(k=1.0, m=1.0, c=4.0))
    assert_allclose(found.eigenvalues, [-2 + np.sqrt(3), -2 - np.sqrt(3)], rtol=1e-14)
    assert_allclose(found.damped_frequencies, 0.0)
    free = vibration.modes(one(k=0.0, m=1.0, c=0.0))
    assert_allclose(free.frequencies, [0.0, 0.0], atol=0)
    assert np.isnan(free.damping_ratios).all()


def test_real_eigenvalues_are_shown_as_rates():
    k = 3.0
    saddle = vibration.modes(one(k=-k, m=1.0, c=0.0))  # x'' = 3 x
    rate = f"{np.sqrt(k):.6g} 1/s: x 1"
    assert f"no oscillation, decays at {rate}" in repr(saddle)
    assert f"no oscillation, grows at {rate}" in repr(saddle)
    assert_allclose(np.sort(saddle.growth_rates), [-np.sqrt(k), np.sqrt(k)], rtol=1e-14)
    overdamped = repr(vibration.modes(one(k=1.0, m=1.0, c=4.0)))
    assert f"decays at {2 - np.sqrt(3):.6g} 1/s" in overdamped
    assert f"decays at {2 + np.sqrt(3):.6g} 1/s" in overdamped
    assert "damping ratio" not in overdamped
    assert "mode 1  0 rad/s (0 Hz): x 1" in repr(vibration.modes(one(k=0.0, m=1.0, c=0.0)))
    driven = scenes.linear_system(M=[[1.0]], C=[[-0.2]], K=[[1.0]], names=["x"])
    said = "1 rad/s (0.159155 Hz), damping ratio -0.1: x 1"
    assert said in repr(vibration.modes(driven))


def test_the_modes_of_a_pendulum_are_those_of_its_matrices():
    rest = scenes.double_pendulum(angles=(0.0, 0.0))
    found, known = vibration.modes(rest), jaxdyn.modes(rest)
    assert_allclose(found.frequencies, known.frequencies, rtol=1e-13)
    assert_allclose(found.mass, known.mass, rtol=1e-14)
    assert_allclose(found.stiffness, known.stiffness, rtol=1e-14, atol=1e-14)
    assert_allclose(found.damping, 0.0, atol=1e-14)
    squares, shapes = eigh(np.asarray(known.stiffness), np.asarray(known.mass))
    assert_allclose(found.frequencies**2, squares, rtol=1e-13)
    assert_allclose(found.shapes, shapes / np.abs(shapes).max(0) * np.sign(shapes[1]), atol=1e-13)


def test_the_modes_of_a_plain_ode_are_those_of_its_rate():
    found = vibration.modes(quarter_car(0.0, 0.0))
    assert_allclose(found.mass, np.eye(2))  # masses are not known there
    assert_allclose(found.stiffness, np.linalg.solve(CAR[0], CAR[2]), rtol=1e-14)
    lorenz = vibration.modes(scenes.lorenz(), y=[np.sqrt(72), np.sqrt(72), 27.0])
    assert lorenz.mass is None
    assert lorenz.damping is None
    assert lorenz.shapes.shape == (3, 2)
    assert_allclose(
        np.asarray(lorenz.eigenvalues), [0.0939556 + 10.1945j, -13.8546], rtol=0, atol=1e-4
    )


@pytest.mark.slow
def test_modes_are_differentiable_and_run_under_vmap():
    slope = jax.grad(lambda k: vibration.modes(one(k=k)).frequencies[0])(K)
    assert_allclose(slope, 0.5 / np.sqrt(K * M), rtol=1e-13)
    slope = jax.grad(lambda k: vibration.modes(one(k=k)).damping_ratios[0])(K)
    assert_allclose(slope, -0.25 * C / np.sqrt(M) / K**1.5, rtol=1e-12)
    many = jax.vmap(lambda c: vibration.modes(one(c=c)).damping_ratios[0])(jnp.array([C, 100.0]))
    assert_allclose(many, [C / (2 * np.sqrt(K * M)), np.nan], rtol=1e-13)

    def stretch(k):  # of the lower mode of two equal masses: a shape is differentiable too
        two = jaxdyn.Scene(
            FreePoints([1.0, 1.0], 1),
            (effects.Spring(k), effects.Spring(1.0, 1.0, i=0, j=1)),
            y0=jnp.array([0.0, 1.0, 0.0, 0.0]),
        )
        return vibration.modes(two).shapes[0, 0].real

    low = [stretch(1.0 + h) for h in (-1e-6, 1e-6)]
    assert_allclose(jax.grad(stretch)(1.0), (low[1] - low[0]) / 2e-6, rtol=1e-7)


def test_what_vmap_made_has_the_numbers_of_each():
    def car(k):  # of two coordinates, so that axes of the batch can be taken for those of the state
        def rate(t, y, p):
            return [y[2], y[3], p * (y[1] - y[0]) - y[2], p * (y[0] - y[1]) - 3.0 * y[1]]

        return jaxdyn.ode(rate, np.zeros(4), names=["a", "b", "u", "v"], params=k)

    ks = np.array([2.0, 5.0])
    pairs = jax.vmap(lambda k: (vibration.modes(car(k)), seen(car(k))))(ks)
    alone = [(vibration.modes(car(k)), seen(car(k))) for k in ks]
    for name in ("frequencies", "damping_ratios", "shapes", "damping", "stiffness"):
        wanted = [getattr(modes, name) for modes, _ in alone]
        assert_allclose(getattr(pairs[0], name), wanted, rtol=1e-12, atol=1e-12)
    assert_allclose(pairs[0].stiffness, [[[k, -k], [-k, k + 3.0]] for k in ks], rtol=1e-14)
    assert_allclose(pairs[1].at(OMEGA), [h.at(OMEGA) for _, h in alone], rtol=1e-12)
    by_hand = [np.linalg.inv([[k + 1j - 1, -k], [-k, k + 2]])[:, 0] for k in ks]  # at omega 1
    assert_allclose(pairs[1].at(1.0), by_hand, rtol=1e-13)
    assert pairs[1].at(OMEGA).shape == (2, len(OMEGA), 2)


def seen(scene):
    return vibration.transfer_function(scene, "a", lambda t, y: y[:2])


def test_what_is_not_known_under_jit_has_no_derivative_and_no_shape():
    def ratio(c):
        return vibration.modes(one(c=c)).damping_ratios[0]

    assert np.isnan(jax.value_and_grad(ratio)(100.0)).all()
    found = jax.jit(lambda c: vibration.modes(one(c=c)))(100.0)
    assert np.isnan(found.frequencies).all()
    assert np.isnan(np.abs(found.shapes)).all()
    slope = jax.grad(lambda c: vibration.modes(one(c=c)).frequencies[0])
    assert np.isnan(slope(100.0))


@pytest.mark.parametrize("k", [1e-9, 1.0, 1e12])
def test_under_jit_the_rounding_of_a_free_motion_is_no_frequency(k):
    def free(t, y, p):
        pull = p * (y[0] - y[1])
        return [y[2], y[3], -pull, 0.5 * pull]

    def frequencies(k):
        return vibration.modes(jaxdyn.ode(free, [0.0] * 4, params=k)).frequencies

    assert_allclose(jax.jit(frequencies)(k), [np.nan, np.sqrt(1.5 * k)], rtol=1e-12)
    assert_allclose(frequencies(k), [0.0, 0.0, np.sqrt(1.5 * k)], rtol=1e-12)


def test_modes_have_the_same_order_under_jit():
    # The damped frequency of the first is 1.3, below that of the second.
    def rate(t, y, c):
        return [y[2], y[3], -9 * y[0] - c * y[2], -4 * y[1]]

    def frequencies(c):
        rest = jaxdyn.ode(rate, np.zeros(4), names=["a", "b", "u", "v"], params=c)
        return vibration.modes(rest).frequencies

    assert_allclose(frequencies(5.4), [2.0, 3.0], rtol=1e-12)
    assert_allclose(jax.jit(frequencies)(5.4), [2.0, 3.0], rtol=1e-12)


def stands_on(height, rate):
    return scenes.spring_chain(m=[1.0, 1.0], wall=height, wall_velocity=rate)


CHAIN = scenes.spring_chain(m=[1.0, 1.0])
IN_MM = dataclasses.replace(scenes.oscillator(x=0.0), units=("mm", "g", "ms"))
PLAIN = jaxdyn.ode(lambda t, y: [y[1], -y[0]], [0.0, 0.0], names=[("x", "m"), ("v", "m/s")])
BARE = jaxdyn.ode(lambda t, y: [y[1], -y[0]], [0.0, 0.0], names=["x", "v"])


@pytest.mark.parametrize(
    ("scene", "given", "to", "name", "unit"),
    [
        (CHAIN, "x1", "x1", "x1 / force on x1", "m/N"),
        (CHAIN, "x1", "vx1", "vx1 / force on x1", "(m/s)/N"),
        (CHAIN, vibration.Force(0, [1.0]), "x1", "x1 / force on body 1", "m/N"),
        (CHAIN, vibration.Base([1.0]), "x1", "x1 / acceleration of the base", "m/(m/s^2)"),
        (CHAIN, vibration.Motion(stands_on), "x1", "x1 / displacement", ""),
        (CHAIN, vibration.Parameter(lambda u: CHAIN), "x1", "x1 / parameter", ""),
        (CHAIN, "x1", lambda t, y: y[0], "output / force on x1", ""),
        (scenes.pendulum(angle=0.0), "theta", "theta", "theta / torque on theta", "rad/(N m)"),
        (IN_MM, "x", "x", "x / force on x", "mm/(g mm/ms^2)"),
        (PLAIN, "x", "x", "x / force per mass on x", "m/(m/s^2)"),  # its masses are not known
        (BARE, "x", "x", "x / force per mass on x", ""),
    ],
)
def test_transfer_functions_have_names_and_units(scene, given, to, name, unit):
    h = vibration.transfer_function(scene, given, to)
    assert (h.name, h.unit) == (name, unit)
    assert repr(h).startswith(f"Transfer function {name}\n  input ")


def test_derivatives_of_transfer_functions_have_their_names_and_units():
    h = vibration.transfer_function(CHAIN, "x1", "x1")
    velocity, acceleration = h.derivative(), h.derivative(2)
    assert (velocity.name, velocity.unit) == ("velocity of x1 / force on x1", "(m/s)/N")
    assert acceleration.name == "acceleration of x1 / force on x1"
    assert acceleration.unit == "(m/s^2)/N"
    assert h.derivative(3).name == "derivative 3 of x1 / force on x1"
    assert_allclose(velocity.at(OMEGA), vibration.mobility(CHAIN, "x1", "x1", OMEGA), rtol=0)
    with pytest.raises(ValueError, match="order: expected a whole number"):
        h.derivative(0.5)
    angular, turns = h.table(OMEGA), h.table(OMEGA, hertz=True)
    assert (angular.units["omega"], turns.units["frequency"]) == ("rad/s", "Hz")
    frequencies = turns.coordinates["frequency"].array
    assert_allclose(2 * np.pi * frequencies, OMEGA, rtol=1e-15)
    slow = vibration.transfer_function(IN_MM, "x", "x")
    units = [slow.table(OMEGA, hertz=hertz).coordinates.popitem()[1].unit for hertz in (0, 1)]
    assert units == ["rad/ms", "1/ms"]
    assert "omega" not in vibration.transfer_function(BARE, "x", "x").table(OMEGA).units


def test_a_transfer_function_is_a_table():
    both = vibration.transfer_function(one(), "x", lambda t, y: y)
    table = both.to_pandas([1.0, 2.0])
    assert [*table.columns] == [
        "output / force on x 0", "phase 0", "output / force on x 1", "phase 1"
    ]  # fmt: skip
    h = vibration.transfer_function(one(), "x", "x")
    table = h.to_pandas(OMEGA)
    assert table.attrs["units"] == {"omega": "rad/s", "x / force on x": "m/N", "phase": "rad"}
    assert_allclose(table["x / force on x"], np.abs(receptance(OMEGA)), rtol=1e-12)
    assert_allclose(table["phase"], np.angle(receptance(OMEGA)), rtol=1e-12)
    with pytest.raises(ValueError, match="omega: expected"):
        h.to_pandas(1.0)


def test_the_argument_of_a_transfer_function_is_s_also_where_it_is_real():
    h = vibration.transfer_function(one(), "x", "x")
    s = np.array([0.0, 2.0, 30.0])
    assert_allclose(h(s), 1 / (M * s**2 + C * s + K), rtol=1e-13)
    assert_allclose(h(1j * OMEGA), receptance(OMEGA), rtol=1e-13)
    for documented in (vibration.transfer_function, vibration.TransferFunction):
        assert "h(1j * omega)" in (documented.__doc__ or "")


def test_frequency_responses_of_an_oscillator_are_the_closed_forms():
    h = receptance(OMEGA)
    assert_allclose(vibration.receptance(one(), "x", "x", OMEGA), h, rtol=1e-13)
    assert_allclose(vibration.mobility(one(), "x", "x", OMEGA), 1j * OMEGA * h, rtol=1e-13)
    assert_allclose(vibration.accelerance(one(), "x", "x", OMEGA), -(OMEGA**2) * h, rtol=1e-13)
    assert_allclose(vibration.receptance(one(), "x", "vx", OMEGA), 1j * OMEGA * h, rtol=1e-13)
    transmitted = (K + 1j * C * OMEGA) * h
    assert_allclose(vibration.transmissibility(one(), [2.0], OMEGA), transmitted, rtol=1e-12)
    points = vibration.Force(0, [1.0])
    assert_allclose(vibration.receptance(one(), points, "x", OMEGA), h, rtol=1e-13)


def test_an_output_may_be_a_function_and_have_several_entries():
    found = vibration.receptance(one(), "x", lambda t, y: jnp.stack([y[0], -K * y[0]]), OMEGA)
    h = receptance(OMEGA)
    assert found.shape == (11, 2)
    assert_allclose(found, np.stack([h, -K * h], -1), rtol=1e-13)


def test_a_base_that_moves_a_plain_ode_acts_by_its_place_and_speed():
    rest = quarter_car(0.0, 0.0)
    found = vibration.transfer_function(rest, vibration.Motion(quarter_car), "x1")
    m, c, k = CAR
    moved = [np.linalg.solve(k - m * w**2 + 1j * w * c, [0.0, 200.0 + 0.5j * w])[0] for w in OMEGA]
    assert_allclose(found.at(OMEGA), moved, rtol=1e-12)
    poles = np.sort_complex(np.asarray(found.poles))
    assert_allclose(np.abs(poles)[[0, 2]], vibration.modes(rest).frequencies[::-1], rtol=1e-12)


def test_a_parameter_is_an_input():
    def make(k):
        return scenes.spring_mass(k=k, g=9.81, length=0.0, position=(0.0, -9.81 / 10))

    rest = make(10.0)  # it hangs at -g / k
    found = vibration.transfer_function(rest, vibration.Parameter(make, 10.0), "y")
    assert_allclose(found.at(2.0), 9.81 / 10 / (10.0 - 4.0), rtol=1e-13)


def test_a_torque_acts_on_an_angle():
    rest = scenes.pendulum(angle=0.0, g=9.81, length=2.0)
    mass = np.asarray(vibration.modes(rest).mass).item()
    found = vibration.receptance(rest, "theta", "theta", 1.0)
    assert_allclose(found, 1 / (mass * (9.81 / 2.0 - 1.0)), rtol=1e-13)


def test_responses_are_differentiable_and_run_under_jit_and_vmap():
    def at(k):
        return jnp.abs(vibration.receptance(one(k=k), "x", "x", 1.0)) ** 2

    d = K - M
    assert_allclose(jax.jit(jax.grad(at))(K), -2 * d / (d**2 + C**2) ** 2, rtol=1e-12)
    many = jax.vmap(at)(jnp.array([1.0, K]))
    assert_allclose(many, [1 / (1 + C**2), 1 / (d**2 + C**2)], rtol=1e-12)


def test_numbers_of_a_plain_ode_may_be_traced():
    def rate(t, y, p):
        return {"q": y["v"], "v": -(p["k"] * y["q"] + C * y["v"]) / M}

    def scene(k):
        return jaxdyn.ode(rate, {"q": [0.0], "v": [0.0]}, params={"k": k})

    def at(k):  # a force per mass
        return jnp.abs(vibration.receptance(scene(k), "q[0]", "q[0]", 1.0)) ** 2

    d = K - M
    slope = -2 * d * M**2 / (d**2 + C**2) ** 2
    assert_allclose([jax.grad(at)(K), jax.jit(jax.grad(at))(K)], slope, rtol=1e-12)
    assert_allclose(
        jax.vmap(at)(jnp.array([1.0, K])), M**2 / (np.array([1 - M, d]) ** 2 + C**2), rtol=1e-12
    )
    assert_allclose(
        jax.jit(lambda k: vibration.modes(scene(k)).stiffness)(K), [[K / M]], rtol=1e-14
    )


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: vibration.modes(scenes.oscillator()), "y: expected an equilibrium, got a rate"),
        (lambda: vibration.receptance(one(), "z", "x", 1.0), "Force.on: expected"),
        (lambda: vibration.receptance(one(), "x", "z", 1.0), "to: expected"),
        (lambda: vibration.receptance(one(), "x", 3, 1.0), "to: expected the name of an entry"),
        (
            lambda: vibration.receptance(one(), "x", lambda t, y: y[None, None], 1.0),
            "that returns the shape",
        ),
        (lambda: vibration.receptance(one(), 1.0, "x", 1.0), "input: expected an input or the"),
        (
            lambda: vibration.receptance(one(), vibration.Force(2, [1.0]), "x", 1.0),
            "Force.on: expected the number of a point, below 1",
        ),
        (
            lambda: vibration.receptance(one(), vibration.Force(0), "x", 1.0),
            "Force.direction: expected 1 components",
        ),
        (
            lambda: vibration.receptance(one(), vibration.Force("x", [1.0]), "x", 1.0),
            "Force.direction: expected none for a coordinate",
        ),
        (
            lambda: vibration.receptance(
                jaxdyn.ode(lambda t, y: -y, [0.0]), vibration.Force("y0"), "y0", 1.0
            ),
            "Force: expected a scene whose state is",
        ),
        (
            lambda: vibration.transmissibility(quarter_car(0.0, 0.0), [1.0], 1.0),
            "Base: expected a scene with material points",
        ),
        (
            lambda: vibration.transmissibility(one(), [1.0], 1.0, point=1),
            "point: expected at most 0",
        ),
        (
            lambda: vibration.transmissibility(one(), [0.0], 1.0),
            "direction: expected one along which the base moves",
        ),
        (
            lambda: vibration.receptance(one(), vibration.Parameter(lambda u: u), "x", 1.0),
            "Parameter.make: expected a function that returns this scene",
        ),
    ],
)
def test_misuse_is_refused_with_what_to_do(call, said):
    with pytest.raises(ValueError, match=said):
        call()


def test_isolation_at_kilohertz_is_as_accurate_as_at_one_radian_per_second():
    m, c, k = 1e-6, 1e-6, 1e3
    rest = scenes.oscillator(m=m, c=c, k=k, x=0.0)
    omega = np.sqrt(k / m) * np.array([0.1, 1.0, 3.0, 50.0])
    found = [complex(vibration.transmissibility(rest, [1.0], w)) for w in omega]
    spring = k + 1j * omega * c
    # 1 and the answer, which is 4e-4 at the last one, differ by rounding of 1.
    assert_allclose(found, spring / (spring - m * omega**2), rtol=3e-12)
