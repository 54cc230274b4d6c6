"""Inverted pendulum on a shaking base.

A uniform stick of length 1 m stands on a hinge that shakes up and down, at -A cos(w t). Find its
equation of motion, show in a simulation that it can stay upright if the shaking is fast, do the
same with the length of the stick as a constraint, and find out for which A and w it stays up.

Answer: With L = 2/3 of the length, theta'' = (g + A w^2 cos(w t)) sin(theta) / L. The stick stays
up for A between two edges, those of Mathieu's equation: 0.0604 m and 0.3073 m at w = 60 rad/s. For
fast shaking the first edge tends to (A w)^2 = 2 g L.

(a) The hinge is at h(t) = -A cos(w t), so it accelerates upwards at h'' = A w^2 cos(w t). About the
hinge the moment of the weight is m g (l / 2) sin(theta), with theta from upright, and m h'' acts at
the mass centre like additional weight. With the moment of inertia m l^2 / 3 about the hinge

    theta'' = (3 / (2 l)) (g + h'') sin(theta).

The equations as the scene has them write Omega for w, and a for the amplitude A.

(b) Released 0.2 rad aside, with A = 0.1 m and w = 60 rad/s (l = 1 m, g = 9.81 m/s^2), the stick
sways about upright and never leans more than 0.271 rad in 5 s. The base then accelerates at up to
360 m/s^2, 37 times g.

(c) The mass centre (x, y), theta, and the force (X, Y) of the hinge on the stick have the equations

    m x'' = X,   m y'' = Y - m g,   (m l^2 / 12) theta'' = (l / 2) (Y sin(theta) - X cos(theta))

with the conditions x = (l / 2) sin(theta), y = -A cos(w t) + (l / 2) cos(theta), which are
differentiated twice: five linear equations for x'', y'', theta'', X and Y. Their theta'' is that of
(a). Integrated, with the length as the constraint, the end of the stick moves as in (a) to 1e-9 m
over the 5 s, which `--check` confirms.

(d) Near upright, with tau = w t / 2, that is Mathieu's equation

    theta'' + (a - 2 q cos(2 tau)) theta = 0,   a = -4 g / (L w^2),   q = 2 A / L.

It is stable between the characteristic values a_0(q) and b_1(q), and in thin tongues between a_n(q)
and b_(n+1)(q) at large amplitudes. Fast shaking of small amplitude, averaged over a period, is
stable from (A w)^2 = 2 g L on, where a_0 = -q^2 / 2.
"""

import jax
import jax.numpy as jnp
import numpy as np
from scipy import special

from jaxdyn import drawing, ode, scenes, simulate
from jaxdyn.course.page import Page, largest, show
from jaxdyn.hard.cases import shaken

PROBLEM = 29
TOPIC = "pendulums and linkages"

NUMBERS = {"A": 0.1, "w": 60.0, "g": 9.81, "l": 1.0}


def balance(t, y, p):
    """The rate of theta (from upright) and its rate by angular momentum balance about the hinge."""
    lift = p["g"] + p["A"] * p["w"] ** 2 * jnp.cos(p["w"] * t)
    return [y[1], lift * jnp.sin(y[0]) / (2 / 3 * p["l"])]


def by_constraints(t, theta, turning):
    """theta'' from the five equations of (c), for a stick of 1 kg."""
    A, w, g, length = NUMBERS.values()
    sin, cos = np.sin(theta), np.cos(theta)
    # The columns belong to x'', y'', theta'', X and Y.
    left = np.array(
        [
            [1, 0, 0, -1, 0],
            [0, 1, 0, 0, -1],
            [0, 0, length / 6, cos, -sin],
            [1, 0, -length / 2 * cos, 0, 0],
            [0, 1, length / 2 * sin, 0, 0],
        ]
    )
    inward = length / 2 * turning**2
    lift = A * w**2 * np.cos(w * t)
    return np.linalg.solve(left, [0, -g, 0, -inward * sin, lift - inward * cos])[2]


def solve(page: Page) -> None:
    """Shake the stick; find where it stays up, and compare with Mathieu."""
    shaking, y = scenes.shaken_pendulum(), jnp.array([0.7, -1.3])
    found, known = jax.jit(shaking.rate)(0.3, y), jnp.stack(balance(0.3, y, NUMBERS))
    page.equal("a: The scene has the equation by hand", found, known, within=1e-12, route="by hand")
    statement = "c: theta'' from the five equations with the constraints"
    tied = by_constraints(0.3, *y)
    page.equal(statement, tied, known[1], within=1e-12, route="second formulation")
    page.number("largest acceleration of the base", 0.1 * 60.0**2, "m/s^2")

    edges = shaken.stability_edges(60.0)
    page.number("smallest and largest amplitude A that hold it up at 60 rad/s", edges, "m")
    limit = shaken.averaged_limit(60.0)
    page.number("smallest A by averaging over fast shaking, sqrt(2 g L) / w", limit, "m")
    a, q = shaken.mathieu_numbers(edges, 60.0)
    known = np.array([special.mathieu_a(0, q[0]), special.mathieu_b(1, q[1])])
    page.equal("The edges are Mathieu's a_0 and b_1", known, [a, a], within=1e-9)

    look = "Upright is stable in the blue band; the dashed line is the averaged limit."
    page.draw(picture, look)
    motions = {
        A: simulate(scenes.shaken_pendulum(amplitude=A), 2.0, samples=601)
        for A in (0.03, 0.05, 0.06, 0.07, 0.1, 0.2)
    }
    page.play(
        motions, "Below 0.06 m the stick falls, above it sways upright.", choose="amplitude [m]"
    )


def picture():
    """Where upright is stable, by frequency and amplitude."""
    frequencies = np.linspace(20.0, 100.0, 33)
    chart = shaken.upright_chart(np.linspace(0.0, 0.4, 33), frequencies)
    names = ("amplitude of the base [m]", "frequency of the base [rad/s]")
    figure = drawing.stability_chart(chart, names=names)
    figure.axes[0].plot(frequencies, shaken.averaged_limit(frequencies), "k--")
    return figure


def ask(page: Page) -> None:
    """Slower shaking, wider shaking, and none."""
    limit = page["smallest A by averaging over fast shaking, sqrt(2 g L) / w"] * 60.0
    page.ask(
        "What happens when the base shakes half as fast, at 30 rad/s by 0.1 m?",
        f"The stick falls: A w = 3 m/s is less than sqrt(2 g L) = {limit:.3g} m/s.",
        scenes.shaken_pendulum(amplitude=0.1, frequency=30.0, t1=2.0),
    )
    page.ask(
        "What happens when it leans by 1 rad at the start, shaken by 0.1 m at 60 rad/s?",
        "It comes back, and sways from side to side. From 1.2 rad it falls.",
        scenes.shaken_pendulum(amplitude=0.1, angle=1.0),
    )
    page.ask(
        "What happens when the base is at rest?",
        "The stick falls over, and swings about its lowest position.",
        scenes.shaken_pendulum(amplitude=0.0, t1=5.0),
    )


def check(page: Page) -> None:
    """Shake the stick in three formulations, and find how far it leans."""
    by_hand = simulate(ode(balance, [0.2, 0.0], 5.0, params=NUMBERS), samples=601, rtol=1e-13)
    by_angle = simulate(scenes.shaken_pendulum(), samples=601, rtol=1e-13)
    tied = simulate(scenes.shaken_pendulum(formulation="constrained"), samples=601, rtol=1e-13)
    statement = "a: The equation by hand gives the same motion"
    page.equal(statement, by_angle.ys, by_hand.ys, within=1e-10, route="second formulation")
    statement = "c: With the length as a constraint the end moves in the same way"
    page.equal(statement, tied.r, by_angle.r, within=1e-9, route="second formulation")
    most = largest(by_angle.scene, lambda t, y: y[0] ** 2)
    page.number("b: largest angle from upright in 5 s", np.sqrt(most.value), "rad")


if __name__ == "__main__":
    show(solve)
