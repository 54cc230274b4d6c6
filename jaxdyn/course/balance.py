"""Static and dynamic balance.

A rigid body turns at a constant rate about a fixed axis with two bearings. When do all forces on
it, those of the bearings and of gravity, add up to zero (static balance), and when have they no
moment either (dynamic balance), and how would one test it? In how many positions can an unsymmetric
body turn in dynamic balance? Show that a plus sign of four masses is balanced about a line in its
plane at any angle. Can one bearing of an unbalanced shaft be free of load?

Answer: Statically, if the mass centre is on the axis (released at any angle, the body stays at
rest); dynamically, if the axis is also a principal axis, which holds in six positions, three axes
in two directions. The plus sign has equal moments about all lines in its plane. Yes, one bearing
can carry the whole load: masses of 1 kg at (1, 2) and (2, -1) leave the bearing at x = 3 free.

(a) The net force is m a_G, and G moves on a circle about the axis at the rate omega: a_G = -omega^2
times its distance. So static balance means that the mass centre is on the axis, whatever the shape.

(b) Lay the shaft level, let it turn freely, with the motor off, and let go at several angles. If G
is off the axis its weight turns the shaft until G is below; if it is on it, the shaft stays at
every angle.

(c) With G on the axis, and the axis along x, the net moment about C is the rate of the angular
momentum omega (I_xx, I_xy, I_xz), which turns with the body: omega^2 (0, -I_xz, I_xy). It is zero
where both products of inertia are: where the axis is a principal axis through G.

(d) A body without symmetry has three principal axes through G, at right angles. Each can be the
axis of rotation, in either direction: six positions, each with any angle about the axis.

(e) I. Four unit masses at 1 m, 90 degrees apart, have the products x y = sin(2 a) / 2 at the angle
a, which change their sign from one to the next: I_xy = 0 at any angle of the plus sign, and I_xz =
0 since z = 0. II. The masses need the forces -omega^2 y j; those at 30 and 210 degrees are
opposite, as are those at 120 and 300 degrees, and the moment about C of one pair cancels that of
the other: x y is 0.433 m^2 for the masses of the first and -0.433 m^2 for those of the second.

(f) Yes. Without weight, the forces on the shaft at x = 0 and 3 m, which turn with it, have to be
-omega^2 sum(m y) in all, with the moment -omega^2 sum(m x y) about x = 0. With 1 kg at (1, 2) m and
at (2, -1) m the second sum is zero, so all the force is at x = 0: 100 N at 10 rad/s.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import inertia
from jaxdyn.geometry.balance import bearing_forces

PROBLEM = 54
TOPIC = "rigid bodies in space"


def solve(page: Page) -> None:
    """Spin a plus sign, an unsymmetric body, and a shaft with two masses; find the loads."""
    spin, ends = 10.0, (jnp.array([-1.5, 0.0, 0.0]), jnp.array([1.5, 0.0, 0.0]))
    angles = np.radians([30, 120, 210, 300])
    arms = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    plus = sum((inertia.point(1.0, r) for r in arms[1:]), inertia.point(1.0, arms[0]))
    loads = bearing_forces(plus, *ends, spin)
    products = plus.inertia[0, 1:]
    page.equal("e: The plus sign has no products of inertia", products, [0, 0], within=1e-14)
    page.true("e: The plus sign is dynamically balanced", loads.dynamically, route="inertia")
    pulls = -(spin**2) * arms * np.array([0.0, 1.0, 1.0])  # m a of each mass
    page.equal("e: The four forces cancel", pulls.sum(axis=0), np.zeros(3), within=1e-12)
    moment = np.cross(arms, pulls).sum(axis=0)
    page.number("e: x y of its masses", arms[:, 0] * arms[:, 1], "m^2")
    page.equal("e: So do their moments", moment, np.zeros(3), within=1e-12, route="mass by mass")

    body = inertia.box(2.0, [1.0, 2.0, 3.0]) + inertia.point(0.5, [0.3, 0.7, 1.1])
    axes = inertia.principal(body).axes
    balanced = [
        bearing_forces(body, body.centre - way * n, body.centre + way * n, spin).dynamically
        for n in (*axes.T, axes @ jnp.array([0.8, 0.6, 0.0]), axes @ jnp.array([0.0, 0.6, 0.8]))
        for way in (1.0, -1.0)
    ]
    page.number("d: positions of an unsymmetric body in balance", sum(map(int, balanced)))
    only = balanced == [True] * 6 + [False] * 4
    page.true(
        "d: Only its principal axes among those tried, in both directions",
        only,
        route="bearing forces",
    )

    shaft = inertia.point(1.0, [1.0, 2.0, 0.0]) + inertia.point(1.0, [2.0, -1.0, 0.0])
    loads = bearing_forces(shaft, jnp.zeros(3), jnp.array([3.0, 0.0, 0.0]), spin)
    page.number("f: force on the shaft at x = 0, along x, y and z", loads.at_a, "N")
    page.equal("f: The bearing at x = 0 carries all", loads.at_a, [0, -100.0, 0], within=1e-11)
    page.equal("f: The bearing at x = 3 carries nothing", loads.at_b, np.zeros(3), within=1e-11)

    page.draw(picture, "The moments of both masses about the left bearing cancel: 1 x 2 = 2 x 1.")


def picture():
    """The shaft with its two masses and two bearings."""
    figure = drawing.figures.blank(6.4, 4.0)
    ax = figure.add_subplot(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    drawing.figures.style(ax)
    ax.plot([0, 3], [0, 0], "k-", [1, 1], [0, 2], "k-", [2, 2], [0, -1], "k-")
    ax.plot([1, 2], [2, -1], "o", ms=14, label="1 kg each")
    ax.plot([0, 3], [0, 0], "^", ms=12, label="bearings")
    ax.legend(loc="upper right", frameon=False)
    return figure


if __name__ == "__main__":
    show(solve)
