"""Simple pendulum, seven derivations.

A point of mass m hangs on a massless rod of length l from a fixed hinge. Derive its equation of
motion in polar coordinates in as many ways as you can: by momentum with the force in the rod
eliminated, by momentum along e_theta, by momentum crossed with the arm, by angular momentum, by
conservation of energy, by the balance of power, and by Lagrange. The course lets x point down.

Answer: All seven give theta'' = -(g / l) sin(theta), without the mass. The period grows with the
amplitude, from 2 pi sqrt(l / g) for small ones: 4 sqrt(l / g) K(sin^2(A / 2)) for the amplitude A,
where K(m) is the complete elliptic integral of the first kind.

e_r points from the hinge to the mass, e_theta across, towards larger theta. The mass is at r = l
e_r, its velocity is l theta' e_theta and its acceleration a = l theta'' e_theta - l theta'^2 e_r.
The rod pulls with -T e_r, and the weight is W = m g cos(theta) e_r - m g sin(theta) e_theta.

(a) m a = W - T e_r in components along x (down) and y (sideways):

    -m l (theta'' sin theta + theta'^2 cos theta) = m g - T cos theta
     m l (theta'' cos theta - theta'^2 sin theta) = -T sin theta

The first times -sin theta plus the second times cos theta has no T: m l theta'' = -m g sin theta.

(b) e_theta . (m a = W - T e_r): m l theta'' = -m g sin theta at once, as e_theta . e_r = 0.

(c) l e_r x (m a = W - T e_r): m l^2 theta'' k = -m g l sin(theta) k, as e_r x e_r = 0.

(d) H about the hinge is m l^2 theta' k, and the moment -m g l sin(theta) k: H' = M.

(e) m l^2 theta'^2 / 2 - m g l cos theta is constant. Its derivative, (m l^2 theta'' + m g l sin
theta) theta' = 0, holds at all times, so the bracket is zero, by continuity also where theta' = 0.

(f) The power of W is W . v = -m g l sin(theta) theta', that of the rod is zero. It is the rate of
the kinetic energy, m l^2 theta' theta''. Divide by theta'.

(g) L = m l^2 theta'^2 / 2 + m g l cos theta: d/dt (m l^2 theta') = -m g l sin theta.

Each is evaluated below for theta = 2 rad, theta' = 0.8 rad/s, m = 2 kg, l = 0.7 m and g = 9.81
m/s^2.
"""

import jax
import jax.numpy as jnp
import numpy as np
from scipy import special

from jaxdyn import drawing, effects, lagrangian, scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 22
TOPIC = "pendulums and linkages"

m, l, g = 2.0, 0.7, 9.81  # noqa: E741 the usual name
weight = np.array([0.0, -m * g])


def axes(theta):
    """e_r, from the hinge to the mass, and e_theta."""
    s, c = jnp.sin(theta), jnp.cos(theta)
    return jnp.array([s, -c]), jnp.array([c, s])


def kinetic(t, q, v):
    """m l^2 theta'^2 / 2."""
    return m * (l * v[0]) ** 2 / 2


def potential(t, q):
    """m g times the height above the lowest position."""
    return m * g * l * (1 - jnp.cos(q[0]))


def moment(arm, force):
    """Arm x force in the plane, a number."""
    return arm[0] * force[1] - arm[1] * force[0]


@jax.jit
def derivations(theta, rate):
    """theta'' by each of the ways."""
    e_r, e_theta = axes(theta)
    known = -m * l * rate**2 * e_r  # m a = m l theta'' e_theta + known
    # Two equations for theta'' and the force in the rod: m a = weight - force e_r.
    both = jnp.linalg.solve(jnp.stack([m * l * e_theta, e_r], axis=1), weight - known)
    q, v = jnp.array([theta]), jnp.array([rate])
    lifted = jax.grad(potential, argnums=1)(0.0, q)[0]
    faster = jax.grad(kinetic, argnums=2)(0.0, q, v)[0]
    return {
        "momentum, the force eliminated": both[0],
        "momentum along e_theta": weight @ e_theta / (m * l),
        "momentum crossed with the arm": moment(l * e_r, weight) / moment(l * e_r, m * l * e_theta),
        "angular momentum": moment(l * e_r, weight) / (m * l**2),
        "conservation of energy": -lifted * rate / faster,
        "balance of power": weight @ (l * rate * e_theta) / faster,
        "Lagrange": lagrangian((kinetic, potential), q, v).rate(0.0, jnp.array([theta, rate]))[1],
    }


def solve(page: Page) -> None:
    """Compare the derivations at a pose, and the periods of swings with elliptic integrals."""
    expected = -g / l * np.sin(2.0)
    for name, got in derivations(2.0, 0.8).items():
        page.equal(
            f"theta'' = -(g / l) sin(theta) by {name}", got, expected, within=1e-13, route="formula"
        )

    amplitudes = np.array([0.1, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    periods = 4 * np.sqrt(l / g) * special.ellipk(np.sin(amplitudes / 2) ** 2)
    swings = {}
    for angle, period in zip(amplitudes, periods, strict=True):
        scene = scenes.pendulum(angle=angle, m=m, length=l, g=g)
        back = simulate(scene, period, samples=401, rtol=1e-13).ys[-1]
        page.equal(
            f"A swing of {angle} rad is back after 4 sqrt(l / g) K", back, scene.y0, within=1e-11
        )
        swings[angle] = simulate(scene, 5.0, samples=401)
    page.number("periods of swings of 0.1, 0.5, 1, 1.5, 2, 2.5, 3 rad", periods, "s")
    page.draw(
        lambda: picture(swings),
        "Wide swings take longer, and stay near the top for most of the time.",
    )
    page.play(swings, "The wider the swing, the longer its period.", choose="amplitude [rad]")


def picture(swings):
    """The angle over time, for each amplitude."""
    figure = drawing.figures.blank(6.4, 4.0)
    ax = figure.subplots()
    drawing.figures.style(ax)
    for motion in swings.values():
        ax.plot(motion.ts, motion["theta"])
    ax.set(xlabel="t [s]", ylabel="angle [rad]")
    return figure


def ask(page: Page) -> None:
    """Starts near the top, another mass and another planet."""
    made = {"m": m, "length": l, "g": g, "t1": 5.0}
    small, wide = 2 * np.pi * np.sqrt(l / g), 4 * np.sqrt(l / g) * special.ellipk(np.sin(1.57) ** 2)
    page.ask(
        "What happens when it starts at rest just short of upright, at 3.14 rad?",
        f"It lingers there: one swing takes {wide:.3g} s, while a small one takes {small:.3g} s.",
        scenes.pendulum(angle=3.14, **made),
    )
    page.ask(
        "What happens when the mass is ten times larger?",
        "The swing is the same; the forces and the energy are ten times as large.",
        scenes.pendulum(angle=2.0, **made | {"m": 10 * m}),
    )
    page.ask(
        "What happens on the Moon, where g = 1.62 m/s^2?",
        f"All swings take sqrt(9.81 / 1.62) = {np.sqrt(g / 1.62):.3g} times as long.",
        scenes.pendulum(angle=2.0, **made | {"g": 1.62}),
    )
    page.ask(
        "What happens without gravity, when it is pushed?",
        "It goes round at a constant speed. Try to switch gravity on at the top, or at the bottom.",
        scenes.pendulum(angle=1.0, rate=3.0, **made).without(effects.UniformGravity),
    )


if __name__ == "__main__":
    show(solve)
