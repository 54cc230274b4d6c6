"""Motions with corners: starts in contact, infinitely many bounces, a corner of a box, a stop.

They are compared with closed forms: the times of the bounces are a geometric series, and a car that
brakes in a straight line decelerates uniformly. For a cylinder that slides down a fixed one, too
slow in spin to roll, the squared angular velocity u about the fixed axis at an angle theta
satisfies the linear equation

    du / dtheta = 2 mu u + 2 (g / L) (sin theta - mu cos theta),    N = m (g cos theta - L u),

with L the distance of the axes. Time and spin are integrals over theta.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.hard.case import Case, Figure, relative_error
from jaxdyn.integrate.events import Reaches
from jaxdyn.integrate.phase import END, Exit, Phase
from jaxdyn.integrate.phases import simulate_phases
from jaxdyn.scenes.corners import phases_of
from jaxdyn.scenes.cylinders import cylinder_on_cylinder
from jaxdyn.scenes.particles import cannonball, particle
from jaxdyn.scenes.wheels import braking, car
from jaxdyn.status import Status

_G = 10.0
_UP = 5.0  # initial vertical velocity [m/s]
_SLOW = 1e-8  # speed below which a ball no longer bounces [m/s]


class Bounce(eqx.Module):
    """The state with the vertical velocity reversed and reduced."""

    keeps: Array

    def __call__(self, t: Array, y: Array) -> Array:
        """The state (4,) after the bounce."""
        del t
        return y.at[3].multiply(-self.keeps)


class RestOrBounce(eqx.Module):
    """The choice whether a ball stays on the floor: 1 for END, 0 to bounce."""

    speed: Array

    def __call__(self, t: Array, y: Array) -> Array:
        """The number of the next phase."""
        del t
        return jnp.where(y[3] < self.speed, 1, 0)


def bouncing_ball(keeps: float) -> dict[str, Phase]:
    """A ball that keeps a fraction of its speed at each bounce, and finally comes to rest."""
    lands = Reaches(1, 0.0, -1)
    rest = RestOrBounce(jnp.asarray(_SLOW))
    landing = Exit(event=lands, to=("fly", END), change=Bounce(jnp.asarray(keeps)), choose=rest)
    return {"fly": Phase(cannonball(g=_G), (landing,))}


def _bounces() -> tuple[Figure, ...]:
    keeps = 0.8
    chain = simulate_phases(bouncing_ball(keeps), "fly", [0.0, 0.0, 1.0, _UP], 1e3, samples=2)
    flights = 2 * _UP / _G * keeps ** np.arange(len(chain.times))
    zeno = 2 * _UP / _G / (1 - keeps)
    return (
        Figure("times of the bounces", relative_error(chain.times, np.cumsum(flights)), 1e-10),
        Figure("end of infinitely many bounces", relative_error(chain.t, zeno), 1e-8),
        Figure("phases", len(chain.names), 100),
        Figure("no clear end", float(not chain.ended), 0),
        Figure("deepest under the floor [m]", float(max(-p.ys[:, 1].min() for p in chain.pieces))),
    )


def _brake() -> tuple[Figure, ...]:
    speed, mu, g = 20.0, 0.7, 9.81
    scene = car(locked="rear", spin=0.0, mu=mu, g=g, speed=speed)
    chain = simulate_phases(braking(scene), "slide", scene.y0, 60.0, samples=2)
    slows = mu * g * 1.2 / 2.6  # 1.2 / 2.6 of the weight is on the rear axle
    return (
        Figure("time of the stop", relative_error(chain.t, speed / slows), 1e-14),
        Figure("way of the stop", relative_error(chain.y[0], speed**2 / (2 * slows)), 1e-13),
        Figure("speed after it [m/s]", float(jnp.max(jnp.abs(chain.y[3:]))), 0),
        Figure("phases", len(chain.names), 1),
    )


class Reflected(eqx.Module):
    """The state with one of the two velocities reversed."""

    entry: int = eqx.field(static=True)

    def __call__(self, t: Array, y: Array) -> Array:
        """The state (4,) after the reflection."""
        del t
        return y.at[2 + self.entry].multiply(-1.0)


def box(one_sided: bool) -> dict[str, Phase]:
    """A ball in a unit square; its walls are bounds, or events in both directions."""
    walls = tuple(
        Exit(Reaches(entry, level, way if one_sided else 0), "box", Reflected(entry))
        for entry in (0, 1)
        for level, way in ((0.0, -1), (1.0, 1))
    )
    return {"box": Phase(particle(), walls)}


def _corner() -> tuple[Figure, ...]:
    """The figures of a ball on a diagonal of the square: each corner sends it back on its path."""
    figures = []
    for one_sided, walls in ((True, "bounds"), (False, "walls of two sides")):
        chain = simulate_phases(box(one_sided), "box", [0.5, 0.5, 1.0, 1.0], 40.0, samples=2)
        ends = np.stack([piece.ys[-1, :2] for piece in chain.pieces])
        back = float(jnp.max(jnp.abs(chain.y - jnp.array([0.5, 0.5, 1.0, 1.0]))))
        figures += [
            Figure(f"{walls}: ball at the end [m]", back, 1e-12),
            Figure(
                f"{walls}: farthest outside [m]", float(np.max(np.abs(ends - 0.5))) - 0.5, 1e-12
            ),
            Figure(f"{walls}: corners missed", abs(len(chain.pieces) - 41), 0),
        ]
    return tuple(figures)


def _endless() -> tuple[Figure, ...]:
    keeps = 0.5
    landing = Exit(Reaches(1, 0.0, -1), "fly", Bounce(jnp.asarray(keeps)))
    phases = {"fly": Phase(cannonball(g=_G), (landing,))}
    chain = simulate_phases(phases, "fly", [0.0, 0.0, 1.0, _UP], 9.0, samples=2)
    zeno = 2 * _UP / _G / (1 - keeps)
    return (
        Figure("end of infinitely many bounces", relative_error(chain.t, zeno), 1e-14),
        Figure("height there [m]", abs(float(chain.y[1])), 1e-14),
        Figure("not called stuck", float(chain.status != Status.STUCK), 0),
    )


#: Coefficients of friction and initial angles of cylinders that cannot roll at the start.
_SLIDES = ((0.0, 0.1), (0.02, 0.1), (0.4, 1.2))
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(80)


def _slides() -> tuple[Figure, ...]:
    figures = []
    for mu, start in _SLIDES:
        scene = cylinder_on_cylinder(mu=mu, theta=start, g=_G, t1=2.0)
        chain = simulate_phases(phases_of(scene), None, scene.y0, 2.0, samples=2, rtol=1e-13)
        wrong = chain.names[:2] != ("slip_on", "fly")
        x, y = chain.pieces[0].ys[-1, :2]
        found = (jnp.arctan2(x, y), chain.times[0], chain.pieces[0].ys[-1, 5])
        case = f"mu = {mu}, theta = {start}: "
        figures += [Figure(case + "phases of the wrong kind", float(wrong), 0)]
        for what, got, exact in zip(
            ("angle", "time", "spin"), found, _leaving(mu, start, 1.5, 0.5), strict=True
        ):
            error = abs(float(got) - exact) / max(exact, 1.0)
            figures.append(Figure(f"{case}{what} where it leaves", error, 1e-10))
    return tuple(figures)


def _leaving(mu: float, start: float, far: float, r: float) -> tuple[float, float, float]:
    """The angle, time and spin at which a solid cylinder, sliding from rest, leaves a fixed one."""
    scale = _G / far / (1 + 4 * mu * mu)

    def even(theta):
        return scale * ((4 * mu * mu - 2) * np.cos(theta) - 6 * mu * np.sin(theta))

    def square(theta):
        return even(theta) - even(start) * np.exp(2 * mu * (theta - start))

    def push(theta):  # N / m
        return _G * np.cos(theta) - far * square(theta)

    low, high = start, np.pi / 2
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if push(middle) > 0 else (low, middle)
    # theta = start + s^2 removes the singularity of dtheta / sqrt(u).
    s = np.sqrt(low - start) * (1 + _NODES) / 2
    theta = start + s * s
    dt = _WEIGHTS * np.sqrt(low - start) * s / np.sqrt(square(theta))
    return low, float(np.sum(dt)), float(np.sum(dt * 2 * mu * push(theta) / r))


CASES = (
    Case(
        "contact-starts",
        "A cylinder on a cylinder that cannot roll at its start slips, and then flies.",
        _slides,
    ),
    Case("corner", "A ball that runs into the corner of a box stays in it.", _corner),
    Case(
        "endless", "Bounces without a phase of rest end with a status, above the floor.", _endless
    ),
    Case("zeno", "A ball bounces infinitely often in finite time, and comes to rest.", _bounces),
    Case("braking-to-rest", "A car slides until it stands still, and stays there.", _brake),
)
