"""Indicators that distinguish regular and chaotic motions, for many starts at once, on all cores.

`megno` is the quickest for a map, since it has the same value, 2, for all regular motions; `sali`
and `gali` fall to zero exponentially for chaotic motions. All are functions of a finite time: a
motion that looks regular may be chaotic with a rate below one over that time.
"""

import math
from typing import Annotated

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn.chaos.timed import Timed
from jaxdyn.ensemble import engine
from jaxdyn.ensemble.lanes import Ends
from jaxdyn.ensemble.watches import Until
from jaxdyn.integrate.flow import Variational
from jaxdyn.integrate.march import Watch
from jaxdyn.integrate.spans import host_floats
from jaxdyn.plan import plan_of
from jaxdyn.scales import sizes_at_start, sizes_at_starts
from jaxdyn.scene import Field, Scene, check_scene
from jaxdyn.status import Status
from jaxdyn.system import System

# ---- Systems that carry unit tangents with their motion, for ensembles
#
# A unit tangent u of a motion obeys u' = J u - (u . J u) u, with J the Jacobian of the rate: its
# length stays 1, so that it neither overflows nor underflows however long the motion is. Lengths
# are measured in the sizes of the entries, so that they do not depend on units. Rounding and the
# errors of steps are removed after each step (`System.project`). Quantities that are averaged along
# the motion are integrated as further entries of the state.


class Deviations(System):
    """A motion with unit tangents: the state is [y, u_1, ..., u_m, averages].

    Attributes:
      field: the field of the motion.
      sizes: (k,) sizes of the entries of its state.
      count: m, the number of tangents.
      averaged: whether the four averages of the first tangent follow (`_averages`).
    """

    field: Field
    sizes: Array
    count: int = eqx.field(static=True)
    averaged: bool = eqx.field(static=True, default=False)

    def labels(self):
        names = self.field.system.labels()
        tangents = [(f"{name}'{i}", "1") for i in range(self.count) for name, _ in names]
        averages = [(name, "1") for name in ("growth", "weighted", "mean", "time")]
        return (*names, *tangents, *(averages if self.averaged else ()))

    def rate(self, t, y, effects):
        del effects
        columns, averages = self.split(y)
        rates = Variational.of(self.field).rate(t, columns)
        u, growing = columns[:, 1:], rates[:, 1:]
        growth = jnp.sum(u * growing / self.sizes[:, None] ** 2, axis=0)
        turning = growing - u * growth[None, :]
        parts = [rates[:, 0], turning.T.ravel()]
        return jnp.concatenate([*parts, *self._averages(growth, averages)])

    def _averages(self, growth: Array, averages: Array) -> tuple[Array, ...]:
        """The rates of the averages: G' = g, P' = 2 s g, M' = P / s, s' = 1."""
        if not self.averaged:
            return ()
        _, weighted, _, s = averages
        start = s == 0
        mean = jnp.where(start, 0.0, weighted / jnp.where(start, 1.0, s))
        return (jnp.stack([growth[0], 2.0 * s * growth[0], mean, jnp.ones_like(s)]),)

    def project(self, t, y):
        columns, averages = self.split(y)
        columns = Variational.of(self.field).project(t, columns)
        u = columns[:, 1:]
        u = u / jnp.sqrt(jnp.sum((u / self.sizes[:, None]) ** 2, axis=0))[None, :]
        return jnp.concatenate([columns[:, 0], u.T.ravel(), averages])

    def undetermined(self, t, y):
        return self.field.undetermined(t, self.split(y)[0][:, 0])

    def loses(self, t0, y0, t1, y1):
        return self.field.loses(t0, self.split(y0)[0][:, 0], t1, self.split(y1)[0][:, 0])

    def split(self, y: Array) -> tuple[Array, Array]:
        """(k, 1 + m) the motion and its tangents as columns, and the averages."""
        columns = y[: len(y) - (4 if self.averaged else 0)]
        return columns.reshape(1 + self.count, -1).T, y[len(columns) :]


# ---- Indicators that distinguish regular and chaotic motions, for many starts, on all cores

#: Default relative tolerance of a step.
RTOL = 1e-10
#: Two tangents closer than this are aligned to double precision, and the run ends.
ALIGNED = 1e-14


class Megno(Timed):
    """The mean exponential growth of nearby orbits, for each start.

    Attributes:
      megno: (...) Y [1]: oscillates about 2 for quasi-periodic motions, and grows like L t for
        chaotic ones, with L the largest Lyapunov exponent.
      mean: (...) mean of Y since the start [1]: tends to 2 for quasi-periodic motions, and grows
        like L t / 2 for chaotic ones.
      exponent: (...) mean growth rate of the tangent [1/s], in 1 over the scene's unit of time;
        it tends to the largest Lyapunov exponent.
      time: (...) time since the start [s], in the scene's unit of time.
      status: (...) `Status` codes; numbers are NaN unless it is OK.
    """

    megno: Array
    mean: Array
    exponent: Array
    time: Array
    status: Annotated[Array, Status]

    __repr__ = _text.fields
    _repr_html_ = _text.html


class Alignment(Timed):
    """How far from parallel the tangents of a motion are at its end, for each start.

    Attributes:
      index: (...) SALI, between 0 and sqrt(2), or GALI, between 0 and 1 [1].
      time: (...) time since the start [s], in the scene's unit of time; a SALI below `ALIGNED`
        ends the run.
      status: (...) `Status` codes; numbers are NaN unless it is OK.
    """

    index: Array
    time: Array
    status: Annotated[Array, Status]

    __repr__ = _text.fields
    _repr_html_ = _text.html


@check_first
def megno(
    scene: Scene,
    starts=None,
    t1=None,
    *,
    t0=0.0,
    params: Scene | None = None,
    rtol: float = RTOL,
    progress: bool = False,
) -> Megno:
    """The MEGNO (mean exponential growth of nearby orbits) of many motions, on all cores.

    Y(t) = 2/t times the integral of (u . J u) s ds over 0 <= s <= t, with u a unit tangent in the
    sizes of the state's entries, J the Jacobian of the rate and s the time since the start.

    Args:
      scene: system and effects, shared by all motions.
      starts: (..., k) starts, with any number of axes, e.g. (a, b, k) for a map; by default the
        starts of `params`, or the scene's own.
      t1: () or (...) end time [s], after or before t0; the scene's own span by default.
      t0: () or (...) start time [s].
      params: the scene with a leading axis in the numbers that differ; see `ensemble.run`.
      rtol: relative tolerance of a step.
      progress: show a bar.
    Returns:
      The indicators, with the axes of `starts`; a motion that fails has a status and NaN.
    Raises:
      ValueError: the rate jumps with the state, as by dry friction; or see `ensemble.run`.
    Limits: host only, no derivatives. The value is 2 for tangents that grow in proportion to time;
      it tends to 0 where frequencies do not depend on the amplitude (a harmonic oscillator), and
      becomes negative where motions are attracted.
    Reference: Cincotta & Simo (2000), Astron. Astrophys. Suppl. 147, 205; Gozdziewski, Bois,
      Maciejewski & Kiseleva-Eggleton (2001), Astron. Astrophys. 378, 569.
    Example:
      >>> from jaxdyn import chaos, scenes
      >>> swing = chaos.megno(scenes.pendulum(angle=2.0), t1=1000.0)
      >>> abs(float(swing.mean) - 2.0) < 0.05
      True
    """
    run = _Run(scene, params, 1, averaged=True)
    ends, shape = run.run_all(starts, t0, t1, rtol, progress)
    growth, weighted, mean, time = np.moveaxis(ends.y1[:, -4:], -1, 0)
    with np.errstate(invalid="ignore"):
        values = (weighted / time, mean / time, growth / np.abs(time), np.abs(time), ends.status)
    return Megno(*(x.reshape(shape) for x in values), time_unit=_text.second(scene.labels()))


@check_first
def sali(
    scene: Scene,
    starts=None,
    t1=None,
    *,
    t0=0.0,
    params: Scene | None = None,
    rtol: float = RTOL,
    progress: bool = False,
) -> Alignment:
    """The smaller alignment index min(|u1 + u2|, |u1 - u2|) of many motions, on all cores.

    It falls like exp(-(L1 - L2) t) for chaotic motions, L1 and L2 being the two largest Lyapunov
    exponents. On a torus of two or more frequencies it stays of order one; for periodic motions,
    and where there is one degree of freedom only, it falls like a power of t.

    Args:
      scene: as for `megno`, like all other arguments.
      starts: (..., k) starts.
      t1: () or (...) end time [s].
      t0: () or (...) start time [s].
      params: the scene with a leading axis in the numbers that differ.
      rtol: relative tolerance of a step.
      progress: show a bar.
    Returns:
      The index at the end, and the time, which is shorter where the tangents became parallel.
    Raises:
      ValueError: see `ensemble.run`.
    Reference: Skokos (2001), J. Phys. A 34, 10029.
    Example:
      >>> from jaxdyn import chaos, scenes
      >>> found = chaos.sali(scenes.lorenz(), t1=100.0)
      >>> float(found.index) < 1e-12, float(found.time) < 100.0
      (True, True)
    """
    run = _Run(scene, params, 2)
    ends, shape = run.run_all(starts, t0, t1, rtol, progress, run.parallel())
    u = run.tangents(ends)
    index = np.minimum(*(np.linalg.norm(u[:, 0] + s * u[:, 1], axis=1) for s in (1, -1)))
    return _alignment(scene, index, ends, t0, shape)


@check_first
def gali(
    scene: Scene,
    starts=None,
    t1=None,
    *,
    count: int,
    t0=0.0,
    params: Scene | None = None,
    rtol: float = RTOL,
    progress: bool = False,
) -> Alignment:
    """The generalised alignment index: the volume that `count` unit tangents span at the end.

    On a torus of s dimensions it stays of order one for count <= s and falls like a power of t
    above; for chaotic motions it falls exponentially.

    Args:
      scene: as for `megno`, like all arguments that are not described here.
      starts: (..., k) starts.
      t1: () or (...) end time [s].
      count: number of tangents, between 2 and the number of entries of the state.
      t0: () or (...) start time [s].
      params: the scene with a leading axis in the numbers that differ.
      rtol: relative tolerance of a step.
      progress: show a bar.
    Raises:
      ValueError: `count` is out of range, or see `ensemble.run`.
    Limits: below some 1e-14 the index is rounding.
    Reference: Skokos, Bountis & Antonopoulos (2007), Physica D 231, 30.
    Example:
      >>> from jaxdyn import chaos, scenes
      >>> float(chaos.gali(scenes.lorenz(), t1=20.0, count=3).index) < 1e-8
      True
    """
    _checks.whole("count", count, 2, len(check_scene(scene).y0))
    run = _Run(scene, params, count)
    ends, shape = run.run_all(starts, t0, t1, rtol, progress)
    u = run.tangents(ends)
    lost = np.isnan(np.sum(u, axis=(1, 2)))
    stretches = np.linalg.svd(np.where(lost[:, None, None], 0.0, u), compute_uv=False)
    index = np.where(lost, math.nan, np.prod(stretches, axis=1))
    return _alignment(scene, index, ends, t0, shape)


def _alignment(
    scene: Scene, index: np.ndarray, ends: Ends, t0, shape: tuple[int, ...]
) -> Alignment:
    time = np.abs(ends.t - np.ravel(t0))
    values = (x.reshape(shape) for x in (index, time, ends.status))
    return Alignment(*values, time_unit=_text.second(scene.labels()))


class _Parallel(eqx.Module):
    """Whether the two tangents of a state are parallel or opposite up to rounding."""

    system: Deviations

    def __call__(self, t: Array, y: Array) -> Array:
        del t
        u = self.system.split(y)[0][:, 1:] / self.system.sizes[:, None]
        sides = jnp.stack([u[:, 0] + u[:, 1], u[:, 0] - u[:, 1]])
        return jnp.min(jnp.sum(sides**2, axis=1)) < ALIGNED**2 * jnp.sum(u[:, 0] ** 2)


#: Newton steps to a surface, the distance from it in sizes that counts as none, and the part of a
#: rate above which its change there is a jump.
_STEPS, _ON_SURFACE, _JUMP = 8, 1e-9, 1e-6


def _check_no_jump(scene: Scene, t: float) -> None:
    """Raise ValueError if the rate jumps with the state: tangents jump there as well.

    Each surface of a condition is sought from the start; the rates on its two sides are compared.
    """
    field, y0 = scene.field, np.asarray(scene.y0)
    plan, sizes = plan_of(field, len(y0)), sizes_at_start(scene, t)
    here = plan.evaluate(field, t, y0)[1].outcomes if plan.on_state else None
    for i in np.flatnonzero(~plan.of_time):

        def margin(x, i=i):
            return plan.evaluate(field, t, sizes * x, here)[1].margins[i]

        x, along = y0 / sizes, jax.jit(jax.value_and_grad(margin))
        for _ in range(_STEPS):
            value, slope = map(np.asarray, along(x))
            square = np.sum(slope**2)
            x = x - value * slope / np.where(square > 0, square, 1.0)
        if not abs(float(along(x)[0])) <= _ON_SURFACE * np.sqrt(square):
            continue
        _, conditions = plan.evaluate(field, t, sizes * x, here)
        other = jnp.where(np.arange(plan.size) == i, conditions.beyond, here)
        one, two = (
            np.asarray(plan.evaluate(field, t, sizes * x, side)[0]) / sizes
            for side in (here, other)
        )
        if np.abs(two - one).max() > _JUMP * np.maximum(np.abs(one), np.abs(two)).max():
            remedy = (
                "Tangents jump where it does: use jaxdyn.lyapunov_exponents, which counts that."
            )
            raise _checks.fail("scene", "a rate that does not jump with the state", "one", remedy)


class _Run:
    """Motions of a scene with their tangents, in an ensemble."""

    def __init__(self, scene: Scene, params: Scene | None, count: int, averaged: bool = False):
        _checks.check_on_host("scene", (scene, params))
        self.scene, self.params = check_scene(scene), params
        self.count, self.averaged = count, averaged
        self.sizes = np.zeros((0, len(self.scene.y0)))  # (n, k), set by `run_all`

    def system(self, sizes: np.ndarray, scene: Scene | None = None) -> Deviations:
        """The system of a scene with its tangents, whose entries have sizes (k,), or (n, k)."""
        field = (scene or self.scene).field
        return Deviations(field, jnp.asarray(sizes), self.count, self.averaged)

    def parallel(self) -> Until:
        """The watch that ends a run where two tangents become parallel."""
        return Until(_Parallel(self.system(sizes_at_start(self.scene))))

    def run_all(
        self, starts, t0, t1, rtol: float, progress: bool, watch: Watch | None = None
    ) -> tuple[Ends, tuple[int, ...]]:
        """The ends of all motions along one axis, and the axes of the starts."""
        _checks.check_untraced("starts and times", (starts, t0, t1, rtol))
        own = self.scene if self.params is None else self.params
        starts = host_floats(own.y0 if starts is None else starts, "starts")
        k = len(self.scene.y0)
        _checks.check_shape("starts", starts.shape[-1:], (k,), "The last axis is the state's.")
        shape, flat = starts.shape[:-1], starts.reshape(-1, k)
        _check_no_jump(self.scene, float(np.ravel(t0)[0]))
        t1 = own.t1 if t1 is None else t1
        # Starts may be NaN, but the scene's own is not.
        every = np.concatenate([self.scene.y0[None], flat])
        start, end = (np.ravel(t).mean() for t in (t0, t1))
        mine = sizes_at_starts(self.scene, every[:1], start, end)
        self.sizes = sizes_at_starts(self.scene, flat, start, end, self.params)
        sizes = np.concatenate([mine, self.sizes])
        first, *_ = whole = self._with_tangents(every, sizes)
        template = Scene(self.system(sizes[0]), y0=first, t1=self.scene.t1)
        system = self.system(sizes[1:], self.params)
        numbers = Scene(system, y0=first, t1=self.scene.t1)
        ends = engine.run(
            template,
            whole[1:],
            np.ravel(t1) if np.ndim(t1) else t1,
            params=numbers,
            t0=np.ravel(t0) if np.ndim(t0) else t0,
            rtol=rtol,
            watch=watch,
            progress=progress,
        )
        return ends, shape

    def tangents(self, ends: Ends) -> np.ndarray:
        """(n, m, k) unit tangents at the ends, in units of the sizes."""
        n, k = len(ends.y1), len(self.scene.y0)
        tangents = np.asarray(ends.y1)[:, k : k * (1 + self.count)].reshape(n, self.count, k)
        return tangents / self.sizes[:, None]

    def _with_tangents(self, starts: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """The starts (n, k) with generic tangents, which are the same for all in their sizes."""
        n, k = starts.shape
        u = np.random.default_rng(0).normal(size=(self.count, k)) * sizes[:, None]
        averages = np.zeros((n, 4 if self.averaged else 0))
        # The projection makes them unit tangents along the constraints.
        whole = np.concatenate([starts, u.reshape(n, -1), averages], axis=1)
        return np.asarray(_project(self.system(sizes), whole))


@jax.jit
def _project(system: Deviations, states: Array) -> Array:
    def project(sizes, y):
        return eqx.tree_at(lambda s: s.sizes, system, sizes).project(jnp.zeros(()), y)

    return jax.vmap(project)(system.sizes, states)
