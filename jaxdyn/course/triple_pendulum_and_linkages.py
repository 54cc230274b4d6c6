"""Triple pendulum, four-bar linkage, and more.

Simulate three uniform bars that hang in a row, by three sets of equations, and a linkage of three
bars between two fixed hinges. Check the motions in as many ways as possible.

Answer: Newton-Euler, Lagrange and constraints give one motion of the triple pendulum; the crank
angle alone and the three angles with a closed loop give one motion of the four-bar linkage.
Energies are conserved to 1e-12. Released from rest at a crank angle of 2 rad, the linkage swings
periodically, with the period 9.137 s. Bars that are too short to close a loop are refused.

The numbers belong to uniform bars of 1 kg and 1 m in the triple pendulum, and to a crank of 1 m, a
coupler and a rocker of 2 m, 1 kg each, on hinges 2 m apart in the linkage, with g = 1 m/s^2. The
pendulum starts at rest at the angles pi/2, pi and 2 rad, the linkage at a crank angle of 2 rad with
the coupler pointing upwards; with it pointing downwards the loop closes as well.

Triple pendulum, with the angles from hanging down. By Lagrange, or by Newton and Euler (the angular
momentum balance of bars i to 3 about the upper hinge of bar i, each less the next):

    sum over j of A_ij (cos(theta_i - theta_j) theta_j'' + sin(theta_i - theta_j) theta_j'^2)
        = -g B_i sin(theta_i),    i = 1, 2, 3

    A = (7/3, 3/2, 1/2; 3/2, 4/3, 1/2; 1/2, 1/2, 1/3) kg m^2,   B = (5/2, 3/2, 1/2) kg m

A_ii is l_i^2 times a third of the bar's mass and all masses below it, A_ij (j below i) l_i l_j
times half of the mass of bar j and all masses below that; B_i is l_i times half of the mass of bar
i and all masses below. By constraints: three free bars, nine equations, and the six forces of the
hinges with six conditions, each differentiated twice.

The first equations printed below are these.

Four-bar linkage. The same chain of three bars, whose end (x, y) is held at the second hinge, (D,
0), where D is called e_x in the equations printed last:

    sum over j of l_j sin(theta_j) = D,   sum over j of l_j cos(theta_j) = 0,

so the equations of the chain get the moments of the hinge's force (X, Y) on their right sides,
l_i (X cos(theta_i) + Y sin(theta_i)), and the two conditions differentiated twice are two more
equations for X and Y. By the crank alone: theta_2 and theta_3 follow from theta_1, and with T =
J(theta_1) theta_1'^2 / 2 the motion is J theta_1'' + (dJ/dtheta_1) theta_1'^2 / 2 = -dV/dtheta_1.

Periodic motions. With one degree of freedom and a constant energy every swing of the linkage is
periodic. For the triple pendulum, small oscillations in one of three mode shapes are periodic;
their periods are in the table. Larger periodic motions continue these; most other large motions are
chaotic.

Limiting cases. If the lower bars are light, the first one swings like a simple pendulum of length
2/3 m. At small angles the motion is a sum of the three modes. At g = 0 the angular momentum of the
pendulum about its hinge is constant. The first two are checked.
"""

import numpy as np
from scipy import optimize

from jaxdyn import drawing, linearize, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show

PROBLEM = 43
TOPIC = "pendulums and linkages"


BARS = {"m": (1.0, 1.0, 1.0), "length": (1.0, 1.0, 1.0), "rates": (0.0, 0.0, 0.0)}
PRECISELY = {"samples": 2001, "rtol": 1e-13}
A = np.array([[7 / 3, 3 / 2, 1 / 2], [3 / 2, 4 / 3, 1 / 2], [1 / 2, 1 / 2, 1 / 3]])
B = np.array([5 / 2, 3 / 2, 1 / 2])


def by_hand(angles, rates):
    """theta_i'' of the triple pendulum by the equations above."""
    between = angles[:, None] - angles
    return np.linalg.solve(
        A * np.cos(between), -(A * np.sin(between)) @ rates**2 - B * np.sin(angles)
    )


def period_of(swing):
    """The time [s] at which the crank rests for the second time after its start at rest."""
    scene, rates = swing.scene, np.asarray(swing["theta1_dot"])[1:]
    i = 1 + np.flatnonzero(rates[1:] * rates[:-1] < 0)[1]

    def rate(t):
        return simulate(scene, t, **PRECISELY)["theta1_dot"][-1]

    return optimize.brentq(rate, *swing.ts[i : i + 2], xtol=1e-14)


def solve(page: Page) -> None:
    """Swing the triple pendulum and the linkage; their equations, periods and energies."""
    triple = simulate(scenes.triple_pendulum(), **PRECISELY)
    names = ("theta1", "theta2", "theta3")
    page.number("angles of the triple pendulum after 10 s", [triple[n][-1] for n in names], "rad")
    y = np.array([0.5, 2.0, -1.0, 0.3, -0.7, 1.1])
    found, known = triple.scene.rate(0.0, y)[3:], by_hand(y[:3], y[3:])
    page.equal("Triple pendulum: the equations", found, known, within=1e-12, route="by hand")
    hanging = triple.scene.starting(np.zeros(6))
    rates = np.sort(np.abs(linearize(hanging, np.zeros(6)).eigenvalues))[::2]
    page.number("Triple pendulum: periods of its three small swings", 2 * np.pi / rates, "s")
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(A, np.diag(B))))
    page.equal("Triple pendulum: their frequencies", rates**2, squares, within=1e-12)

    linkage = scenes.four_bar(angle=2.0, formulation="newton_euler")  # by the crank alone
    crank = simulate(linkage, 10.0, **PRECISELY)
    page.number("angle of the crank after 10 s", crank["theta1"][-1], "rad")
    period = period_of(crank)
    page.number("Linkage: period of its swing from 2 rad, at rest", period, "s")
    back = simulate(linkage, period, **PRECISELY).ys[-1]
    page.equal("Linkage: Then it is back at its start", back, linkage.y0, within=1e-10)
    refused = ""
    try:
        scenes.pinned_chain(**BARS | {"length": (1.0, 2.0, 2.0)}, span=6.0, angles=(0.2, 1.0, 2.4))
    except ValueError as error:
        refused = str(error)
    page.true("5 m of bars over 6 m are refused", "span" in refused, route="the message")

    page.draw(lambda: drawing.trajectory(triple), "The third bar turns over again and again.")
    page.draw(
        lambda: drawing.trajectory(crank), "The crank swings, and drives the rocker by the coupler."
    )
    for name, motion in {"triple pendulum": triple, "linkage": crank}.items():
        drift = energy.drift(motion)
        page.equal(
            f"The energy is conserved, {name}", drift, 0.0, within=1e-11, route="conservation"
        )
        page.play(motion, f"The motion of the {name}.")


def check(page: Page) -> None:
    """The motions by other formulations, a limiting case, and a chain that ends on a skate."""
    angles, names = (np.pi / 2, np.pi, 2.0), ("theta1", "theta2", "theta3")
    triple = simulate(scenes.triple_pendulum(), **PRECISELY)
    chain = scenes.n_pendulum(**BARS, angles=angles, formulation="lagrange")
    tied = simulate(scenes.triple_pendulum(formulation="constrained"), **PRECISELY)
    free, loose = (np.stack([one[name] for name in names]) for one in (triple, tied))
    statement, lagrange = "Newton-Euler and Lagrange agree", simulate(chain, **PRECISELY).ys
    page.equal(statement, triple.ys, lagrange, within=1e-9, route="second formulation")
    statement = "Newton-Euler and constraints agree"
    page.equal(statement, free, loose, within=1e-8, route="second formulation")
    light = BARS | {"m": (1.0, 1e-7, 1e-7)}
    first = simulate(scenes.n_pendulum(**light, angles=angles, formulation="lagrange"), **PRECISELY)
    alone = simulate(scenes.pendulum(length=2 / 3, g=1.0, angle=np.pi / 2), 10.0, **PRECISELY)
    statement = "Above light bars the first is a simple pendulum of 2/3 m"
    page.equal(statement, first["theta1"], alone["theta"], within=1e-4, route="special case")

    crank = simulate(scenes.four_bar(angle=2.0, formulation="newton_euler"), 10.0, **PRECISELY)
    start = scenes.four_bar(angle=2.0, formulation="loop").y0[:3]
    lengths = BARS | {"length": (1.0, 2.0, 2.0)}
    loop = simulate(scenes.pinned_chain(**lengths, span=2.0, angles=start), **PRECISELY)
    statement, angle = "The crank alone and the closed loop agree", loop["theta1"]
    page.equal(statement, crank["theta1"], angle, within=1e-11, route="second formulation")
    skating = simulate(scenes.skate_chain(**BARS | {"rates": (1.0, 0.0, 0.0)}), **PRECISELY)
    for name, motion in {"closed loop": loop, "chain on a skate": skating}.items():
        drift = energy.drift(motion)
        page.equal(
            f"The energy is conserved, {name}", drift, 0.0, within=1e-11, route="conservation"
        )
        page.play(motion, f"The motion of the {name}, from one of its formulations.")


if __name__ == "__main__":
    show(solve)
