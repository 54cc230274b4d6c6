"""Massless bodies in rotating frames: the restricted three-body problem, Hill's problem.

`SYSTEMS` has the numbers of pairs of bodies to which spacecraft fly, in kilometres and seconds.
"""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import as_float, check_first
from jaxdyn.scene import Scene, System
from jaxdyn.scenes.ready_made import ready_made
from jaxdyn.sketch import Shape, circle, mark
from jaxdyn.system import UNIT, Points

#: Radius of attracting masses in drawings; in the equations they are points.
DRAWN = 0.02
_MOON = 0.01215  # share of the Moon in the mass of Earth and Moon
#: Entries of a start in the units of a pair are smaller than this; some in kilometres are larger.
_MOST = 1e3


class RestrictedProblem(System):
    """A massless body near two on circles, in the frame that rotates with them about z.

    The masses are 1 - mu at x = -mu and mu at x = 1 - mu; units are such that the distance of the
    two and their angular velocity are 1. The energy is -C / 2 with Jacobi's constant C (without the
    term mu (1 - mu) that some authors add).

    Attributes:
      mu: () mass of the second body as a share of the mass of both [1].
    """

    mu: Array = eqx.field(converter=as_float, default=_MOON)
    singular: ClassVar[str] = "The attraction is infinite at the two masses."

    @property
    def units(self) -> Array:
        """(k,) units of the state, the distance and its product with the angular velocity."""
        return jnp.ones(len(self.labels()))

    @property
    def unit_of_time(self) -> Array:
        """() 1 over the angular velocity."""
        return jnp.ones(())

    def points(self, t, y):
        del t  # energies are per mass
        d = len(y) // 2
        return Points(y[None, :d], y[None, d:], jnp.ones(1))

    def rate(self, t, y, effects):
        del t, effects
        (x, y_, *z), (vx, vy, *vz) = _halves(y)
        mu, far = self.mu, 1 - self.mu
        off = sum((c * c for c in z), y_ * y_)
        one = far / ((x + mu) ** 2 + off) ** 1.5
        two = mu / ((x - far) ** 2 + off) ** 1.5
        ax = 2 * vy + x - one * (x + mu) - two * (x - far)
        az = (-(one + two) * c for c in z)
        return jnp.stack([vx, vy, *vz, ax, y_ - 2 * vx - (one + two) * y_, *az])

    def energies(self, t, y, effects):
        del t, effects
        (x, y_, *z), (vx, vy, *vz) = _halves(y)
        mu, far = self.mu, 1 - self.mu
        off = sum((c * c for c in z), y_ * y_)
        near = far / jnp.sqrt((x + mu) ** 2 + off) + mu / jnp.sqrt((x - far) ** 2 + off)
        square = sum((v * v for v in vz), vx * vx + vy * vy)
        return 0.5 * square, -0.5 * (x * x + y_ * y_), -near

    def check(self, t, y):
        del t, y
        if not 0 < float(self.mu) < 1:
            raise _checks.fail("mu", "between 0 and 1", float(self.mu), "It is a share of mass.")


def _halves(y: Array) -> tuple[list[Array], list[Array]]:
    """The coordinates, and the velocities."""
    entries = [*y]
    return entries[: len(y) // 2], entries[len(y) // 2 :]


class RestrictedThreeBody(RestrictedProblem):
    """The restricted three-body problem in the plane."""

    def labels(self):
        return tuple((name, "1") for name in ("x", "y", "vx", "vy"))

    def sketch(self, t, y):
        del t, y
        centres = (jnp.stack([x, 0.0 * x]) for x in (-self.mu, 1 - self.mu))
        return tuple(Shape("solid", circle(centre, DRAWN)) for centre in centres)


class RestrictedThreeBodyInSpace(RestrictedProblem):
    """The restricted three-body problem in space.

    Attributes:
      primaries: names of the two bodies, in pictures.
    """

    primaries: tuple[str, str] = eqx.field(static=True, default=("m1", "m2"), kw_only=True)

    def labels(self):
        return tuple((name, "1") for name in ("x", "y", "z", "vx", "vy", "vz"))

    def sketch(self, t, y):
        del t, y
        places = (self.units[0] * jnp.stack([x, 0.0 * x, 0.0 * x]) for x in (-self.mu, 1 - self.mu))
        return tuple(mark(name, at) for name, at in zip(self.primaries, places, strict=True))


class Pair(NamedTuple):
    """Two bodies on circles.

    Attributes:
      mu: mass of the second body as a share of the mass of both [1].
      distance: distance between them [km].
      time: 1 over their angular velocity [s].
    """

    mu: float
    distance: float
    time: float


#: Pairs as in JPL's catalogue of periodic orbits of three bodies, ssd.jpl.nasa.gov.
SYSTEMS = {
    "earth-moon": Pair(1.215058560962404e-2, 389703.264829278, 382981.289129055),
    "sun-earth": Pair(3.0542e-6, 149597871.0, 5022635.0),
    "sun-mars": Pair(3.227154996101724e-7, 208321282.0, 8253622.0),
    "mars-phobos": Pair(1.611081404409632e-8, 9468.0, 4452.0),
    "jupiter-europa": Pair(2.52801752854e-5, 668519.0, 48562.0),
    "saturn-enceladus": Pair(1.901109735892602e-7, 238529.0, 18913.0),
    "saturn-titan": Pair(2.366393158331484e-4, 1195677.0, 212238.0),
}
_DAY = 86400.0  # [s]
#: Largest G (m1 + m2) of a pair [km^3/s^2], that of 750 suns; of Earth and Moon it is 4e5. A time
#: in days instead of seconds multiplies it by 7e9.
_HEAVIEST = 1e14


class RestrictedThreeBodyInKilometres(RestrictedThreeBodyInSpace):
    """The restricted three-body problem in space, in kilometres and days.

    Attributes:
      distance: distance between the two bodies [km].
      time: 1 over their angular velocity [day].
    """

    distance: Array = eqx.field(converter=as_float, default=1.0, metadata={UNIT: True})
    time: Array = eqx.field(converter=as_float, default=1.0, metadata={UNIT: True})

    def labels(self):
        names = ("x", "y", "z")
        return (*((x, "km") for x in names), *((f"v{x}", "km/day") for x in names))

    def base_units(self):
        return "km", "", "day"

    @property
    def units(self):
        speed = self.distance / self.time
        return jnp.stack([*[self.distance] * 3, *[speed] * 3])

    @property
    def unit_of_time(self):
        return self.time

    def rate(self, t, y, effects):
        return super().rate(t, y / self.units, effects) * self.units / self.time

    def energies(self, t, y, effects):
        square = (self.distance / self.time) ** 2
        return tuple(square * x for x in super().energies(t, y / self.units, effects))

    def check(self, t, y):
        super().check(t, y)
        for name in ("distance", "time"):
            _checks.positive(name, getattr(self, name))


@ready_made()
def restricted_three_body(*, mu=_MOON, x=0.5, y=0.0, vx=0.0, vy=0.8, t1=20.0) -> Scene:
    """A massless body near two that circle each other, in the frame that rotates with them.

    The equilibria are the `libration_points`.

    Args:
      mu: mass of the second body as a share of the mass of both [1]; 0.01215 for the Moon.
      x: initial x [1], the masses being at -mu and 1 - mu.
      y: initial y [1].
      vx: initial vx, in the rotating frame [1].
      vy: initial vy, in the rotating frame [1].
      t1: span [1]; the two masses turn once in 2 pi.
    """
    return Scene(RestrictedThreeBody(mu), y0=jnp.stack([x, y, vx, vy]), t1=t1)


@ready_made(but=("system",))
def restricted_three_body_in_space(
    *, mu=_MOON, x=0.8234, y=0.0, z=0.0224, vx=0.0, vy=0.1343, vz=0.0, t1=2.75, system=""
) -> Scene:
    """A massless body near two that circle each other, in and out of their plane.

    The axes turn with the two bodies, and z is the axis of their circles. The equilibria are the
    `libration_points`, at z = 0; halo orbits lie about them.

    Args:
      mu: mass of the second body as a share of the mass of both [1]; 0.01215 for the Moon.
      x: initial x [1], the masses being at -mu and 1 - mu.
      y: initial y [1].
      z: initial z [1].
      vx: initial vx, in the rotating frame [1].
      vy: initial vy, in the rotating frame [1].
      vz: initial vz [1].
      t1: span [1]; the two masses turn once in 2 pi.
      system: "" for these units; "earth-moon", "sun-earth", "sun-mars", "mars-phobos",
        "jupiter-europa", "saturn-enceladus" or "saturn-titan" for the same scene in km and days,
        with the numbers of that pair in JPL's catalogue of periodic orbits of three bodies; those
        of Earth and Moon are 389703 km and 382981 s over a radian, a month of 27.851 days. A
        ``scenes.restricted.Pair(mu, distance, time)`` has other ones, the distance in km and the
        time over a radian in seconds, such as 384400 km and 375700 s, from the sidereal month of
        27.322 days. The numbers above remain relative to the distance and the
        angular velocity of the pair; ``scene.starting(y0, t1)`` takes a state in km and km/day,
        and a span in days.
    """
    y0 = jnp.stack([x, y, z, vx, vy, vz])
    if not system:
        return Scene(RestrictedThreeBodyInSpace(mu), y0=y0, t1=t1)
    primaries = ("m1", "m2")
    if not isinstance(system, Pair):
        name = _checks.choice("system", system, list(SYSTEMS))
        primaries, system = tuple(name.title().split("-")), SYSTEMS[name]
    _check_mass(system)
    if _checks.is_traced(mu) or float(mu) != _MOON:
        raise _checks.fail("mu", "none with system=, which has its own", mu, "Leave it out.")
    if not _checks.is_traced(y0) and float(jnp.abs(y0).max()) > _MOST:
        wanted = "a start relative to the distance and the angular velocity of the two bodies"
        remedy = "scene.starting(y0) takes one in km and km/day."
        raise _checks.fail("y0", wanted, _text.brief(np.asarray(y0)), remedy)
    days = system.time / _DAY
    made = RestrictedThreeBodyInKilometres(system.mu, system.distance, days, primaries=primaries)
    return Scene(made, y0=y0 * made.units, t1=t1 * days)


def _check_mass(pair: Pair) -> None:
    if _checks.is_traced(pair[1:]):
        return
    distance, time = float(pair.distance), float(pair.time)
    if time > 0 and distance**3 / time**2 > _HEAVIEST:
        mass = f"G M = distance^3 / time^2 = {distance**3 / time**2:.0e} km^3/s^2"
        got = f"{time:g} at a distance of {distance:g} km ({mass}; 1e11 for the Sun)"
        remedy = "The time of a Pair is in seconds, although the scene is in km and days."
        raise _checks.fail("time", "1 over the angular velocity, in seconds", got, remedy)


_HALVINGS = 60  # bisections of intervals shorter than 2, to the last bit
_POLISHING_STEPS = 2  # steps of Newton's method: they carry derivatives up to the third


def libration_points(mu) -> Array:
    """(5, 2) positions of the equilibria L1 to L5 of the restricted three-body problem.

    On the axis through the masses L1 is between them, L2 beyond the one at 1 - mu and L3 beyond the
    other; L4 and L5 form equilateral triangles with them, L4 with y > 0.

    Args:
      mu: mass of the second body as a share of the mass of both, between 0 and 1 [1].
    Returns:
      x and y of each [1]; the velocities there are 0. They are differentiable in mu, also under
      jit.
    Raises:
      ValueError: `mu` is not between 0 and 1.
    Reference: Szebehely (1967), Theory of Orbits, section 4.4.
    Example:
      >>> from jaxdyn import scenes
      >>> print(scenes.libration_points(0.01215)[:3, 0].round(5))
      [ 0.83692  1.15568 -1.00506]
    """
    mu = _checks.array("mu", mu, ())
    if not _checks.is_traced(mu):
        RestrictedThreeBody(mu).check(0.0, None)
    return _compiled_points(mu)


@jax.jit  # a loop outside a program captures mu, and is compiled for each value of it
def _compiled_points(mu: Array) -> Array:
    system = RestrictedThreeBody(mu)
    far, zero = 1 - mu, jnp.zeros_like(mu)

    @jax.vmap
    def pull(x):
        return system.rate(zero, jnp.stack([x, zero, zero, zero]), ())[2]

    def halved(_, bounds):
        low, high = bounds
        middle = 0.5 * (low + high)
        above = pull(middle) > 0
        return jnp.where(above, low, middle), jnp.where(above, middle, high)

    # The force along the axis increases from mass to mass, and beyond them to infinity.
    bounds = jnp.stack([-mu, far, zero - 2]), jnp.stack([far, zero + 2, -mu])
    x = jax.lax.fori_loop(0, _HALVINGS, halved, jax.lax.stop_gradient(bounds))[0]
    for _ in range(_POLISHING_STEPS):
        value, slope = jax.jvp(pull, (x,), (jnp.ones(3),))
        x = x - value / slope
    side, height = 0.5 - mu, jnp.sqrt(0.75) + zero
    return jnp.stack(
        [
            jnp.append(x, jnp.stack([side, side])),
            jnp.stack([zero, zero, zero, height, -height]),
        ],
        axis=1,
    )


@check_first
def libration_point(scene: Scene, name: str) -> Array:
    """(k,) the state at rest in a libration point of a restricted three-body scene, in its units.

    Args:
      scene: `restricted_three_body` or `restricted_three_body_in_space`.
      name: "L1" between the masses, "L2" beyond the second, "L3" beyond the first, "L4" ahead of
        the second, "L5" behind it.
    Raises:
      ValueError: `scene` is another one, or there is no such point.
    Example:
      >>> from jaxdyn import scenes
      >>> scene = scenes.restricted_three_body_in_space(system="earth-moon")
      >>> print(scenes.libration_point(scene, "L1")[:3].round())
      [326149.      0.      0.]
    """
    system = restricted(scene)
    which = _NAMES.index(_checks.choice("name", name, _NAMES))
    place, k = libration_points(system.mu)[which], len(scene.y0)
    still = jnp.concatenate([place, jnp.zeros(k - 2, place.dtype)])
    return still * system.units


@check_first
def jacobi_constant(scene: Scene, y=None) -> Array:
    """() Jacobi's constant of a restricted three-body scene, -2 times the energy, without units.

    It lacks the term mu (1 - mu) that some authors add.

    Args:
      scene: see `libration_point`.
      y: (k,) state; the scene's start by default.
    Raises:
      ValueError: `scene` is another one.
    Example:
      >>> from jaxdyn import scenes
      >>> scene = scenes.restricted_three_body_in_space(system="earth-moon")
      >>> print(scenes.jacobi_constant(scene, scenes.libration_point(scene, "L1")).round(6))
      3.188341
    """
    system = restricted(scene)
    y = jnp.asarray(scene.y0 if y is None else y, float) / system.units
    return -2.0 * sum(RestrictedProblem.energies(system, jnp.zeros(()), y, ()), jnp.zeros(()))


def restricted(scene: Scene) -> RestrictedProblem:
    """The system of a restricted three-body scene.

    Raises:
      ValueError: `scene` is another one.
    """
    if not isinstance(scene.system, RestrictedProblem):
        wanted = "a restricted three-body scene"
        remedy = "scenes.restricted_three_body_in_space makes one."
        raise _checks.fail("scene", wanted, type(scene.system).__name__, remedy)
    return scene.system


_NAMES = ("L1", "L2", "L3", "L4", "L5")


class Hill(System):
    """A massless body near a planet that circles the Sun, in the frame that rotates with it.

    This is the limit of the restricted three-body problem for a small mu, with lengths in units of
    mu^(1/3): the planet is at the origin, the Sun far away on the negative x axis. The energy is
    -C / 2 with Jacobi's constant C of Hill's problem.
    """

    singular: ClassVar[str] = "The attraction is infinite at the planet."

    def labels(self):
        return tuple((name, "1") for name in ("x", "y", "vx", "vy"))

    def points(self, t, y):
        del t  # energies are per mass
        return Points(y[None, :2], y[None, 2:], jnp.ones(1))

    def sketch(self, t, y):
        del t, y
        return (Shape("solid", circle(jnp.zeros(2), DRAWN)),)

    def rate(self, t, y, effects):
        del t, effects
        x, y_, vx, vy = y
        pull = 1 / (x * x + y_ * y_) ** 1.5
        return jnp.stack([vx, vy, 2 * vy + 3 * x - pull * x, -2 * vx - pull * y_])

    def energies(self, t, y, effects):
        del t, effects
        x, y_, vx, vy = y
        return 0.5 * (vx * vx + vy * vy), -1.5 * x * x, -1 / jnp.sqrt(x * x + y_ * y_)


@ready_made()
def hill(*, x=0.3, y=0.0, vx=0.0, vy=1.5, t1=10.0) -> Scene:
    """Hill's problem: a massless moon about a planet that circles the Sun.

    Its two equilibria are at x = 3^(-1/3) and -3^(-1/3), where Jacobi's constant is 3^(4/3). Hill
    (1878), American Journal of Mathematics 1, 5; Henon (1969), Astronomy and Astrophysics 1, 223.

    Args:
      x: initial x, away from the Sun [1]; lengths are in units of the distance of the Sun times
        the cube root of the planet's share of the mass.
      y: initial y, along the planet's motion [1].
      vx: initial vx, in the rotating frame [1].
      vy: initial vy, in the rotating frame [1].
      t1: span [1]; the planet circles the Sun once in 2 pi.
    """
    return Scene(Hill(), y0=jnp.stack([x, y, vx, vy]), t1=t1)
