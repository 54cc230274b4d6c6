"""Problems 14, 18, 19, 50: which definitions and balances hold, about which points."""

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import EXACT, gap

from jaxdyn import Scene, simulate
from jaxdyn.analysis import energy, momenta
from jaxdyn.effects import LinearDrag, PairGravity, Spring, StepForce, UniformGravity
from jaxdyn.formulations.newton import FreePoints

RNG = np.random.default_rng(6)


@pytest.fixture(scope="module")
def motion():
    """Three points in space that attract each other, fall, and are dragged."""
    effects = (PairGravity(0.5), UniformGravity(1.0), LinearDrag(0.3), Spring(2.0, 1.0, j=1))
    scene = Scene(FreePoints([1.0, 2.0, 0.5], 3), effects, y0=RNG.normal(size=18))
    return simulate(scene, 0.5, samples=7, rtol=1e-12)


def at_rest(t, points):
    return jnp.array([1.0, -2.0, 0.5]) + 0 * t


def uniform(t, points):
    return jnp.array([1.0, -2.0, 0.5]) + t * jnp.array([0.3, 1.0, -2.0])


def wild(t, points):
    return jnp.stack([jnp.sin(3 * t), t**3, jnp.cos(t)])


def beside_g(t, points):
    """Moves parallel to G: with it, at a fixed distance."""
    return momenta.centre_of_mass(t, points) + jnp.array([1.0, 2.0, 3.0])


def towards_g(t, points):
    """Accelerates along the line to G, since G moves uniformly in `coasting`."""
    return momenta.centre_of_mass(t, points) + jnp.exp(t) * jnp.array([1.0, 2.0, -1.0])


# Problems 14 and 19: (moving point C, definitions of H/C for which M = dH/dt)
CASES = [
    (at_rest, {"fixed", "absolute", "relative"}),
    (momenta.centre_of_mass, {"fixed", "absolute", "relative"}),  # problem 50
    (uniform, {"fixed", "relative"}),
    (beside_g, {"fixed", "absolute"}),
    (wild, {"fixed"}),
]


@pytest.mark.parametrize(("c", "true"), CASES)
@pytest.mark.slow
def test_problems_14_and_19_which_definition_holds_about_which_point(motion, c, true):
    balances = momenta.moment_balance(motion, c)
    assert {name for name, balance in balances.items() if balance.holds} == true
    for name, balance in balances.items():
        # Either rounding or a gross failure, nothing between.
        small = 1e-13 if name in true else 1e-3
        assert (balance.residual < small * balance.scale) == (name in true)


@pytest.mark.slow
def test_relative_holds_about_a_point_that_accelerates_from_a_coasting_g(motion):
    coasting = motion.scene.without(UniformGravity).without(LinearDrag)
    balances = momenta.moment_balance(simulate(coasting, 0.5, samples=7), towards_g)
    assert {name for name, balance in balances.items() if balance.holds} == {"fixed", "relative"}


def test_what_is_missing_where_a_definition_fails(motion):
    scene, t, y = motion.scene, motion.ts[3], motion.ys[3]
    r, v, m = (np.asarray(x) for x in scene.system.points(t, y))
    time = float(t)
    moment = momenta.moment_about(scene, t, y, wild)

    def missing(definition):
        return moment - momenta.angular_momentum_rate(scene, t, y, wild, definition)

    c = np.array([np.sin(3 * time), time**3, np.cos(time)])
    c_rate = np.array([3 * np.cos(3 * time), 3 * time**2, -np.sin(time)])
    c_acceleration = np.array([-9 * np.sin(3 * time), 6 * time, -np.cos(time)])
    total, g = m.sum(), m @ r / m.sum()
    assert gap(missing("absolute"), np.cross(c_rate, m @ v)) < 100 * EXACT
    assert gap(missing("relative"), np.cross(g - c, total * c_acceleration)) < 1000 * EXACT
    assert gap(missing("fixed"), np.zeros(3)) < 1000 * EXACT


def test_the_moment_is_that_of_the_forces(motion):
    scene, t, y = motion.scene, motion.ts[2], motion.ys[2]
    r, v, m = scene.system.points(t, y)
    force = sum(effect.force(t, r, v, m) for effect in scene.effects)
    expected = np.cross(np.asarray(r) - np.asarray(at_rest(0.0, None)), force).sum(axis=0)
    assert gap(momenta.moment_about(scene, t, y, at_rest), expected) < 100 * EXACT
    # Internal forces have none.
    inside = scene.without(UniformGravity).without(LinearDrag)
    assert gap(momenta.moment_about(inside, t, y, at_rest), np.zeros(3)) < 100 * EXACT


def test_angular_momentum_about_the_origin_is_the_usual_one(motion):
    scene, t, y = motion.scene, motion.ts[2], motion.ys[2]
    usual = energy.angular_momentum(scene, t, y)
    for definition in momenta.DEFINITIONS:
        h = momenta.angular_momentum_about(scene, t, y, lambda t, p: jnp.zeros(3), definition)
        assert gap(h, usual) < 10 * EXACT


def test_one_particle_about_a_point_that_rides_on_it():
    # Problem 14 with C = P: r_P/C = 0, so all hold for a single particle.
    scene = Scene(FreePoints(2.0), (UniformGravity(1.0),), y0=[1.0, 0.0, 2.0, 3.0])
    motion = simulate(scene, 1.0, samples=3)
    balances = momenta.moment_balance(motion, lambda t, points: points.r[0])
    assert all(balance.holds for balance in balances.values())
    assert balances["fixed"].residual.shape == ()


def test_koenigs_split_adds_up_and_moves_with_the_frame(motion):
    scene, t, y = motion.scene, motion.ts[2], motion.ys[2]
    centre, relative = momenta.kinetic_split(scene, t, y)
    assert gap(centre + relative, scene.system.kinetic(t, y)) < 10 * EXACT
    # Seen from a frame that moves, only the first part changes.
    moving = y.at[9:].add(jnp.tile(jnp.array([1.0, 2.0, 3.0]), 3))
    assert gap(momenta.kinetic_split(scene, t, moving)[1], relative) < 10 * EXACT
    g = np.asarray(momenta.centre_of_mass(t, scene.system.points(t, y)))
    assert gap(g, np.asarray(y[:9]).reshape(3, 3).T @ [1.0, 2.0, 0.5] / 3.5) < EXACT


class Internal(Spring):
    """The springs of problem 18 that belong to the system."""


def _pair(*external):
    y0 = [0.0, 0.0, 2.0, 0.0, 0.0, 0.5, 1.0, -0.5]
    return Scene(FreePoints([1.0, 3.0]), (Internal(5.0, 1.0, j=1), *external), y0=y0)


@pytest.mark.slow
def test_problem_18_b_always_and_c_not_always():
    # Uniform gravity works on all points as on G: the relative part has internal power only.
    alike = simulate(_pair(UniformGravity(2.0)), 1.0, samples=5)
    balances = momenta.power_balances(alike, Internal)
    assert balances["centre"].holds
    assert balances["relative"].holds
    # A push on one point, the counter-example to c: b holds all the same.
    pushed = simulate(_pair(StepForce([3.0, 1.0], on=(1,))), 1.0, samples=5)
    balances = momenta.power_balances(pushed, Internal)
    assert balances["centre"].holds
    assert not balances["relative"].holds
    assert balances["relative"].residual > 0.1
    # The powers themselves: 3, 1 N on the mass centre, which moves at v_G.
    v_g = 0.25 * pushed.ys[:, 4:6] + 0.75 * pushed.ys[:, 6:8]
    assert gap(balances["centre"].left, v_g @ jnp.array([3.0, 1.0])) < 10 * EXACT
    assert gap(balances["centre"].left, balances["centre"].right) < 10 * EXACT


def test_an_unknown_definition_is_refused(motion):
    message = r"^definition: expected one of absolute, fixed, relative, got 'relativ'\. Did you"
    with pytest.raises(ValueError, match=message):
        momenta.angular_momentum_about(motion.scene, 0.0, motion.ys[0], at_rest, "relativ")
    with pytest.raises(ValueError, match=message):
        momenta.angular_momentum_rate(motion.scene, 0.0, motion.ys[0], at_rest, "relativ")
