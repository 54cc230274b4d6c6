"""Coordinates exchanged before they fail: against motions that need no exchange."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SOLVED, gap

from jaxdyn import Scene, scenes, simulate
from jaxdyn.effects import Spring
from jaxdyn.formulations import rigid
from jaxdyn.geometry.euler import (
    SEQUENCES,
    euler_from_matrix,
    matrix_from_euler,
    omega_w_from_euler,
)
from jaxdyn.integrate import phases
from jaxdyn.mechanisms.euler_body import EulerBody
from jaxdyn.scenes.particles import particle
from jaxdyn.scenes.switching import complement, coordinate_phases, simulate_switching

RTOL = 1e-13


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_a_sequence_and_its_complement_never_lock_together(sequence):
    other = complement(sequence)
    assert other in SEQUENCES
    assert complement(other) in SEQUENCES
    locked = jnp.pi / 2 if len(set(sequence)) == 3 else 0.0
    R = matrix_from_euler(jnp.array([0.4, locked, 0.7]), sequence)
    assert abs(jnp.linalg.det(omega_w_from_euler(jnp.array([0.4, locked, 0.7]), sequence))) < 1e-15
    angles = euler_from_matrix(R, other).angles
    assert abs(abs(jnp.linalg.det(omega_w_from_euler(angles, other))) - 1) < 1e-14


@pytest.mark.slow
def test_a_pendulum_goes_over_the_top_by_x_and_y():
    angle = simulate(scenes.pendulum(rate=7.0), 1.5, samples=7, rtol=RTOL).ys[:, 0]
    chain = simulate_switching(scenes.sideways_pendulum(rate=7.0), 1.5, samples=3, rtol=RTOL)
    assert chain.ended is False
    assert chain.message == "The span ended."
    assert chain.names[:5] == ("below", "right", "above", "left", "below")
    r = chain.pieces[-1].r[-1, 0]
    assert gap(r, jnp.stack([jnp.sin(angle[-1]), -jnp.cos(angle[-1])])) < 10 * SOLVED
    # The exchanges are where x or y are at sqrt(3)/2 of the length.
    for piece in chain.pieces[:-1]:
        assert abs(abs(piece.ys[-1, 0]) - np.sqrt(0.75)) < SOLVED


@pytest.mark.slow
def test_a_start_near_the_edge_is_exchanged_at_once():
    near = scenes.sideways_pendulum(angle=1.5, rate=1.0)
    chain = simulate_switching(near, 0.5, samples=2, rtol=RTOL)
    assert chain.names[0] == "right"
    angle = simulate(scenes.pendulum(angle=1.5, rate=1.0), 0.5, samples=1, rtol=RTOL).ys[0, 0]
    wanted = jnp.stack([jnp.sin(angle), -jnp.cos(angle)])
    assert gap(chain.pieces[-1].r[-1, 0], wanted) < 10 * SOLVED


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-3])
@pytest.mark.slow
def test_a_particle_on_a_spring_passes_the_origin_by_polar_coordinates(off):
    start = {"position": (1.0, off), "velocity": (-1.0, 0.1 * off)}
    chain = simulate_switching(scenes.polar_particle(Spring(4.0), **start), 5.0, rtol=RTOL)
    plain = simulate(particle(Spring(4.0), **start), 5.0, samples=1, rtol=RTOL)
    assert set(chain.names) == {"polar", "cartesian"}
    assert gap(chain.pieces[-1].r[-1], plain.r[-1]) < 10 * SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("sequence", ["XYZ", "zxz"])
def test_a_body_tumbles_through_the_locks_of_its_angles(sequence):
    turning = (0.3, 1.0, 0.2)
    scene = scenes.free_body(turning, representation="euler", sequence="YXZ")
    body = EulerBody(scene.system.mechanism.matter, sequence)
    start = rigid.resting(matrix_from_euler(jnp.array([0.1, 0.8, 0.2]), sequence), turning)
    chain = simulate_switching(
        Scene(type(scene.system)(body), y0=body.state(start)), 20.0, rtol=RTOL
    )
    free = scenes.free_body(turning)
    free = free.starting(free.system.state(start))
    wanted = rigid.pose(free, 20.0, simulate(free, 20.0, samples=1, rtol=RTOL).ys[-1])
    found = rigid.pose(chain.pieces[-1].scene, chain.t, chain.y)
    assert gap(found.R_wb, wanted.R_wb) < 100 * SOLVED
    assert {sequence, complement(sequence)} == set(chain.names)


@pytest.mark.slow
def test_a_known_sequence_of_exchanges_has_derivatives():
    def end(rate):
        scene = scenes.polar_particle(position=(1.0, 1e-3), velocity=(rate, 0.0))
        known = coordinate_phases(scenes.polar_particle(position=(1.0, 1e-3)))
        return phases.follow(known, (("polar", 0),), scene.y0, 2.0)[0]

    # From 1 to 0.5 from the origin.
    time, slope = jax.value_and_grad(end)(-1.0)
    assert abs(time - 0.5) < 1e-5
    assert abs(slope - 0.5) < 1e-5


def test_what_makes_no_sense_is_refused():
    with pytest.raises(ValueError, match=r"^margin: expected between 0 and 0\.7, got 0\.8"):
        simulate_switching(scenes.polar_particle(), margin=0.8)
    with pytest.raises(ValueError, match=r"^scene: expected a body by Euler angles, .* got Stick"):
        simulate_switching(scenes.pendulum())
    with pytest.raises(ValueError, match="got FreePoints"):
        coordinate_phases(scenes.cannonball())
