"""Normal forms of bifurcations of orbits: closed forms under changes of coordinates, and branches.

Each scene is a normal form whose map over a period is known, in coordinates that bend it and move
with the time. These do not change the coefficients.
"""

import functools
import math

import jax.numpy as jnp
import numpy as np
import odes
import pytest
from scipy.special import mathieu_b

import jaxdyn
import orbits
from orbits import PLAIN, Kind
from orbits.orbit import Orbit, Outcome

TURN = 2 * math.pi
BEND, SHIFT = 0.7, 0.3


def held(scene, y0, period=TURN, closing=PLAIN):
    """An orbit known in closed form, at a bifurcation, where a search would not converge."""
    return Orbit(scene.starting(jnp.asarray(y0), period), closing, 0.0, Outcome.FOUND, 0, 1e-13)


@functools.cache
def bent(flow):
    """The rate of X = x + (BEND x2^2 + SHIFT cos t, 0, ..) for x' = flow(t, x).

    One function for each flow, so that each is compiled once.
    """

    def rate(t, big, c):
        x = jnp.asarray(big).at[0].add(-BEND * big[1] ** 2 - SHIFT * jnp.cos(t))
        v = flow(t, x, c)
        return v.at[0].add(2 * BEND * x[1] * v[1] - SHIFT * jnp.sin(t))

    return rate


def half_turning(t, x, c):
    """u1' = c u1^3, u2' = -u2 + u1^2 u2 in axes that make half a turn in a period."""
    cos, sin = jnp.cos(t / 2), jnp.sin(t / 2)
    u = jnp.stack([cos * x[0] + sin * x[1], cos * x[1] - sin * x[0]])
    v = jnp.stack([c * u[0] ** 3, -u[1] + u[0] ** 2 * u[1]])
    spun = 0.5 * jnp.stack([-x[1], x[0]])
    return jnp.stack([cos * v[0] - sin * v[1], sin * v[0] + cos * v[1]]) + spun


def turning(t, x, c):
    """z' = 0.3 i z + c z |z|^2."""
    r = x[0] ** 2 + x[1] ** 2
    return c * r * x[:2] + 0.3 * jnp.stack([-x[1], x[0]])


def one_sided(t, x, c):
    """x1' = c[0] x1^2 + c[1] x1^3, x2' = -x2 / 2."""
    return jnp.stack([c[0] * x[0] ** 2 + c[1] * x[0] ** 3, -0.5 * x[1]])


CASES = [
    (Kind.DOUBLING, half_turning, -0.2, 0.2 * TURN, "supercritical"),
    (Kind.DOUBLING, half_turning, 0.15, -0.15 * TURN, "subcritical"),
    (Kind.TORUS, turning, -0.2, -0.4 * TURN, "supercritical"),
    (Kind.TORUS, turning, 0.1, 0.2 * TURN, "subcritical"),
    (Kind.FOLD, one_sided, (0.2, 0.0), 0.2 * TURN, "fold"),
    (Kind.BRANCH, one_sided, (0.0, -0.1), -0.1 * TURN, "supercritical"),
    # x^2 over a period: x + c T x^2 + (c T)^2 x^3.
    (Kind.BRANCH, one_sided, (0.2, 0.1), 0.1 * TURN + (0.2 * TURN) ** 2, "transcritical"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "flow", "c", "exact", "verdict"), CASES)
def test_coefficients_of_driven_scenes_in_bent_coordinates(kind, flow, c, exact, verdict):
    scene = jaxdyn.ode(bent(flow), [SHIFT, 0.0], TURN, params=jnp.asarray(c))
    found = orbits.criticality(held(scene, [SHIFT, 0.0]), kind)
    assert found.verdict == verdict
    assert abs(found.coefficient - exact) < 1e-11
    assert abs(found.coefficient - exact) < found.bar + 1e-12
    assert verdict in str(found)


@pytest.mark.slow
def test_a_torus_point_of_a_cycle_whose_speed_depends_on_where_it_is():
    """r' = r (1 - r^2), phi' = 1 + 0.4 x, beside it z' = 0.3 i z + c z |z|^2."""

    def rate(t, y, c):
        loss, beside = 1 - y[0] ** 2 - y[1] ** 2, y[2:]
        speed = 1 + 0.4 * beside[0]
        around = jnp.stack([y[0] * loss - speed * y[1], y[1] * loss + speed * y[0]])
        return jnp.concatenate([around, turning(t, beside, c)])

    scene = jaxdyn.ode(rate, [1.0, 0.0, 0.0, 0.0], TURN, params=-0.2)
    found = orbits.criticality(held(scene, [1.0, 0.0, 0.0, 0.0]), "torus point")
    assert abs(found.coefficient + 0.4 * TURN) < 1e-11
    assert found.verdict == "supercritical"


def rossler(c):
    return jaxdyn.ode(odes.roessler, [3.0, -3.0, 0.1], 5.9, params=c)


@pytest.mark.long
def test_the_branch_lies_on_the_side_that_the_coefficient_says():
    """Roessler's first period doubling, near c = 2.83, is supercritical: it begins the cascade."""
    first = orbits.find(rossler(2.6))
    family = orbits.continue_family(first, rossler, 2.6, step=0.2, within=(2.6, 3.2), members=30)
    point = next(x for x in family.special if x.kind == Kind.DOUBLING)
    assert abs(point.parameter - 2.83) < 0.01
    found = orbits.criticality(point)
    assert found.verdict == "supercritical"
    double, parameter = orbits.switch_branch(family, point, amplitude=0.2)
    assert parameter > point.parameter
    assert orbits.stability(double).verdict == "stable"


@pytest.mark.slow
def test_a_strong_resonance_is_undecided():
    def third(t, x, c):
        return c * x * (x @ x) + jnp.stack([-x[1], x[0]]) / 3

    scene = jaxdyn.ode(bent(third), [SHIFT, 0.0], TURN, params=-0.2)
    found = orbits.criticality(held(scene, [SHIFT, 0.0]), Kind.TORUS)
    assert found.verdict == "undecided"
    assert "1:3 or 1:4" in found.message


@pytest.mark.slow
def test_a_coefficient_that_vanishes_is_undecided():
    scene = jaxdyn.ode(bent(half_turning), [SHIFT, 0.0], TURN, params=0.0)
    found = orbits.criticality(held(scene, [SHIFT, 0.0]), Kind.DOUBLING)
    assert found.verdict == "undecided"
    assert "codimension two" in found.message


def shaken(t, y, p):
    omega, damping = p
    return [y[1], -damping * y[1] - (1 + 0.3 * jnp.cos(omega * t)) * y[0] - y[0] ** 3]


def at_rest(omega, damping):
    numbers = jnp.stack([jnp.asarray(omega, float), jnp.asarray(damping)])
    return jaxdyn.ode(shaken, [0.0, 0.0], TURN / omega, params=numbers)


@pytest.mark.slow
def test_branches_of_a_rest_state_are_pitchforks_by_its_symmetry():
    """The second tongue of Mathieu's equation, with a spring that stiffens: both bend upwards."""

    def make(omega):
        return at_rest(omega, 0.01)

    rest = orbits.find(make(1.02))
    family = orbits.continue_family(rest, make, 1.02, within=(0.97, 1.02), down=True, members=20)
    upper, lower = family.special
    assert [orbits.criticality(x).verdict for x in family.special] == [
        "subcritical",
        "supercritical",
    ]
    for point, verdict in ((upper, "unstable"), (lower, "stable")):
        branch, omega = orbits.switch_branch(family, point)
        assert omega > point.parameter
        assert orbits.stability(branch).verdict == verdict


@pytest.mark.slow
@pytest.mark.parametrize(("low", "high"), [(2.1, 2.2), (0.99, 1.01)])
def test_without_damping_multipliers_are_double_and_the_edges_those_of_mathieu(low, high):
    def make(omega):
        return at_rest(omega, 0.0)

    family = orbits.continue_family(
        orbits.find(make(high)), make, high, within=(low, high), down=True, members=20
    )
    (point,) = family.special
    order = round(2 / point.parameter)
    q = 2 * 0.3 / point.parameter**2
    assert point.parameter == pytest.approx(2 / math.sqrt(mathieu_b(order, q)), rel=1e-11)
    found = orbits.criticality(point)
    assert found.verdict == "undecided"
    assert found.message.startswith("Two multipliers have the critical value")
    assert math.isnan(found.coefficient)


@pytest.mark.slow
def test_an_orbit_of_a_conservative_scene_is_refused():
    swing = orbits.find(jaxdyn.scenes.pendulum(angle=1.0), period=2.2)
    with pytest.raises(ValueError, match="without a first integral"):
        orbits.criticality(swing, "fold")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("orbit", "kind", "said"),
    [
        (held(rossler(2.6), [3.0, -3.0, 0.1]), None, "kind: expected a fold"),
        (held(rossler(2.6), [3.0, -3.0, 0.1]), "cusp", "kind: expected a fold"),
        (held(jaxdyn.ode(bent(turning), [0.3, 0.0], TURN, params=0.1), [0.3, 0.0]), "fold", "crit"),
        (held(jaxdyn.scenes.pinned_chain(), np.zeros(8), 2.0), "fold", "without constraints"),
        (
            held(jaxdyn.scenes.three_body(), np.ones(12), 1.0, orbits.relative()),
            "fold",
            "closes without a rotation",
        ),
    ],
)
def test_misuse_is_refused(orbit, kind, said):
    with pytest.raises(ValueError, match=said):
        orbits.criticality(orbit, kind)
