"""Euler angles about fixed axes and about the body's own.

A body is turned about the fixed x axis, then about the fixed y axis, then about the fixed z axis.
Find the matrix of the whole. Why is it also the matrix of turns about z, then about the new y axis
and then about the newest x axis, by the same angles?

Answer: R = R_z R_y R_x, with the rows (cy cz, sx sy cz - cx sz, cx sy cz + sx sz),
(cy sz, sx sy sz + cx cz, cx sy sz - sx cz) and (-sy, sx cy, cx cy), where cx is cos(theta_x), and
so on. Rotations about fixed axes multiply from the left, those about the body's own axes from the
right, so both sequences give the same product.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import euler, rotations

PROBLEM = 48
TOPIC = "vectors and rotations"
ANGLES = np.array([0.6, -0.9, 1.3])


class Turns(eqx.Module):
    """Angles about x, y and z, each turned from rest to rest in the second after its beginning."""

    begin: np.ndarray

    def __call__(self, t):
        """(3,) angles at time t."""
        part = jnp.clip(t - self.begin, 0, 1)
        return jnp.asarray(ANGLES) * (part - jnp.sin(2 * jnp.pi * part) / (2 * jnp.pi))


FIRST_X_THEN_Y_THEN_Z = np.array([0.0, 1.0, 2.0])
FIRST_Z_THEN_Y_THEN_X = FIRST_X_THEN_Y_THEN_Z[::-1]


def solve(page: Page) -> None:
    """Multiply the three matrices, and compare with the formula and with both sequences."""
    x, y, z = np.eye(3)
    Rx, Ry, Rz = (
        np.asarray(rotations.matrix_from_axis_angle(n, a))
        for n, a in zip((x, y, z), ANGLES, strict=True)
    )
    R = Rz @ Ry @ Rx
    (sx, sy, sz), (cx, cy, cz) = np.sin(ANGLES), np.cos(ANGLES)
    formula = [
        [cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz],
        [cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz],
        [-sy, sx * cy, cx * cy],
    ]
    page.equal("The product has this formula", R, formula, within=1e-14, route="algebra")
    fixed = euler.matrix_from_euler(ANGLES, "xyz")
    page.equal("Turns about fixed x, y, z", fixed, R, within=1e-14, route="product")
    body = euler.matrix_from_euler(ANGLES[::-1], "ZYX")
    page.equal("Turns about the body's z, y, x", body, R, within=1e-14, route="product")
    new_y, newest_x = Rz @ y, Rz @ Ry @ x
    turned = Rz
    for axis, angle in ((new_y, ANGLES[1]), (newest_x, ANGLES[0])):
        turned = np.asarray(rotations.matrix_from_axis_angle(axis, angle)) @ turned
    page.equal("Turns about z, new y and newest x", turned, R, within=1e-14, route="axes as drawn")
    back = euler.euler_from_matrix(R, "xyz")
    page.equal("The angles come back", back.angles, ANGLES, within=1e-14, route="there and back")

    orders = {"fixed": (np.eye(3), Rx, Ry @ Rx, R), "body's": (np.eye(3), Rz, Rz @ Ry, R)}
    look = "The axes x, y, z (blue, orange, green), turned about fixed axes and (below) its own."
    page.draw(lambda: picture(orders), look)
    begins = {
        "about fixed x, y, z": FIRST_X_THEN_Y_THEN_Z,
        "about its own z, y, x": FIRST_Z_THEN_Y_THEN_X,
    }
    boxes = {
        name: simulate(scenes.moved_box(angles=Turns(begin), t1=3.0))
        for name, begin in begins.items()
    }
    page.play(boxes, "The boxes separate at once, and coincide again at the end.")


def picture(orders):
    """The axes at the start and after each turn, for both orders."""
    figure = drawing.figures.blank(9.0, 5.0)
    for i, (kind, poses) in enumerate(orders.items()):
        for j, (pose, axis) in enumerate(zip(poses, (" ", *("xyz", "zyx")[i]), strict=True)):
            ax = figure.add_subplot(
                2, 4, 4 * i + j + 1, projection="3d", title=f"{kind} {axis}" if j else "start"
            )
            ax.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(-1, 1), xticks=[], yticks=[], zticks=[])
            drawing.figures.style(ax)
            for arrow, colour in zip(pose.T, drawing.figures.PALETTE, strict=False):
                ax.plot(*np.stack([0 * arrow, arrow]).T, color=colour, lw=3)
    return figure


if __name__ == "__main__":
    show(solve)
