"""Montgomery's eight.

Three equal bodies (m = G = 1) start in a row, the middle one at the origin, with velocities given
to eight digits. Follow them for 2.1 units of time and for 10. Then move one body a little at the
start, then more, and wait longer. What is curious about these motions?

Answer: The three chase each other round one figure of eight: after T / 3 = 2.1086 each is where the
next one was, to the digits that are printed. With one body displaced by 0.01 the motion stays close
to the eight, which is stable, but slowly rotates; with 0.22, two bodies form a pair near t = 35 and
eject the third.

(a) In 2.1 units of time, almost a third of the period T = 6.326, each body runs a third of the
curve, so the three paths together are the whole eight.

(b) In 10 units each runs round the eight one and a half times, always on the same curve, and is
never farther than 1.081 from the middle, a little more than at the start.

(c) With the first body 0.01 farther to the right the motion stays near the eight for 100 units, but
its curve turns.

(d) A larger displacement shows what follows sooner. With 0.22 the three first move on wilder loops.
Then two of them form a close pair, and the energy that this releases ejects the third: at t = 45
one body is 11.99 from the middle.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, largest, show

PROBLEM = 17
TOPIC = "many particles"


def squared_distances(t, y):
    """(3,) the squares of the distances of the bodies from the origin."""
    return jnp.sum(y[:6].reshape(3, 2) ** 2, axis=1)


def solve(page: Page) -> None:
    """Follow the printed start, and starts near it; find out which motions stay close."""
    eight = scenes.three_body(scenes.EIGHT)
    r = np.asarray(simulate(eight, scenes.EIGHT_PERIOD, samples=601, rtol=1e-13).r)
    page.number("period, and a third of it", [scenes.EIGHT_PERIOD, scenes.EIGHT_PERIOD / 3])
    statement = "After T / 3 each body is where the next one was"
    page.equal(statement, r[200], r[0][np.array([2, 0, 1])], within=1e-7, route="closure")
    page.equal("After T all are back", r[600], r[0], within=1e-7, route="closure")

    near, off = (eight.starting(eight.y0 + by * np.eye(12)[0]) for by in (0.01, 0.22))
    spans = {"2.1 units": (eight, 2.1), "10 units": (eight, 10.0)}
    spans |= {"0.01 aside, 100 units": (near, 100.0), "0.22 aside, 45 units": (off, 45.0)}
    motions = {name: simulate(*one, samples=601, rtol=1e-13) for name, one in spans.items()}
    farthest = {}
    for name, (scene, end) in spans.items():
        most = largest(scene, squared_distances, end)
        farthest[name] = np.sqrt(most.value)
        page.number(f"largest distance of a body from the origin, {name}", farthest[name])
    drifts = np.array([energy.drift(motion) for motion in motions.values()])
    page.equal("The energy stays the same", drifts, np.zeros(4), within=1e-11, route="conservation")
    route = "distance from the origin"
    page.true(
        "A start 0.01 aside stays near the eight",
        farthest["0.01 aside, 100 units"] < 1.1,
        route=route,
    )
    page.true(
        "A start 0.22 aside throws a body out", farthest["0.22 aside, 45 units"] > 5.0, route=route
    )

    look = "In 2.1 units each body runs a third of the one curve. The eight of a start aside turns."
    page.draw(lambda: picture(motions), look)
    page.play(motions["10 units"], "Three bodies chase each other on one curve.")
    page.play(motions["0.22 aside, 45 units"], "Two bodies form a pair, and eject the third.")


def picture(motions):
    """The paths of all motions."""
    figure = drawing.figures.blank(9.0, 6.6)
    for ax, (name, motion) in zip(figure.subplots(2, 2).flat, motions.items(), strict=True):
        drawing.figures.style(ax)
        x, y = drawing.paths(motion).xyz.T
        ax.set_prop_cycle(color=drawing.figures.PALETTE)
        ax.plot(x.T, y.T, lw=1.2)
        ax.set(title=name, aspect="equal", xlabel="x", ylabel="y")
    return figure


if __name__ == "__main__":
    show(solve)
