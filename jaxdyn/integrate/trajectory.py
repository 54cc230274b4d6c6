"""What a simulation returns: a motion at sampled times, or a batch, and how accurate it is."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn.integrate.errors import Estimate
from jaxdyn.integrate.flow import flow
from jaxdyn.integrate.march import Limits
from jaxdyn.integrate.spans import of_samples
from jaxdyn.plan import plan_of
from jaxdyn.scales import groups
from jaxdyn.scene import Scene
from jaxdyn.solvers import Method, default_solver
from jaxdyn.status import IntegrationError, Status
from jaxdyn.system import Record, System

_STIFF_WARNING = (
    "The scene is stiff: stability, not accuracy, limited the steps of the explicit method. "
    "Pass solver=solvers.RADAU9."
)
_SWITCHED_WARNING = (
    "The scene is stiff: stability, not accuracy, limited the steps of the explicit method, so "
    "RADAU9, which is implicit, took over. Pass solver=solvers.RADAU9 to begin with it."
)
_LONG_STEPS_WARNING = (
    "Steps of fixed length are too long for parts of the motion: adaptive steps disagree. "
    "Make dt smaller, or leave out the solver to use adaptive steps."
)
_MAX_STEP_MISMATCH = 0.05  # part of a step's displacement: with more the step is meaningless
_CHECK_RTOL, _CHECK_STEPS = 1e-6, 10_000  # tolerance and most of the adaptive steps to compare with
T = TypeVar("T")


class Motion:
    """How a motion, of one piece or of several phases, is written to files and shown.

    The methods lead to folders above this one, which are loaded when they are called.
    """

    def save(self, path: str | Path) -> None:
        """Write the motion with its scene to a file, atomically; `jaxdyn.load` reads it.

        Every number comes back to the bit. NumPy reads the file too: ``numpy.load(path)["ys"]``.
        Files hold no functions: give `jaxdyn.load` the scene again if it holds one, as `ode` does.

        Args:
          path: path of the .npz file.
        Raises:
          ValueError: `path` cannot be written, or the method of fixed step is not one of
            `jaxdyn.solvers`.
        """
        from jaxdyn.files import motion_files

        motion_files.save(path, self)

    def to_pandas(self):
        """The samples as a pandas DataFrame: a row for each time, a column for each entry.

        The index is the time "t"; of a batch, the number of the motion along each of its axes
        and the time. ``frame.attrs["units"]`` has the unit of each column. A motion in phases has
        a column "phase" as well; after the last exit that is "end".

        Returns:
          The frame; NaN where a motion was not reached, and for entries that a phase lacks.
        Raises:
          ValueError: pandas is not installed, or values are traced.
        """
        from jaxdyn.files import data_frames

        return data_frames.frame(self)

    def to_xarray(self):
        """The samples as an xarray Dataset: a variable for each entry, along the time "t".

        A batch has an axis "motion" for each of its axes, and one "sample", along which the times
        of each motion are the coordinate "t". A motion in phases has the coordinate "phase";
        after the last exit that is "end". ``attrs["units"]`` of each has its unit.

        Returns:
          The data set; NaN where a motion was not reached, and for entries that a phase lacks.
        Raises:
          ValueError: xarray is not installed, or values are traced.
        """
        from jaxdyn.files import data_frames

        return data_frames.dataset(self)

    def play(self, path=None):
        """A page that plays the motion, in a notebook or a browser: see `jaxdyn.player.play`.

        Args:
          path: a file to write the page to, .html; it needs no other file.
        Raises:
          ValueError: the motion is a batch, has fewer than two samples or nothing to draw, or
            `path` cannot be written.
        """
        from jaxdyn.player import pages

        return pages.play(self, path)

    @_text.with_picture
    def _repr_html_(self):
        from jaxdyn.drawing import space

        return space.overview(self)


class Trajectory(Record, Motion):
    """A motion of a scene at sampled times, or a batch of them.

    ``jax.vmap`` of a function that simulates returns a batch: every array, including those of the
    scene, has the batch axes in front of its own.

    Attributes:
      scene: the scene that was simulated.
      ts: (s,) sample times [s].
      ys: (s, k) states there; NaN where not reached.
      steps: () accepted steps.
      rejected: () rejected steps.
      status: () `Status` code.
      stiff: () whether stability, not accuracy, limited the steps of an explicit method.
      switched: () whether `RADAU9` took over for that reason.
      error: the accuracy estimate, if ``digits`` were requested.
      dt: () signed length of its steps, where it is fixed [s].
      method: the method, where its steps have fixed length.

    Example:
      >>> from jaxdyn import scenes, simulate
      >>> print(simulate(scenes.oscillator(), 1.0, samples=5))
      Trajectory of oscillator
        span     0 to 1 s
        samples  5
        steps    3 accepted, 0 rejected
        status   OK: The integration reached its end.
        end      x = 0.540302 m, vx = -0.841471 m/s
    """

    scene: Scene
    ts: Array
    ys: Array
    steps: Array
    rejected: Array
    status: Array
    stiff: Array | bool = False
    switched: Array | bool = False
    error: Estimate | None = None
    dt: Array | None = None
    method: Method | None = eqx.field(static=True, default=None)

    @_text.never_raising
    def __repr__(self) -> str:
        shape, one = self.batch_shape, self.one(*(0 for _ in self.batch_shape))
        labels, n = one.scene.labels(), self.ts.shape[-1]
        head = f"Trajectory of {_text.title_of(one.scene)}"
        batch = ("batch", f"of shape {shape}" if shape else "")
        if _checks.is_traced((self.ts, self.ys, self.status)):
            return _text.table(head, [batch, ("samples", f"{n}, traced")])
        begin, end = (_text.extent(np.asarray(self.ts)[..., i]) for i in (0, -1))
        status = f"{self.status_code.name}: {self.message}"
        if shape:
            right = f"{np.sum(np.asarray(self.status) == Status.OK)} of {np.size(self.status)} OK"
            status = right if self.ok else f"{right}, the worst {status}"
        steps = f"{_text.extent(self.steps)} accepted, {_text.extent(self.rejected)} rejected"
        rows = [
            batch,
            ("span", f"{begin} to {end} {_text.second(labels)}".rstrip()),
            ("samples", str(n)),
            ("steps", steps),
            ("status", status),
            ("end", "" if shape else _text.entries(labels, np.asarray(self.ys)[-1])),
        ]
        return _text.table(head, rows)

    @property
    def ok(self) -> bool:
        """Whether the end was reached; host only."""
        return bool((np.asarray(self.status) == Status.OK).all())

    @property
    def message(self) -> str:
        """What happened and what to do about it; host only."""
        return explanation(self.status_code, self.scene)

    @property
    def status_code(self) -> Status:
        """The status as a `Status`, the worst of a batch; host only."""
        return Status(int(np.asarray(self.status).max()))

    @property
    def warning(self) -> str:
        """Warnings and their remedies; empty if there are none; host only."""
        stiff = np.any(np.asarray(self.stiff) & ~np.asarray(self.switched))
        parts = [_STIFF_WARNING] if stiff else []
        parts += [_SWITCHED_WARNING] if np.any(self.switched) else []
        checkable = self.method is not None and self.ok
        parts += [_LONG_STEPS_WARNING] if checkable and not np.all(_steps_agree(self)) else []
        one = self.one(*(0 for _ in self.batch_shape)).scene
        parts += filter(None, [_beyond(self, one.system)])
        parts += filter(None, [plan_of(one.field, len(one.y0)).caveat])
        parts += [self.error.shortfall] if self.error and self.error.shortfall else []
        return " ".join(parts)

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """The axes of a batch, (b,) or more; () for one motion."""
        return np.shape(self.ts)[:-1]

    def one(self, *index: int) -> "Trajectory":
        """One motion of a batch."""
        if len(index) != len(self.batch_shape):
            wanted = f"a number for each axis of the batch, {self.batch_shape}"
            raise _checks.fail("index", wanted, index)
        return jax.tree.map(lambda x: x[index], self) if index else self

    def __getitem__(self, name: str) -> Array:
        """(s,) values of a labelled entry of the state, e.g. ``motion["x"]``; (b, s) of a batch."""
        system = self.one(*(0 for _ in self.batch_shape)).scene.system
        names = [label for label, _ in system.labels()]
        i, ys = names.index(_checks.choice("label", name, names)), self.ys
        # It is done on the host: indexing on the device compiles for each number of samples.
        return ys[..., i] if _checks.is_traced(ys) else jax.device_put(np.asarray(ys)[..., i])

    @property
    def y1(self) -> Array:
        """(k,) state at the last sample; (b, k) of a batch."""
        return self.ys[..., -1, :]

    @property
    def r(self) -> Array:
        """(s, n, d) positions of the material points [m]; (b, s, n, d) of a batch."""
        return _positions(self)


def each_motion(function: Callable[..., T]) -> Callable[..., T]:
    """Decorate a function of a motion to accept batches; results get the batch axes."""

    @functools.wraps(function)
    def of_each(motion: Trajectory, *args, **kwargs) -> T:
        if not motion.batch_shape:
            return function(motion, *args, **kwargs)
        return eqx.filter_vmap(lambda one: of_each(one, *args, **kwargs))(motion)

    return of_each


def single(motion: Trajectory) -> Trajectory:
    """The motion; raises ValueError for a batch."""
    if motion.batch_shape:
        got = f"a batch of them, {motion.batch_shape}"
        remedy = "Take one motion of the batch: batch.one(0)."
        raise _checks.fail("motion", "one motion", got, remedy)
    return motion


@each_motion
@of_samples
@eqx.filter_jit
def _positions(motion: Trajectory) -> Array:
    return jax.vmap(lambda t, y: motion.scene.system.points(t, y).r)(motion.ts, motion.ys)


#: A sample has passed a bound if it is beyond it by more than this part of the largest distance
#: from it (the second for the last sample, which may be on the bound) and, as in a small bounce,
#: this number of roundings of the state.
_PASSED, _LAST_PASSED, _PASSED_ROUNDINGS = 1e-6, 1e-3, 64


@each_motion
@of_samples
@eqx.filter_jit
def _bounds(motion: Trajectory) -> dict[str, tuple[Array, Array]]:
    """(s,) distances from the bounds of a system's equations, and their errors by rounding."""
    scene = motion.scene

    def at_one(t, y):
        def distances(y):
            return scene.system.bounds(t, y, scene.effects)

        unit = _PASSED_ROUNDINGS * jnp.finfo(y.dtype).eps * jnp.abs(y)
        by_state = jax.jacfwd(distances)(y)
        return {name: (x, jnp.abs(by_state[name]) @ unit) for name, x in distances(y).items()}

    return jax.vmap(at_one)(motion.ts, motion.ys)


def _beyond(motion: Trajectory, system: System) -> str:
    """A warning where samples pass a bound of the equations; "" where none does; host only."""
    if type(system).bounds is System.bounds:
        return ""
    share = np.full(motion.ts.shape[-1], _PASSED)
    share[-1:] = _LAST_PASSED
    for name, found in _bounds(motion).items():
        x, rounding = (np.nan_to_num(np.asarray(part)) for part in found)
        least = share * np.abs(x).max(axis=-1, keepdims=True) + rounding
        beyond = (x < -least) & (np.maximum.accumulate(x, axis=-1) > least)
        if beyond.any():
            at = float(np.asarray(motion.ts)[beyond][0])
            return (
                f"At t = {at:.4g} the motion is beyond {name}, where its equations do not hold. "
                "Run it through its phases: jaxdyn.integrate.phases.simulate_phases("
                "scenes.phases_of(scene), None, scene.y0, t1)."
            )
    return ""


#: Distance from a start, relative to each entry, at which a rate that is NaN there is evaluated.
_BESIDE = 1e-6


def explanation(status: Status, scene: Scene) -> str:
    """What a status means, and the singularities of the scene where one of them may be near."""
    if status == Status.NOT_FINITE and _is_removable(scene):
        return (
            f"{status.message} The rate is 0/0 at the start and finite beside it. Write the "
            "quotient as its series there, so that it has derivatives: x / expm1(x) as "
            "jnp.where(near, 1 - x / 2 + x**2 / 12 - x**4 / 720, s / jnp.expm1(s)) with near = "
            "abs(x) < 1e-2 and s = jnp.where(near, 1.0, x)."
        )
    # Rounding decides whether steps collapse at a singularity or become too many near it.
    singular = status in (Status.STEP_COLLAPSED, Status.NOT_FINITE, Status.STEP_LIMIT)
    said = f"{status.message} {scene.singular}".strip() if singular else status.message
    sizes = groups(scene.system)
    if status == Status.STEP_LIMIT and sizes.alone and len(sizes.group_of) > 1:
        said += " Give entries of one kind, such as modes, names with one unit: they share a size."
    return said


def _is_removable(scene: Scene) -> bool:
    """Whether the rate is NaN at the start and finite on all sides of it."""
    if _checks.is_traced(scene) or np.ndim(scene.y0) != 1:
        return False
    y0 = np.asarray(scene.y0)
    if not np.isfinite(y0).all() or np.isfinite(scene.rate(jnp.zeros(()), scene.y0)).all():
        return False
    off = _BESIDE * np.where(y0 == 0, 1.0, y0)
    beside = (scene.rate(jnp.zeros(()), jnp.asarray(y0 + sign * off)) for sign in (-1, 1))
    return all(np.isfinite(rate).all() for rate in beside)


def raise_unless_ok(status: Array, scene: Scene) -> None:
    """Raise IntegrationError for the first status that is not OK; traced values pass."""
    if _checks.is_traced(status):
        return
    codes = np.asarray(status)
    if codes.any():  # OK is 0
        raise IntegrationError(explanation(Status(int(codes[codes != 0].flat[0])), scene))


@eqx.filter_jit
@each_motion
def _steps_agree(motion: Trajectory) -> Array:
    """(s,) whether a step of fixed length from each sample agrees with adaptive ones."""
    field, h, method = motion.scene.field, motion.dt, motion.method
    assert h is not None  # the method is one of fixed step
    assert method is not None
    default, nothing = default_solver(motion.scene), jnp.zeros(0)
    loose = Limits(jnp.array([_CHECK_RTOL, 0.0, _CHECK_RTOL]), jnp.full(2, _CHECK_STEPS))

    def agree(sample):
        t, y = sample
        there = field.project(t + h, y + method.in_loops(1).advance(field.rate, t, h, y).increment)
        right = flow(field, y, t, t + h, nothing, loose, method=default).y1
        off, displacement = jnp.max(jnp.abs(there - right)), jnp.max(jnp.abs(right - y))
        # At rest both may be rounding.
        return off <= _MAX_STEP_MISMATCH * displacement + _CHECK_RTOL * jnp.max(jnp.abs(right))

    return jax.lax.map(agree, (motion.ts, motion.ys))
