"""Times and distances of closest approach of bodies that attract each other."""

import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import check_first
from jaxdyn.analysis.regularized import run_regularized
from jaxdyn.integrate.events import Event, until
from jaxdyn.integrate.spans import MAX_STEPS, RTOL, SolverOptions
from jaxdyn.integrate.trajectory import explanation
from jaxdyn.scene import Scene, System
from jaxdyn.status import IntegrationError, Status


class Approach(NamedTuple):
    """A closest approach of two points: time [s], their indices, distance [m]."""

    t: float
    pair: tuple[int, int]
    distance: float


@check_first
def closest_approaches(
    scene: Scene,
    t1=None,
    *,
    t0=0.0,
    samples: int = 5000,
    rtol: float = RTOL,
    max_steps: int = MAX_STEPS,
) -> list[Approach]:
    """Local minima of the distances between the bodies of a motion, the smallest first.

    Args:
      scene: see `regularize`.
      t1: () end time [s], after t0; the scene's own span by default.
      t0: () start time [s].
      samples: number of samples; two approaches of the same pair between two samples are missed.
      rtol: relative tolerance of one step.
      max_steps: largest number of steps.
    Raises:
      ValueError: see `simulate_regularized`.
      IntegrationError: the end was not reached.
    Example:
      >>> from jaxdyn import scenes
      >>> bodies = scenes.two_body().starting([-1.0, 0, 0.5, 0, 0, -0.2, 0, 0.1], 6.0)
      >>> [round(near.distance, 6) for near in closest_approaches(bodies)]
      [0.034527, 0.034527]
    """
    options = SolverOptions(rtol=rtol, max_steps=max_steps)
    slow, grid, run, _ = run_regularized(scene, t1, t0, samples, options, throw=True)
    n = scene.system.points(run.ys[0, -1], run.ys[0, :-2]).m.shape[0]
    found = []
    for i, j in itertools.combinations(range(n), 2):
        event = _Parting(slow.system, jnp.zeros(n).at[i].set(-1.0).at[j].set(1.0))
        value = np.asarray(jax.vmap(event.value)(grid, run.ys))
        for k in np.flatnonzero((value[:-1] < 0) & (value[1:] >= 0)):
            near = until(slow.starting(run.ys[k]), event, grid[k + 1], t0=grid[k], rtol=rtol)
            status = Status(int(near.status))
            if status != Status.OK:
                raise IntegrationError(explanation(status, scene))
            t, y = near.t, near.y
            if not near.happened:  # it is at one of the two samples, to rounding
                at = k if -value[k] < value[k + 1] else k + 1
                t, y = grid[at], run.ys[at]
            gap, _ = event.between(t, y)
            found.append(Approach(float(y[-1]), (i, j), float(jnp.linalg.norm(gap))))
    return sorted(found, key=lambda near: near.distance)


class _Parting(Event):
    """The distance of two points starts to increase."""

    system: System
    weights: Array  # (n,) -1 and 1 for the two: an array, so that all pairs share one program

    def between(self, t, y) -> tuple[Array, Array]:
        """The vector (d,) from one point to the other, and its rate."""
        r, v, _ = self.system.points(t, y)
        return jnp.sum(self.weights[:, None] * r, 0), jnp.sum(self.weights[:, None] * v, 0)

    def value(self, t, y):
        gap, rate = self.between(t, y)
        return jnp.sum(gap * rate)

    @property
    def direction(self):
        return 1
