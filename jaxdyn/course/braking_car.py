"""A car that brakes with locked front or rear wheels.

A car, seen from above, runs straight ahead when either its front or its rear wheels lock; the
other axle rolls freely, the locked one drags like a single point on the centre line. Derive the
motion, brake down to rest, and decide which of the two is stable: does a small rotation grow? What
does that depend on?

Answer: With the front wheels locked any rotation dies out, at any speed. With the rear wheels
locked it grows while V^2 > mu g L, above 4.2 m/s here. From 20 m/s a rotation of 0.01 rad/s turns
this car by 257 degrees before it stops, with locked front wheels by 0.07 degrees.

The numbers belong to m = 1000 kg, I = 1500 kg m^2, the front axle 1.2 m ahead of the mass centre
and the rear axle 1.4 m behind (L = 2.6 m), mu = 0.7 and g = 9.81 m/s^2.

(a) Let the free axle be s ahead of the mass centre G (s = 1.2 m with the rear locked, s = -1.4 m
with the front locked) and the locked axle b ahead of the free one (b = -L or L). The free axle
cannot move sideways: its velocity is V along the car. With the rate of turning omega the locked one
has the velocity (V, b omega) along and across, and the friction mu N against it, with N = m g |s| /
L. Momentum along the car, and angular momentum about the free axle, where the unknown side force
has no moment, with J = I + m s^2:

    m (V' + s omega^2) = -mu N V / u
    J omega' = m s V omega - mu N b^2 omega / u,      u = sqrt(V^2 + b^2 omega^2)

and theta' = omega, while the free axle moves at V in the direction theta.

(b) u = 0 only where the car stands. The integration ends at a small speed; the rest of the stop is
added in closed form.

(c) The car is called stable if a small rotation gets smaller while it brakes. The pictures show
both cars after the same small disturbance.

(d) For small omega the second equation is J omega' = (m s V - mu N L^2 / V) omega, and m V' = -mu
N. The friction damps; the free axle steers the car back if it trails (s < 0, front locked), and
away if it leads. With the rear locked omega grows while m s V^2 > mu N L^2, which is V^2 > mu g L,
whatever the place of G. Dividing the two equations by each other and integrating from V0 to V:

    omega = omega0 (V / V0)^(m L^2 / J) exp(m^2 s (V0^2 - V^2) / (2 mu N J))

With the rear wheels locked the exponent is m L (V0^2 - V^2) / (2 mu g J). It is large for a fast
car on a slippery road: 20 m/s and mu = 0.7 make exp(25.8) at the end. The power of V / V0 takes
omega back to zero while the car stops, so the rotation is largest at V^2 = mu g L: 1.4e9 times the
first one, to first order.

(e) i. With mu = 0 they are the ideal equations, m V' = -m s omega^2 and J omega' = m s V omega, of
a body on one skate. ii. Then the energy (m V^2 + J omega^2) / 2 is constant. Without rotation the
car slows down uniformly, at mu g |s| / L, and stays straight. A small rotation follows (d) to first
order. `jaxdyn course 32 --check` checks all of these.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxdyn import drawing, ode, scenes, simulate, until
from jaxdyn.analysis import energy
from jaxdyn.course.page import Page, show
from jaxdyn.integrate.events import When
from jaxdyn.integrate.phases import HybridTrajectory, simulate_phases
from jaxdyn.scenes.wheels import AXLES
from jaxdyn.status import Status

PROBLEM = 32
TOPIC = "rolling and skating"


J = 1500.0 + 1000.0 * 1.2**2  # about the front axle [kg m^2]
#: Distance of the free axle ahead of G, and of the locked one ahead of the free one [m].
PLACES = {"front": (-1.4, 2.6), "rear": (1.2, -2.6)}


def by_hand(t, y, p):
    """The rates of V, of the speed w = b omega of the locked axle across the car, and of theta."""
    (V, w, _), m, s, b = y, 1000.0, p["s"], p["b"]
    inertia, force, u = 1500.0 + m * s**2, 0.7 * 9.81 * m * jnp.abs(s / b), jnp.hypot(V, w)
    slowing = -s * (w / b) ** 2 - force * V / u / m
    turning = m * s * V * w / inertia - force * b**2 * w / u / inertia
    return jnp.stack([slowing, turning, w / b])


def slow(t, y):
    """The squared sliding speed of the locked axle minus that of 1e-4 m/s."""
    return y[0] ** 2 + y[1] ** 2 - 1e-8


def brake(page, locked):
    """The slide and the stop; the equations of (a) give the duration of the slide."""
    scene, (s, b) = scenes.car(locked=locked), PLACES[locked]
    hand = ode(by_hand, [20.0, 0.01 * b, 0.0], 60.0, params={"s": s, "b": b})
    stop = until(hand, When(slow, -1), rtol=1e-12)
    slide = simulate(scene, stop.t, samples=2001, rtol=1e-12)
    turned = slide["theta"][-1]
    statement = f"a: Equations by hand, same turn, {locked}"
    page.equal(statement, stop.y[2], turned, within=1e-9, route="second formulation")
    (way,) = scenes.braking(scene)["slide"].exits
    lasts, rest = eqx.filter_jit(lambda way, *at: (way.lasts(*at), way.change(*at)))(
        way, stop.t, slide.ys[-1]
    )
    whole = {"names": ("slide",), "pieces": (slide,), "path": (("slide", 0),), "ended": True}
    return HybridTrajectory(**whole, t=stop.t + lasts, y=rest, status=Status.OK)


def solve(page: Page) -> None:
    """Brake both cars to rest; the equations, and how small rotations grow."""
    edge = np.sqrt(0.7 * 9.81 * (1.2 + 1.4))
    page.number("speed above which locked rear wheels are unstable", edge, "m/s")
    power = 1000.0 * 2.6 * 20.0**2 / (2 * 0.7 * 9.81 * J)
    page.number("d: that exponent from 20 m/s to rest, rear wheels locked", power)
    most = (edge / 20.0) ** (1000.0 * 2.6**2 / J) * np.exp(power * (1 - (edge / 20.0) ** 2))
    page.number("d: largest growth of a small rotation from 20 m/s on", most)
    stops = {}
    for locked, (s, _) in PLACES.items():
        stops[f"{locked} wheels locked"] = motion = brake(page, locked)
        page.number(f"turned at rest, {locked} wheels locked", np.degrees(motion.y[2]), "degrees")

        hardly = scenes.car(locked=locked, speed=10.0, spin=1e-6)
        left = scenes.wheels.turning_left(hardly, 10.0 - 0.7 * 9.81 * abs(s) / 2.6)
        page.number(f"rotation after 1 s from 10 m/s, {locked}", left, "of the first")
        growth = np.asarray(eqx.filter_jit(hardly.rate)(0.0, hardly.y0))[5] / 1e-6
        rate = scenes.turning_rate(hardly, 10.0)
        page.equal(f"Its rate of growth, {locked}", growth, rate, within=1e-12)
    page.equal("It is 0 at that speed", scenes.turning_rate(scenes.car(), edge), 0.0, within=1e-14)

    page.draw(
        lambda: drawing.trajectory(list(stops.values()), names=list(stops)),
        "Both cars start with the same small rotation; one goes straight, one spins.",
    )
    page.play(stops, "The same car with the same disturbance, and two ways to brake.")


def ask(page: Page) -> None:
    """Both cars on ice, slow ones, and without friction."""
    ice = np.sqrt(0.1 * 9.81 * 2.6)

    def both(**numbers):
        return {f"{axle} wheels locked": scenes.car(locked=axle, **numbers) for axle in AXLES}

    page.ask(
        "What happens on ice, mu = 0.1?",
        "Both slide seven times as long. Locked rear wheels are unstable down to a lower speed, "
        f"sqrt(mu g L) = {ice:.2g} m/s, and turn the car about as far as on a dry road: once it "
        "has turned round, its free axle is behind, and it is stable.",
        both(mu=0.1, t1=45.0),
    )
    page.ask(
        "What happens when both cars start with 4 m/s?",
        "The rotation dies out in both: 4 m/s is below sqrt(mu g L) = "
        f"{page['speed above which locked rear wheels are unstable']:.3g} m/s.",
        both(speed=4.0, t1=2.0),
    )
    page.ask(
        "What happens without friction, with a rotation of 0.5 rad/s?",
        "It is a body on one skate: the car whose free axle leads turns round, and both end in a "
        "straight glide with the mass centre ahead of the free axle.",
        both(mu=0.0, spin=0.5, t1=20.0),
    )


def check(page: Page) -> None:
    """Stop by the search for rest, straight, turn a little, and slide without friction."""
    for locked, far in (("front", 1.4), ("rear", 1.2)):
        scene = scenes.car(locked=locked)
        stop = simulate_phases(scenes.braking(scene), "slide", scene.y0, 60.0, samples=300)
        turned, by_hand = np.degrees(stop.y[2]), page[f"turned at rest, {locked} wheels locked"]
        page.equal(f"Turned at rest, {locked}", turned, by_hand, within=1e-7, route="event")
        straight = scenes.car(locked=locked, spin=0.0)
        slide = simulate_phases(scenes.braking(straight), "slide", straight.y0, 60.0, samples=300)
        slowing = 0.7 * 9.81 * far / 2.6
        found, expected = [slide.t, slide.y[0]], [20.0 / slowing, 20.0**2 / (2 * slowing)]
        page.equal(f"Straight stop, {locked}: time and way", found, expected, within=1e-9)

        hardly = scenes.car(locked=locked, speed=10.0, spin=1e-6)
        later = simulate(hardly, 1.0, samples=300, rtol=1e-12)["theta_dot"][-1] / 1e-6
        left = page[f"rotation after 1 s from 10 m/s, {locked}"]
        page.equal(f"A small rotation after 1 s, {locked}", later, left, within=1e-7)
    free = simulate(scenes.car(mu=0.0, spin=0.5), 10.0, samples=300, rtol=1e-12)
    page.equal("Without friction energy is conserved", energy.drift(free), 0.0, within=1e-12)


if __name__ == "__main__":
    show(solve)
