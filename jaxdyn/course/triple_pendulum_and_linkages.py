"""Triple pendulum, four-bar linkage, and more.

Simulate three uniform bars that hang in a row, by three sets of equations, and a linkage of three
bars between two fixed hinges. Check the motions in as many ways as possible. Then try mechanisms of
your own, such as a chain whose last bar ends on a skate.

Answer: Newton-Euler, Lagrange and constraints give one motion of the triple pendulum; the crank
angle alone and the three angles with a closed loop give one motion of the four-bar linkage.
Energies stay to 1e-12. Bars that are too short to close a loop are refused.
"""

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show

PROBLEM = 43
TOPIC = "pendulums and linkages"


def solve(page: Page) -> None:
    """Swing each mechanism by several formulations, and compare."""
    precisely = {"samples": 401, "rtol": 1e-13}
    angles = (np.pi / 2, np.pi, 2.0)
    bars = {"m": (1.0, 1.0, 1.0), "l": (1.0, 1.0, 1.0), "rates": (0.0, 0.0, 0.0)}
    triple = simulate(scenes.triple_pendulum(), **precisely)
    chain = scenes.n_pendulum(**bars, angles=angles, formulation="lagrange")
    by_lagrange = simulate(chain, **precisely)
    tied = simulate(scenes.triple_pendulum(formulation="constrained"), **precisely)
    names = ("theta1", "theta2", "theta3")
    free, loose = (np.stack([one[name] for name in names]) for one in (triple, tied))
    page.number("angles of the triple pendulum after 10 s", free[:, -1], "rad")
    statement, lagrange = "Newton-Euler and Lagrange agree", by_lagrange.ys
    page.equal(statement, triple.ys, lagrange, within=1e-9, route="second formulation")
    statement = "Newton-Euler and constraints agree"
    page.equal(statement, free, loose, within=1e-8, route="second formulation")

    crank = simulate(scenes.four_bar(angle=2.0), 10.0, **precisely)
    start = scenes.four_bar(angle=2.0, formulation="loop").y0[:3]
    lengths = bars | {"l": (1.0, 2.0, 2.0)}
    loop = simulate(scenes.pinned_chain(**lengths, span=2.0, angles=start), **precisely)
    page.number("angle of the crank after 10 s", crank["theta1"][-1], "rad")
    statement, angle = "The crank alone and the closed loop agree", loop["theta1"]
    page.equal(statement, crank["theta1"], angle, within=1e-11, route="second formulation")
    refused = ""
    try:
        scenes.pinned_chain(**lengths, span=6.0, angles=start)
    except ValueError as error:
        refused = str(error)
    page.true("5 m of bars over 6 m are refused", "span" in refused, route="the message")
    skating = simulate(scenes.skate_chain(**bars | {"rates": (1.0, 0.0, 0.0)}), **precisely)
    motions = {"triple pendulum": triple, "linkage": crank, "closed loop": loop, "skate": skating}
    for name, motion in motions.items():
        drift = energy.drift(motion)
        page.equal(f"The energy stays, {name}", drift, 0.0, within=1e-11, route="conservation")

    page.draw(drawing.trajectory(triple), "The third bar turns over again and again.")
    page.draw(drawing.trajectory(crank), "The crank swings, and drives the rocker by the coupler.")
    for name, motion in motions.items():
        page.play(motion, f"The motion of the {name}, from one of its formulations.")


if __name__ == "__main__":
    show(solve)
