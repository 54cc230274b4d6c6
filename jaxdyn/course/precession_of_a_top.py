"""Steady precession of a top.

An axisymmetric top turns about a fixed point below its mass centre, leaning by a constant angle
theta, with the precession omega_p about the vertical and the spin omega_s about its axis. How are
the three related? What is the slowest spin for which this is possible almost upright? Are these the
most general motions of a top?

Answer: With I about the pivot, (I - I_3) cos(theta) omega_p^2 - I_3 omega_s omega_p + m g d = 0: a
slow and a fast precession, or none. Almost upright the slowest total spin is 2 sqrt(I m g d) / I_3,
here 165.7 rad/s; the slowest relative spin, 2 sqrt((I - I_3) m g d) / I_3, is another motion. No:
tops nutate, such as one released at rest.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import scenes, simulate
from jaxdyn.analysis import precession, steady
from jaxdyn.course.page import Page, show
from jaxdyn.drawing.figures import PALETTE, blank, style
from jaxdyn.studies import sleeping_top

PROBLEM = 59
TOPIC = "rigid bodies in space"

TOP = {"m": 0.1, "d": 0.05, "I1": 1e-4, "I3": 5e-5, "g": 9.81}
PIVOT, WEIGHT = 3.5e-4, 0.1 * 9.81 * 0.05  # I about the pivot [kg m^2], m g d [N m]


def effective(theta, along, up):
    """Potential of the lean, at given angular momenta about the axis and the vertical [J]."""
    turning = (up - along * jnp.cos(theta)) / jnp.sin(theta)
    return turning**2 / (2 * PIVOT) + WEIGHT * jnp.cos(theta)


def solve(page: Page) -> None:
    """Find both precessions and see that they last; then release the top at rest."""
    lean, spin = 0.5, 250.0
    roots = precession.top_roots(lean, spin, **TOP)
    page.number("slow and fast precession at 250 rad/s", roots.precession, "rad/s")
    lacks = precession.precession_residual(lean, roots, I1=PIVOT, I3=TOP["I3"], K=WEIGHT)
    page.equal("Moments balance", lacks, [0.0, 0.0], within=1e-14)
    tops = {}
    for name, rate in zip(("slow", "fast", "released"), (*roots.precession, 0.0), strict=True):
        scene = scenes.top(lean, precession=rate, spin=spin, **TOP)
        tops[name] = simulate(scene, 0.5, samples=400, rtol=1e-12)
    leans = jnp.stack([precession.tilts(tops["slow"]), precession.tilts(tops["fast"])])
    page.equal("Both precessions last", leans, jnp.full((2, 400), lean), within=1e-11)

    slowest = sleeping_top.critical_spin(**TOP)
    page.number("slowest total spin upright", slowest, "rad/s")
    page.number("slowest relative spin", sleeping_top.slowest_relative_spin(**TOP), "rad/s")
    spins = jnp.array([0.999, 1.001]) * slowest
    exists = jnp.isfinite(precession.top_roots(1e-5, spins, total=True, **TOP).precession)
    page.true("It exists above that only", exists.tolist() == [[False, True]] * 2, route="roots")

    a = (TOP["I3"] * spin) ** 2 / (2 * PIVOT * WEIGHT)
    deepest = np.arccos((a - np.sqrt(a**2 - 4 * a * np.cos(lean) + 4)) / 2)
    page.number("released at rest it leans between 0.5 and", deepest, "rad")
    lowest = tops["released"].ts[jnp.argmax(precession.tilts(tops["released"]))]
    closer = simulate(scene, samples=lowest + jnp.linspace(-2e-3, 2e-3, 400), rtol=1e-12)
    page.equal("The simulated top does", jnp.max(precession.tilts(closer)), deepest, within=1e-10)

    along, turning = TOP["I3"] * (spin + roots.precession[0] * np.cos(lean)), roots.precession[0]
    up = PIVOT * turning * np.sin(lean) ** 2 + along * np.cos(lean)
    bend = jax.grad(jax.grad(effective))(lean, along, up)
    nods = steady.linearize_steady(tops["slow"].scene).frequencies[-1]
    page.number("nutation about the slow precession", nods, "rad/s")
    page.equal("The potential of the lean says so", nods, np.sqrt(bend / PIVOT), within=1e-10)

    ax = blank(6.4, 4.2).add_subplot(xlabel="spin [rad/s]", ylabel="precession [rad/s]")
    style(ax)
    ax.set_ylim(0, 60)
    spins = jnp.linspace(50.0, 400.0, 40_000)  # the branches meet like a root
    for k, theta in enumerate((0.1, 0.8, 1.4)):
        both = precession.top_roots(theta, spins, **TOP).precession
        ax.plot(spins, both.T, color=PALETTE[k], label=[f"lean {theta} rad", None])
    ax.legend(frameon=False)
    page.draw(ax.figure, "Slow and fast precession meet where the spin is the slowest.")
    page.play(tops, "Slow and fast precession, and a top that nods.", choose="start")


if __name__ == "__main__":
    show(solve)
