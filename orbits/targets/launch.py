"""One throw: where it lands, and the derivative of that with respect to its angle or speed."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Annotated, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status, _text
from jaxdyn._checks import check_on_host, fail
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate import events
from jaxdyn.scene import check_scene
from orbits.targets.thrown import Down, ThrownSystem, Units, direction, rotate

# ---- The end of a throw dominated by drag: a steady fall, in a straight line
#
# A solver's steps would be limited by the relaxation time, and such a fall may last a billion of
# these. If the force does not depend on place and time, the steady fall is uniform and is not
# integrated.

_NEWTONS = 400  # Newton steps to the steady velocity; each at least halves the distance
_FORGOTTEN = 45.0  # relaxation times in which a steady velocity is reached, to e^-45 of the launch
#: Relaxation times, beyond twice those to the steady speed, in which rounding of the launch speed
#: is forgotten.
_ROUNDED = 6.0
_STEADY = 1e-5  # the squares of deviations below this share of the speed are rounding
_SAME_FORCE = 1e-12  # largest relative difference of accelerations where forces are the same
#: Parts of a steady fall at which its force is sampled.
_ON_THE_WAY = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 12), np.arange(1, 16) / 16])
#: Places in units of the throw's length, and times in units of that length over the launch speed.
_ELSEWHERE = (((1.0, 0.3), 0.0), ((0.01, 0.7), 0.0), ((-0.4, -0.1), 0.0), ((0.0, 0.0), 1.3))


class Fall(NamedTuple):
    """Relaxation of a throw to a steady fall.

    Attributes:
      memory: () relaxation time of the steady velocity [s]; infinite if there is none.
      settled: () time after which the fall is steady, to rounding [s]; infinite if the force
        depends on place or time.
    """

    memory: Array
    settled: Array


def fall_of(scene: Scene, launch: Array, length: Array) -> Fall:
    """The relaxation of a throw with a launch velocity (2,) [m/s] and a length () [m]."""
    down, speed = acceleration(scene, jnp.zeros(2)), jnp.linalg.norm(launch)
    g = jnp.linalg.norm(down)

    def newton(_, v):
        return v - _solve(_slope(scene, v), acceleration(scene, v))

    # From large speeds Newton's method always converges: drag grows with the speed.
    steady = jax.lax.fori_loop(0, _NEWTONS, newton, launch + speed * down / g)
    (a, b), (_, d) = slope = _slope(scene, steady)
    slowest = -0.5 * (a + d) - jnp.hypot(0.5 * (a - d), b)  # the smaller rate of the two
    known = (jnp.abs(acceleration(scene, steady)) <= _STEADY * g).all() & (slowest > 0)
    known = known & jnp.isfinite(slope).all()
    memory = jnp.where(known, 1 / jnp.where(known, slowest, 1.0), jnp.inf)
    excess = jnp.log1p(speed / (g * memory))
    # Rounding is kept in units that fade half as fast (`thrown.Units`).
    settled = memory * (excess + jnp.maximum(excess + _ROUNDED, _FORGOTTEN))
    return Fall(memory, jnp.where(_is_uniform(scene, launch, length), settled, jnp.inf))


class End(NamedTuple):
    """Where a steady fall ends, along the launch and across it.

    Attributes:
      t: () time [s]; NaN, like all other entries, if the throw does not land.
      r: (2,) displacement from the launch [m].
      v: (2,) velocity [m/s].
      lost: () whether the fall is not steady, so that its end is unknown.
    """

    t: Array
    r: Array
    v: Array
    lost: Array


def fall_end(scene: Scene, w: Array, height: Array, t: Array, r: Array, v: Array) -> End:
    """The end of the steady fall that a throw of course w reaches at r (2,) with v (2,)."""
    c, s = direction(w)

    def gain(v, r=r, t=t):
        return rotate(acceleration(scene, rotate(v, c, s), rotate(r, c, s), t), c, -s)

    slope = jax.jacfwd(gain)(v)
    off = _solve(slope, gain(v))
    steady = v - off
    # The remaining deviation of the velocity decays like exp(slope t), and displaces the point by
    # its integral.
    r = r - _solve(slope, off)
    up = jnp.stack([s, c])
    sinking = -jnp.sum(up * steady)
    comes = sinking > 0
    left = (height + jnp.sum(up * r)) / jnp.where(comes, sinking, 1.0)
    on_the_way = jax.vmap(lambda part: gain(steady, r + part * left * steady, t + part * left))
    gains = on_the_way(jnp.asarray(_ON_THE_WAY))
    size = _STEADY * jnp.linalg.norm(steady)
    lost = ~(jnp.linalg.norm(off) <= size)
    lost = lost | ~(jnp.abs(gains).max() <= _STEADY * jnp.linalg.norm(slope @ steady))
    left = jnp.where(comes & ~lost, left, jnp.nan)
    return End(t=t + left, r=r + steady * left, v=steady + 0.0 * left, lost=lost)


@functools.partial(jax.jit, inline=True)  # traced once for its many uses in a throw
def acceleration(scene: Scene, velocity: Array, place=0.0, t=0.0) -> Array:
    """(2,) acceleration of the point with a velocity, at a place relative to its launch [m/s^2]."""
    y = jnp.concatenate([scene.y0[:2] + place, velocity])
    return scene.rate(jnp.asarray(t, float), y)[2:]


def _slope(scene: Scene, velocity: Array) -> Array:
    return jax.jacfwd(lambda v: acceleration(scene, v))(velocity)


def _solve(matrix: Array, right: Array) -> Array:
    """(2,) solution of two linear equations."""
    (a, b), (c, d) = matrix
    return jnp.stack([d * right[0] - b * right[1], a * right[1] - c * right[0]]) / (a * d - b * c)


def _is_uniform(scene: Scene, velocity: Array, length: Array) -> Array:
    """() whether the force at sample places and times equals that at the launch."""
    here = acceleration(scene, velocity)
    time = length / jnp.linalg.norm(velocity)
    gaps = [
        jnp.abs(acceleration(scene, velocity, length * jnp.array(place), time * moment) - here)
        for place, moment in _ELSEWHERE
    ]
    return jnp.max(jnp.stack(gaps)) <= _SAME_FORCE * jnp.linalg.norm(here)


# ---- One throw: where it lands, and the derivative of that with respect to its angle or speed

RTOL = 1e-13
_PATIENCE = 100.0  # flights longer than this many times v / g count as endless
_STEPS = 20_000  # most steps of a flight; one that needs more is stiff
_TINY = np.finfo(float).tiny
_GRAIN = 16 * np.finfo(float).eps  # rounding of the speed, in any direction, as a share of it
_CHUNK = 64  # throws per call of the compiled program; fewer are padded
#: What derivatives are taken along: the course w = log tan(angle / 2), or log(speed).
BY_COURSE, BY_SPEED = np.eye(2)


class Landings(eqx.Module):
    """Where throws land; one entry per throw, NaN for a throw that does not.

    Attributes:
      x: (n,) distance from the launch along the first axis [m].
      t: (n,) time of flight [s].
      slope: (n,) derivative of x along a direction [m]; see `landings`.
      vx: (n,) velocity along the first axis on landing [m/s].
      vy: (n,) velocity along the second axis on landing [m/s].
      status: (n,) `jaxdyn.Status` codes of the integration.
    """

    x: np.ndarray
    t: np.ndarray
    slope: np.ndarray
    vx: np.ndarray
    vy: np.ndarray
    status: Annotated[np.ndarray, Status]

    __repr__ = _text.fields
    _repr_html_ = _text.html


def landings(
    scene: Scene,
    w,
    speed,
    rtol: float = RTOL,
    along: np.ndarray = BY_COURSE,
    *,
    height: float = 0.0,
) -> Landings:
    """Where throws of given courses and speeds land.

    The derivative is along one direction, known only at run time, since each use needs one. Both at
    once take half as long again to trace: `jax.jacfwd` traces all of the integration a second time,
    for a batch.

    Args:
      scene: see `check_throw`.
      w: (n,) courses log tan(angle / 2): -inf along the first axis, 0 straight up.
      speed: (n,) launch speeds [m/s], > 0.
      rtol: tolerance of the integrations.
      along: (2,) direction of the derivative, `BY_COURSE` or `BY_SPEED`.
      height: height of the launch above the ground [m], not negative.
    """
    w, log_speed = (np.array(x, float).ravel() for x in np.broadcast_arrays(w, np.log(speed)))
    numbers = np.asarray(rtol), np.asarray(height, float)
    return _in_chunks(functools.partial(_landings, scene, *numbers, along), w, log_speed)


def free_sine(scene: Scene, speed: np.ndarray) -> np.ndarray:
    """(n,) acceleration at rest over that at a launch along the first axis with each speed.

    Up to this sine of the launch angle, drag has no time to act.
    """
    return _in_chunks(functools.partial(_free_sines, scene), speed)


def _in_chunks(fn: Callable, *columns: np.ndarray):
    """The results of fn(counts, *columns) for columns (n,), with some rows in each call.

    `counts` says which rows are not padding: one shape, and so one compilation, serves any number
    of rows.
    """
    n, parts = len(columns[0]), []
    for i in range(0, n, _CHUNK):
        rows = np.arange(i, i + _CHUNK)
        part = fn(rows < n, *(column[np.minimum(rows, n - 1)] for column in columns))
        parts.append(jax.tree.map(lambda x: np.asarray(x), part))
    return jax.tree.map(lambda *parts: np.concatenate(parts)[:n], *parts)


def check_throw(scene: Scene, **numbers) -> Scene:
    """The scene, if it is a single point in the plane with a force at rest.

    Raises:
      ValueError: the scene, or one of the numbers, is traced; or the scene is of another kind.
    """
    for name, x in {"scene": scene, **numbers}.items():
        check_on_host(name, x, "Aim outside of jit, grad and vmap.")
    scene = check_scene(scene)
    system = scene.system
    if not (isinstance(system, FreePoints) and system.d == 2 and len(system.m) == 1):
        raise fail(
            "scene",
            "one free point in the plane",
            type(system).__name__,
            "Use scenes.cannonball() or scenes.particle(...).",
        )
    if not float(_pull(scene)) > 0:
        raise fail("scene", "a force on the point at rest", "none", "Add UniformGravity(9.81).")
    return scene


def angle_of(w):
    """Launch angle [rad] of a course."""
    return 2 * jnp.arctan(jnp.exp(w)) if isinstance(w, Array) else 2 * np.arctan(np.exp(w))


def launch(scene: Scene, angle: float, speed: float, t1: float) -> Scene:
    """The scene with its point thrown at an angle [rad] with a speed [m/s], over a span [s]."""
    velocity = speed * np.array([np.cos(angle), np.sin(angle)])
    return scene.starting(np.concatenate([np.asarray(scene.y0)[:2], velocity]), t1)


def _pull(scene: Scene) -> Array:
    """() magnitude of the acceleration of the point at rest [m/s^2]."""
    return jnp.linalg.norm(acceleration(scene, jnp.zeros(2)))


def _landing(scene: Scene, w: Array, log_speed: Array, rtol: Array, height: Array):
    speed = jnp.exp(log_speed)
    fall, units = jax.lax.stop_gradient(_scales(scene, w, speed, rtol, height))
    system = ThrownSystem(system=scene.system, origin=scene.y0[:2], course=w, units=units)
    start = jnp.zeros(4).at[2].set(speed / units.speeds(jnp.zeros(()))[0])
    # With a span much longer than the flight, the time of the flight would have no digits left.
    soon, patience = jax.lax.stop_gradient(_patience(scene, speed, height))
    longest = jnp.where(jnp.isfinite(fall.settled), jnp.minimum(fall.settled, soon), patience)
    throw = dataclasses.replace(scene, system=system, y0=start)
    down = Down(w, units.lengths, height)
    span = longest / units.time
    stop = events.until(throw, down, span, rtol=rtol, atol=rtol, max_steps=_STEPS)
    landed = stop.event >= 0
    r, v = system.position_and_velocity(stop.t, stop.y)
    t_end = stop.t * units.time
    end = fall_end(scene, w, height, t_end, r, v)
    falls = ~landed & jnp.isfinite(fall.settled)
    unsettled = end.lost | (fall.settled > soon)
    c, s = direction(w)

    def at_last(here, there):
        return jnp.where(landed, here, jnp.where(falls & ~unsettled, there, jnp.nan))

    t, x = at_last(t_end, end.t), at_last(rotate(r, c, s)[0], rotate(end.r, c, s)[0])
    vx, vy = at_last(rotate(v, c, s), rotate(end.v, c, s))
    lost = falls & unsettled & (stop.status == Status.OK)
    return x, (t, vx, vy, jnp.where(lost, jnp.int32(Status.STEP_LIMIT), stop.status))


def _patience(scene: Scene, speed: Array, height: Array) -> tuple[Array, Array]:
    """Times () [s] after which a throw has landed: if the force is uniform, and for any force."""
    pull = acceleration(scene, jnp.zeros(2))
    down, g = -pull[1], jnp.linalg.norm(pull)
    speed = jnp.hypot(speed, jnp.sqrt(2 * g * height))
    soon = jnp.where(down > 0, _PATIENCE * speed / jnp.where(down > 0, down, 1.0), jnp.inf)
    return soon, _PATIENCE * speed / g


def _scales(scene: Scene, w: Array, speed: Array, rtol: Array, height: Array) -> tuple[Fall, Units]:
    """The fall at the end of a throw, and the units of its state when it lands."""
    g, (cosine, sine) = _pull(scene), direction(w)
    launch = speed * jnp.stack([cosine, sine])
    # The length on which the force at the launch, or at rest if that is larger, uses up the speed.
    slowing = jnp.linalg.norm(acceleration(scene, launch))
    length = speed * speed / jnp.maximum(slowing, g)
    fall = fall_of(scene, launch, length)
    # A free throw comes down with this vertical speed, in units of the launch speed.
    sine = jnp.hypot(sine, jnp.sqrt(2 * g * height) / speed)
    last = jnp.minimum(g * fall.memory, jnp.maximum(speed, speed * sine))
    flat = jnp.minimum(length, speed * speed * sine / g)
    units = Units(
        lengths=flat * jnp.stack([jnp.ones_like(sine), sine]),
        last=jnp.stack([last * sine, jnp.minimum(last, speed * sine)]),
        grain=_GRAIN / rtol * speed * sine,
        memory=fall.memory,
        # Geometric mean of the times in which the force at the launch and gravity use up the speed.
        time=speed / g * jnp.sqrt(g / jnp.maximum(slowing, g)),
    )
    return fall, units


@jax.jit
def _free_sines(scene: Scene, counts: Array, speeds: Array) -> Array:
    del counts

    def along(speed):
        return jnp.linalg.norm(acceleration(scene, speed * jnp.array([1.0, 0.0])))

    ratio = _pull(scene) / jax.vmap(along)(speeds)
    return jnp.where(ratio > _TINY, ratio, _TINY)  # also where the acceleration overflows


@jax.jit
def _landings(scene: Scene, rtol: Array, height: Array, along, counts, w, log_speed) -> Landings:
    def one(throw):
        x, slope, rest = jax.jvp(
            lambda w, log_speed: _landing(scene, w, log_speed, rtol, height),
            throw,
            tuple(along),
            has_aux=True,
        )
        t, vx, vy, status = rest
        return Landings(x=x, t=t, slope=slope, vx=vx, vy=vy, status=status)

    # Its shapes are written out: to find them, `one` would have to be traced a second time.
    zero = jnp.zeros_like(w[0])
    blank = Landings(x=zero, t=zero, slope=zero, vx=zero, vy=zero, status=jnp.int32(0))

    def counted(row):
        counts, *throw = row
        return jax.lax.cond(counts, one, lambda _: blank, tuple(throw))

    # Throws run one after the other: each takes its own steps, in one fused loop.
    return jax.lax.map(counted, (counts, w, log_speed))


def are_followed(found: Landings) -> np.ndarray:
    """(n,) whether each throw was integrated to the ground, or does not come down."""
    return found.status == Status.OK
