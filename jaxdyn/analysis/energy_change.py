"""The change of energy along a motion in pieces, and its causes.

Each effect adds its power and the rate of its own potential to dE/dt: nothing, where the force is
minus the gradient of that potential. The remainder of dE/dt is due to the system itself: a
prescribed motion drives it, its contacts rub, or its constraints have drifted. Where all of this
vanishes, a change of the energy is the integrator's error. A jump between pieces is an impact.
"""

import itertools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._checks import check_first, check_on_host
from jaxdyn.analysis.energy import change as change_of
from jaxdyn.analysis.energy import energy
from jaxdyn.analysis.static_friction import with_static_friction
from jaxdyn.analysis.work_by_effect import power_of
from jaxdyn.integrate.phases import HybridTrajectory, pieces_of
from jaxdyn.integrate.spans import of_samples
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.plan import plan_of
from jaxdyn.scene import Effect, Field, Scene

#: A change that follows from the equations counts as none below this part of the energy's size.
_MAX_CHANGE_OF_CONSERVED = 1e-9
_ROUNDING = 1e-12  # part of the terms of a power: smaller powers are rounding
_MAX_SAMPLING_ERROR = 0.1  # part of a work: unknown if halving the samples changes it by more


class EnergyChange(NamedTuple):
    """The change of the energy of a motion.

    Attributes:
      size: the largest change [1], see `energy.drift`.
      causes: what changes it: classes of effects, phases, "impacts", "the drive", "drift of the
        constraints"; none where it is conserved up to the integrator's error.
      works: energy that each cause adds, relative as `size` is [1]; NaN where the samples are too
        few.
      without_potential: causes that define no potential, so that the energy includes none of them.
    """

    size: float
    causes: tuple[str, ...]
    works: tuple[float, ...]
    without_potential: tuple[str, ...]

    @property
    def message(self) -> str:
        """The change and its causes, in one line."""
        change = f"change of energy, relative to its parts: {self.size:.1e}"
        if not self.causes:
            return change
        parts = [
            f"{cause} ({'no potential known, ' if cause in self.without_potential else ''}"
            f"work {'not known' if np.isnan(work) else format(work, '.1e')})"
            for cause, work in zip(self.causes, self.works, strict=True)
        ]
        return f"{change}; it is not conserved, because of {' and '.join(parts)}"


# Motions may be near the largest floats, where their energies are infinite or unknown.
@check_first
@np.errstate(over="ignore", invalid="ignore")
def energy_change(motion: Trajectory | HybridTrajectory) -> EnergyChange | None:
    """The change of the energy over all pieces; None without an energy, or where it is unknown.

    Example:
      >>> from jaxdyn import scenes, simulate
      >>> energy_change(simulate(scenes.cannonball(drag=0.1))).causes
      ('QuadraticDrag',)
    """
    remedy = "Call it outside of jit, grad and vmap; `energy.change` takes traced numbers."
    check_on_host("motion", motion, remedy)
    pieces = pieces_of(motion)
    if not pieces[0].scene.has_energy or len(pieces[0].ts) < 2:
        return None
    changes = [change_of(piece.scene, piece.ts, piece.ys) for piece in pieces]
    totals = [np.asarray(one.values) for one in changes]
    total, size = np.concatenate(totals), float(max(one.size for one in changes))
    change = np.max(np.abs(total - total[0])) / size
    if not np.isfinite(change):
        return None
    names = motion.names if isinstance(motion, HybridTrajectory) else ("",)
    works: dict[str, float] = {}
    for i, (piece, part) in enumerate(zip(pieces, totals, strict=True)):
        for cause, work in _works(piece, names[i], part[-1] - part[0], size).items():
            works[cause] = works.get(cause, 0.0) + work / size
    jumps = [two[0] - one[-1] for one, two in itertools.pairwise(totals)]
    if any(abs(jump) > _MAX_CHANGE_OF_CONSERVED * size for jump in jumps):
        works["impacts"] = sum(jumps) / size
    without = {
        type(effect).__name__
        for piece in pieces
        for effect in piece.scene.effects
        if not _has_potential(piece.scene, effect)
    }
    unknown = tuple(cause for cause in works if cause in without)
    return EnergyChange(
        size=float(change),
        causes=tuple(works),
        works=tuple(map(float, works.values())),
        without_potential=unknown,
    )


def _works(piece: Trajectory, phase: str, change: float, size: float) -> dict[str, float]:
    """The work of each cause in a piece, from the equations of motion."""
    found = jax.tree.map(np.asarray, _measure(piece))
    ts = np.asarray(piece.ts)

    def acts(gain: np.ndarray, terms: np.ndarray) -> bool:
        gain = np.where(np.abs(gain) > _ROUNDING * terms, gain, 0.0)
        return bool(np.max(np.abs(gain)) * np.ptp(ts) > _MAX_CHANGE_OF_CONSERVED * size)

    # The work of a force that is minus the gradient of its potential is 0, and its integral over
    # the samples is only the error of the quadrature.
    works = {
        name: _integral(ts, kind.power, kind.slope) + kind.potential[-1] - kind.potential[0]
        for name, kind in found.kinds.items()
        if acts(kind.gain, kind.terms)
    }
    if acts(found.rest, found.terms):
        works[phase or _by_itself(piece)] = change - sum(works.values())
    return works


def _by_itself(piece: Trajectory) -> str:
    # The derivative with respect to time would not show a drive by steps.
    if plan_of(Field(piece.scene.system, ()), len(piece.scene.y0)).depends_on_time:
        return "the drive"
    bound = piece.scene.system.undetermined(piece.ts[0], piece.ys[0]) is not None
    return "drift of the constraints" if bound else "the system itself"


def _has_potential(scene: Scene, effect: Effect) -> bool:
    t = np.zeros(())
    r, _, m = jax.eval_shape(scene.system.points, t, scene.y0)
    return jax.eval_shape(effect.potential, t, r, m) is not None


def _integral(ts: np.ndarray, f: np.ndarray, slope: np.ndarray) -> float:
    """The integral of a function from its values and slopes; NaN where samples are too few."""

    def hermite(ts, f, slope):
        h = np.diff(ts)
        return np.sum(h * (f[1:] + f[:-1]) / 2 - h * h * np.diff(slope) / 12)

    # Its difference from the integral over every other sample shows the error.
    half = np.unique([*range(0, len(ts), 2), len(ts) - 1])
    fine, coarse = hermite(ts, f, slope), hermite(ts[half], f[half], slope[half])
    return fine if abs(fine - coarse) <= _MAX_SAMPLING_ERROR * abs(fine) else np.nan


class _Kind(NamedTuple):
    """The effects of one class at the samples, (s,) each."""

    power: Array  # power of their forces [W]
    slope: Array  # its rate [W/s]
    potential: Array  # [J]
    gain: Array  # their part of dE/dt [W]
    terms: Array  # magnitude of the terms of that sum [W]


class _Measured(NamedTuple):
    kinds: dict[str, _Kind]
    rest: Array  # (s,) the part of dE/dt that no effect causes [W]
    terms: Array  # (s,) magnitude of its terms [W]


def _powers(field: Field, t: Array, y: Array) -> Array:
    """(e,) the power of each effect."""
    powers = [power_of(field, effect, t, y)[0] for effect in field.effects]
    return jnp.stack(powers) if powers else jnp.zeros(0)


@of_samples
@eqx.filter_jit
def _measure(motion: Trajectory) -> _Measured:
    scene, ts = motion.scene, motion.ts

    def at(t, y):
        both = with_static_friction(scene, _powers, t, y, 2 * ts[-1] - ts[0])
        flow = (jnp.ones_like(t), both(t, y)[0])
        kinds = {}
        for i, effect in enumerate(scene.effects):

            def power(t, y, i=i, effect=effect):
                return both(t, y)[1][i], power_of(scene, effect, t, y)[1]

            name, kind = type(effect).__name__, _kind(scene, effect, t, y, flow, power)
            kinds[name] = jax.tree.map(jnp.add, kinds[name], kind) if name in kinds else kind
        whole = jax.jvp(lambda t, y: energy(scene, t, y), (t, y), flow)[1]
        rest = whole - sum((kind.gain for kind in kinds.values()), jnp.zeros(()))
        terms = jnp.abs(whole) + sum((kind.terms for kind in kinds.values()), jnp.zeros(()))
        return _Measured(kinds=kinds, rest=rest, terms=terms)

    return jax.vmap(at)(motion.ts, motion.ys)


def _kind(
    scene: Scene, effect: Effect, t: Array, y: Array, flow: tuple[Array, Array], power: Callable
) -> _Kind:
    """One effect at a time and state whose rate of change is `flow`; `power` is like `power_of`."""

    def potential(t, y):
        r, _, m = scene.system.points(t, y)
        value = effect.potential(t, r, m)
        return jnp.zeros(()) if value is None else value

    (work, terms), (slope, _) = jax.jvp(power, (t, y), flow)
    stored, rate = jax.jvp(potential, (t, y), flow)
    terms = jnp.maximum(terms, jnp.abs(work)) + jnp.abs(rate)
    return _Kind(power=work, slope=slope, potential=stored, gain=work + rate, terms=terms)
