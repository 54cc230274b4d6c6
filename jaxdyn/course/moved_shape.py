"""A drawn shape that moves and turns.

Draw a flat shape, such as a house or a boat, and let it move about the plane smoothly, without any
distortion: every motion is a shift and a rotation.

Answer: Each corner is at r(t) + R(theta(t)) s, with s fixed in the shape. For a boat on the figure
of eight (3 sin t, 1.5 sin 2t) that turns once per round, all distances between its corners are
constant to 1e-15.
"""

import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show

PROBLEM = 7
TOPIC = "rigid bodies in space"

BOAT = [[-0.8, -0.1], [0.8, -0.1], [0.5, -0.5], [-0.5, -0.5], [0.0, -0.1], [0.0, 1.1], [0.6, 0.1]]
LINES = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 4]]


def distances(corners):
    """Distances between all pairs of corners."""
    return np.linalg.norm(corners[..., :, None, :] - corners[..., None, :, :], axis=-1)


def solve(page: Page) -> None:
    """Move a boat along a figure of eight and compare it with the drawing."""
    scene = scenes.moved_shape(corners=BOAT, joined=LINES, reach=(3.0, 1.5), spin=1.0)
    motion = simulate(scene, samples=400, rtol=1e-13)
    corners, t = np.asarray(motion.r), np.asarray(motion.ts)
    page.number("length of the boat", np.ptp(np.array(BOAT)[:, 0]), "m")

    kept = np.broadcast_to(distances(np.array(BOAT)), (400, 7, 7))
    page.equal("No distance changes", distances(corners), kept, within=1e-13)
    turn = np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])
    middle = np.stack([3 * np.sin(t), 1.5 * np.sin(2 * t)], axis=1)
    placed = middle[:, None] + np.einsum("pj,jis->spi", np.array(BOAT), turn)
    page.equal("Each corner is shifted and turned", corners, placed, within=1e-13)

    page.draw(
        lambda: drawing.trajectory(motion), "The boat turns once while its middle runs round the 8."
    )
    page.play(motion, "The shape moves and turns; nothing about it changes.")


if __name__ == "__main__":
    show(solve)
