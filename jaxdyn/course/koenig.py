"""Koenig's theorem.

The kinetic energy of a system of particles is the sum of m_i v_i^2 / 2. Write it as m v_G^2 / 2
with the total mass and the velocity of the centre of mass, plus a rest (a). Is the resultant of
the external forces times v_G always the rate of the first part (b)? Is the power of the internal
forces always the rate of the rest (c)?

Answer: The rest is the energy relative to G, the sum of m_i |v_i - v_G|^2 / 2. (b) is always true,
since internal forces sum to zero. (c) is not: of two masses on a spring one is pushed by F, and the
push works on its motion relative to G as well, with the power F (v_2 - v_G).

(a) With v_i = v_G + u_i the square is v_G^2 + 2 v_G . u_i + u_i^2. Summed with m_i / 2 the middle
part is v_G . sum of m_i u_i, and that sum is zero, since the sum of m_i v_i is m v_G. So

    E = m v_G^2 / 2 + sum of m_i u_i^2 / 2.

(b) Always. m a_G is the sum of all forces, in which internal ones cancel in pairs, so the sum of
the external forces times v_G is m a_G . v_G, which is d/dt (m v_G^2 / 2).

(c) Not always. The rate of the rest is the power of all forces on the motions u_i. The internal
ones have their whole power there: they add up to zero, so v_G drops out. An external force F_i adds
F_i . u_i. It is true where these add up to zero, as for weights, since the sum of m_i u_i is zero.
The counterexample has 1 kg and 2 kg on a spring of 100 N/m, at rest until 1 N pushes the second,
for 2 s.
"""

import numpy as np

from jaxdyn import drawing, effects, scenes, simulate
from jaxdyn.analysis import energy, momenta
from jaxdyn.course.page import Page, show

PROBLEM = 18
TOPIC = "many particles"


def solve(page: Page) -> None:
    """Push one of two masses on a spring, and compare powers with rates of the energies."""
    scene = scenes.two_masses(m1=1.0, m2=2.0, k=100.0, force=1.0)
    motion = simulate(scene, 2.0, samples=401, rtol=1e-13)
    v = motion.ys[:, 2:]
    v_G = v @ np.array([1.0, 2.0]) / 3.0
    centre, relative = energy.along(momenta.kinetic_split, motion)
    page.number("energy of G and relative to G at the end", [centre[-1], relative[-1]], "J")
    total = 0.5 * v**2 @ np.array([1.0, 2.0])
    statement = "The energies of G and relative to G add up"
    page.equal(statement, centre + relative, total, within=1e-14)

    balances = momenta.power_balances(motion, effects.Spring)
    b, c = balances["centre"], balances["relative"]
    statement = "b: the push times v_G is the rate of the energy of G"
    page.equal(statement, v_G, b.right, within=1e-13, route="derivative of the energy")
    statement = "c: the power of the spring is not the rate of the energy relative to G"
    page.true(statement, not c.holds, route="derivative of the energy")
    page.equal("It lacks F (v_2 - v_G)", c.right - c.left, v[:, 1] - v_G, within=1e-13)

    page.draw(
        lambda: picture(motion.ts, c),
        "The spring alone does not account for the energy relative to G.",
    )
    page.play(motion, "The right mass is pushed; both swing about a centre that speeds up.")


def picture(ts, balance):
    """The power of the spring and the rate of the energy relative to G over time."""
    figure = drawing.figures.blank(6.4, 4.0)
    ax = figure.subplots()
    drawing.figures.style(ax)
    ax.plot(ts, balance.left, label="power of the spring")
    ax.plot(ts, balance.right, label="rate of the energy relative to G")
    ax.set(xlabel="t [s]", ylabel="power [W]")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    return figure


if __name__ == "__main__":
    show(solve)
