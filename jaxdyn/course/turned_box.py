"""A box turned about a line.

Draw a box with three different sides, and a line through it, and turn the box smoothly about the
line. Show in this way that a turn by 120 degrees about (1, 1, 1) exchanges the axes.

Answer: The turn takes x to y, y to z and z to x: a box of 3 x 2 x 1 m then stands with its sides
1, 3 and 2 m along x, y and z. A cube set spinning about (1, 1, 1) moves in the same way by itself.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.geometry.rotations import matrix_from_axis_angle

PROBLEM = 47
TOPIC = "rigid bodies in space"


def solve(page: Page) -> None:
    """Turn a box by 120 degrees, and let a cube do the same without help."""
    third = 2 * np.pi / 3
    R = matrix_from_axis_angle(jnp.ones(3), third)
    exchange = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    page.equal("120 degrees exchange the axes", R, exchange, within=1e-14)

    turning = simulate(scenes.turned_box(sides=(3.0, 2.0, 1.0)), third, samples=200)
    box = turning.r[:, :8]
    page.number("sides along x, y, z after the turn", jnp.ptp(box[-1], axis=0), "m")
    page.equal("So they are 1, 3 and 2", jnp.ptp(box[-1], axis=0), [1.0, 3.0, 2.0], within=1e-12)
    page.equal("Its corners are exchanged", box[-1], box[0] @ exchange.T, within=1e-12)

    cube = (1.0, 1.0, 1.0)
    given = simulate(scenes.turned_box(sides=cube), third, samples=200).r[:, :8]
    free = simulate(scenes.box(jnp.ones(3) / np.sqrt(3), sides=cube), third, samples=200)
    same = "A cube that spins freely about its diagonal does the same"
    page.equal(same, free.r[:, :8], given, within=1e-12, route="Euler's equations")

    page.draw(
        lambda: drawing.trajectory(turning), "The box at the start, its axis, and a corner's path."
    )
    again = simulate(scenes.turned_box(sides=(3.0, 2.0, 1.0)), 3 * third, samples=200)
    page.play(again, "Each third of the round puts the box onto other axes.")


if __name__ == "__main__":
    show(solve)
