"""Is steady precession general for an axisymmetric body?

A free axisymmetric body can precess steadily about its angular momentum. Are these its most general
motions, or are there others?

Answer: There are no others: with H constant, omega = H / I_1 + omega_s e_3', and omega_s = (1 - I_3
/ I_1) omega_3 is constant, so the attitude is exp(t S(H) / I_1) R_0 exp(t omega_s S(e_3)) for any
start, where S(a) r = a x r. Simulations of satellite B from three starts, given along the edges of
its cube, agree with it to 1e-11.

Why: for I_1 = I_2 the angular momentum H = I_1 omega + (I_3 - I_1) omega_3 e_3', so

    omega = H / I_1 + omega_s e_3',   omega_s = (1 - I_3 / I_1) omega_3.

Euler's third equation, I_3 omega_3' = (I_1 - I_2) omega_1 omega_2 = 0, says that omega_3 is
constant, and without a moment H is constant. So e_3' changes at omega x e_3' = (H / I_1) x e_3': it
goes round H at the constant rate |H| / I_1, at a constant angle. The body turns relative to it at
the constant omega_s. Nothing was assumed of the start, so there is no other motion; an exact spin
about the axis or across it is the special case in which e_3' stays, or omega_s e_3' is zero.
"""

import jax
import jax.numpy as jnp

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import energy, precession
from jaxdyn.course.page import Page, show
from jaxdyn.formulations import rigid
from jaxdyn.geometry import inertia

PROBLEM = 58
TOPIC = "rigid bodies in space"


def two_turns(R0, omega_b0, moments, ts):
    """Attitudes exp(t S(H) / I_1) R_0 exp(t omega_s S(e_3)) at some times."""
    numbers = {"I1": moments[0], "I3": moments[2]}
    return jax.vmap(lambda t: precession.free_attitude(R0, omega_b0, t, **numbers))(ts)


def solve(page: Page) -> None:
    """Compare satellite B, from unlike starts, with two turns at constant rates."""
    moments, axes = inertia.principal(scenes.satellites.satellite_b())
    across = "principal moments of satellite B: I_1 across its axis, I_3 about it"
    page.number(across, moments[1:], "kg m^2")
    starts = {"tumble": (0.3, 1.0, 0.2), "wobble": (1.0, 0.8, 1.1), "flat": (1.0, -0.4, -0.5)}
    motions = {}
    for name, omega in starts.items():
        motion = simulate(scenes.satellite("B", omega), 30.0, samples=400, rtol=1e-12)
        closed = two_turns(axes, axes.T @ jnp.array(omega), moments, motion.ts)
        pose = energy.along(rigid.pose, motion)
        attitude = pose.R_wb @ axes
        statement = f"The attitude is that of two steady turns, start omega = {omega} rad/s"
        page.equal(statement, attitude, closed, within=1e-11)
        momentum = energy.along(energy.angular_momentum, motion)[0]
        tilt = attitude[:, :, 2] @ momentum / jnp.linalg.norm(momentum)
        page.number(f"angle from H to the axis of B, start {omega}", jnp.arccos(tilt[0]), "rad")
        page.equal(f"That angle is constant, start {omega}", jnp.ptp(tilt), 0.0, within=1e-12)
        about = pose.omega_w - (momentum / moments[0])
        spin = (1 - moments[2] / moments[0]) * jnp.array(omega) @ axes[:, 2]
        statement = f"omega = H / I_1 + omega_s e_3', start {omega}"
        page.equal(statement, about, spin * attitude[:, :, 2], within=1e-11)
        motions[name] = motion

    page.draw(
        lambda: drawing.trajectory(motions["wobble"]),
        "One antenna, on the axis, draws a circle, the other a curve of two turns.",
    )
    page.play(motions, "The axis goes round evenly, whatever the start.", choose="start")


if __name__ == "__main__":
    show(solve)
