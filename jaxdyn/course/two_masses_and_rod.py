"""Two masses joined by a rod or by a stiff spring.

Two masses on a line are joined by a rigid rod, and a force F sin(w t) acts on the second. Set up
the differential-algebraic equations and integrate them; compare with a very stiff spring. Which is
faster, which has the better centre of mass, and how does the error of the length grow? What do the
equations do with unequal velocities at the start?

Answer: The rod is faster: it takes tens of steps for 20 s, a spring of 1e6 N/m thousands. Both have
the right centre of mass, since inner forces cancel in the sum; with its many steps the spring has
it to more digits. On a line the condition is linear, so that, contrary to what the course says, no
error grows. Unequal velocities contradict the rod: they are refused, and the bare equations, which
only make the accelerations equal, let the masses separate.

The numbers belong to m1 = 1 kg, m2 = 2 kg, a rod of 1 m and the force sin(t) in N on the second
mass, for 20 s at a relative tolerance of 1e-9.

The differential-algebraic equations, with the tension T of the rod, are three linear equations:

    m1 x1'' = T,   m2 x2'' = -T + F sin(w t),   x2'' - x1'' = 0.

Which is faster? The rod, whose solution is as smooth as the push. A spring that replaces it has to
be stiff, and then vibrates at sqrt(k (m1 + m2) / (m1 m2)) = 1225 rad/s for 1e6 N/m: the steps have
to follow the vibrations, so their number grows nearly like sqrt(k), a little less since the
stretch, and with it what there is to resolve, falls like 1 / k.

Which has the better centre of mass? Both are right to 1e-9 at this tolerance, since adding the two
equations of motion removes the tension of a rod as it does the force of a spring. The spring's is
right to rounding, the rod's to 4e-11: with so few steps the errors of the steps show. In the
equations as the scene has them lambda is -T.

How does the error of the length grow? Here it does not: it stays at rounding. The condition x2 - x1
= l is linear, so steps preserve it if it holds at the start, as does its derivative. In the plane,
where it is quadratic, it drifts: see problems 23 and 25.

Unequal velocities at the start contradict x2' - x1' = 0. The bare equations do not contain this
condition, only its derivative, so they let the masses separate at the constant rate of the start.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, drawing, scenes, simulate
from jaxdyn.accuracy.quantities import Quantity
from jaxdyn.accuracy.work_precision import work_precision
from jaxdyn.analysis.momenta import centre_of_mass
from jaxdyn.course.page import Page, largest, show
from jaxdyn.hard.cases.stiff import LENGTH, joined_by_rod, joined_by_spring, mass_centre
from jaxdyn.integrate.simulation import solve as integrate
from jaxdyn.solvers import default_solver

PROBLEM = 21
TOPIC = "constraints"

_SAMPLES = 201


def squared_stretch(t, y):
    """The square of how much longer than 1 m a spring is [m^2]."""
    del t
    return (y[1] - y[0] - 1.0) ** 2


def solve(page: Page) -> None:
    """Push the rod and springs; compare lengths, centres and steps (`compare` takes the times)."""
    joined = {"rod": joined_by_rod(drift="raw")}
    joined |= {f"spring of {k:g} N/m": joined_by_spring(k) for k in (1e2, 1e4, 1e6)}
    motions = {name: simulate(scene, samples=401, rtol=1e-9) for name, scene in joined.items()}
    for name, motion in motions.items():
        x1, x2 = motion["x1"], motion["x2"]
        exact = mass_centre(np.asarray(motion.ts))
        page.number(f"steps for 20 s, {name}", motion.steps)
        page.equal(f"The centre of mass is right, {name}", (x1 + 2 * x2) / 3, exact, within=1e-9)
    rod, stiff = motions["rod"], motions["spring of 1e+06 N/m"]

    for name in list(motions)[1:]:
        stretch = largest(joined[name], squared_stretch, rtol=1e-12)
        page.number(f"largest change of the length, {name}", np.sqrt(stretch.value), "m")
    page.number("frequency of the spring of 1e6 N/m", np.sqrt(1.5e6), "rad/s")
    length = rod["x2"] - rod["x1"]
    page.equal("The bare equations keep the rod's length", length, np.ones(401), within=1e-12)
    page.true("The rod takes fewer steps", 10 * rod.steps < stiff.steps, route="count of steps")

    unequal = {"m": (1.0, 2.0), "speed": (0.0, 0.5)}
    refused = ""
    try:
        simulate(scenes.rod_on_line(**unequal))
    except ValueError as error:
        refused = str(error)
    statement = "Unequal velocities are refused"
    page.true(statement, "a start that satisfies the constraints" in refused, route="the message")
    parting = simulate(scenes.rod_on_line(**unequal, drift="raw"), samples=401, rtol=1e-9)
    apart = parting["x2"] - parting["x1"]
    statement = "By the bare equations they part at the constant rate of the start"
    page.equal(statement, apart, 1.0 + 0.5 * parting.ts, within=1e-10)

    page.draw(
        lambda: picture(motions),
        "The rod keeps its length; the spring stretches with the push, and vibrates.",
    )
    page.play(
        {"rod": rod, "unequal velocities": parting}, "With unequal velocities no rod is left."
    )


def picture(motions):
    """The distance of the masses over time."""
    figure = drawing.figures.blank(6.4, 4.0)
    ax = figure.subplots()
    drawing.figures.style(ax)
    for name in ("rod", "spring of 100 N/m"):
        ax.plot(motions[name].ts, motions[name]["x2"] - motions[name]["x1"], label=name)
    ax.set(xlabel="t [s]", ylabel="distance of the masses [m]")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    return figure


class Row(NamedTuple):
    """The cost of a given accuracy of the centre of mass, for one way to join the masses.

    Attributes:
      name: rod or spring.
      rtol: the loosest tolerance that reaches the accuracy; NaN if there is none.
      error: error of the centre of mass at the end [m].
      stretch: largest change of the distance between the masses at that tolerance [m].
      seconds: median time of a run.
      evaluations: number of evaluations of the right-hand side.
    """

    name: str
    rtol: float
    error: float
    stretch: float
    seconds: float
    evaluations: float


def compare(k=(1e2, 1e4, 1e6), *, t1=20.0, digits=9, rounds=10) -> tuple[Row, ...]:
    """Compare the rod, for each `drift`, and springs, at equal accuracy of the centre of mass.

    The rod is faster than any spring stiff enough to replace it: a spring that is ten times stiffer
    takes three times as long, and still stretches. The centre of mass is not less accurate with a
    spring: its two forces cancel in the sum, and the short steps make the centre of mass accurate
    to rounding, which the rod reaches at a tighter tolerance for less time. On a line the
    constraint is linear and does not drift even without correction ("raw"); Baumgarte's method
    perturbs it.

    Args:
      k: stiffnesses of the springs [N/m].
      t1: span [s].
      digits: correct decimal places of the centre of mass [m] at the end.
      rounds: how often each run is timed.
    Returns:
      A row for each drift of `scenes.rod_on_line`, then one for each spring.
    """
    drifts = ("projection", "baumgarte", "raw")
    joined = {f"rod, {drift}": joined_by_rod(drift, t1=t1) for drift in drifts}
    joined |= {f"spring, k = {stiffness:g}": joined_by_spring(stiffness, t1=t1) for stiffness in k}
    return tuple(_row(name, scene, t1, digits, rounds) for name, scene in joined.items())


def _row(name: str, scene: Scene, t1, digits, rounds) -> Row:
    def centre(scene, t1, *, solver, rtol, dt):
        y1 = integrate(scene, t1, solver=solver, rtol=rtol, dt=dt).y1
        return centre_of_mass(t1, scene.system.points(t1, y1))[0]

    wanted = Quantity("mass centre", centre, float(mass_centre(t1)))
    # A Runge-Kutta pair, since the evaluations of a series cannot be counted.
    solver = default_solver(scene, several=True)
    found = work_precision(scene, t1, solvers=[solver], quantity=wanted, rounds=rounds)
    choice = found.recommend(digits)
    if choice is None:
        return Row(name, *[float("nan")] * 5)
    (rung,) = (r for r in found.curves[0].rungs if r.fineness == choice.fineness)
    motion = simulate(scene, t1, samples=_SAMPLES, rtol=choice.fineness, solver=solver)
    r = jax.vmap(lambda t, y: scene.system.points(t, y).r)(motion.ts, motion.ys)
    stretch = float(jnp.max(jnp.abs(r[:, 1, 0] - r[:, 0, 0] - LENGTH)))
    return Row(
        name=name,
        rtol=choice.fineness,
        error=choice.error,
        stretch=stretch,
        seconds=choice.seconds,
        evaluations=rung.evaluations,
    )


if __name__ == "__main__":
    show(solve)
