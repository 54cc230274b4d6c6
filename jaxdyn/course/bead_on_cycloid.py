"""Beads on a parabola and on y = c s^2, by Lagrange.

A bead slides without friction on the wire y = c x^2 (a), or on the curve y = c s^2, where s is the
length along the curve from its lowest point (b). Find the equations of motion by Lagrange, for (a)
in x and for (b) in s. Draw the second curve, and say which famous curve it is.

Answer: On y = c s^2 the bead oscillates with the period 2 pi / sqrt(2 c g) for every amplitude,
since s'' = -2 c g s; the curve is a cycloid, traced by a wheel of radius 1 / (8 c) that rolls under
a line. The equation of (a) is that of problem 30.

(a) On y = c x^2 the velocity has the components x' and 2 c x x', so

    L = (m / 2) (1 + 4 c^2 x^2) x'^2 - m g c x^2,

and d/dt (dL/dx') = dL/dx, divided by m, is

    (1 + 4 c^2 x^2) x'' + 4 c^2 x x'^2 + 2 g c x = 0.

By Newton: along the wire the weight is the only force. The direction along it is (1, 2 c x), and
a = (x'', 2 c x x'' + 2 c x'^2), so x'' + 2 c x (2 c x x'' + 2 c x'^2) = -2 c x g: the same.

(b) The speed is s' and the height c s^2, so L = m s'^2 / 2 - m g c s^2 and s'' = -2 c g s: a
harmonic oscillator, whose period does not depend on the amplitude.

(b i, ii) With dy = 2 c s ds the curve has dx/ds = sqrt(1 - 4 c^2 s^2), up to s = 1 / (2 c), where
its tangent is vertical. With 2 c s = sin(a / 2) that integrates to

    x = (a + sin a) / (8 c),   y = (1 - cos a) / (8 c),

the cycloid of a point on the rim of a wheel of radius 1 / (8 c), turned by a, that rolls under the
line y = 1 / (4 c). The numbers belong to c = 1 per metre on the parabola, c = 1/8 per metre on the
cycloid, and g = 9.81 m/s^2.
"""

import math

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, lagrangian, ode, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.scenes import guides

PROBLEM = 33
TOPIC = "constraints"


def on_parabola(t, q, v, p):
    """T - V of the bead on y = c x^2, with m = 1."""
    slope = 2 * p["c"] * q[0]
    return v[0] ** 2 * (1 + slope**2) / 2 - p["g"] * p["c"] * q[0] ** 2


def sideways(s, x, p):
    """dx/ds along the curve y = c s^2."""
    return jnp.sqrt(1 - (2 * p["c"] * s) ** 2)[None]


def solve(page: Page) -> None:
    """Slide on both wires; draw the curve from its equation, and compare with a cycloid."""
    precisely = {"samples": 401, "rtol": 1e-13}
    numbers = {"c": 1.0, "g": 9.81}
    lagrange = simulate(lagrangian(on_parabola, [1.0], [0.0], 10.0, params=numbers), **precisely)
    newton = simulate(scenes.bead_on_parabola(c=1.0, x=1.0), **precisely)
    statement = "a: Lagrange and Newton-Euler agree"
    page.equal(statement, lagrange.ys, newton.ys, within=1e-11, route="second formulation")

    c, g = 0.125, 9.81
    rate = math.sqrt(2 * c * g)
    page.number("period on y = c s^2, c = 1/8 per metre", 2 * math.pi / rate, "s")
    slides = {}
    for a in (0.5, 1.0, 2.0, 3.0, 3.9):
        slides[a] = simulate(scenes.bead_on_cycloid(c=c, s=a, formulation="lagrange"), **precisely)
        s = a * np.cos(rate * slides[a].ts)
        page.equal(f"b: s = {a} cos(sqrt(2 c g) t)", slides[a]["s"], s, within=1e-10)

    along = simulate(ode(sideways, [0.0], 3.9, params={"c": c}), **precisely)
    curve = guides.cycloid(c, along.ts)
    page.equal("The curve from dx/ds is a cycloid", along.ys[:, 0], curve[:, 0], within=1e-11)
    angle = 2 * np.arcsin(2 * c * along.ts)
    wheel = np.stack([angle + np.sin(angle), 1 - np.cos(angle)], axis=1) / (8 * c)
    page.equal("A rolling wheel of radius 1 / (8 c) traces it", wheel, curve, within=1e-12)

    page.draw(lambda: picture(c), "At the bottom the cycloid is a parabola; its ends are vertical.")
    page.play(
        slides, "From any height the bead reaches the bottom at the same time.", choose="s [m]"
    )


def picture(c):
    """The cycloid and the parabola."""
    figure = drawing.figures.blank(6.4, 3.4)
    ax = figure.subplots()
    drawing.figures.style(ax)
    whole = guides.cycloid(c, np.linspace(-4.0, 4.0, 801))
    ax.plot(*whole.T, label="y = c s^2")
    ax.plot(whole[:, 0], c * whole[:, 0] ** 2, "--", label="y = c x^2")
    ax.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    ax.legend(frameon=False)
    return figure


def ask(page: Page) -> None:
    """A start with a speed, and a heavier bead."""
    made = {"c": 0.125, "formulation": "lagrange"}
    page.ask(
        "What happens when it starts at the bottom with 2 m/s?",
        "It swings with the same period, since that does not depend on the start. Its amplitude is "
        f"v / sqrt(2 c g) = {2 / math.sqrt(0.25 * 9.81):.3g} m.",
        scenes.bead_on_cycloid(**made, s=0.0, speed=2.0),
    )
    page.ask(
        "What happens to a bead of ten times the mass?",
        "It moves in the same way: the mass is a factor of all terms of the equation.",
        scenes.bead_on_cycloid(**made, s=3.0, m=10.0),
    )


if __name__ == "__main__":
    show(solve)
