"""A cannonball with linear drag.

A ball of mass m is shot at the angle theta with the speed v0, under gravity g and the drag -c v.
Find its motion in closed form, and by integration with v0 = g = m = c = 1 and 45 degrees: how large
is the error at t = 2 s, and how does it depend on the tolerance or the step? What shape does the
path approach for very large speeds, and what angle does the launch angle of the longest range
approach?

Answer: With tau = m / c, x = tau vx0 (1 - e^(-t/tau)) and y = tau (vy0 + g tau) (1 - e^(-t/tau)) -
g tau t; with Euler's method the error is proportional to the step. Fast shots draw a triangle,
straight to the distance tau v0 and straight down; the best angle tends to 0, like W(u^2 / e) / u
with u = v0 / (g tau), where W is Lambert's function.

(a) m x'' = -c x' and m y'' = -c y' - m g are two linear equations of the first order for the
velocity: vx = vx0 e^(-t/tau), vy = (vy0 + g tau) e^(-t/tau) - g tau. Integrated once more they give
the formulas above.

(b, c) With m = c = g = v0 = 1 and 45 degrees the errors at t = 2 s, the larger of those of x and y,
are in the table. With the method of ode45 they fall with the tolerance; with Euler's method they
halve with the step.

(d) In units of tau v0 the weight does not matter until a fast ball has lost nearly all its speed:
it runs out of speed on its first straight line, at the distance tau v0. From there it falls
straight down at the terminal speed g tau, which takes most of the time.

(e) The best angle tends to zero. A fast shot lands after t = tau (1 + u sin(theta)), at x = tau v0
cos(theta) (1 - e^(-t/tau)). Its derivative by theta vanishes, for small theta, where u theta
e^(u theta) = u^2 / e, so that theta = W(u^2 / e) / u: large u only add logarithms to 1 / u.
"""

import diffrax
import jax
import numpy as np
from scipy import special

from jaxdyn import drawing, scenes, simulate
from jaxdyn.accuracy import convergence
from jaxdyn.course.page import Page, show
from jaxdyn.integrate.events import Reaches
from jaxdyn.scenes import ballistics

PROBLEM = 9
TOPIC = "one particle"


def reach(angle, speed):
    """() [m] the range of a shot with g = m = c = 1."""
    flight = ballistics.flight_time(speed=speed, angle=angle, g=1.0)
    return ballistics.cannonball_linear_exact(flight, speed=speed, angle=angle, g=1.0)[0]


def solve(page: Page) -> None:
    """Compare with the closed form, shoot faster and faster, and look for the longest range."""
    ball = scenes.cannonball(speed=1.0, g=1.0, linear=1.0)
    exact = np.asarray(ballistics.cannonball_linear_exact(2.0, speed=1.0, g=1.0))
    for rtol in (1e-3, 1e-6, 1e-9):
        end = simulate(ball, 2.0, samples=2, rtol=rtol, solver=diffrax.Dopri5()).ys[-1]
        error = np.abs(np.asarray(end) - exact).max()
        page.number(f"c: error at 2 s, ode45's method, tolerance {rtol:.0e}", error, "m")
    halved = convergence.halvings(ball, 2.0, steps=1024, rows=4)
    errors = np.abs(halved.ys - exact).max(axis=1)
    page.number("c: error at 2 s, Euler's method with 1024, 2048, 4096 and 8192 steps", errors, "m")
    page.equal("Its order is 1", halved.orders[-1], 1.0, within=1e-3, route="halved steps")

    shots = {}
    for speed in (1.0, 4.0, 16.0, 64.0, 256.0, 4096.0):
        flight = ballistics.flight_time(speed=speed, g=1.0)
        shot = simulate(scenes.cannonball(speed=speed, g=1.0, linear=1.0), flight, samples=400)
        closed = ballistics.cannonball_linear_exact(shot.ts, speed=speed, g=1.0)
        page.equal(f"Shot at {speed:g} m/s", shot.ys / speed, closed / speed, within=1e-12)
        shots[f"{speed:g}"] = shot
    page.draw(
        lambda: picture(shots),
        "In units of tau v0 the paths tend to a triangle with a vertical side.",
    )
    page.play(
        shots,
        "Slow shots fly on a parabola; fast ones stop, and fall.",
        choose="v0 [m/s]",
        ends=Reaches(1, 0.0, -1),
    )

    u = np.array([1.0, 1e2, 1e4])
    best = ballistics.best_angle(speed=u, g=1.0)
    page.number("e: best angle for v0 = 1, 100, 10000 m/s", np.degrees(best), "degrees")
    law = special.lambertw(u**2 / np.e).real / u
    page.number("e: W(u^2 / e) / u for these", np.degrees(law), "degrees")
    page.equal("e: They agree for 10000 m/s", best[2] / law[2], 1.0, within=1e-5)
    slopes = jax.jit(jax.vmap(jax.grad(reach)))(best, u) / u
    page.equal(
        "No angle takes it farther", slopes, 0 * u, within=1e-11, route="derivative of the range"
    )


def picture(shots):
    """All paths, in units of tau v0."""
    figure = drawing.figures.blank(6.4, 5.4)
    ax = figure.subplots(subplot_kw={"aspect": "equal"})
    drawing.figures.style(ax)
    for (speed, shot), colour in zip(shots.items(), drawing.figures.PALETTE, strict=False):
        path = np.asarray(shot.ys[:, :2]).T / float(speed)
        ax.plot(*path, color=colour, label=f"v0 = {speed} m/s")
    ax.set(xlabel="x / (tau v0)", ylabel="y / (tau v0)")
    ax.legend(frameon=False)
    return figure


def ask(page: Page) -> None:
    """The shot at 16 m/s without air, and with a heavier ball."""
    still = reach(np.pi / 4, 16.0)
    page.ask(
        "What happens without air, at 16 m/s?",
        f"The ball flies on a parabola, v0^2 / g = {16.0**2:.0f} m far instead of {still:.3g} m.",
        scenes.cannonball(speed=16.0, g=1.0, t1=2 * 16.0 * np.sin(np.pi / 4)),
    )
    flight = ballistics.flight_time(speed=16.0, g=1.0, m=10.0)
    far = ballistics.cannonball_linear_exact(flight, speed=16.0, g=1.0, m=10.0)[0]
    page.ask(
        "What happens to a ball of ten times the mass, at 16 m/s?",
        "Its speed decays ten times more slowly, tau = m / c = 10 s: "
        f"it lands after {flight:.3g} s, {far:.3g} m away.",
        scenes.cannonball(speed=16.0, g=1.0, linear=1.0, m=10.0, t1=flight),
    )


if __name__ == "__main__":
    show(solve)
