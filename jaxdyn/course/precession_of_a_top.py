"""Steady precession of a top.

An axisymmetric top turns about a fixed point below its mass centre, leaning by a constant angle
theta, with the precession omega_p about the vertical and the spin omega_s about its axis. How are
the three related? What is the slowest spin for which this is possible almost upright? Are these the
most general motions of a top?

Answer: With I about the pivot, (I - I_3) cos(theta) omega_p^2 - I_3 omega_s omega_p + m g d = 0: a
slow and a fast precession, or none. Almost upright the slowest spin omega_3 = omega_s + omega_p
cos(theta) is 2 sqrt(I m g d) / I_3, here 165.7 rad/s. No, tops nutate, such as one released at
rest.

The numbers belong to m = 0.1 kg, d = 0.05 m, I_1 = 1e-4 kg m^2 about G, I_3 = 5e-5 kg m^2 and g =
9.81 m/s^2; about the pivot I = I_1 + m d^2 = 3.5e-4 kg m^2.

(a) In steady precession the angular momentum H = I omega_p sin(theta) e_1' + I_3 omega_3 e_3' turns
at omega_p about the vertical, and omega_p k x H is the moment m g d sin(theta) of the weight. That
is sin(theta) times the equation above. Any rates are possible at theta = 0 and pi. Elsewhere
omega_p is a root of the equation. For I > I_3 and a mass centre above the pivot there are two where

    (I_3 omega_s)^2 > 4 (I - I_3) cos(theta) m g d,

and none where the top spins more slowly. Hanging (cos(theta) < 0) there always are two, and so
there are for cos(theta) > 0 if I < I_3. Where (I - I_3) cos(theta) = 0, as for a level axis, the
equation is linear and has one root, m g d / (I_3 omega_s).

(b) Near theta = 0 the equation in terms of omega_3 is I omega_p^2 - I_3 omega_3 omega_p + m g d =
0, which has roots from omega_3 = 2 sqrt(I m g d) / I_3 on. Counted as omega_s the limit, for I >
I_3, is 2 sqrt((I - I_3) m g d) / I_3 = 153.4 rad/s; it belongs to another motion, and says nothing
about an upright top, for which only omega_3 is given.

(c) No. A top that is released with its axis at rest falls, and as it falls it begins to precess. It
nods between the initial lean and a larger one, and its tip draws cusps; started with some
precession, it draws waves or loops. The largest lean in the table belongs to a spin of 250 rad/s.
Steady precession is the special case in which the lean stays at the minimum of its potential.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, effects, scenes, simulate
from jaxdyn.analysis import precession, steady
from jaxdyn.course.page import Page, largest, show
from jaxdyn.formulations import rigid

PROBLEM = 59
TOPIC = "rigid bodies in space"

TOP = {"m": 0.1, "d": 0.05, "I1": 1e-4, "I3": 5e-5, "g": 9.81}
PIVOT, WEIGHT = 3.5e-4, 0.1 * 9.81 * 0.05  # I about the pivot [kg m^2], m g d [N m]


def effective(theta, along, up):
    """Potential of the lean, at given angular momenta about the axis and the vertical [J]."""
    turning = (up - along * jnp.cos(theta)) / jnp.sin(theta)
    return turning**2 / (2 * PIVOT) + WEIGHT * jnp.cos(theta)


def nodding(lean, turning, spin):
    """Frequency [rad/s] of small nods about a steady precession."""
    # In these Euler angles the symmetries are shifts, which are known to rounding.
    angles = {"representation": "euler", "sequence": "ZXZ"}
    top = scenes.top(lean, precession=turning, spin=spin, **angles, **TOP)
    return steady.linearize_steady(top).frequencies[-1]


def solve(page: Page) -> None:
    """Find both precessions and see that they last; then release the top at rest."""
    lean, spin = 0.5, 250.0
    roots = precession.top_roots(lean, spin, **TOP)
    both = "a: slow and fast precession, leaning 0.5 rad with omega_s = 250 rad/s"
    page.number(both, roots.precession, "rad/s")
    lacks = precession.precession_residual(lean, roots, I1=PIVOT, I3=TOP["I3"], K=WEIGHT)
    page.equal("a: Both satisfy the balance of moments", lacks, [0.0, 0.0], within=1e-14)
    tops = {}
    for name, rate in zip(("slow", "fast", "released"), (*roots.precession, 0.0), strict=True):
        scene = scenes.top(lean, precession=rate, spin=spin, **TOP)
        tops[name] = simulate(scene, 0.5, samples=400, rtol=1e-12)
    leans = np.stack([precession.tilts(tops["slow"]), precession.tilts(tops["fast"])])
    page.equal("a: Simulated, both keep their lean", leans, np.full((2, 400), lean), within=1e-11)

    slowest = precession.critical_spin(**TOP)
    page.number("b: slowest omega_3 with steady precession almost upright", slowest, "rad/s")
    relative = precession.slowest_relative_spin(**TOP)
    page.number("b: slowest omega_s with steady precession almost upright", relative, "rad/s")
    spins = np.array([0.999, 1.001]) * slowest
    exists = np.isfinite(precession.top_roots(1e-5, spins, total=True, **TOP).precession)
    page.true(
        "b: Steady precession exists for faster omega_3 only",
        exists.tolist() == [[False, True]] * 2,
        route="roots",
    )

    a = (TOP["I3"] * spin) ** 2 / (2 * PIVOT * WEIGHT)
    deepest = np.arccos((a - np.sqrt(a**2 - 4 * a * np.cos(lean) + 4)) / 2)
    page.number("c: largest lean of a top let go with its axis at rest at 0.5 rad", deepest, "rad")

    nods = nodding(lean, roots.precession[0], spin)
    page.number("c: frequency of small nods about the slow precession", nods, "rad/s")

    page.draw(picture, "Slow and fast precession meet where the spin is the slowest.")
    page.play(tops, "Slow and fast precession, and a top that nods.", choose="start")


def picture():
    """Both precessions over the spin, for three leans."""
    ax = drawing.figures.blank(6.4, 4.2).add_subplot(
        xlabel="spin [rad/s]", ylabel="precession [rad/s]"
    )
    drawing.figures.style(ax)
    ax.set_ylim(0, 60)
    spins = np.linspace(50.0, 400.0, 40_000)  # the branches meet like a root
    for k, theta in enumerate((0.1, 0.8, 1.4)):
        both = precession.top_roots(theta, spins, **TOP).precession
        ax.plot(spins, both.T, color=drawing.figures.PALETTE[k], label=[f"lean {theta} rad", None])
    ax.legend(frameon=False)
    return ax.figure


def check(page: Page) -> None:
    """Let a top go with its axis at rest; compare its nods with the potential of its lean."""
    lean, spin = 0.5, 250.0
    roots = precession.top_roots(lean, spin, **TOP)
    along, turning = TOP["I3"] * (spin + roots.precession[0] * np.cos(lean)), roots.precession[0]
    up = PIVOT * turning * np.sin(lean) ** 2 + along * np.cos(lean)
    bend = jax.grad(jax.grad(effective))(lean, along, up)
    nods = page["c: frequency of small nods about the slow precession"]
    same = "c: It is that of the effective potential of the lean, in parts of it"
    page.equal(same, nods / np.sqrt(bend / PIVOT), 1.0, within=1e-12)
    scene = scenes.top(0.5, precession=0.0, spin=250.0, **TOP)
    deepest = page["c: largest lean of a top let go with its axis at rest at 0.5 rad"]
    lowest = largest(scene, lambda t, y: -rigid.pose(scene, t, y).R_wb[2, 2], 0.5)
    found = np.arccos(-lowest.value)
    page.equal("c: The simulated top leans so far", found, deepest, within=1e-10)


def ask(page: Page) -> None:
    """A slow top, and one without weight."""
    page.ask(
        "What happens when it spins at 100 rad/s, let go with its axis at rest?",
        "It falls far and comes up again in low loops, and steady precession almost upright "
        f"would need {page['b: slowest omega_3 with steady precession almost upright']:.4g} rad/s.",
        scenes.top(0.5, precession=0.0, spin=100.0, **TOP, t1=2.0),
    )
    page.ask(
        "What happens without spin?",
        "It is a pendulum: it falls over, through its lowest place and up on the other side.",
        scenes.top(0.5, precession=0.0, spin=0.0, **TOP, t1=2.0),
    )
    page.ask(
        "What happens without weight?",
        "Nothing changes its angular momentum, shown among the vectors; the axis stays at rest.",
        scenes.top(0.5, precession=0.0, spin=250.0, **TOP, t1=0.5).without(effects.UniformGravity),
    )


if __name__ == "__main__":
    show(solve)
