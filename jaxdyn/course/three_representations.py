"""A rigid body by matrix, quaternion and Euler angles.

Solve Euler's equations in the body's axes together with the attitude as a rotation matrix, R' =
S(omega) R: for an object of your choice, for a spin near the middle axis, and for a wobbling plate.
Then use Euler angles instead, and show that both agree. As printed, the dots over omega and over R
are missing.

Answer: Matrix, quaternion and Euler angles give the same attitude to 1e-10 for all three objects.
The columns of R are the body's axes e_i', and e_i' changes at omega x e_i'.
"""

import jax.numpy as jnp

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show
from jaxdyn.formulations import rigid

PROBLEM = 53
TOPIC = "rigid bodies in space"

KINDS = ("matrix", "quaternion", "euler")


def solve(page: Page) -> None:
    """Three objects, each with three representations of its attitude."""
    objects = {
        "a tumbling box": ((0.3, 1.0, 0.5), (3.0, 2.0, 1.0)),
        "a box about its middle axis": ((0.01, 1.0, 0.01), (3.0, 2.0, 1.0)),
        "a wobbling plate": ((0.0, 2.0, 0.2), (1.0, 0.0, 1.0)),
    }
    shown = {}
    for name, (omega, sides) in objects.items():
        motions = {}
        for kind in KINDS:
            scene = scenes.box(omega, sides=sides, representation=kind)
            motions[kind] = simulate(scene, 40.0, samples=400, rtol=1e-12)
        poses = {kind: energy.along(rigid.pose, motion) for kind, motion in motions.items()}
        for kind in KINDS[1:]:
            same = f"Matrix and {kind} agree on {name}"
            other = poses[kind].R_wb
            page.equal(same, poses["matrix"].R_wb, other, within=1e-8, route="second formulation")
        shown[name] = motions["matrix"]

    R, omega = poses["matrix"].R_wb[-1], poses["matrix"].omega_w[-1]
    scene = motions["matrix"].scene
    rate = scene.rate(0.0, motions["matrix"].ys[-1])[3:12].reshape(3, 3)
    page.equal("e_i' changes at omega x e_i'", rate, jnp.cross(omega, R.T).T, within=1e-12)
    off = R.T @ R - jnp.eye(3)
    page.equal("R stays a rotation", off, jnp.zeros((3, 3)), within=1e-12, route="R^T R = 1")
    plate = scenes.free_body((0.0, 2.0, 0.2), moments=jnp.array([1.0, 2.0, 1.0]) / 12)
    spins = plate.rate(0.0, plate.y0)[-3:]
    own = scene.rate(0.0, scene.y0)[-3:]
    page.equal("Only the moments count", spins, own, within=1e-12, route="six points")

    figure = drawing.trajectory(list(shown.values()), names=list(shown))
    page.draw(figure, "Path of a corner of each.")
    page.play(shown, "A box, a box that flips, and a plate that wobbles.", choose="object")


if __name__ == "__main__":
    show(solve)
