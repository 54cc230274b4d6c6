"""Gradients by the adjoint equations, or through steps, and what is refused."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.linalg import expm
from scipy.integrate import solve_ivp

import jaxdyn
from jaxdyn import scenes, solvers
from jaxdyn.effects import LinearDrag
from jaxdyn.integrate.simulation import solve

RTOL = 1e-12
SCENES = {
    "pendulum": (lambda: scenes.pendulum(angle=1.0), 3.0),
    "three bodies": (lambda: scenes.three_body(), 2.0),
    "drag": (lambda: scenes.cannonball(drag=0.01, speed=50.0), 3.0),
    "backwards": (lambda: scenes.oscillator(), -2.0),
}


def loss(numbers, t1, ts, rest, adjoint):
    scene = eqx.combine(numbers, rest)
    found = solve(scene, t1, ts=ts, rtol=RTOL, adjoint=adjoint)
    return jnp.sum(jnp.sin(found.y1)) + 1e-3 * jnp.sum(found.ys**2)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_gradients_are_those_of_the_variational_equations(name):
    make, t1 = SCENES[name]
    numbers, rest = eqx.partition(make(), eqx.is_inexact_array)
    ts = jnp.array([0.3, 0.9]) * np.sign(t1)
    found, wanted = (
        jax.grad(loss, argnums=(0, 1, 2))(numbers, t1, ts, rest, adjoint)
        for adjoint in (True, False)
    )
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        assert np.abs(a - b).max() <= 1e-10 * max(1.0, np.abs(b).max())


def test_a_motion_that_forgets_its_start_has_a_gradient():
    # v' = -c v: in one piece backwards it would grow by e^20.
    scene = scenes.cannonball(drag=0.0, speed=3.0) + LinearDrag(10.0)

    def end(y0):
        return solve(scene.starting(y0), 2.0, rtol=1e-10, adjoint=True).y1[0]

    assert jax.grad(end)(scene.y0)[2] == pytest.approx((1 - np.exp(-20)) / 10, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("t1", [3.0, -3.0])
@pytest.mark.parametrize("make", [scenes.pendulum, scenes.three_body, scenes.shaken_pendulum])
def test_gradients_through_steps_are_those_of_the_variational_equations(make, t1):
    """Some of these motions have more steps than states that are kept."""
    numbers, rest = eqx.partition(make(), eqx.is_inexact_array)
    ts = jnp.array([0.0, 0.5, 0.5, 1.0]) * t1
    found, wanted = (
        jax.grad(loss, argnums=(0, 1, 2))(numbers, t1, ts, rest, adjoint)
        for adjoint in ("steps", False)
    )
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_gradients_through_steps_in_a_batch():
    """A run that has ended waits for others; steps that are too long lead where a root has none."""

    def end(y0, adjoint):
        scene = jaxdyn.ode(lambda t, y: [y[1], jnp.sqrt(1.0 - y[0] ** 2) - 2.0 * y[0]], y0)
        return solve(scene, 3.0 * y0[1], adjoint=adjoint).y1[0]

    y0s = jnp.array([[0.0, 0.1], [0.1, 0.5], [0.2, 0.6]])
    found, wanted = (jax.vmap(jax.grad(end), (0, None))(y0s, how) for how in ("steps", False))
    np.testing.assert_allclose(found, wanted, rtol=1e-8)


@pytest.mark.slow
def test_gradients_through_steps_of_a_rate_with_conditions_are_those_of_the_adjoint():
    def end(y0, adjoint):
        scene = jaxdyn.ode(lambda t, y: [y[1], -jnp.sign(y[0]) - 0.1 * y[1]], y0)
        return solve(scene, 3.0, adjoint=adjoint).y1[0]

    y0 = jnp.array([0.5, 0.2])
    found, same = (jax.grad(end)(y0, adjoint) for adjoint in ("steps", True))
    np.testing.assert_array_equal(found, same)


@pytest.mark.parametrize("adjoint", [True, "steps"])
@pytest.mark.parametrize("k", [10.0, 60.0, 300.0])
def test_gradients_where_one_entry_decays_fast_are_those_of_a_matrix_exponential(k, adjoint):
    """x follows u at a rate k; backwards in time x departs from it as exp(k t)."""

    def matrix(p):
        return jnp.array([[-k, k], [-p, 0.0]])

    def end(p):
        scene = jaxdyn.ode(lambda t, y, p: matrix(p) @ y, [1.0, 0.5], params=p)
        return solve(scene, 2.0, adjoint=adjoint).y1[1]

    wanted = jax.grad(lambda p: (expm(2.0 * matrix(p)) @ jnp.array([1.0, 0.5]))[1])(0.7)
    assert float(jax.grad(end)(0.7)) == pytest.approx(float(wanted), rel=1e-9)


@pytest.mark.slow
def test_gradients_of_a_chaotic_motion_are_those_of_the_variational_equations():
    scene = scenes.lorenz()

    def gradient(adjoint):
        return jax.grad(lambda y: solve(scene.starting(y), 20.0, adjoint=adjoint).y1[0])(scene.y0)

    np.testing.assert_allclose(gradient(True), gradient(False), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("adjoint", [True, "steps"])
def test_what_a_projection_takes_from_a_start_has_no_effect(adjoint):
    """The norm of a quaternion is projected out, so the derivative along it is 0."""
    scene = scenes.free_body()

    def gradient(adjoint):
        def end(y):
            return jnp.sum(
                jnp.cos(jnp.arange(13)) * solve(scene.starting(y), 5.0, adjoint=adjoint).y1
            )

        return np.asarray(jax.grad(end)(scene.y0))

    found = gradient(adjoint)
    assert abs(found[3:7] @ scene.y0[3:7]) < 1e-11 * np.abs(found).max()
    np.testing.assert_allclose(found, gradient(False), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_many_losses_at_once_and_fixed_numbers():
    scene = scenes.oscillator()

    def end(y0, adjoint):
        return solve(scene.starting(y0), 1.0, rtol=RTOL, fixed=True, adjoint=adjoint).y1[0]

    def gradients(adjoint):
        return jax.jit(jax.vmap(jax.grad(lambda y: end(y, adjoint))))(y0s)

    y0s = jnp.stack([scene.y0, 2 * scene.y0])
    found, wanted = gradients(True), gradients(False)
    assert np.abs(found - wanted).max() <= 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("adjoint", [True, "steps"])
def test_a_run_that_fails_has_no_gradient(adjoint):
    scene = scenes.pendulum(angle=1.0)

    def end(y0):
        return solve(scene.starting(y0), 100.0, max_steps=3, adjoint=adjoint).y1[0]

    assert np.isnan(jax.grad(end)(scene.y0)).all()


@pytest.mark.parametrize(
    "transform",
    [
        jax.jacfwd,
        lambda f: jax.jit(jax.jacfwd(f)),
        lambda f: lambda y: jax.jvp(f, (y,), (y,)),
        lambda f: jax.grad(lambda y: jax.jvp(f, (y,), (y,))[1]),
    ],
)
def test_forward_mode_is_refused(transform):
    scene = scenes.pendulum(angle=1.0)

    def end(y):
        return solve(scene.starting(y), 1.0, adjoint=True).y1[0]

    with pytest.raises(ValueError, match=r"^adjoint: .*forward mode.* Leave adjoint= out"):
        transform(end)(scene.y0)


@pytest.mark.parametrize(
    ("make", "how", "why"),
    [
        (lambda: scenes.pendulum(formulation="constrained"), {}, "a scene without constraints"),
        (
            lambda: scenes.oscillator(),
            {"solver": solvers.KAHAN_LI8, "dt": 0.1},
            "a solver with a tolerance",
        ),
    ],
)
def test_what_has_no_adjoint_is_refused(make, how, why):
    with pytest.raises(ValueError, match=f"adjoint: expected {why}"):
        solve(make(), 1.0, adjoint=True, **how)


@pytest.mark.slow
def test_gradients_of_stiff_motions_are_nan_and_need_the_variational_equations():
    """Robertson's reactions, whose fast part grows by exp(1e5) in 40 s backwards."""

    def gradient(adjoint):
        def rate(t, y, k):
            slow, back, fast = k[0] * y[0], 1e4 * y[1] * y[2], k[1] * y[1] ** 2
            return [back - slow, slow - back - fast, fast]

        def end(k):
            scene = jaxdyn.ode(rate, [1.0, 0.0, 0.0], params=k)
            return solve(scene, 40.0, solver=solvers.RADAU9, adjoint=adjoint).y1[0]

        return np.asarray(jax.grad(end)(jnp.array([0.04, 3e7])))

    def by_scipy(k):
        def rate(t, y):
            slow, back, fast = k[0] * y[0], 1e4 * y[1] * y[2], k[1] * y[1] ** 2
            return [back - slow, slow - back - fast, fast]

        flow = solve_ivp(rate, (0, 40), [1.0, 0, 0], method="Radau", rtol=1e-11, atol=1e-15)
        return flow.y[0, -1]

    assert np.isnan(gradient(adjoint=True)).all()
    k = np.array([0.04, 3e7])
    steps = 1e-3 * np.diag(k)
    wanted = [(by_scipy(k + h) - by_scipy(k - h)) / (2 * h.sum()) for h in steps]
    np.testing.assert_allclose(gradient(adjoint=False), wanted, rtol=1e-4)
