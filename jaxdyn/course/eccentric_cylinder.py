"""An eccentric cylinder that rolls down a ramp.

A cylinder of radius r has its mass centre G at a distance d from its axis, and rolls without slip
down a ramp. Find its equation of motion, and the friction that rolling needs. Released from rest
with G straight above the contact, how far does it roll before it leaves the ramp?

Answer: With unlimited friction this cylinder rolls 12.78 m, two turns and 0.21 rad, until the
normal force vanishes; but the friction does not vanish there, so without contact it would move into
the ramp: with any real coefficient it slips before, and lifts off while slipping, if at all. With
the coefficient 0.8 it slips after 12.568 m.

The numbers belong to m = 1 kg, r = 1 m, d = 0.5 m, I = 0.4 kg m^2 about G, a slope of gamma = 0.2
rad and g = 9.81 m/s^2. Let psi be the angle that the cylinder has rolled, which is that of G from
the normal of the ramp, since it starts with G above the contact; it has rolled the distance r psi.
The equations as the scene has them use phi = psi + gamma, the angle from the vertical.

(a) G is at r psi + d sin psi along the ramp, downwards, and at r + d cos psi off it. Angular
momentum balance about the contact, or Lagrange's equation of T - V, gives

    (I + m (r^2 + d^2 + 2 r d cos psi)) psi'' - m r d sin(psi) psi'^2
        = m g (r sin gamma + d sin(psi + gamma)).

From rest the energy gives the rate: (I + m (r^2 + d^2 + 2 r d cos psi)) psi'^2 / 2 =
m g (r psi sin gamma + d cos gamma - d cos(psi + gamma)).

(b) Momentum balance along the ramp and off it gives the friction F (positive down the ramp) and the
normal force N, and rolling needs a coefficient of at least |F| / N:

    F = m ((r + d cos psi) psi'' - d sin(psi) psi'^2) - m g sin gamma
    N = m g cos gamma - m d (sin(psi) psi'' + cos(psi) psi'^2)

(c) N falls to zero after 12.78 m. There the friction is still -0.602 N: it holds the cylinder back
and, by its moment about G, keeps it turning as it rolls. Without it G would accelerate into the
ramp, at 0.233 m/s^2, so there is no flight that begins there. As N falls, |F| / N grows without
bound, so a real cylinder slips before; it can lift off only while it slips.

(d) Can a cylinder hop for ever? Only if it lands without relative velocity, which loses no energy,
and only on level ground: down a slope every hop would gain some. In the air the angular velocity w
is constant, so the contact point lands with zero velocity only if the flight is its own mirror
image: from an angle -a of G from the vertical to 2 pi n + a, n turns and a bit. Ballistics gives
w^2 d sin a = g (pi n + a).

Under unilateral contact the flight starts where the contact force vanishes, and must not enter the
ground: both only if the cylinder's height h leaves with h'' = 0. So

    tan a = pi n + a,    w^2 = g / (d cos a),

the same for all masses, radii and inertias: the landing grazes, with only h''' nonzero.

Without friction that is a possible motion, which the function `hop` of this page's code finds. With
friction there is none, whatever its coefficient: rolling needs the force I alpha / (r + d cos a),
with the angular acceleration alpha, where the flight begins, so contact ends in slip, and slip
costs energy; only at the top is alpha = 0, and there a flight enters the ground. If friction is
replaced by a constraint that makes the cylinder roll, the ground has to pull it down just before
and after a flight; the function `pull` says how strongly. It is little if the inertia is far above
m r^2. `--check` lets this cylinder hop on level ground, with the same m, r, d, I and g.
"""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from scipy import integrate, optimize

from jaxdyn import Scene, drawing, lagrangian, scenes, simulate, until
from jaxdyn.course.page import Page, show
from jaxdyn.integrate.events import Event, Reaches
from jaxdyn.mechanisms.cylinders import Cylinder
from jaxdyn.scenes.cylinders import FrictionLimit, NormalForce, SlipEnds
from orbits.hybrid.legs import HybridOrbit, Leg
from orbits.hybrid.search import find_hybrid
from orbits.orbit import SearchError
from orbits.shooting.finding import GOAL, RTOL

PROBLEM = 38
TOPIC = "rolling and skating"

_ROUNDS = 15  # steps of a fixed-point iteration
_ROUNDED = (
    "Rounding hides the hop: the inertia is below some 1e-10 of m d^2, or there are hundreds of "
    "turns in the air. Take a larger inertia, or fewer turns."
)

NUMBERS = {"m": 1.0, "r": 1.0, "d": 0.5, "inertia": 0.4, "slope": 0.2, "g": 9.81}


def rolling_law(t, q, v, p):
    """Kinetic minus potential energy by psi, the angle of G from the normal of the ramp."""
    psi, turning = q[0], v[0]
    square = p["r"] ** 2 + p["d"] ** 2 + 2 * p["r"] * p["d"] * jnp.cos(psi)
    down, off = p["r"] * psi + p["d"] * jnp.sin(psi), p["d"] * jnp.cos(psi)
    height = off * jnp.cos(p["slope"]) - down * jnp.sin(p["slope"])
    return (p["m"] * square + p["inertia"]) * turning**2 / 2 - p["m"] * p["g"] * height


def rate_squared(psi):
    """The square of psi' [1/s^2] after a turn psi from rest, and m (r^2 + ...) + I, by energy."""
    m, r, d, inertia, slope, g = NUMBERS.values()
    about = inertia + m * (r**2 + d**2 + 2 * r * d * np.cos(psi))
    fallen = r * psi * np.sin(slope) + 2 * d * np.sin(slope + psi / 2) * np.sin(psi / 2)
    return 2 * m * g * fallen / about, about


def rolling_time(psi):
    """Time [s] from rest to a turn psi; with psi = u^2, which makes it smooth at the start."""

    def pace(u):
        return 2 * u / np.sqrt(rate_squared(u**2)[0])

    return integrate.quad(pace, 0.0, np.sqrt(psi), epsabs=0.0, epsrel=1e-13)[0]


def forces(psi):
    """Friction down the ramp and normal force [N] after a turn psi from rest."""
    m, r, d, _, slope, g = NUMBERS.values()
    square, about = rate_squared(psi)
    pull = m * g * (r * np.sin(slope) + d * np.sin(psi + slope))
    turning = (pull + m * r * d * np.sin(psi) * square) / about
    friction = m * ((r + d * np.cos(psi)) * turning - d * np.sin(psi) * square)
    normal = m * g * np.cos(slope) - m * d * (np.sin(psi) * turning + np.cos(psi) * square)
    return friction - m * g * np.sin(slope), normal


def excess(psi):
    """How much friction rolling needs beyond a coefficient of 0.8 [N]."""
    friction, normal = forces(psi)
    return np.abs(friction) - 0.8 * normal


def solve(page: Page) -> None:
    """Roll to where it slips and to where the normal force vanishes, and find the forces there."""
    psi = np.linspace(0.0, 15.0, 100_000)[1:]
    i = np.flatnonzero(forces(psi)[1] < 0)[0]
    left = optimize.root_scalar(lambda psi: forces(psi)[1], bracket=psi[i - 1 : i + 1], xtol=1e-13)
    rolled = left.root
    page.number("c: it rolls until the normal force vanishes, with unlimited friction", rolled, "m")
    page.number("c: that is, beyond two turns", rolled - 4 * np.pi, "rad")
    friction, _ = forces(rolled)
    page.number("c: friction that is left there", friction, "N")
    lifts = 0.5 * np.sin(rolled) * (1 + 0.5 * np.cos(rolled)) * friction / 0.4
    page.number("c: acceleration of G off the ramp without it", lifts, "m/s^2")
    page.true("c: A flight from there would enter the ramp", lifts < 0, route="Newton's law")

    i = np.flatnonzero(excess(psi) > 0)[0]
    slips = optimize.brentq(excess, psi[i - 1], psi[i], xtol=1e-13)
    page.number("c: with a coefficient of 0.8 it slips after", slips, "m")
    friction, normal = forces(slips)
    page.equal("b: There |F| / N is 0.8", abs(friction) / normal, 0.8, within=1e-9, route="energy")

    scene = scenes.cylinder_on_ramp(t1=10.0, mu=0.8, **NUMBERS)
    motion = simulate(scene, rolling_time(rolled), samples=2001, rtol=1e-12)
    turned = motion["phi"][-1] - NUMBERS["slope"]
    page.equal("The motion takes as long as energy predicts", turned, rolled, within=1e-9)
    page.draw(lambda: drawing.trajectory(motion), "The paths of G and of a mark on the rim.")
    look = (
        "It rolls until the ramp would have to pull, as if friction had no limit; with a "
        "coefficient of friction, `jaxdyn run cylinder_on_ramp` continues with slip and flight."
    )
    page.play(motion, look)


def check(page: Page) -> None:
    """Roll by Lagrange's equation, and find the friction from the multipliers of the contact."""
    scene = scenes.cylinder_on_ramp(t1=10.0, **NUMBERS)
    lost = scenes.contact_lost(scene)
    rolled, end = (
        page["c: it rolls until the normal force vanishes, with unlimited friction"],
        lost.t,
    )
    page.equal(
        "c: The normal force vanishes there", lost.y[2] - 0.2, rolled, within=1e-9, route="event"
    )
    motion = simulate(scene, end, samples=300, rtol=1e-12)
    angle = simulate(lagrangian(rolling_law, [0.0], [0.0], params=NUMBERS), end, samples=300)
    same = "a: Lagrange's equation gives the same motion"
    page.equal(same, motion["phi"] - 0.2, angle["q0"], within=1e-9, route="second formulation")
    friction, normal = forces(np.asarray(motion["phi"]) - 0.2)
    rolls = normal > 0.1
    gripping = scenes.cylinder_on_ramp(t1=10.0, mu=0.8, **NUMBERS)
    slip = until(gripping, FrictionLimit(gripping, 1)).y[2] - NUMBERS["slope"]
    slips = page["c: with a coefficient of 0.8 it slips after"]
    page.equal("c: Friction fails there", slip, slips, within=1e-9, route="event")
    needed = jax.jit(jax.vmap(scenes.friction_needed, (None, 0)))(scene, motion.ys[rolls])
    page.equal("b: Friction needed", needed, abs(friction / normal)[rolls], within=1e-9)

    level = hop(scenes.cylinder_on_ramp(slope=0.0))
    corner = float(level.legs[1].scene.y0[2]) - 2 * np.pi
    same = "d: Contact without friction begins where tan a = pi + a"
    page.equal(same, np.tan(corner), np.pi + corner, within=1e-9)
    page.number("d: advance of the hop in a period", advance(level), "m")


class Rises(Event):
    """A time derivative of the height of a flying cylinder.

    Attributes:
      flying: the cylinder in flight.
      order: 1 for the velocity, 2 for the acceleration; where that is positive a cylinder in
        unilateral contact would leave.
    """

    flying: Scene
    order: int = eqx.field(static=True)

    def value(self, t, y):
        def along(fn):
            return lambda y: jax.jvp(fn, (y,), (self.flying.rate(t, y),))[1]

        fn = self.flying.system.height
        for _ in range(self.order):
            fn = along(fn)
        return fn(y)


class Height(Event):
    """The distance of a cylinder from the surface."""

    cylinder: Cylinder

    def value(self, t, y):
        del t
        return self.cylinder.height(y)


class Mirrored(eqx.Module):
    """Residual of the mirror symmetry of a motion about two times, at which it is time-reversible.

    One time is in the middle of a flight, where the motion starts, the other in the middle of a
    contact.

    Attributes:
      first: () turn at the start [rad].
      last: () turn at the end [rad].
    """

    first: Array
    last: Array

    def __call__(self, end: Array, start: Array) -> Array:
        """(3,) angle and vertical velocity at the start, angle at the end."""
        return jnp.stack([start[2] - self.first, start[4], end[2] - self.last])


class Advanced(eqx.Module):
    """Residual of closing up to the position on level ground and whole turns.

    Attributes:
      turn: () rotation in a period [rad].
    """

    turn: Array

    def __call__(self, end: Array, start: Array) -> Array:
        """(5,) height, turn and velocities."""
        return (end - start)[1:].at[1].add(-self.turn)


# Motions without collisions: A. Chatterjee et al., Int. J. Robotics Research 21 (2002) 621.
def hop(scene: Scene, *, turns: int = 1, rolls: bool = False) -> HybridOrbit:
    """The lossless hopping motion of an eccentric cylinder: in contact, then in the air.

    Args:
      scene: ``scenes.cylinder_on_ramp(slope=0.0, ...)``; its start and friction are not used.
      turns: whole turns in the air, at least 1.
      rolls: a constraint without limits prevents slip, even where the ground has to pull; if
        False, there is no friction, and the cylinder slides between landings at which the contact
        point has zero velocity.
    Returns:
      The chain from the middle of a flight to the middle of the next: down, in contact, up. It
      advances by `advance` in a period, and rotates turns + 1 times.
    Raises:
      ValueError: `scene` is not an eccentric cylinder on level ground, or `turns` is less than 1.
      SearchError: rounding dominates, at an inertia far below m d^2 or after hundreds of turns.
    """
    g = _check_gravity(scene, turns)
    given = scene.system
    slides = eqx.tree_at(lambda system: system.mu, given, 0.0 * given.mu).with_contact("slip_on")
    contact, fly = (
        dataclasses.replace(scene, system=system)
        for system in (given.with_contact("roll") if rolls else slides, given.with_contact("fly"))
    )
    leaves = Rises(fly, 2)
    lands = (Height(given), Rises(fly, 1), leaves, SlipEnds(given, 1))
    d, r, first = float(given.d), float(given.r), math.pi * turns
    a = _corner(turns)
    up = first + a
    spin = math.sqrt(g / (d * math.cos(a)))
    reach = r + d * math.cos(a)
    top = reach + g * (up / spin) ** 2 / 2  # of G, in the middle of the flight
    y0 = np.array([0.0, top, first, spin * reach, 0.0, spin])
    corner = np.array([y0[3] * up / spin, reach, first + up, y0[3], -g * up / spin, spin])
    # The contact lasts less than twice as long as it would at the spin that it begins with.
    lowest = Reaches(2, 2 * first + math.pi, 1)
    stop = until(contact.starting(corner, 2 * (math.pi - a) / spin), lowest, rtol=RTOL)
    if not stop.happened:
        raise SearchError(_ROUNDED)
    spans = np.array([up / spin, float(stop.t)])
    # In the whole chain the motion is a double root: at h'' = 0 unequal corners close too.
    mirrors = Mirrored(jnp.asarray(first), jnp.asarray(2 * first + math.pi))
    legs = (Leg(scene=fly, ends=lands), Leg(scene=contact, ends=()))
    # Where it turns fast at the lowest point, the rounding of the times alone exceeds the goal.
    half = find_hybrid(legs, y0, spans, closes=mirrors, throw=False)
    down, rest = half.spans
    above = (Height(given),)
    presses = () if rolls else (NormalForce(contact),)
    chain = (
        Leg(scene=fly, ends=lands, bounds=above),
        Leg(scene=contact, ends=(leaves,), bounds=presses),
        Leg(scene=fly, ends=(), bounds=above),
    )
    spans = [down, 2 * rest, down]
    around = Advanced(jnp.asarray(2 * (first + math.pi)))
    # Over the whole chain the residuals of the halves count several times.
    whole = 8 * GOAL
    return _check(
        find_hybrid(chain, half.y0, spans, closes=around, goal=whole, max_iterations=0, throw=False)
    )


def _check(found: HybridOrbit) -> HybridOrbit:
    """The motion found from an exact guess; raises if rounding prevented it."""
    if not found.ok:
        raise SearchError(_ROUNDED)
    return found


def _corner(turns: int) -> float:
    """a [rad] of tan a = pi n + a: each iteration reduces the error by a factor of 17 or more."""
    a = math.pi / 2
    for _ in range(_ROUNDS):
        a = math.atan(math.pi * turns + a)
    return a


def advance(hop: HybridOrbit) -> float:
    """Advance of the cylinder along the ground in a period [m]."""
    return float(hop.trajectory(2).pieces[-1].ys[-1, 0] - hop.y0[0])


def pull(hop: HybridOrbit) -> float:
    """Largest pull of the ground over the weight [1]; 0 if it only pushes."""
    scene = hop.legs[1].scene
    weight = float(scene.system.m) * _gravity(scene)
    return max(0.0, -hop.smallest(1, NormalForce(scene)) / weight)


def _gravity(scene: Scene) -> float:
    fly = scene.system.with_contact("fly")
    fall = fly.rate(jnp.zeros(()), scene.y0, scene.effects)
    return -float(fall[4])


def refusal(name: str, expected: str, got, remedy: str) -> ValueError:
    """The error that is raised where no cylinder hops."""
    return ValueError(f"{name}: expected {expected}, got {got}. {remedy}")


def _check_gravity(scene: Scene, turns) -> float:
    """The acceleration of gravity [m/s^2], with the scene and the number of turns checked."""
    system = scene.system
    if not (isinstance(system, Cylinder) and system.flat):
        got = type(system).__name__
        raise refusal("scene", "a cylinder on a ramp", got, "Use scenes.cylinder_on_ramp().")
    scene.check()
    if float(system.slope) != 0.0:
        remedy = "Each hop down a slope gains energy, and these landings lose none."
        raise refusal("slope", "0, level ground", float(system.slope), remedy)
    if not float(system.d) > 0:
        raise refusal("d", "> 0", float(system.d), "A balanced cylinder does not hop.")
    if not (isinstance(turns, int) and turns > 0):
        remedy = "Without a turn the flight would enter the ground."
        raise refusal("turns", "a whole number > 0", repr(turns), remedy)
    g = _gravity(scene)
    if not g > 0:
        raise refusal("scene", "gravity downwards", f"g = {g:.6g}", "Add UniformGravity(9.81).")
    return g


if __name__ == "__main__":
    show(solve)
