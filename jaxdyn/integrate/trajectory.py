"""What a simulation returns: a motion at sampled times, or a batch, and how accurate it is."""

import functools
from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn.integrate.flow import Settings, flow
from jaxdyn.integrate.step_control import Limits
from jaxdyn.scene import Scene
from jaxdyn.solvers import Method, default_solver
from jaxdyn.status import IntegrationError, Status
from jaxdyn.system import Record

_STIFF_WARNING = (
    "The scene is stiff: stability, not accuracy, limited the steps of the explicit method. "
    "Pass solver='auto' or solvers.RADAU9."
)
_LONG_STEPS_WARNING = (
    "Steps of fixed length are too long for parts of the motion: adaptive steps disagree. "
    "Make dt smaller, or leave out the solver to use adaptive steps."
)
_MAX_STEP_MISMATCH = 0.05  # of a step's displacement: with more the step is meaningless
_CHECK_RTOL, _CHECK_STEPS = 1e-6, 10_000  # of the adaptive steps compared with
#: Distance of a promised digit from rounding, in spreads of two draws; 1 in 26 errs by more.
ROUNDING_MARGIN = 5.0
T = TypeVar("T")


class Estimate(Record):
    """How far a solution is from the exact one.

    Attributes:
      ts: (s,) times [s].
      ys: (s, k) the solution.
      error: (s, k) estimated absolute error of each entry, in its unit.
      rounding: (s, k) the part of it that no tolerance removes; NaN where not measured.
      scale: (k,) the measure of errors: the largest entry of the same unit. Angles are
        taken modulo a turn.
      kind: the kind of estimate.
      solver: name of the method of the solution.
      other: name of the method of the second solution.
      wanted: () digits requested, if any.
      fineness: (2,) tolerances, or steps, of the solution and of the second one.
    """

    ts: Array
    ys: Array
    error: Array
    rounding: Array
    scale: Array
    fineness: Array
    kind: str = eqx.field(static=True)
    solver: str = eqx.field(static=True)
    other: str = eqx.field(static=True)
    wanted: Array | float | None = None

    @_text.never_raising
    def __repr__(self) -> str:
        digits = f"{self.digits:.1f} at {len(self.ts)} times, at most {self.most_digits:.1f}"
        rows = [("digits", digits), ("basis", self.basis), ("shortfall", self.shortfall)]
        return _text.table("Estimate", rows)

    @property
    def relative(self) -> float:
        """Largest error relative to the scale; NaN if a run failed; host only."""
        return float(np.max(np.asarray(self.error) / np.asarray(self.scale)))

    @property
    def digits(self) -> float:
        """Correct digits at all times, 0 if none; NaN if a run failed; host only."""
        return digits_of(self.relative)

    @property
    def most_digits(self) -> float:
        """Digits certain in double precision with any solver; host only."""
        return digits_of(
            ROUNDING_MARGIN * np.max(np.asarray(self.rounding) / np.asarray(self.scale))
        )

    @property
    def basis(self) -> str:
        """The basis of the estimate, as text; host only."""
        mine, its = np.asarray(self.fineness)
        return f"{self.kind}: {self.solver} at {mine:.1e} against {self.other} at {its:.1e}"

    @property
    def shortfall(self) -> str:
        """Why requested digits were not reached, and the remedy; empty if they were; host only."""
        sure = min(self.digits, self.most_digits)
        if self.wanted is None or not sure < self.wanted:
            return ""
        held = self.until(self.wanted)
        where = "at no sample" if np.isnan(held) else f"up to t = {held:.6g}"
        return (
            f"{self.wanted:g} digits were requested; over the whole span {sure:.1f} are certain, "
            f"all of them {where}. Rounding, amplified, limits any solver to "
            f"{self.most_digits:.1f} certain digits: shorten the span."
        )

    def until(self, digits: float) -> float:
        """Time up to which this many digits are certain; NaN if at no time; host only."""
        off = np.maximum(self.error, ROUNDING_MARGIN * np.nan_to_num(self.rounding))
        # Not >, or a run that failed, whose errors are NaN, would be right to its end.
        wrong = ~((off / np.asarray(self.scale)).max(axis=1) <= 10.0**-digits)
        first = int(np.argmax(wrong)) if wrong.any() else len(wrong)
        return float(self.ts[first - 1]) if first else float("nan")


def digits_of(error) -> float:
    """() correct digits at a relative error, 0 if none; NaN for an error that is not finite."""
    return max(0.0, -float(np.log10(error))) if np.isfinite(error) else float("nan")


class Trajectory(Record):
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
      stiff: () whether stability, not accuracy, limited the steps; False where an implicit method
        took them.
      error: the accuracy estimate, if ``digits`` were requested.
      dt: () signed length of its steps, where it is fixed [s].
      method: the method, where its steps have fixed length.

    Example:
      >>> from jaxdyn import scenes, simulate
      >>> print(simulate(scenes.oscillator(), 1.0, samples=5))
      Trajectory of oscillator
        span     0 to 1 s
        samples  5
        steps    4 accepted, 0 rejected
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
    error: Estimate | None = None
    dt: Array | None = None
    method: Method | None = eqx.field(static=True, default=None)

    @_text.never_raising
    def __repr__(self) -> str:
        shape, one = self.batch_shape, self.one(*(0 for _ in self.batch_shape))
        labels, n = one.scene.labels(), self.ts.shape[-1]
        head = f"Trajectory of {_text.called(one.scene)}"
        batch = ("batch", f"of shape {shape}" if shape else "")
        if _checks.is_traced((self.ts, self.ys, self.status)):
            return _text.table(head, [batch, ("samples", f"{n}, traced")])
        begin, end = (_text.extent(np.asarray(self.ts)[..., i]) for i in (0, -1))
        status = f"{self.status_code.name}: {self.message}"
        if shape:
            right = f"{np.sum(np.asarray(self.status) == Status.OK)} of {np.size(self.status)} OK"
            status = right if self.ok else f"{right}, the worst {status}"
        rows = [
            batch,
            ("span", f"{begin} to {end} {_text.second(labels)}".rstrip()),
            ("samples", str(n)),
            (
                "steps",
                f"{_text.extent(self.steps)} accepted, {_text.extent(self.rejected)} rejected",
            ),
            ("status", status),
            ("end", "" if shape else _text.entries(labels, np.asarray(self.ys)[-1])),
        ]
        return _text.table(head, rows)

    @property
    def ok(self) -> bool:
        """Whether the end was reached; host only."""
        return bool((self.status == Status.OK).all())

    @property
    def message(self) -> str:
        """What happened and what to do about it; host only."""
        return explained(self.status_code, self.scene)

    @property
    def status_code(self) -> Status:
        """The status as a `Status`, the worst of a batch; host only."""
        return Status(int(np.max(self.status)))

    @property
    def warning(self) -> str:
        """Warnings and their remedies; empty if there are none; host only."""
        parts = [_STIFF_WARNING] if np.any(self.stiff) else []
        checkable = self.method is not None and self.ok
        parts += [_LONG_STEPS_WARNING] if checkable and not np.all(_steps_agree(self)) else []
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
        """(s,) values of a labelled entry of the state, e.g. ``motion["x"]``.

        (b, s) of a batch.
        """
        system = self.one(*(0 for _ in self.batch_shape)).scene.system
        names = [label for label, _ in system.labels()]
        i, ys = names.index(_checks.choice("label", name, names)), self.ys
        # On the host: indexing on the device compiles for each number of samples.
        return ys[..., i] if _checks.is_traced(ys) else jax.device_put(np.asarray(ys)[..., i])

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
def _positions(motion: Trajectory) -> Array:
    return jax.vmap(lambda t, y: motion.scene.system.points(t, y).r)(motion.ts, motion.ys)


def explained(status: Status, scene: Scene) -> str:
    """What a status means; for a singularity, also the singularities of the scene."""
    singular = status in (Status.STEP_COLLAPSED, Status.NOT_FINITE)
    return f"{status.message} {scene.singular}".strip() if singular else status.message


def raise_unless_ok(status: Array, scene: Scene) -> None:
    """Raise IntegrationError for the first status that is not OK; traced values pass."""
    if _checks.is_traced(status):
        return
    codes = np.asarray(status)
    if codes.any():  # OK is 0
        raise IntegrationError(explained(Status(int(codes[codes != 0].flat[0])), scene))


@eqx.filter_jit
@each_motion
def _steps_agree(motion: Trajectory) -> Array:
    """(s,) whether a step of fixed length from each sample agrees with adaptive ones."""
    field, h, method = motion.scene.field, motion.dt, motion.method
    assert h is not None  # the method is one of fixed step
    assert method is not None
    settings, nothing = Settings(default_solver(motion.scene)), jnp.zeros(0)
    loose = Limits(jnp.full(2, _CHECK_RTOL), jnp.asarray(_CHECK_STEPS))

    def agree(sample):
        t, y = sample
        there = field.project(t + h, y + method.in_loops(1).advance(field.rate, t, h, y).increment)
        right = flow(field, y, t, t + h, nothing, loose, settings=settings).y1
        off, moved = jnp.max(jnp.abs(there - right)), jnp.max(jnp.abs(right - y))
        # Both may be rounding, at rest.
        return off <= _MAX_STEP_MISMATCH * moved + _CHECK_RTOL * jnp.max(jnp.abs(right))

    return jax.lax.map(agree, (motion.ts, motion.ys))
