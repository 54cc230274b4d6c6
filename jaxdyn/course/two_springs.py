"""Rest and motion of a mass on two springs.

A mass hangs between two anchors on springs with parallel dashpots, with weight and air drag. Find
where it can rest, how it moves from a given start, and the smallest and the largest possible number
of equilibria. Decide for each whether it is stable in two ways: by a motion that begins close to
it, and by the eigenvalues of the linearised equations.

Answer: The springs below have five equilibria, and a proof shows that these are all: two are
stable and three are saddles. Two springs and weight have one to five, as far as is known; without
springs there are none, and a single spring without weight has a circle of them. Small disturbances
grow or decay at the rates given by the eigenvalues.

(a) At rest the forces of both springs and the weight add up to zero: two equations for x and y,
solved from a guess by Newton's method, or for all solutions in a region by intervals.

(b) As the scene below has them, with A as spring 1, B as spring 2 and c3 = c_d: m r'' = sum over A
and B of [-k (l - L) - c l'] e - c_d v - m g j, where l is the distance from the anchor and e the
direction from it. The motions below start beside each equilibrium.

(c) The springs have k_A = 1 N/m, L_A = 2 m from (0, 0) and k_B = 8 N/m, L_B = 0.8 m from (0.8, 0.6)
m, with c_A = c_B = 0.2 kg/s, c_d = 0.1 kg/s, m = 1 kg and g = 1 m/s^2: five equilibria. With a
hundred times the weight one is left.

(d) Both ways agree. The eigenvalues of the linearised equations give the rate at which a small
disturbance grows or decays, and a simulated disturbance of 1e-6 does so.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, equilibria, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show

PROBLEM = 13
TOPIC = "one particle"


def hung(g):
    """A short stiff spring and a long soft one, with some damping."""
    springs = {"k_a": 1.0, "k_b": 8.0, "length_a": 2.0, "length_b": 0.8}
    anchors = {"anchor_a": (0.0, 0.0), "anchor_b": (0.8, 0.6)}
    return scenes.two_springs(**springs, **anchors, c_a=0.2, c_b=0.2, c_d=0.1, g=g)


def solve(page: Page) -> None:
    """Find all equilibria, push the mass off each, and compare with the eigenvalues."""
    scene = hung(g=1.0)
    found = equilibria(scene, [-5, -5], [5, 5])
    all_of_them = len(found) == 5 and found.complete
    page.true("There are five equilibria", all_of_them, route="proof by intervals")
    heavy = equilibria(hung(g=100.0), [-200, -200], [200, 200])
    page.true("A hundred times the weight leaves one", len(heavy) == 1, route="proof by intervals")

    motions = {}
    pairs = zip(found.states, found.linearizations, strict=True)
    for i, (rest, near) in enumerate(pairs, start=1):
        page.number(f"equilibrium {i}, {near.verdict}", rest[:2], "m")
        page.number(f"real parts of the eigenvalues at {i}", near.eigenvalues.real, "1/s")
        values, shapes = np.linalg.eig(near.jacobian)
        first = np.argmax(values.real)
        push, t = 1e-6 * shapes[:, first], min(1.0 / abs(values[first].real), 4.0)
        pushed = simulate(scene.starting(rest + push.real), t, samples=400, rtol=1e-13)
        expected = (push * np.exp(values[first] * t)).real
        name = f"A push off {i} grows or decays like it"
        page.equal(name, pushed.ys[-1] - rest, expected, within=1e-10, route="simulated")
        off = rest - 5e4 * push.real
        motions[f"beside {i}"] = simulate(scene.starting(off), 30.0, samples=400)
    page.draw(
        lambda: picture(scene, found, motions),
        "Lines of equal potential energy: motions end in one of its two wells.",
    )
    look = "Each motion begins beside an equilibrium and ends at a stable one."
    page.play(motions, look, choose="start")


def picture(scene, found, motions):
    """Lines of equal potential energy, the equilibria and the motions beside them."""
    span = np.linspace(-1.0, 2.2, 120)
    places = np.stack([*np.meshgrid(span, span - 0.4), *np.zeros((2, 120, 120))], axis=-1)
    at = jax.vmap(lambda y: energy.potential(scene, 0.0, y))
    heights = np.reshape(at(jnp.asarray(places.reshape(-1, 4))), (120, 120))
    figure = drawing.figures.blank(6.0, 5.6)
    ax = figure.subplots(subplot_kw={"aspect": "equal", "xlabel": "x [m]", "ylabel": "y [m]"})
    drawing.figures.style(ax)
    ax.grid(visible=False)
    ax.contour(span, span - 0.4, heights, np.linspace(0, 4, 28), colors="0.8", linewidths=0.7)
    drawn = zip(found.states, found.linearizations, motions.values(), strict=True)
    for i, (rest, near, motion) in enumerate(drawn):
        colour = drawing.figures.PALETTE[i]
        ax.plot(motion["x"], motion["y"], color=colour, lw=1.0)
        ax.plot(*rest[:2], "o", color=colour, ms=9, label=f"{i + 1}: {near.verdict}")
    ax.legend(loc="lower left")
    return figure


def ask(page: Page) -> None:
    """The hanging mass without damping, and a heavy one."""
    start = jnp.array([2.0, 0.9, 0.0, 0.0])
    springs = {"k_a": 1.0, "k_b": 8.0, "length_a": 2.0, "length_b": 0.8}
    anchors = {"anchor_a": (0.0, 0.0), "anchor_b": (0.8, 0.6)}
    free = scenes.two_springs(**springs, **anchors, g=1.0)
    page.ask(
        "What happens without any damping?",
        "The energy is conserved: it never comes to rest, and wanders from well to well.",
        free.starting(start, 30.0),
    )
    page.ask(
        "What happens when gravity is a hundred times stronger?",
        "One equilibrium is left, far below, and every motion ends there.",
        hung(g=100.0).starting(start, 30.0),
    )


if __name__ == "__main__":
    show(solve)
