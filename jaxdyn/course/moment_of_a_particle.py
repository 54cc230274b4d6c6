"""Rate of change of the angular momentum of a particle.

A particle P moves under forces, and so does a point C, in any way. There are three candidates for
the angular momentum of P about C: with the velocity of P and the arm from the place where C is now
(a), with that velocity and the arm from the moving C (b), and with the velocity of P relative to C
(c). For which of them is the moment of the forces about C the rate of change, and when?

Answer: For that of (a) always; for (b) the moment minus the rate is v_C x m v_P, so C has to rest
or to move parallel to P. For (c) it is r_P/C x m a_C, so C must not accelerate, unless along the
line PC.

The moment is M = r_P/C x m a_P, with r_P/C = r_P - r_C. Each definition is differentiated:

(a) H = (r_P - r_C') x m v_P, where C' does not move: H' = v_P x m v_P + r_P/C x m a_P = M, always.

(b) H = r_P/C x m v_P: H' = (v_P - v_C) x m v_P + r_P/C x m a_P = M - v_C x m v_P.

(c) H = r_P/C x m (v_P - v_C): H' = r_P/C x m (a_P - a_C) = M - r_P/C x m a_C.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import momenta
from jaxdyn.course.page import Page, show

PROBLEM = 14
TOPIC = "many particles"


#: C (time, points), and the definitions that hold for it.
POINTS = {
    "rests": (lambda t, points: jnp.array([1.0, 2.0]), "abc"),
    "has a constant velocity": (lambda t, points: jnp.array([2.0 - t, 0.5 * t]), "ac"),
    "moves parallel to P": (lambda t, points: points.r[0] / 2, "ab"),
    "accelerates along PC": (lambda t, points: points.r[0] - jnp.array([0.0, 1.0 + t]), "ac"),
    "accelerates": (lambda t, points: jnp.array([t**2, 1.0]), "a"),
}


def solve(page: Page) -> None:
    """Throw a ball, and evaluate both sides for five points C."""
    motion = simulate(scenes.cannonball(speed=5.0), 1.0, samples=201, rtol=1e-13)
    balances = {name: momenta.moment_balance(motion, c) for name, (c, _) in POINTS.items()}
    for name, (_, expected) in POINTS.items():
        good = [balances[name][definition].holds for definition in momenta.DEFINITIONS]
        found = "".join(letter for letter, yes in zip("abc", good, strict=True) if yes)
        page.number(f"definitions with M = dH/dt where C {name}", ", ".join(found))
        page.true(f"They are the expected ones where C {name}", found == expected, route="formulas")

    balance = balances["accelerates"]
    ts = np.asarray(motion.ts)
    b, c = (balance[name].left - balance[name].right for name in ("absolute", "relative"))
    _, y, _, vy = motion.ys.T
    page.equal("For b M - dH/dt is v_C x m v_P", b, 2 * ts * vy, within=1e-12)
    page.equal("For c it is r_P/C x m a_C", c, -2 * (y - 1.0), within=1e-12)

    page.draw(
        lambda: picture(ts, balance),
        "About a point that accelerates, only the definition a has dH/dt = M.",
    )
    page.play(motion, "The particle is a ball, thrown without drag.")


def picture(ts, balance):
    """The moment about C and the rates of all three definitions of H over time."""
    figure = drawing.figures.blank(6.4, 4.0)
    ax = figure.subplots()
    drawing.figures.style(ax)
    ax.plot(ts, balance["fixed"].left, "k", lw=5, alpha=0.2, label="moment about C")
    for letter, name in zip("abc", momenta.DEFINITIONS, strict=True):
        ax.plot(ts, balance[name].right, label=f"dH/dt by {letter}")
    ax.set(xlabel="t [s]", ylabel="moment and rates of H [N m]")
    ax.legend(frameon=False)
    return figure


if __name__ == "__main__":
    show(solve)
