"""orbits.sections.poincare_map: its fixed points are periodic orbits, its derivative their flow."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import DIFFED, SOLVED, central_difference, gap, refusal
from odes import stuart_landau
from scipy.integrate import quad

import jaxdyn
import orbits
from jaxdyn import Status, scenes
from jaxdyn.analysis.monodromy import monodromy
from jaxdyn.integrate.events import Every, Reaches
from orbits.sections import poincare_map

HENON, PLANE = scenes.henon_heiles(), Reaches(0, 0.0, 1)
E = 1 / 12
P = poincare_map(HENON, PLANE, energy=E)


def fixed_point(poincare, q):
    """Newton's method on P(q) = q."""
    for _ in range(7):
        q = q - jnp.linalg.solve(poincare.jacobian(q) - jnp.eye(2), poincare(q) - q)
    return q


@pytest.fixture(scope="module")
def loop():
    """The loop about the origin that crosses the section upright."""
    return fixed_point(P, jnp.array([0.25, 0.0]))


def test_straight_motions_through_the_origin_are_fixed_points():
    # Along a side of the triangle's symmetry, 30 degrees from the x axis: v = sqrt(2 E).
    step = P.step([0.0, np.sqrt(2 * E) / 2])
    assert gap(step.q, [0.0, np.sqrt(2 * E) / 2]) < SOLVED
    # s'' = -s - s^2 on the line, E = s'^2 / 2 + s^2 / 2 + s^3 / 3; between the ends a < b < c.
    a, b, c = np.sort(np.roots([-2 / 3, -1.0, 0.0, 2 * E]).real)
    # s = middle + half sin(u) takes the square roots at both ends away.
    middle, half = (b + c) / 2, (c - b) / 2
    period = quad(
        lambda u: 2 / np.sqrt(2 / 3 * (middle + half * np.sin(u) - a)), -np.pi / 2, np.pi / 2
    )
    assert abs(float(step.t) - period[0]) < SOLVED


def test_a_fixed_point_is_an_orbit_and_the_jacobian_has_its_multipliers(loop):
    step, jac = P.step(loop), P.jacobian(loop)
    assert gap(step.q, loop) < SOLVED
    orbit = orbits.find(HENON, P.state(loop), float(step.t))
    assert orbit.ok
    assert gap(orbit.y0, P.state(loop)) < 1e-11
    assert abs(orbit.period - float(step.t)) < 1e-11
    m = monodromy(HENON, P.state(loop), step.t, rtol=1e-13)
    # Two of the four are 1; the trace of the others is that of the section.
    assert abs(float(jnp.trace(m)) - 2 - float(jnp.trace(jac))) < 1e-10
    others = np.asarray(orbits.stability(orbit).multipliers)
    own = np.linalg.eigvals(np.asarray(jac))
    assert all(np.abs(others - x).min() < 1e-10 for x in own)
    assert abs(float(jnp.linalg.det(jac)) - 1) < 1e-10


def test_a_loop_that_is_run_backwards_is_a_fixed_point_too(loop):
    back = jaxdyn.until(HENON.starting(P.state(loop)), Reaches(0, 0.0, -1), 9.0, rtol=1e-13)
    other = jnp.array([back.y[1], -back.y[3]])
    step = P.step(other)
    assert gap(step.q, other) < SOLVED
    assert abs(float(step.t - P.step(loop).t)) < SOLVED
    traces = [float(jnp.trace(P.jacobian(q))) for q in (loop, other)]
    assert abs(traces[0] - traces[1]) < 1e-10


def test_derivatives_agree_with_differences_and_in_both_modes():
    q = jnp.array([0.1, 0.05])
    jac = P.jacobian(q)
    assert gap(jac, central_difference(P, q)) < 10 * DIFFED
    assert gap(jax.jacrev(P)(q), jac) < 1e-13
    assert abs(float(jnp.linalg.det(jac)) - 1) < 1e-10


@pytest.mark.slow
def test_several_crossings_are_the_map_several_times():
    q = jnp.array([0.1, 0.05])
    twice = poincare_map(HENON, PLANE, energy=E, crossings=2)
    assert gap(twice.jacobian(q), P.jacobian(P(q)) @ P.jacobian(q)) < 1e-9
    assert gap(twice(q), P(P(q))) < SOLVED


@pytest.mark.slow
def test_the_map_of_a_cycle_contracts_by_its_multiplier():
    a, b, w = 0.04, 0.5, 1.0
    scene = jaxdyn.ode(stuart_landau, [0.2, 0.0], 12.0, params=[a, b, w], names=["x", "y"])
    round_ = poincare_map(scene, Reaches(1, 0.0, 1))
    assert round_.names == ("x",)
    q = jnp.array([np.sqrt(a)])
    period = 2 * np.pi / (w + a * b)
    step = round_.step(q)
    assert gap(step.q, q) < SOLVED
    assert abs(float(step.t) - period) < SOLVED
    assert gap(round_.jacobian(q), [[np.exp(-2 * a * period)]]) < SOLVED

    def radius(params):
        moved = jaxdyn.ode(stuart_landau, [0.2, 0.0], 12.0, params=params, names=["x", "y"])
        return poincare_map(moved, Reaches(1, 0.0, 1))(q)[0]

    # dP/da = (1 - P'(r)) dr/da, since the fixed point r = sqrt(a) moves with a.
    slope = jax.grad(radius)([a, b, w])[0]
    assert abs(float(slope) - (1 - np.exp(-2 * a * period)) / (2 * np.sqrt(a))) < 1e-11


@pytest.mark.slow
def test_a_stroboscopic_map_of_a_driven_scene_preserves_areas():
    scene = scenes.shaken_pendulum(uniform=False)
    period = 2 * np.pi / 60
    strobe = poincare_map(scene, Every(period), span=1.5 * period)
    q = jnp.array([0.2, 0.1])
    after = jaxdyn.solve(scene.starting(q), period, rtol=1e-13).y1
    assert gap(strobe(q), after) < SOLVED
    assert abs(float(jnp.linalg.det(strobe.jacobian(q))) - 1) < 1e-11


def test_points_without_an_image_are_nan_with_a_status():
    outside = P.step([0.9, 0.0])
    assert outside.status == Status.FORBIDDEN
    assert np.isnan(outside.q).all()
    short = poincare_map(HENON, PLANE, energy=E, span=1.0).step([0.1, 0.0])
    assert short.status == Status.FEW_CROSSINGS
    assert np.isnan(short.q).all()
    assert np.isnan(short.t)
    assert np.isnan(P.jacobian([0.9, 0.0])).all()
    short = poincare_map(HENON, PLANE, energy=E, span=1.0)
    for poincare, q in [(P, [0.9, 0.0]), (short, [0.1, 0.0])]:
        value = lambda q, poincare: poincare(q)[0]  # noqa: E731
        d_q, d_map = jax.grad(value, argnums=(0, 1), allow_int=True)(jnp.array(q), poincare)
        assert np.isnan(d_q).all()
        assert np.isnan(d_map.energy)


def test_misuse_is_refused():
    def call(event=PLANE, **more):
        return refusal(lambda: poincare_map(HENON, event, **more))

    assert "one with a direction" in call(Reaches(0, 0.0))
    assert "none for a stroboscopic map" in call(Every(1.0), energy=0.1)
    assert "events.Reaches or events.Every" in call("x")
    assert "crossings: expected a whole number" in call(energy=0.1, crossings=0)
    assert "period: expected > 0" in call(Every(0.0))
    assert "q: expected shape (2,), got shape (3,). One entry for each of y, vy." in refusal(
        lambda: P([1.0, 2.0, 3.0])
    )
