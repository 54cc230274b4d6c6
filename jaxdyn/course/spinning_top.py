"""A spinning top in space.

Write the equations of a top with a fixed point by Euler angles, solve them and animate the motion.
Does it precess steadily from the starts of steady precession? Is the slowest spin that has such
steady motions near upright also the slowest spin at which the top stands stably upright?

Answer: Yes to both, if the spin is the total one about the axis: it must exceed 2 sqrt(I m g d) /
I_3, with I about the pivot, here 165.7 rad/s. Eigenvalues and simulations find the same limit;
below it a top released almost upright falls to cos(theta / 2) = spin / limit and rises again.
"""

import jax.numpy as jnp

from jaxdyn import lagrangian, scenes, simulate
from jaxdyn.analysis import energy, precession
from jaxdyn.course.page import Page, show
from jaxdyn.drawing.figures import blank, style
from jaxdyn.formulations import rigid
from jaxdyn.studies import sleeping_top

PROBLEM = 61
TOPIC = "rigid bodies in space"

TOP = {"m": 0.1, "d": 0.05, "I1": 1e-4, "I3": 5e-5, "g": 9.81}


def law_of_the_top(t, q, v, p):
    """Kinetic minus potential energy by phi (precession), theta (lean) and psi (spin)."""
    _, theta, _ = q
    turning, nodding, spinning = v
    across = (p["I1"] + p["m"] * p["d"] ** 2) * (nodding**2 + (turning * jnp.sin(theta)) ** 2)
    about = p["I3"] * (spinning + turning * jnp.cos(theta)) ** 2
    return (across + about) / 2 - p["m"] * p["g"] * p["d"] * jnp.cos(theta)


def solve(page: Page) -> None:
    """Simulate tops in two ways; start them steadily; find the critical spin in three ways."""
    slow = precession.top_roots(0.5, 250.0, **TOP).precession[0]
    page.number("slow steady precession at a spin of 250 rad/s", slow, "rad/s")
    tops = {
        f"{share:g}": simulate(
            scenes.top(0.5, precession=share * slow, spin=250.0, **TOP), 2.0, samples=600
        )
        for share in (-2.0, -1.0, 0.0, 0.5, 1.0, 2.0)
    }
    lean = precession.tilts(tops["1"])
    page.equal("A steady start stays steady", lean, jnp.full(600, 0.5), within=1e-9)
    released = lagrangian(law_of_the_top, [0.0, 0.5, 0.0], [0.0, 0.0, 250.0], params=TOP)
    angles = simulate(released, 2.0, samples=600)
    same = "Euler angles and quaternions agree on a top released at rest"
    other = precession.tilts(tops["0"])
    page.equal(same, other, angles["q1"], within=1e-8, route="second formulation")

    limit = sleeping_top.critical_spin(**TOP)
    page.number("critical spin", limit, "rad/s")
    by_eigenvalues = sleeping_top.critical_spin_by_linearisation(**TOP)
    by_simulation = sleeping_top.critical_spin_by_simulation(**TOP)
    page.equal("By eigenvalues", by_eigenvalues / limit, 1.0, within=1e-9, route="linearisation")
    page.equal("By simulation", by_simulation / limit, 1.0, within=1e-4, route="simulation")
    falling = scenes.top(1e-6, spin=0.9 * limit, **TOP)
    falls = simulate(falling, 3.5, samples=600)
    lowest = falls.ts[jnp.argmax(precession.tilts(falls))]
    closer = simulate(falling, samples=lowest + jnp.linspace(-0.01, 0.01, 600))
    depth = jnp.cos(jnp.max(precession.tilts(closer)) / 2)
    page.equal("Below it falls to cos(theta / 2) = spin / limit", depth, 0.9, within=1e-7)

    figure = blank(9.0, 3.4)
    for i, share in enumerate(("0", "1", "-2")):
        ax = figure.add_subplot(
            1, 3, i + 1, aspect="equal", title=f"starts at {share} of the slow one"
        )
        style(ax)
        ax.plot(*energy.along(rigid.pose, tops[share]).R_wb[:, :2, 2].T, lw=1.0)
        ax.set(xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), xlabel="x", ylabel="y")
    page.draw(
        figure, "The axis from above: cusps from rest, a circle if steady, loops if pushed back."
    )
    look = "The tip draws cusps from 0, a circle from 1, waves in between, and loops below 0."
    page.play(tops, look, choose="first precession [of the steady one]")


if __name__ == "__main__":
    show(solve)
