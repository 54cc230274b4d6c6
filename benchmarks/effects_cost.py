"""What does composition cost: a step with more effects, pendulums against formulas by hand?

Run: ``python -m benchmarks effects-cost``. The first rows are the time of one step (16 stages)
of one particle on a spring with more and more effects: effects that a scene does not have cost
nothing. The others compare the composed double and triple pendulum (`scenes.pendula`) with
closed forms as in textbooks, in the same solver, at equal true error.

Last numbers (2 cores, 2026-11), minima: a step 0.6 to 1.0 us with one to five effects; double
pendulum at 1e-12 0.15 ms against 0.09 ms by hand (1.6), triple 0.22 against 0.21 ms (1.01), since
the pair evaluates both by their formulas; building and first run 1.9 s and 0.8 s against 1.2 s and
1.0 s.
"""

import functools
from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks._timing import Curves, Method, Row, Times, interleave, work_precision
from jaxdyn.effects import LinearDrag, PowerLaw, QuadraticDrag, Spring, UniformGravity
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.simulation import solve
from jaxdyn.scene import Effect, Scene, System
from jaxdyn.scenes.pendula import double_pendulum, triple_pendulum
from jaxdyn.solvers import VERNER9

#: True errors of the pendulums compared at.
ERRORS = (1e-6, 1e-9, 1e-12)
TOLERANCES = tuple(10.0**-e for e in np.arange(5.0, 14.5, 0.5))
_SPAN = 5.0  # the pendulums lose one digit (double) and two (triple) to their instability
_ROUNDS, _QUICK_ROUNDS = 200, 10


def run(quick: bool = False) -> list[Row | Curves]:
    """Time of a step with each list of effects, then the pendulums."""
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    found: list[Row | Curves] = [*_steps(rounds)]
    for name, make in (("double", double_pendulum), ("triple", triple_pendulum)):
        scenes = {"jaxdyn": make(), "by hand": by_hand(make())}
        # A separate program, so that the first runs of the others compile.
        truth = np.asarray(solve(make(formulation="lagrange"), _SPAN, rtol=1e-15).y1)
        methods = {key: Method(_runs(scene), TOLERANCES) for key, scene in scenes.items()}
        found.append(work_precision(f"{name} pendulum by hand", methods, truth, ERRORS, rounds))
    return found


def by_hand(composed: Scene) -> Scene:
    """The same pendulum with equal bars of unit mass and length by the closed form."""
    kind = {2: DoubleByHand, 3: TripleByHand}[composed.y0.size // 2]
    return Scene(kind(composed.effects[0].g), (), y0=composed.y0)


def _runs(scene: Scene):
    def build(tolerance: float):
        return lambda: np.asarray(solve(scene, _SPAN, rtol=tolerance).y1)

    return build


def _effects() -> dict[str, Effect]:
    """Effects on one particle, each list one effect longer than the one before.

    A function, since arrays made on import would start the device before `configure`.
    """
    return {
        "spring": Spring(2.0, 0.5),
        "gravity": UniformGravity(1.0),
        "linear drag": LinearDrag(0.1),
        "quadratic drag": QuadraticDrag(0.1),
        "central force": PowerLaw(1.0, -1.0),
    }


def _steps(rounds: int) -> list[Row]:
    """One row for each list of effects: seconds per step."""
    start = jnp.array([1.0, 0.5, 0.2, -0.3])
    scenes, effects = {}, ()
    for name, effect in _effects().items():
        effects = (*effects, effect)
        scenes[f"and {name}" if scenes else name] = Scene(FreePoints(1.0), effects, y0=start)
    # The general method for all of them, or those without drag would take another.
    ways = {
        name: functools.partial(solve, scene, 20.0, rtol=1e-12, solver=VERNER9)
        for name, scene in scenes.items()
    }
    steps = {name: int(way().steps + way().rejected) for name, way in ways.items()}
    runs = {name: (lambda way=way: np.asarray(way().y1)) for name, way in ways.items()}
    times: Mapping[str, Times] = interleave(runs, rounds)
    return [
        Row(f"a step: {name}", {"jaxdyn": Times(*(s / steps[name] for s in times[name]))})
        for name in ways
    ]


class _ByHand(System):
    """Equal uniform bars of unit mass and length; g () [m/s^2]."""

    g: jax.Array
    bars: ClassVar[int]

    def labels(self):
        angles = tuple((f"theta{i + 1}", "rad") for i in range(self.bars))
        return (*angles, *((f"{name}_dot", "rad/s") for name, _ in angles))


class DoubleByHand(_ByHand):
    """Two bars: 2 x 2 system solved by Cramer's rule."""

    bars: ClassVar[int] = 2

    def rate(self, t, y, effects):
        a, b, u, w = y
        c, s = 0.5 * jnp.cos(a - b), 0.5 * jnp.sin(a - b)
        first = -s * w * w - 1.5 * self.g * jnp.sin(a)
        second = s * u * u - 0.5 * self.g * jnp.sin(b)
        determinant = 4 / 9 - c * c
        x = (first / 3 - c * second) / determinant
        z = (4 / 3 * second - c * first) / determinant
        return jnp.stack([u, w, x, z])


class TripleByHand(_ByHand):
    """Three bars: 3 x 3 system solved by cofactors."""

    bars: ClassVar[int] = 3

    def rate(self, t, y, effects):
        a, b, c, u, v, w = y
        p, q = 1.5, 0.5
        x, y_, z = p * jnp.cos(a - b), q * jnp.cos(a - c), q * jnp.cos(b - c)
        sx, sy, sz = p * jnp.sin(a - b), q * jnp.sin(a - c), q * jnp.sin(b - c)
        f = -sx * v * v - sy * w * w - 2.5 * self.g * jnp.sin(a)
        h = sx * u * u - sz * w * w - 1.5 * self.g * jnp.sin(b)
        k = sy * u * u + sz * v * v - 0.5 * self.g * jnp.sin(c)
        m1, m2, m3 = 7 / 3, 4 / 3, 1 / 3
        c11, c12, c13 = m2 * m3 - z * z, y_ * z - x * m3, x * z - m2 * y_
        c22, c23, c33 = m1 * m3 - y_ * y_, x * y_ - m1 * z, m1 * m2 - x * x
        d = m1 * c11 + x * c12 + y_ * c13
        rates = (c11 * f + c12 * h + c13 * k, c12 * f + c22 * h + c23 * k)
        rates += (c13 * f + c23 * h + c33 * k,)
        return jnp.stack([u, v, w, *(rate / d for rate in rates)])
