"""Static and dynamic balance.

A rigid body turns at a constant rate about a fixed axis with two bearings. When do the bearings
supply no net force (static balance), and when no moment either (dynamic balance), and how would one
test it? In how many positions can an unsymmetric body turn in dynamic balance? Show that a plus
sign of four masses is balanced about a line in its plane at any angle. Can one bearing of an
unbalanced shaft be free of load?

Answer: Statically, if the mass centre is on the axis (let go at any angle it stays); dynamically,
if the axis is a principal axis too, which it is in six positions, three axes in two directions. The
plus sign has equal moments about all lines in its plane. Yes, one bearing can carry everything:
masses 1 kg at (1, 2) and (2, -1) leave the bearing at x = 3 free.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn.course.page import Page, show
from jaxdyn.drawing.figures import blank, style
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
    page.equal("Its inertia has no products with x", plus.inertia[0, 1:], [0, 0], within=1e-14)
    page.true("The plus sign is dynamically balanced", loads.dynamically, route="inertia")
    pulls = -(spin**2) * arms * np.array([0.0, 1.0, 1.0])  # m a of each mass
    page.equal("The four forces cancel", pulls.sum(axis=0), np.zeros(3), within=1e-12)
    moment = np.cross(arms, pulls).sum(axis=0)
    page.equal("So do their moments", moment, np.zeros(3), within=1e-12, route="mass by mass")

    body = inertia.box(2.0, [1.0, 2.0, 3.0]) + inertia.point(0.5, [0.3, 0.7, 1.1])
    axes = inertia.principal(body).axes
    balanced = [
        bearing_forces(body, body.centre - way * n, body.centre + way * n, spin).dynamically
        for n in (*axes.T, axes @ jnp.array([0.8, 0.6, 0.0]), axes @ jnp.array([0.0, 0.6, 0.8]))
        for way in (1.0, -1.0)
    ]
    page.number("balanced positions of an unsymmetric body", sum(map(int, balanced)))
    only = balanced == [True] * 6 + [False] * 4
    page.true("They are its principal axes, either way round", only, route="bearing forces")

    shaft = inertia.point(1.0, [1.0, 2.0, 0.0]) + inertia.point(1.0, [2.0, -1.0, 0.0])
    loads = bearing_forces(shaft, jnp.zeros(3), jnp.array([3.0, 0.0, 0.0]), spin)
    page.number("forces on the shaft at x = 0", loads.at_a, "N")
    page.equal("The bearing at x = 0 carries all", loads.at_a, [0, -100.0, 0], within=1e-11)
    page.equal("The bearing at x = 3 carries nothing", loads.at_b, np.zeros(3), within=1e-11)

    figure = blank(6.4, 4.0)
    ax = figure.add_subplot(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    style(ax)
    ax.plot([0, 3], [0, 0], "k-", [1, 1], [0, 2], "k-", [2, 2], [0, -1], "k-")
    ax.plot([1, 2], [2, -1], "o", ms=14, label="1 kg each")
    ax.plot([0, 3], [0, 0], "^", ms=12, label="bearings")
    ax.legend(loc="upper right", frameon=False)
    page.draw(figure, "The moments of both masses about the left bearing cancel: 1 x 2 = 2 x 1.")


if __name__ == "__main__":
    show(solve)
