"""Simple equations solved three ways, and their accuracy.

Take simple equations such as the harmonic oscillator or Lorenz's. Solve them by a bare loop of
Euler's method, by a function for Euler's method that calls a right-hand side, and by a solver with
error control (that of ode45). Estimate the accuracy of a solution without knowing the exact one, by
halving the step. Does the tolerance of the solver say how accurate its solution is?

Answer: Halving the step halves Euler's error, so two solutions give the errors of both: with 4000
steps over 10 s it is 0.0106, and estimated as 0.0103. No, the tolerance is not the error: it bounds
the error of one step, and these errors add up and grow. With 1e-6 the oscillator is off by 1.2e-6
after 10 s, and the Lorenz system, which is chaotic, by 2.5e-4.

(a, b) The loop is x, v = x + h v, v - h x, a thousand times; the function `euler` calls the
right-hand side `oscillate`. Both do the same operations and give the same digits.

(c) The method of ode45 (Dormand and Prince, order 5) with the tolerance 1e-12 is accurate to 1e-9.

(d) Without knowing the solution: the solutions with h and h / 2 have the errors C h and C h / 2, so
their difference, C h / 2, is the error of the second, and twice it is that of the first. This uses
the order of the method. A third solution shows the order as well: if a difference is q times the
next, the last solution is off by its difference from the one before over q - 1. The table has these
estimates beside the true errors of (x, v), the larger of the two; they approach them as the steps
get smaller.

(e) No. ode45 estimates what each step adds, and keeps that below the tolerance. The error of the
solution is the sum of these, each propagated by the equations. It is of the size of the tolerance
where the motion neither attracts nor repels its neighbours, and hundreds of times larger after 10 s
of the Lorenz system. It is proportional to the tolerance, though, so a second solution with a
smaller tolerance gives the error of the first, as the picture shows.
"""

import diffrax
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.accuracy import convergence, work_precision
from jaxdyn.course.page import Page, show

PROBLEM = 3
TOPIC = "one particle"


def oscillate(y):
    """Rate of the position and the velocity of an oscillator."""
    return np.array([y[1], -y[0]])


def euler(rate, y, t1, steps):
    """State at t1 after equal steps of Euler's method."""
    for _ in range(steps):
        y = y + t1 / steps * rate(y)
    return y


def solve(page: Page) -> None:
    """Solve three ways, halve steps, and compare tolerances with errors."""
    scene, exact = scenes.oscillator(t1=10.0), np.array([np.cos(10.0), -np.sin(10.0)])
    x, v, h = 1.0, 0.0, 0.01
    for _ in range(1000):
        x, v = x + h * v, v - h * x
    called = euler(oscillate, np.array([1.0, 0.0]), 10.0, 1000)
    page.equal("a, b: A loop and a function agree", [x, v], called, within=1e-12, route="function")
    ours = convergence.fixed_steps(scene, steps=1000)
    page.equal("b: The library's Euler agrees", ours, called, within=1e-12, route="function")
    ode45 = simulate(scene, samples=200, rtol=1e-12, solver=diffrax.Dopri5())
    page.equal("c: A solver with tolerance 1e-12", ode45.ys[-1], exact, within=1e-9)

    halved = convergence.halvings(scene, steps=1000, rows=6)
    errors = np.abs(halved.ys - exact).max(axis=1)
    page.number("d: steps", halved.steps[2:])
    page.number("d: estimated errors", halved.errors[2:])
    page.number("d: true errors", errors[2:])
    page.equal(
        "d: The order of Euler's method is 1", halved.orders[-1], 1.0, within=5e-3, route="halving"
    )
    page.equal("d: The last estimate is right", halved.errors[-1], errors[-1], within=1e-5)
    ends = {
        rtol: simulate(scene, samples=200, rtol=rtol, solver=diffrax.Dopri5()).ys[-1]
        for rtol in (1e-6, 1e-8)
    }
    estimate, true = abs(ends[1e-6] - ends[1e-8]), abs(ends[1e-6] - exact)
    page.equal("e: A tighter tolerance shows the error", estimate, true, within=1e-7)

    judged = {
        name: work_precision.work_precision(
            one, 10.0, solvers=[diffrax.Dopri5()], tolerances=np.logspace(-3, -12, 10), rounds=1
        )
        for name, one in {"oscillator": scene, "Lorenz": scenes.lorenz()}.items()
    }
    for name, found in judged.items():
        page.number(f"e: error at tolerance 1e-6, {name}", found.curves[0].rungs[3].error)
    look = "The error falls with the tolerance, and is larger."
    page.draw(lambda: drawing.judgement(judged), look)

    lorenz = {
        name: simulate(scenes.lorenz(y0=(1.0, 1.0, 1.0 + change), t1=30.0), samples=500, rtol=1e-12)
        for name, change in {"a start": 0.0, "1e-8 beside it": 1e-8}.items()
    }
    page.play(lorenz, "Two starts 1e-8 apart stay together for some 20 time units.")


if __name__ == "__main__":
    show(solve)
