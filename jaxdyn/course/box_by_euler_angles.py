"""A box animated by Euler angles.

Turn a drawn box by three Euler angles that are any functions of time. Begin with one angle at a
time, to see roll, pitch and yaw alone.

Answer: Roll, pitch and yaw are turns about x, y and z alone; together the box has the matrix
R_z R_y R_x, and its corners are that matrix times the corners of the drawing.

The angles swing as 0.6 sin(t), 0.9 sin(2 t) and 1.2 sin(3 t) rad. In roll alone every x stays the
same, in pitch every y, in yaw every z.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.geometry.euler import matrix_from_euler
from jaxdyn.geometry.rotations import matrix_from_axis_angle

PROBLEM = 49
TOPIC = "rigid bodies in space"


def solve(page: Page) -> None:
    """Roll, pitch and yaw alone, then all together; compare with products of matrices."""
    swings = {
        "roll": (1.0, 0.0, 0.0),
        "pitch": (0.0, 1.0, 0.0),
        "yaw": (0.0, 0.0, 1.0),
        "all": (0.6, 0.9, 1.2),
    }
    motions = {
        name: simulate(scenes.moved_box(swings=size, frequencies=(1.0, 2.0, 3.0)), samples=400)
        for name, size in swings.items()
    }
    for i, name in enumerate(("roll", "pitch", "yaw")):
        change = jnp.ptp(motions[name].r[..., i])
        side = (3.0, 2.0, 1.0)[i]
        page.equal(f"In {name} every {'xyz'[i]} stays", change, side, within=1e-13)

    whole = motions["all"]
    t, names = np.asarray(whole.ts), [name for name, _ in whole.scene.labels()]
    angles = jnp.stack([whole[name] for name in names[:3]], axis=1)
    given = np.array(swings["all"]) * np.sin(np.array([1.0, 2.0, 3.0]) * t[:, None])
    page.number("largest roll, pitch and yaw when all swing", swings["all"], "rad")
    page.equal("The angles are those given", angles, given, within=1e-11)

    about = jax.jit(jax.vmap(matrix_from_axis_angle, (None, 0)))
    Rx, Ry, Rz = (about(axis, angle) for axis, angle in zip(np.eye(3), given.T, strict=True))
    R = Rz @ Ry @ Rx
    by_angles = jax.jit(jax.vmap(lambda a: matrix_from_euler(a, "xyz")))(given)
    page.equal("Three turns in a row are the matrix", by_angles, R, within=1e-14)
    placed = whole.r[0] @ jnp.swapaxes(R, 1, 2)
    page.equal("It places every corner", whole.r, placed, within=1e-11)

    page.draw(
        lambda: drawing.trajectory(whole), "The path of a corner when all three angles swing."
    )
    page.play(motions, "One angle at a time, then all of them.", choose="angles")


if __name__ == "__main__":
    show(solve)
