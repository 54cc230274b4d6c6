"""Parameters that no motion can start from are refused in one line that names them."""

import math
import re

import jax
import numpy as np
import pytest

from jaxdyn import IntegrationError, Status, scenes, simulate
from jaxdyn.analysis.ledger import with_work
from jaxdyn.effects import QuadraticDrag
from orbits.orbit import Outcome

CASES = [
    (lambda: scenes.two_body(d=-1.0), "d: expected > 0, got -1.0"),
    (lambda: scenes.two_body(m1=-5.0), "m1: expected > 0, got -5.0"),
    (lambda: scenes.two_body(G=0.0), "G: expected > 0, got 0.0"),
    (lambda: scenes.three_body_circular(diameter=0.0), "diameter: expected > 0, got 0.0"),
    (lambda: scenes.three_body_circular(m=-1.0), "m: expected > 0, got -1.0"),
    (lambda: scenes.top(0.0, representation="euler"), "sequence: expected Euler angles that do"),
    (
        lambda: scenes.free_body(representation="euler", sequence="ZXZ"),
        "sequence: expected Euler angles that do not lock in the pose at the start, got 'ZXZ'",
    ),
    (lambda: scenes.bead_on_cycloid(s=9.0, c=0.25), "s: expected less than 2 m from the bottom"),
    (lambda: scenes.bead_on_cycloid(s=math.nan), "s: expected less than"),
    (lambda: scenes.car(to_front=-1.4), "to_front: expected > 0, got -1.4"),
    (lambda: scenes.car(to_rear=0.0), "to_rear: expected > 0, got 0.0"),
    (lambda: scenes.pinned_chain(span=9.0), "span: expected links that can close"),
    (lambda: scenes.pinned_chain(span=4.0), "span: expected links that can close"),
    (lambda: scenes.pinned_chain(span=math.nan), "span: expected finite numbers, got nan"),
    (lambda: scenes.four_bar(ground=9.0), "ground: expected links that can close"),
    (lambda: scenes.four_bar(l=(9.0, 1.0, 1.0)), "l: expected links that can close"),
    (
        lambda: scenes.four_bar(ground=4.5, angle=0.0),
        "angle: expected an angle of the crank at which coupler and rocker reach",
    ),
    (lambda: scenes.top(I1=0.0), "I1: expected > 0, got 0.0"),
    (lambda: scenes.top(I3=0.0), "I3: expected > 0, got 0.0"),
    (lambda: scenes.one_skate(at=1.0), r"at: expected shape (2,), got shape ()"),
    (lambda: scenes.one_skate(at=((1.0, 0.0), (2.0, 0.0))), "at: expected shape (2,)"),
    (lambda: scenes.one_skate(heading=(1.0, 2.0)), "heading: expected shape ()"),
    (lambda: scenes.two_skates(at=(1.0, 0.0)), "at: expected shape (2, 2)"),
    (lambda: scenes.two_skates(headings=(1.0,)), "headings: expected shape (2,)"),
    (
        lambda: scenes.rolling_disk(0.0),
        "theta: expected a disk that does not lie flat, 0 < theta",
    ),
    (lambda: scenes.rolling_disk(math.pi), "theta: expected a disk that does not lie flat"),
]


@pytest.mark.parametrize(("make", "message"), CASES, ids=[m[:30] for _, m in CASES])
def test_a_senseless_start_is_refused_by_name(make, message):
    with pytest.raises(ValueError, match="expected") as refused:
        make()
    assert str(refused.value).startswith(message)
    assert "\n" not in str(refused.value)


def test_a_start_just_inside_is_taken():
    assert simulate(scenes.bead_on_cycloid(s=1.99, c=0.25), 0.1).ok
    near = scenes.pinned_chain(span=3.9, angles=(1.4, 1.5, 1.6, 1.7))
    np.testing.assert_allclose(near.system.violation(0.0, near.y0)[0], 0.0, atol=1e-12)


def test_traced_numbers_pass_the_checks():
    slope = jax.grad(lambda d: scenes.two_body(d=d).t1)(1.0)
    np.testing.assert_allclose(slope, 1.5 * scenes.two_body().t1, rtol=1e-14)
    locked = jax.jit(lambda theta: scenes.top(theta, representation="euler").y0)(0.0)
    assert np.isnan(locked).any()


ENDS = [
    (lambda: scenes.sideways_pendulum(rate=6.0), r"level of the hinge .* scenes\.sideways_edge"),
    (lambda: scenes.power_law(speed=0.0, n=-2.0), r"A central force may be infinite at its centre"),
    (lambda: scenes.bead_on_cycloid(speed=9.0), r"The wire ends upright"),
    (lambda: scenes.top(1e-9, representation="euler"), r"Euler angles lock .* another sequence"),
    (
        lambda: scenes.four_bar(l=(1.0, 2.0, 2.0), ground=4.5, rate=5.0, formulation="lagrange"),
        r"coupler and rocker are in line",
    ),
    (
        lambda: scenes.two_body().starting([0.0, 0, 1, 0, 0, 0, 0, 0]),
        r"Bodies that meet .* regularised\.simulate_regularised",
    ),
]


@pytest.mark.parametrize(("make", "says"), ENDS, ids=[says[:20] for _, says in ENDS])
def test_a_motion_that_ends_in_a_singularity_says_which_ones_its_scene_has(make, says):
    scene = make()
    motion = simulate(scene, 5.0, samples=2, rtol=1e-8, throw=False)
    assert motion.status_code in (Status.STEP_COLLAPSED, Status.NOT_FINITE)
    assert motion.message.startswith(motion.status_code.message)
    assert re.search(says, motion.message)
    others = [other for _, other in ENDS if other != says]
    assert not any(re.search(other, motion.message) for other in others)
    with pytest.raises(IntegrationError, match=says):
        simulate(scene, 5.0, samples=2, rtol=1e-8)


def test_a_spring_through_its_pin_is_no_collision_of_bodies():
    scene = scenes.spring_mass(position=(0.5, 0.0), g=0.0, length=0.2)
    assert scene.singular.startswith("A spring or dashpot has no direction where its ends coincide")
    assert "bod" not in Outcome.COLLISION.message
    assert (scenes.cannonball().singular, scenes.pendulum().singular) == ("", "")
    assert with_work(scenes.cannonball(drag=1.0), QuadraticDrag).singular == ""
