"""Mass in a slot on a turntable.

A rigid table turns freely about its centre. A mass slides without friction in a straight slot that
passes the centre at the distance d. With the angle theta of the table and the position s along the
slot, find the acceleration of the mass in three ways (a) and the equations of motion by angular
momentum balance (b) and by Lagrange (c). Started with s = 0, s' > 0 and theta' > 0, does theta grow
without bound (d)?

Answer: s'' = theta'^2 s - theta'' d and (I + m s^2) theta'' = -m s (2 theta' s' + theta'^2 d). With
s' > 0 at the start the angle has a limit: the mass runs away steadily, s grows like t, and with the
angular momentum fixed theta' falls like 1 / s^2. With s' = 0 it stays at s = 0, and theta = theta'
t grows without bound.

(a) i' points along the slot, j' across it towards the centre, and the mass is at r = s i' - d j'.
The axes turn, so di'/dt = theta' j' and dj'/dt = -theta' i', and two derivatives give

    a = (s'' + d theta'' - s theta'^2) i' + (s theta'' + 2 s' theta' + d theta'^2) j'

i. In fixed axes r = (s cos theta + d sin theta, s sin theta - d cos theta); its second derivative
is this, with i' = (cos theta, sin theta). iii. The five terms in the frame of the table, whose
centre is at rest, are theta'' k x r - theta'^2 r + 2 theta' s' j' + s'' i': the same.

(b) No force acts along the slot, so a . i' = 0. About the centre the whole has no moment, so
I theta'' + m (s a_j + d a_i) = 0, where a_i = 0:

    s'' + d theta'' - s theta'^2 = 0
    I theta'' + m s (s theta'' + 2 s' theta' + d theta'^2) = 0

(c) L = I theta'^2 / 2 + m ((s' + d theta')^2 + s^2 theta'^2) / 2. Its equation for s is the first;
the one for theta says that the angular momentum H = I theta' + m d (s' + d theta') + m s^2 theta'
is constant, and its derivative less m d times the first is the second.

(d) With v0 = 0: no force pushes the mass off s = 0, since s'' = -d theta'' = 0 there. The table
turns at omega_0 for ever, so theta grows without bound. (This motion is unstable: the slightest
push ends it.)

With v0 > 0, no: with A = I + m d^2 and the energy E, the two conserved quantities give

    s'^2 = (I v0^2 + 2 E s^2) / (I + m s^2),
    dtheta/ds = (H / s' - m d) / (A + m s^2).

The first is positive, so s grows for ever, at a speed that tends to sqrt(2 E / m). The second falls
like 1 / s^2, and the integral of that to infinity is finite. For slow masses the limit is large, as
log(1 / v0). With v0 < 0 the mass runs away to the other side, and the angle has a limit again. With
I = 1 kg m^2, m = 1 kg, d = 0.5 m, v0 = 1 m/s and omega_0 = 1 rad/s it is 1.061 rad.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, ode, scenes, simulate
from jaxdyn.course.page import Page, show
from jaxdyn.geometry import kinematics

PROBLEM = 34
TOPIC = "constraints"


def by_balance(t, y, p):
    """The rate of theta, s and their rates, by the balances of table and mass, and of the mass."""
    _, s, w, v = y
    turning = -p["m"] * s * (2 * w * v + w**2 * p["d"]) / (p["I"] + p["m"] * s**2)
    return [w, v, turning, w**2 * s - turning * p["d"]]


def solve(page: Page) -> None:
    """Compare accelerations and equations of motion, then wait for the limit of the angle."""
    d, q, v, a = 0.5, jnp.array([0.7, 1.1]), jnp.array([1.3, -0.4]), jnp.array([0.2, 0.9])
    by_axes = kinematics.slot_acceleration(d, q, v, a)
    what = "a: at d = 0.5, theta = 0.7, s = 1.1, theta' = 1.3, s' = -0.4, theta'' = 0.2, s'' = 0.9"
    page.number(what, by_axes, "m/s^2")
    twice = kinematics.by_derivatives(lambda q: kinematics.slot_position(d, q), q, v, a)
    statement = "It is the second derivative of x and y"
    page.equal(statement, by_axes, twice, within=1e-14, route="autodiff")
    five = kinematics.slot_acceleration_five_terms(d, q, v, a)
    page.equal("The five-term formula agrees", by_axes, five, within=1e-14, route="moving frame")

    numbers = {"m": 1.0, "I": 1.0, "d": d}
    precisely = {"samples": 401, "rtol": 1e-13}
    hand = simulate(ode(by_balance, [0.0, 0.0, 1.0, 1.0], 3.0, params=numbers), **precisely)
    by_lagrange = simulate(scenes.turntable(formulation="lagrange"), **precisely)
    statement = "Balances and Lagrange agree"
    page.equal(statement, hand.ys, by_lagrange.ys, within=1e-12, route="second formulation")

    late = simulate(by_lagrange.scene, 1e4, **precisely)
    theta, s, _, speed = late.ys[-1]
    momentum = (1.0 + d**2) * 1.0 + d * 1.0
    # The integral of dtheta / ds from s on; the neglected terms fall like 1 / s^3.
    tail = (momentum / speed - d) / s
    limit = scenes.turntable_limit(d=d)
    page.number("d: angle after 1e4 s, v0 = 1 m/s, omega_0 = 1 rad/s", theta, "rad")
    page.number("d: its limit", limit, "rad")
    page.equal("The angle and the rest of the integral", theta + tail, limit, within=1e-11)
    slow = [scenes.turntable_limit(d=d, speed=u) for u in (0.01, 0.1, 1.0)]
    page.number("d: limits with v0 = 0.01, 0.1 and 1 m/s", slow, "rad")
    still = scenes.turntable(speed=0.0, formulation="lagrange")
    change = jax.jit(still.rate)(0.0, still.y0 + np.array([0.3, 0.0, 0.0, 0.0]))
    statement = "d: With v0 = 0 nothing moves the mass or slows the table, at any angle"
    page.equal(statement, change, [1.0, 0.0, 0.0, 0.0], within=1e-15, route="equations")

    look = "The slot pushes the mass sideways, and the mass the slot."
    page.draw(lambda: drawing.free_body(by_lagrange, float(by_lagrange.ts[40])), look)
    look = "The mass leaves on a path that becomes straight."
    page.draw(lambda: drawing.trajectory(by_lagrange), look)
    speeds = {
        u: simulate(scenes.turntable(speed=u, formulation="lagrange"), 6.0, samples=401)
        for u in (0.01, 0.1, 0.3, 1.0, 3.0)
    }
    page.play(speeds, "The slower the mass, the longer the table turns.", choose="speed [m/s]")


if __name__ == "__main__":
    show(solve)
