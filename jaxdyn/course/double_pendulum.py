"""Double pendulum.

Two equal uniform bars (m = l = g = 1) hang from a hinge, one from the other. They are released with
the upper arm level, to the right, and the forearm straight up. Find the equations of motion by
angular momentum balance, by Lagrange, and by constraints between two free bodies; show that they
are the same, and draw the path of the end of the forearm up to t = 30.

Answer: The balance about the hinge, and that of the forearm about the elbow, are two linear
equations for the angular accelerations. All derivations give the same motion, which ends at
(1.2362, 0.0122), but chaos costs each of them digits: until t = 30 a small initial error of theta1
grows, in theta2, 57238-fold.

(a) theta1 and theta2 are the angles of the bars from hanging down, D = theta1 - theta2, and each
bar has the inertia 1/12 about its centre. Angular momentum balance of both bars about the hinge,
and of the forearm about the elbow, which moves:

    (4/3) theta1'' + (1/2) (theta1'' + theta2'') cos D + (1/3) theta2''
        + (1/2) (theta2'^2 - theta1'^2) sin D = -(3/2) sin theta1 - (1/2) sin theta2

    (1/3) theta2'' + (1/2) theta1'' cos D - (1/2) theta1'^2 sin D = -(1/2) sin theta2

The first minus the second is (4/3) theta1'' + (1/2) theta2'' cos D + (1/2) theta2'^2 sin D =
-(3/2) sin theta1; `balance` in the code solves it, with the second, for theta1'' and theta2''.

(b) Each bar alone has three equations, with the force P of the hinge and the force Q from the
forearm on the upper arm at the elbow; e_i = (sin theta_i, -cos theta_i) points along bar i:

    r1'' = P + Q - j         (1/12) theta1'' = (e1 / 2) x (Q - P)
    r2'' = -Q - j            (1/12) theta2'' = (e2 / 2) x Q

and the hinges are four conditions, r1 - e1 / 2 = 0 and r2 - e2 / 2 = r1 + e1 / 2, which are
differentiated twice: ten linear equations for six accelerations and four components of forces.
Their accelerations are those of (a). The motion by constraints has the angles of (a) to 1e-11 rad
at t = 10 and to 1e-8 rad at t = 30, which `--check` confirms: chaos takes the other digits.

(c) The Lagrangian is the kinetic minus the potential energy,

    L = (2/3) theta1'^2 + (1/6) theta2'^2 + (1/2) theta1' theta2' cos D
        + (3/2) cos theta1 + (1/2) cos theta2.

Its equations are the two that `balance` solves, and the motion is the same.

(d) `jaxdyn course 31 --play` animates it.

(e) i. Other ways lead from the same laws to the same accelerations. The two balances are linear in
theta1'' and theta2'': their residuals at zero accelerations are h, the change of the residuals from
there to a unit acceleration is a column of M, and M (theta1'', theta2'') = -h. So no terms have to
be collected by hand; a Jacobian, or EquationsToMatrix of a symbolic program, gives the same M. Such
a program can also print the solution: `jaxdyn equations double_pendulum --code python` writes a
function to copy. From the solution of the ten equations of (b), a state of four numbers needs only
theta1'' and theta2''. Alternatively, all twelve numbers of the two free bodies are integrated; then
errors separate the hinges unless something keeps them together, as the projection after each step
does here.

ii. The checks below compare the results with one another, and the energy with its initial value.

iii. Known without integrating: the energy, here 1/2, is constant; small oscillations have the
squared frequencies 3 - 6 / sqrt(7) and 3 + 6 / sqrt(7), that is 0.732 and 5.268; without gravity
the angular momentum about the hinge is constant; hanging, standing and folded bars are in
equilibrium.
"""

import math

import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, effects, linearize, ode, scenes, simulate
from jaxdyn.analysis import energy
from jaxdyn.analysis.monodromy import monodromy
from jaxdyn.course.page import Page, show

PROBLEM = 31
TOPIC = "pendulums and linkages"


def balance(t, y):
    """The rate of theta1, theta2 and their rates by angular momentum balance."""
    q, v = y[:2], y[2:]
    sin, cos = jnp.sin(q[0] - q[1]), jnp.cos(q[0] - q[1])
    inertia = jnp.array([[4 / 3, cos / 2], [cos / 2, 1 / 3]])
    moment = jnp.array([-sin * v[1] ** 2 - 3 * jnp.sin(q[0]), sin * v[0] ** 2 - jnp.sin(q[1])]) / 2
    return jnp.concatenate([v, jnp.linalg.solve(inertia, moment)])


def by_columns(q, v):
    """theta1'' and theta2'' from the values of the two balances at zero and unit accelerations."""
    (sin1, sin2), sin, cos = np.sin(q), np.sin(q[0] - q[1]), np.cos(q[0] - q[1])

    def lacks(a):
        elbow = a[1] / 3 + (a[0] * cos - v[0] ** 2 * sin + sin2) / 2
        hinge = 4 / 3 * a[0] + a[1] / 3 + ((a[0] + a[1]) * cos + (v[1] ** 2 - v[0] ** 2) * sin) / 2
        return np.array([hinge + (3 * sin1 + sin2) / 2, elbow])

    h = lacks(np.zeros(2))
    return np.linalg.solve(np.stack([lacks(unit) - h for unit in np.eye(2)], axis=1), -h)


def by_free_bodies(q, v):
    """theta1'' and theta2'' from the ten equations of two free bars and two hinges."""
    along, across = np.array([np.sin(q), -np.cos(q)]), np.array([np.cos(q), np.sin(q)])
    i, o, weight = np.eye(2), np.zeros((2, 2)), np.array([0.0, -1.0])
    left, right = np.zeros((10, 10)), np.zeros(10)  # r1'', r2'', theta1'', theta2'', P, Q
    left[:4] = np.block([[i, o, o, -i, -i], [o, i, o, o, i]])
    right[:4] = *weight, *weight
    # (e / 2) x F is (-e_y, e_x) . F / 2, and (-e_y, e_x) is the unit vector across the bar.
    left[4, [4, 6, 7, 8, 9]] = 1 / 12, *across[:, 0] / 2, *-across[:, 0] / 2
    left[5, [5, 8, 9]] = 1 / 12, *-across[:, 1] / 2
    left[6:8, :2], left[6:8, 4] = i, -across[:, 0] / 2
    left[8:, :6] = np.block([-i, i, -across / 2])
    right[6:8] = -along[:, 0] * v[0] ** 2 / 2
    right[8:] = -(along @ v**2) / 2
    return np.linalg.solve(left, right)[4:6]


PRECISELY = {"samples": 3001, "rtol": 1e-13}


def compare(page, route, one, other):
    """Check that two routes give the same angles (s, 2), early and late."""
    for t, within in ((10, 1e-11), (30, 1e-8)):
        statement = f"Balance and {route} give the same angles at t = {t}"
        page.equal(statement, one[100 * t], other[100 * t], within=within, route=route)


def solve(page: Page) -> None:
    """Solve by balance and by Lagrange, compare, and start again with a tiny displacement."""
    by_lagrange = simulate(scenes.double_pendulum(formulation="lagrange"), **PRECISELY)
    by_balance = simulate(ode(balance, [math.pi / 2, math.pi, 0.0, 0.0], 30.0), **PRECISELY)
    page.number("angles at t = 30", by_balance.ys[-1, :2], "rad")
    page.number("end of the forearm there", by_lagrange.r[-1, 2], "m")

    compare(page, "Lagrange", by_balance.ys[:, :2], by_lagrange.ys[:, :2])
    y = np.array([0.4, -1.1, 0.7, -1.3])
    rates = by_lagrange.scene.rate(0.0, y)[2:]
    for route, way in {"columns": by_columns, "ten equations": by_free_bodies}.items():
        statement = f"e: Accelerations from the {route}"
        page.equal(statement, way(y[:2], y[2:]), rates, within=1e-13, route="second formulation")
    drift = energy.drift(by_lagrange)
    page.equal("The energy stays the same", drift, 0.0, within=1e-12, route="conservation")

    hanging = np.asarray(linearize(by_lagrange.scene, np.zeros(4)).eigenvalues)
    squares = np.sort(np.abs(hanging) ** 2)[::2]
    page.number("e: squared frequencies of small swings", squares, "1/s^2")
    known = 3 + np.array([-6, 6]) / math.sqrt(7)
    page.equal("e: They are 3 -+ 6 / sqrt(7)", squares, known, within=1e-12)

    beside = by_lagrange.scene.starting([math.pi / 2 + 1e-5, math.pi, 0.0, 0.0])
    aside = simulate(beside, **PRECISELY)
    grown = np.abs(np.asarray(monodromy(by_lagrange.scene, period=30.0))[:, 0]).max()
    page.number("growth until t = 30 of a small error of theta1 at the start", grown)

    look = "The end of the forearm draws a tangle that never repeats."
    page.draw(
        lambda: drawing.free_body(by_lagrange, float(by_lagrange.ts[200])),
        "The forces on each bar: hinge 2 acts on both, in opposite directions.",
    )
    page.draw(lambda: drawing.trajectory(by_lagrange), look)
    motions = {"released": by_lagrange, "1e-5 rad aside": aside}
    page.play(motions, "Two motions with almost equal starts stay together for a while, then part.")


def check(page: Page) -> None:
    """The motion by constraints, and the growth of an error by two starts close together."""
    by_balance = simulate(ode(balance, [math.pi / 2, math.pi, 0.0, 0.0], 30.0), **PRECISELY)
    tied = simulate(scenes.double_pendulum(formulation="constrained"), **PRECISELY)
    angles = np.stack([tied["theta1"], tied["theta2"]], axis=1)
    compare(page, "constraints", by_balance.ys[:, :2], angles)
    end = [
        simulate(ode(balance, [math.pi / 2 + off, math.pi, 0.0, 0.0], 30.0), rtol=1e-13).ys[-1]
        for off in (-1e-8, 1e-8)
    ]
    grown = np.abs(end[1] - end[0]).max() / 2e-8
    page.equal(
        "The growth of a small error is that of two neighbours, in parts of it",
        grown / page["growth until t = 30 of a small error of theta1 at the start"],
        1.0,
        within=1e-2,
        route="difference of two motions",
    )


def ask(page: Page) -> None:
    """Starts without chaos."""
    made = {"formulation": "lagrange", "t1": 30.0}
    slow, fast = np.sqrt(page["e: squared frequencies of small swings"])
    page.ask(
        "What happens when it makes small oscillations, from 0.1 rad?",
        "Nothing chaotic: each angle is a sum of two oscillations, of "
        f"{slow:.4g} and {fast:.4g} rad/s. Choose several motions: they stay together.",
        scenes.double_pendulum(angles=(0.1, 0.0), **made),
    )
    page.ask(
        "What happens without gravity, when the upper arm is pushed?",
        "It is regular again: the energy and the angular momentum about the hinge are conserved, "
        "which rules out chaos.",
        scenes.double_pendulum(rates=(2.0, 0.0), **made).without(effects.UniformGravity),
    )
    page.ask(
        "What happens when the forearm is a hundred times lighter?",
        "The upper arm swings almost as if it were alone, and whirls the forearm about.",
        scenes.double_pendulum(m=(1.0, 0.01), **made),
    )


if __name__ == "__main__":
    show(solve)
