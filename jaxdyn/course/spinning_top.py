"""A spinning top in space.

Write the equations of a top with a fixed point by Euler angles, solve them and animate the motion.
Does it precess steadily from the starts of steady precession? Is the slowest spin that has such
steady motions near upright also the slowest spin at which the top stands stably upright?

Answer: Yes to both, if the spin is the total one about the axis: it must exceed 2 sqrt(I m g d) /
I_3, with I about the pivot, here 165.7 rad/s. Eigenvalues and simulations find the same limit;
below it a top released almost upright falls to cos(theta / 2) = spin / limit and rises again.

The numbers belong to m = 0.1 kg, d = 0.05 m, I_1 = 1e-4 kg m^2 about G, I_3 = 5e-5 kg m^2 and g =
9.81 m/s^2, so I = I_1 + m d^2 = 3.5e-4 kg m^2. In the equations as the scene has them, in the
body's axes, I1 is this I, I3 is I_3 and l is d.

The equations, by the Euler angles phi (precession about the vertical), theta (lean) and psi (spin
about the axis), with omega_3 = psi' + phi' cos(theta): Euler's equations about the pivot, in axes
that follow phi and theta but not psi, are

    I theta'' = I phi'^2 sin(theta) cos(theta) - I_3 omega_3 phi' sin(theta) + m g d sin(theta)
    I (phi'' sin(theta) + 2 phi' theta' cos(theta)) = I_3 omega_3 theta'
    I_3 omega_3' = 0

so omega_3 is constant; so is the angular momentum about the vertical, I phi' sin(theta)^2 + I_3
omega_3 cos(theta), whose derivative is the second equation. With theta'' = theta' = 0 the first is
the condition of steady precession of problem 59.

Upright stability: near theta = 0 the place (x, y) of the axis, as a complex number z = x + i y,
obeys I z'' - i I_3 omega_3 z' - m g d z = 0. Its exponents are i times the roots of I s^2 - I_3
omega_3 s + m g d = 0, which are real, so that deviations do not grow, where omega_3 exceeds
2 sqrt(I m g d) / I_3: exactly where steady precession near upright exists.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, lagrangian, scenes, simulate
from jaxdyn.analysis import energy, precession
from jaxdyn.analysis.linearize import classify, jacobian
from jaxdyn.course.page import Page, largest, show
from jaxdyn.formulations import rigid
from jaxdyn.integrate.simulation import solve as integrate

PROBLEM = 61
TOPIC = "rigid bodies in space"

_TILT_ENTRIES = np.array([0, 1, 3, 4])  # of the state: the two angles that tilt, and their rates
_MIN_GROWTH = 1e-7  # in units of the spin; double eigenvalues are accurate to 1e-9
#: A sleeping top is released at the first of these tilts [rad] and has fallen at the second.
_RELEASED, _FALLEN = 1e-5, 1e-2
#: In units of 2 I_1 / (I_3 omega), the time of growth far below the critical spin.
_WATCHED_SPAN = 1500.0
_WATCHED_SAMPLES = 4000

TOP = {"m": 0.1, "d": 0.05, "I1": 1e-4, "I3": 5e-5, "g": 9.81}


def law_of_the_top(t, q, v, p):
    """Kinetic minus potential energy by phi (precession), theta (lean) and psi (spin)."""
    _, theta, _ = q
    turning, nodding, spinning = v
    across = (p["I1"] + p["m"] * p["d"] ** 2) * (nodding**2 + (turning * jnp.sin(theta)) ** 2)
    about = p["I3"] * (spinning + turning * jnp.cos(theta)) ** 2
    return (across + about) / 2 - p["m"] * p["g"] * p["d"] * jnp.cos(theta)


def by_euler(theta, turning, nodding, spinning):
    """phi'', theta'' and psi'' by the equations above."""
    I, I3, K = 3.5e-4, TOP["I3"], TOP["m"] * TOP["g"] * TOP["d"]  # noqa: E741 the usual name
    sin, cos = np.sin(theta), np.cos(theta)
    about = I3 * (spinning + turning * cos)
    lean = turning**2 * sin * cos + (K - about * turning) * sin / I
    precess = (about * nodding / I - 2 * turning * nodding * cos) / sin
    return np.array([precess, lean, turning * nodding * sin - precess * cos])


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

    rate = jax.jit(released.rate)(0.0, np.array([0.3, 0.7, 0.1, 5.0, 2.0, 90.0]))[3:]
    by_hand = by_euler(0.7, 5.0, 2.0, 90.0)
    statement = "Lagrange's equations are Euler's, as written above"
    page.equal(statement, rate, by_hand, within=1e-10, route="second formulation")
    limit = precession.critical_spin(**TOP)
    page.number("slowest omega_3 at which the upright top is stable", limit, "rad/s")
    by_eigenvalues = critical_spin_by_linearization(**TOP)
    page.equal("By eigenvalues", by_eigenvalues / limit, 1.0, within=1e-9, route="linearisation")

    page.draw(
        lambda: picture(tops),
        "The axis from above: cusps from rest, a circle if steady, loops if pushed back.",
    )
    look = "The tip draws cusps from 0, a circle from 1, waves in between, and loops below 0."
    page.play(tops, look, choose="first precession [of the steady one]")


def picture(tops):
    """The axis of three tops from above."""
    figure = drawing.figures.blank(9.0, 3.4)
    for i, share in enumerate(("0", "1", "-2")):
        ax = figure.add_subplot(
            1, 3, i + 1, aspect="equal", title=f"starts at {share} of the slow one"
        )
        drawing.figures.style(ax)
        ax.plot(*energy.along(rigid.pose, tops[share]).R_wb[:, :2, 2].T, lw=1.0)
        ax.set(xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), xlabel="x", ylabel="y")
    return figure


def check(page: Page) -> None:
    """The limit of stability by simulation, and how far a slower top falls."""
    limit = page["slowest omega_3 at which the upright top is stable"]
    by_simulation = critical_spin_by_simulation(**TOP)
    page.equal("By simulation", by_simulation / limit, 1.0, within=1e-4, route="simulation")
    falling = scenes.top(1e-6, spin=0.9 * limit, **TOP)
    lowest = largest(falling, lambda t, y: -rigid.pose(falling, t, y).R_wb[2, 2], 3.5)
    depth = np.cos(np.arccos(-lowest.value) / 2)
    page.equal("Below it falls to cos(theta / 2) = spin / limit", depth, 0.9, within=1e-7)


def critical_spin_by_linearization(**top_numbers) -> float:
    """The spin where the eigenvalues of the upright top turn real, on the host.

    Args:
      top_numbers: m, d, I1, I3, g of `scenes.bodies.top`.
    """
    guess = float(precession.critical_spin(**top_numbers))

    def unstable(spin):
        # Upright, XYZ Euler angles are regular, and the third, which grows steadily, does not
        # enter the rates: the motion has eigenvalues like an equilibrium.
        scene = scenes.top(0.0, spin=spin, representation="euler", sequence="XYZ", **top_numbers)
        a = np.asarray(jacobian(scene, scene.y0))[np.ix_(_TILT_ENTRIES, _TILT_ENTRIES)]
        return classify(a).eigenvalues[0].real > _MIN_GROWTH * spin

    return _threshold(unstable, guess, 45)


def critical_spin_by_simulation(**top_numbers) -> float:
    """The same to a few parts in 1e5, from tops released almost upright, on the host.

    Below the critical spin such a top falls to cos(theta / 2) = spin / critical spin and rises
    again, for any small initial tilt; above, it stays upright.

    Args:
      top_numbers: m, d, I1, I3, g of `scenes.bodies.top`.
    """
    guess = float(precession.critical_spin(**top_numbers))
    scene = scenes.top(_RELEASED, spin=guess, **top_numbers)
    body: Any = scene.system
    inertia = rigid.inertia_matrix(body.matter)
    t1 = _WATCHED_SPAN * 2 * inertia[0, 0] / (inertia[2, 2] * guess)
    ts = jnp.linspace(0.0, t1, _WATCHED_SAMPLES)

    @jax.jit
    def unstable(spin):
        y0 = scenes.top(_RELEASED, spin=spin, **top_numbers).y0
        ys = integrate(scene.starting(y0), t1, ts=ts, rtol=1e-11).ys
        axis = jax.vmap(body.pose)(ys).R_wb[..., 2]
        return jnp.min(axis[:, 2]) < jnp.cos(_FALLEN)

    return _threshold(unstable, guess, 20)


def _threshold(unstable, guess: float, halvings: int) -> float:
    low, high = 0.3 * guess, 3.0 * guess
    for _ in range(halvings):
        middle = (low + high) / 2
        below = unstable(middle)
        low, high = (middle, high) if below else (low, middle)
    return (low + high) / 2


if __name__ == "__main__":
    show(solve)
