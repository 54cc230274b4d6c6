"""Rate of change of the angular momentum of a system.

Particles move under forces from outside and from each other; G is their centre of mass and C a
point that moves in any way. The candidates are those of one particle, summed: velocities and arms
from the place where C is now (a), arms from the moving C (b), velocities and arms relative to C
(c). For which of them, and when, is the moment of all forces about C the rate of change?

Answer: For that of (a) always; for (b) the moment minus the rate is v_C x m v_G, so C has to rest
or to move parallel to G. For (c) it is r_G/C x m a_C, so C is G itself, or does not accelerate,
unless along the line CG.

M is the sum of r_i/C x m_i a_i; the moments of inner forces cancel in pairs. Each definition is
differentiated, with m the whole mass:

(a) H = sum of (r_i - r_C') x m_i v_i, where C' does not move: H' = M, as each v_i x v_i is zero.

(b) H = sum of r_i/C x m_i v_i: H' = M - v_C x sum of m_i v_i = M - v_C x m v_G.

(c) H = sum of r_i/C x m_i (v_i - v_C): H' = M - (sum of m_i r_i/C) x a_C = M - r_G/C x m a_C.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, effects, scenes, simulate
from jaxdyn.analysis import momenta
from jaxdyn.course.page import Page, show

PROBLEM = 19
TOPIC = "many particles"


#: C (time, points), and the definitions that hold for it.
POINTS = {
    "is G": (momenta.centre_of_mass, "abc"),
    "rests": (lambda t, points: jnp.array([1.0, 2.0]), "abc"),
    "moves parallel to G": (lambda t, points: momenta.centre_of_mass(t, points) / 2, "ab"),
    "accelerates along CG": (
        lambda t, points: momenta.centre_of_mass(t, points) - jnp.array([0.0, 1.0 + t]),
        "ac",
    ),
    "is the first body": (lambda t, points: points.r[0], "a"),
}


def solve(page: Page) -> None:
    """Let three attracting bodies fall, and evaluate both sides for five points C."""
    thrown = [-1.0, 0.0, 1.0, 0.0, 0.0, 0.8, 1.0, 0.5, 1.0, 2.0, 0.2, 1.0]
    scene = scenes.three_body(thrown, m=(1.0, 2.0, 3.0)) + effects.UniformGravity(1.0)
    motion = simulate(scene, 2.0, samples=201, rtol=1e-13)
    balances = {name: momenta.moment_balance(motion, c) for name, (c, _) in POINTS.items()}
    for name, (_, expected) in POINTS.items():
        good = [balances[name][definition].holds for definition in momenta.DEFINITIONS]
        found = "".join(letter for letter, yes in zip("abc", good, strict=True) if yes)
        page.number(f"definitions with M = dH/dt where C {name}", ", ".join(found))
        page.true(f"They are the expected ones where C {name}", found == expected, route="formulas")

    b = balances["accelerates along CG"]["absolute"]
    c = balances["moves parallel to G"]["relative"]
    place = np.average(motion.r, axis=1, weights=scene.system.m)
    across = np.full(201, 1.0 * 1.0 + 2.0 * 1.0 + 3.0 * 0.2)  # m v_G to the right, which stays
    page.equal("For b M - dH/dt is v_C x m v_G", b.left - b.right, across, within=1e-11)
    expected = -6.0 * place[:, 0] / 4
    page.equal("For c it is r_G/C x m a_C", c.left - c.right, expected, within=1e-12)

    page.draw(
        lambda: picture(motion, place),
        "The bodies swing about G, which runs on a parabola (dashed).",
    )
    page.play(motion, "Three bodies attract each other and fall.")


def picture(motion, place):
    """The paths of the bodies and that of G."""
    figure = drawing.trajectory(motion)
    figure.axes[0].plot(*place.T, "k--")
    return figure


if __name__ == "__main__":
    show(solve)
