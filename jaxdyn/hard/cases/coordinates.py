"""Coordinates that fail: Euler angles at a pole, x of a pendulum, polar ones at the origin.

Motions that switch coordinates in time (`jaxdyn.scenes.switching`) are compared with descriptions
that never need to: quaternions, the angle of the pendulum, a straight line. The result without
switching is reported as well.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn.analysis import energy
from jaxdyn.formulations import rigid
from jaxdyn.hard.case import Case, Figure, absolute_error
from jaxdyn.integrate.phases import HybridTrajectory
from jaxdyn.integrate.simulation import simulate
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.scenes.bodies import free_body, top
from jaxdyn.scenes.particles import polar_particle
from jaxdyn.scenes.pendula import pendulum
from jaxdyn.scenes.sideways import sideways_edge, sideways_pendulum
from jaxdyn.scenes.switching import simulate_switching
from jaxdyn.status import Status

_RTOL = 1e-13
_BOUND = 1e-9
_FEW = 20_000  # step limit of a motion in failing coordinates
_SLOW = 0.5  # spin over the critical spin: upright is unstable, and the top passes it


def upright_passing(representation: str = "quaternion") -> Scene:
    """A top that repeatedly passes exactly upright: its momenta about z and its axis are equal.

    That is, I sin^2(theta) phi' + I3 w3 cos(theta) = I3 w3. ZXZ angles lock upright.
    """
    numbers = {"m": 0.1, "d": 0.05, "I1": 1e-4, "I3": 5e-5, "g": 9.81}
    across = numbers["I1"] + numbers["m"] * numbers["d"] ** 2
    w3 = _SLOW * 2 * np.sqrt(across * numbers["m"] * numbers["g"] * numbers["d"]) / numbers["I3"]
    theta = 0.5
    precession = numbers["I3"] * w3 / (across * (1 + np.cos(theta)))
    rates = {"precession": precession, "nutation": -8.0, "spin": w3 - precession * np.cos(theta)}
    return top(theta, **rates, **numbers, representation=representation, t1=1.0)


def _pole() -> tuple[Figure, ...]:
    by_quaternion = simulate(upright_passing(), samples=1001, rtol=_RTOL)
    axis = energy.along(rigid.pose, by_quaternion).R_wb[:, 2, 2]
    scene = upright_passing("euler")
    refused = simulate(scene, rtol=_RTOL, samples=101, max_steps=_FEW, throw=False)
    chain = simulate_switching(scene, rtol=_RTOL, samples=2)
    got_to = np.asarray(refused.ts)[np.isfinite(np.asarray(refused.ys)).all(axis=1)]
    return (
        Figure("apart from the quaternion", _apart(chain, by_quaternion), _BOUND),
        Figure("nearest to upright seen [rad]", float(jnp.arccos(jnp.max(axis))), 0.05),
        Figure("exchanges of angles", len(chain.names) - 1, 10),
        Figure("no status without exchanges", float(refused.status == Status.OK), 0),
        Figure("where that stopped [s]", float(got_to[-1])),
    )


def _tumbling() -> tuple[Figure, ...]:
    turning = (0.3, 1.0, 0.2)
    scene = free_body(turning, representation="euler", sequence="XYZ")
    chain = simulate_switching(scene, rtol=_RTOL, samples=2)
    other = simulate(free_body(turning), samples=1, rtol=_RTOL)
    without = simulate(scene, samples=1, rtol=_RTOL, throw=False)
    found, wanted = (rigid.pose(m.scene, 0.0, m.ys[-1]).R_wb for m in (without, other))
    return (
        Figure("apart from the quaternion", _apart(chain, other), _BOUND),
        Figure("exchanges of angles", len(chain.names) - 1, 60),
        Figure("apart without exchanges", absolute_error(found, wanted)),
        Figure("steps with", sum(int(piece.steps) for piece in chain.pieces)),
        Figure("steps without", int(without.steps)),
    )


def _apart(chain: HybridTrajectory, other: Trajectory) -> float:
    found = rigid.pose(chain.pieces[-1].scene, chain.t, chain.y).R_wb
    return absolute_error(found, rigid.pose(other.scene, chain.t, other.ys[-1]).R_wb)


def _over() -> tuple[Figure, ...]:
    t1, rate = 10.0, 7.0  # nine times over the top
    angle = simulate(pendulum(rate=rate), t1, samples=2, rtol=_RTOL).ys[-1, 0]
    chain = simulate_switching(sideways_pendulum(rate=rate), t1, samples=2, rtol=_RTOL)
    turns = float(angle / (2 * jnp.pi))
    wanted = np.array([jnp.sin(angle), -jnp.cos(angle)])
    edge = sideways_edge(sideways_pendulum(rate=rate), t1, rtol=_RTOL)
    refused = simulate(
        sideways_pendulum(rate=rate), t1, samples=1, rtol=_RTOL, max_steps=_FEW, throw=False
    )
    return (
        Figure(
            "apart from the angle [m]", absolute_error(chain.pieces[-1].r[-1, 0], wanted), _BOUND
        ),
        Figure("turns", turns),
        Figure("exchanges beyond four a turn", len(chain.names) - 1 - 4 * turns, 1.0),
        Figure("no status without exchanges", float(refused.status == Status.OK), 0),
        Figure("when x is at its edge [s]", float(edge.t)),
    )


def _origin() -> tuple[Figure, ...]:
    offs = (0.0, 1e-15, 1e-9, 1e-3)
    found = []
    for off in offs:
        scene = polar_particle(position=(1.0, off), velocity=(-1.0, 0.0))
        chain = simulate_switching(scene, 2.0, samples=2, rtol=_RTOL)
        found.append(absolute_error(chain.pieces[-1].r[-1, 0], [-1.0, off]))
    return (
        Figure("off a straight line [m]", max(found), _BOUND),
        Figure("steps past 1e-9 m without exchanges", _polar_steps(1e-9)),
    )


def _polar_steps(off: float) -> float:
    scene = polar_particle(position=(1.0, off), velocity=(-1.0, 0.0))
    return float(simulate(scene, 2.0, samples=1, rtol=_RTOL, throw=False).steps)


CASES = (
    Case(
        "euler-angles-at-the-pole", "A top by Euler angles passes upright, where they lock.", _pole
    ),
    Case("gimbal-lock", "A body by Euler angles tumbles through all gimbal locks.", _tumbling),
    Case("pendulum-by-x", "A pendulum goes over the top, by x and y in turn.", _over),
    Case(
        "polar-origin",
        "A particle in polar coordinates passes straight through the origin.",
        _origin,
    ),
)
