"""A rigid body by matrix, quaternion and Euler angles.

Solve Euler's equations in the body's axes together with the attitude as a rotation matrix, R' =
S(omega) R: for an object of your choice, for a spin near the middle axis, and for a wobbling plate.
Then use Euler angles instead, and show that both agree. As printed, the dots over omega and over R
are missing.

Answer: Matrix, quaternion and Euler angles give the same attitude in all three motions, to 1e-9
after 40 s. The columns of R are the body's axes e_i', and e_i' changes at omega x e_i'.

(a) In the axes of the body, which are principal axes, with the moment (M1, M2, M3) about G:

    M1 = I1 omega1' + (I3 - I2) omega2 omega3
    M2 = I2 omega2' + (I1 - I3) omega3 omega1
    M3 = I3 omega3' + (I2 - I1) omega1 omega2

(b) Solved for the rates, with no moment, these are three of the equations that are integrated.

(c) The others are R' = S(omega) R, where S(omega) is the matrix with S(omega) r = omega x r and
omega in fixed axes is R times (omega1, omega2, omega3). Each column of it says e_i' ' = omega x
e_i'.

(d) The three motions, each of 40 s, are a box of 3 m x 2 m x 1 m that tumbles, from omega = (0.3,
1, 0.5) rad/s in its axes; the same box spun near its middle axis, which flips over, from (0.01, 1,
0.01) rad/s; and a plate of 1 m x 1 m normal to its axis y' that wobbles, from (0, 2, 0.2) rad/s
(problem 56 is about it). Each has a mass of 1 kg.

(e) With turns alpha about y, then beta about the new x, then gamma about the newest z, R =
R_y(alpha) R_x(beta) R_z(gamma), the angular velocity in the body's axes is

    omega1 = beta' cos(gamma) + alpha' cos(beta) sin(gamma)
    omega2 = -beta' sin(gamma) + alpha' cos(beta) cos(gamma)
    omega3 = gamma' - alpha' sin(beta)

and, solved for the rates of the angles,

    alpha' = (omega1 sin(gamma) + omega2 cos(gamma)) / cos(beta)
    beta' = omega1 cos(gamma) - omega2 sin(gamma)
    gamma' = omega3 + alpha' sin(beta)

which, with Euler's equations for omega1, omega2 and omega3, are the equations of motion. They are
singular at beta = 90 degrees (gimbal lock); these three motions stay away from it.
"""

import jax
import numpy as np

from jaxdyn import drawing, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show
from jaxdyn.formulations import rigid
from jaxdyn.geometry import euler

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
            page.equal(same, poses["matrix"].R_wb, other, within=1e-9, route="second formulation")
        shown[name] = motions["matrix"]

    scene, end = motions["matrix"].scene, motions["matrix"].ys[-1]
    R, omega_b = np.asarray(end[3:12]).reshape(3, 3), np.asarray(end[15:])
    rate = np.asarray(scene.rate(0.0, end)[3:12]).reshape(3, 3)
    turned = np.cross(R @ omega_b, R.T).T
    page.equal("e_i' changes at omega x e_i'", rate, turned, within=1e-12)
    off = R.T @ R - np.eye(3)
    page.equal("R stays a rotation", off, np.zeros((3, 3)), within=1e-12, route="R^T R = 1")
    plate = scenes.free_body((0.0, 2.0, 0.2), moments=np.array([1.0, 2.0, 1.0]) / 12)
    spins = plate.rate(0.0, plate.y0)[-3:]
    own = scene.rate(0.0, scene.y0)[-3:]
    page.equal("Only the moments count", spins, own, within=1e-12, route="six points")

    _, beta, gamma = angles = np.array([0.4, -0.7, 1.1])
    formulas = [
        [np.cos(beta) * np.sin(gamma), np.cos(gamma), 0.0],
        [np.cos(beta) * np.cos(gamma), -np.sin(gamma), 0.0],
        [-np.sin(beta), 0.0, 1.0],
    ]
    by_angles = jax.jit(euler.omega_b_from_euler, static_argnums=1)(angles, "YXZ")
    page.equal("e: omega by the rates of the angles", by_angles, formulas, within=1e-14)

    names, boxes = list(shown), list(shown.values())
    page.draw(lambda: drawing.trajectory(boxes, names=names), "Path of a corner of each.")
    page.play(shown, "A box, a box that flips, and a plate that wobbles.", choose="object")


if __name__ == "__main__":
    show(solve)
