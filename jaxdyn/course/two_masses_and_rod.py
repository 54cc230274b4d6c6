"""Two masses joined by a rod or by a stiff spring.

Two masses on a line are joined by a rigid rod, and a force F sin(w t) acts on the second. Set up
the differential-algebraic equations and integrate them; compare with a very stiff spring. Which is
faster, which has the better centre of mass, and how does the error of the length grow? What do the
equations do with unequal velocities at the start?

Answer: The rod is faster: it takes tens of steps for 20 s, a spring of 1e6 N/m thousands. Both have
the right centre of mass, since inner forces cancel in the sum. On a line the condition is linear,
so that, unlike the course says, no error grows. Unequal velocities contradict the rod: they are
refused, and the bare equations, which only hold the accelerations equal, let the masses part.

The numbers belong to m1 = 1 kg, m2 = 2 kg, a rod of 1 m and the force sin(t) in N on the second
mass, for 20 s at a relative tolerance of 1e-9.

The differential-algebraic equations, with the tension T of the rod, are three linear equations:

    m1 x1'' = T,   m2 x2'' = -T + F sin(w t),   x2'' - x1'' = 0.

Which is faster? The rod, whose solution is as smooth as the push. A spring that stands for it has
to be stiff, and then vibrates at sqrt(k (m1 + m2) / (m1 m2)) = 1225 rad/s for 1e6 N/m: each of
the vibrations has to be resolved, so steps grow like sqrt(k) while the stretch falls like 1 / k.

Which has the better centre of mass? Both are right to 1e-9 at this tolerance: adding the two
equations of motion removes the tension of a rod as it does the force of a spring.

How does the error of the length grow? Here it does not: it stays at rounding. The condition x2 - x1
= l is linear, so steps keep it, if it holds at the start, with its rate. In the plane, where it is
quadratic, it drifts: see problems 23 and 25.

Unequal velocities at the start contradict x2' - x1' = 0. The bare equations do not contain that,
only its derivative, so they let the masses part at the constant rate of the start.
"""

import numpy as np

from jaxdyn import scenes, simulate
from jaxdyn.course.page import Page, largest, show
from jaxdyn.drawing.figures import blank, style
from jaxdyn.studies import rod_or_spring

PROBLEM = 21
TOPIC = "constraints"


def solve(page: Page) -> None:
    """Push the rod and springs; compare lengths, centres and steps (`compare` takes the times)."""
    joined = {"rod": rod_or_spring.joined_by_rod(drift="raw")}
    joined |= {f"spring of {k:g} N/m": rod_or_spring.joined_by_spring(k) for k in (1e2, 1e4, 1e6)}
    motions = {name: simulate(scene, samples=401, rtol=1e-9) for name, scene in joined.items()}
    for name, motion in motions.items():
        x1, x2 = motion["x1"], motion["x2"]
        exact = rod_or_spring.mass_centre(np.asarray(motion.ts))
        page.number(f"steps for 20 s, {name}", motion.steps)
        page.equal(f"The centre of mass is right, {name}", (x1 + 2 * x2) / 3, exact, within=1e-9)
    rod, stiff = motions["rod"], motions["spring of 1e+06 N/m"]
    for name in list(motions)[1:]:
        stretch = largest(joined[name], lambda t, y: (y[1] - y[0] - 1.0) ** 2, rtol=1e-9)
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

    figure = blank(6.4, 4.0)
    ax = figure.subplots()
    style(ax)
    for name in ("rod", "spring of 100 N/m"):
        ax.plot(motions[name].ts, motions[name]["x2"] - motions[name]["x1"], label=name)
    ax.set(xlabel="t [s]", ylabel="distance of the masses [m]")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    page.draw(figure, "The rod keeps its length; the spring stretches with the push, and vibrates.")
    page.play(
        {"rod": rod, "unequal velocities": parting}, "With unequal velocities no rod is left."
    )


if __name__ == "__main__":
    show(solve)
