"""A mass on a spring, and ways to check its motion.

A mass moves in the plane on a spring of stiffness k and rest length L that is pinned at the origin,
under gravity g. Write the equation of motion, solve it from any start, and draw the path. Then
collect ways to know that the solution is right: cases whose motion is known in closed form,
quantities that stay constant, and another formulation of the same problem.

Answer: m r'' = -k (|r| - L) r / |r| - m g j. The solution conserves the energy, agrees with
Lagrange's equations in polar coordinates, and is right in all special cases: without the spring a
parabola; from rest below the pin a vertical line; without gravity a harmonic oscillation along a
radius from rest, and a circle where v^2 = k r (r - L) / m; with L = 0 an ellipse.

(a) The spring pulls with k (|r| - L) towards the pin (L is l0 in the equations as the scene has
them), so

    m x'' = -k (1 - L / |r|) x,   m y'' = -k (1 - L / |r|) y - m g,   |r| = sqrt(x^2 + y^2).

(b) The path and the motion below start at (1, 0) m with (0, 1) m/s, for m = 1 kg, k = 10 N/m, L =
0.5 m and g = 9.81 m/s^2.

(c) i. k = 0: parabolic flight. ii. x0 = vx0 = 0: it stays on the y axis. iii. g = 0 from rest: it
swings on a radius, r = L + (r0 - L) cos(sqrt(k / m) t), if it does not reach the pin.

iv. L = 0, all else arbitrary: the path is an ellipse about the point m g / k below the pin,
traversed once in 2 pi sqrt(m / k). Why? The force -k r - m g j is linear, so both components of the
distance from that point obey m u'' = -k u, with one frequency.

v. g = 0 and v^2 = k r (r - L) / m across the radius: a circle, as the spring supplies m v^2 / r.
vi. The energy m v^2 / 2 + k (|r| - L)^2 / 2 + m g y is constant. vii. Lagrange's equations in polar
coordinates, integrated by themselves, give the same path.
"""

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, lagrangian, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show
from jaxdyn.scenes import springs

PROBLEM = 6
TOPIC = "one particle"


def polar(t, q, v, p):
    """Kinetic minus potential energy, with the angle from the x axis."""
    r, theta = q
    kinetic = 0.5 * p["m"] * (v[0] ** 2 + (r * v[1]) ** 2)
    potential = 0.5 * p["k"] * (r - p["L"]) ** 2 + p["m"] * p["g"] * r * jnp.sin(theta)
    return kinetic - potential


def solve(page: Page) -> None:
    """Solve the general case and the special ones, and compare with what is known of them."""
    m, k, L, g, end = 1.0, 10.0, 0.5, 9.81, 6.0

    def move(position, velocity, k=k, L=L, g=g):
        scene = scenes.spring_mass(position=position, velocity=velocity, m=m, k=k, length=L, g=g)
        return simulate(scene, end, samples=400, rtol=1e-13)

    motion = move((1.0, 0.0), (0.0, 1.0))
    page.equal(
        "The energy is conserved", energy.drift(motion), 0.0, within=1e-13, route="conservation"
    )
    lagrange = lagrangian(polar, [1, 0], [0, 1], params={"m": m, "k": k, "L": L, "g": g})
    r, theta = np.asarray(simulate(lagrange, end, samples=400, rtol=1e-13).ys[:, :2]).T
    path = np.stack([r * np.cos(theta), r * np.sin(theta)], axis=1)
    page.equal("Polar coordinates agree", motion.ys[:, :2], path, within=1e-12, route="Lagrange")

    t = np.asarray(motion.ts)
    free = move((1.0, 0.0), (2.0, 3.0), k=0.0)
    thrown = np.stack([1 + 2 * t, 3 * t - 0.5 * g * t**2], axis=1)
    page.equal("Without the spring it flies on a parabola", free.ys[:, :2], thrown, within=1e-11)
    hanging = move((0.0, -1.0), (0.0, 0.5))
    page.equal("Started below the pin it stays below", hanging["x"], 0 * t, within=0.0)
    radial = move((0.48, 0.64), (0.0, 0.0), g=0.0)
    swing = np.outer(L + (0.8 - L) * np.cos(np.sqrt(k / m) * t), [0.6, 0.8])
    page.equal("Without gravity it swings on a radius", radial.ys[:, :2], swing, within=1e-12)
    w = np.sqrt(k * (1 - L) / m)
    circle = move((1.0, 0.0), (0.0, w), g=0.0)
    round_ = np.stack([np.cos(w * t), np.sin(w * t)], axis=1)
    page.equal("and circles at the right speed", circle.ys[:, :2], round_, within=1e-11)
    ellipse = move((1.0, 0.0), (0.0, 1.0), L=0.0)
    exact = springs.hanging_spring_exact(ellipse.scene, t)
    page.equal("Without rest length the path is an ellipse", ellipse.ys, exact, within=1e-12)

    motions = {"rest length 0.5 m": motion, "rest length 0": ellipse}
    page.draw(
        lambda: drawing.trajectory(list(motions.values()), names=list(motions), title=""),
        "A rest length turns the ellipse into a tangle.",
    )
    page.play(motions, "Both start alike; the spring with a rest length soon goes its own way.")


def ask(page: Page) -> None:
    """Starts and numbers with a motion that is known."""
    start = {"position": (1.0, 0.0), "m": 1.0, "k": 10.0, "length": 0.5}
    page.ask(
        "What happens without gravity, when it is thrown across the spring at 2.236 m/s?",
        "It goes round a circle: at sqrt(k r (r - L) / m) the spring pulls with m v^2 / r.",
        scenes.spring_mass(**start, velocity=(0.0, np.sqrt(5.0)), g=0.0),
    )
    page.ask(
        "What happens when it is released from rest, straight below the pin?",
        "It bounces up and down on the vertical line, "
        f"with the period 2 pi sqrt(m / k) = {2 * np.pi / np.sqrt(10.0):.4g} s.",
        scenes.spring_mass(**start | {"position": (0.0, -1.2)}, velocity=(0.0, 0.0)),
    )
    page.ask(
        "What happens when the spring is ten times stiffer?",
        "It vibrates faster along the spring and swings like a pendulum across it: a very stiff "
        "spring acts like a rod.",
        scenes.spring_mass(**start | {"k": 100.0}, velocity=(0.0, 1.0)),
    )


if __name__ == "__main__":
    show(solve)
