"""Starts on a section: the velocity that follows from section coordinates and an energy.

The energy of a mechanical scene is a quadratic polynomial of each velocity, a v^2 + b v + c, so
the missing velocity is a root of it. Newton's method polishes the root, and does all the work where
the energy is another function of the unknown.
"""

import functools
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, Status, _text
from jaxdyn._checks import check_first, fail, finite, is_traced, numbers
from jaxdyn._numerics import nan_unless
from jaxdyn.analysis.energy import energy as energy_of
from jaxdyn.integrate.event_search.event_values import evaluate
from jaxdyn.integrate.events import Event, Reaches, as_events
from jaxdyn.scene import check_scene
from jaxdyn.status import tally
from orbits.closing.sizes import sizes
from orbits.sections.coordinates import entry, fixed_entry, list_names, names_of, unknown_of

_NEWTON_STEPS = 30
#: Largest residual of a solution, relative to the terms of the energy.
_RESIDUAL = 1e-13
_QUADRATIC = 1e-9  # relative change of the second derivative that counts as rounding
_OFF = 1e-9  # largest distance of a start from the section, relative to the state


class Completed(NamedTuple):
    """Starts on a section, with the entry that the energy determines.

    Attributes:
      y0s: (n, k) states; NaN outside the allowed region.
      status: (n,) `Status` codes.
    """

    y0s: Array
    status: Annotated[Array, Status]

    __repr__ = _text.fields
    _repr_html_ = _text.html

    @property
    def ok(self) -> Array:
        """(n,) whether each start was completed."""
        return self.status == Status.OK

    @property
    def message(self) -> str:
        """The number of starts with each status, and the remedies; host only."""
        return outcome_text(self.status)


def outcome_text(status) -> str:
    """The number of starts with each status, and the remedies."""
    return tally(status, "start", lambda code: code.message if code else "OK.")


@check_first
def complete(
    scene: Scene,
    event: Event,
    given: Mapping[str, Any],
    *,
    energy,
    unknown: str | None = None,
    sign: int | None = None,
    t0=0.0,
) -> Completed:
    """Starts on a section from all entries but one, which the energy determines.

    Args:
      scene: the scene, with an energy.
      event: the section; an entry that it fixes need not be given.
      given: the entries by name, () or (n,) each.
      energy: () or (n,) energy of the starts [J].
      unknown: name of the entry that is sought; by default the velocity of the position that the
        event fixes.
      sign: 1 for the larger of two solutions, -1 for the smaller one; by default the direction
        of the event, or 1.
      t0: () time of the starts.
    Returns:
      The starts, in the order of the numbers; those outside the allowed region are NaN, with a
      status. They are differentiable in the numbers of the scene, the given ones and the energy.
    Raises:
      ValueError: the scene has no energy, a name is not that of an entry, an entry is missing or
        given twice, the given starts are not on the section, or `sign` is not 1 or -1.
    Example:
      >>> import jaxdyn, orbits
      >>> from jaxdyn import scenes
      >>> from jaxdyn.integrate import events
      >>> section = events.Reaches(0, 0.0)
      >>> found = orbits.sections.complete(
      ...     scenes.henon_heiles(), section, {"y": [0.1, 0.9], "vy": 0.0}, energy=1 / 8
      ... )
      >>> [round(float(x), 6) for x in found.y0s[0]], found.ok.tolist()
      ([0.0, 0.1, 0.490578, 0.0], [True, False])
    """
    check_scene(scene)
    as_events(event, len(scene.y0))
    if sign not in (None, 1, -1):
        raise fail("sign", "1 or -1", sign, "1 is the larger of two solutions.")
    index = unknown_of(scene, event, unknown)
    rows = _rows(scene, event, given, index, finite("energy", numbers("energy", energy)))
    sign = (event.direction or 1) if sign is None else sign
    t0 = jnp.asarray(t0, float)
    y0s, status = _completed(scene, t0, *rows, float(sign), index=index)
    # An entry that the event fixes is checked at starts outside the allowed region as well.
    incomplete = fixed_entry(event) not in (None, index)
    _check_on_section(scene, event, t0, rows[0] if incomplete else y0s)
    return Completed(y0s, status)


def _rows(scene: Scene, event: Event, given: Mapping, index: int, energy) -> tuple[Array, Array]:
    """(n, k) states with the unknown at zero, and (n,) energies."""
    names = names_of(scene)
    values = {
        entry(scene, "given", name): finite(name, numbers(name, x)) for name, x in given.items()
    }
    if index in values:
        raise fail(
            "given", f"entries without {names[index]}", list_names(given), "It is the unknown."
        )
    taken = fixed_entry(event)
    if isinstance(event, Reaches) and taken is not None and taken != index:
        values.setdefault(taken, event.level)
    missing = [names[i] for i in range(len(names)) if i != index and i not in values]
    if missing:
        raise fail(
            "given", f"also {list_names(missing)}", list_names(given), "Only one entry is unknown."
        )
    shape = jnp.broadcast_shapes(energy.shape, *(x.shape for x in values.values()))
    if len(shape) > 1:
        raise fail("given", "one number or n for each entry", f"shape {shape}", "Ravel them.")
    n = shape[0] if shape else 1
    values[index] = jnp.zeros(())
    columns = [jnp.broadcast_to(values[i], (n,)) for i in range(len(names))]
    return jnp.stack(columns, axis=-1), jnp.broadcast_to(energy, (n,))


@jax.jit
def _values_and_rounding(scene: Scene, event: Event, t0: Array, y0s: Array):
    seen = jax.vmap(lambda y: evaluate(scene.field, (event,), t0, y))(y0s)
    return seen.values[:, 0], seen.rounding[:, 0]


def _check_on_section(scene: Scene, event: Event, t0: Array, y0s: Array) -> None:
    if is_traced((scene, event, t0, y0s)):
        return
    values, rounding = map(np.asarray, _values_and_rounding(scene, event, t0, y0s))
    size, entry = rounding / np.finfo(float).eps, fixed_entry(event)
    # The terms of the value may be small by chance, so the size of a fixed entry counts as well.
    size = size + (0.0 if entry is None else sizes(scene)[entry])
    off = np.abs(values) > _OFF * size
    if off.any():
        got = f"value {values[off][0]:.3g} at start {int(np.argmax(off))}"
        raise fail("given", "starts on the section, where the event is 0", got)


def _solve(scene: Scene, t0: Array, y: Array, energy: Array, sign: Array, index: int):
    """The state (k,) and its status."""

    def excess(v, energy=energy):
        return energy_of(scene, t0, y.at[index].set(v)) - energy

    slope = jax.grad(excess)
    zero = jnp.zeros(())
    c, b, a = excess(zero), slope(zero), 0.5 * jax.grad(slope)(zero)
    discriminant = b * b - 4 * a * c
    # This form of the roots avoids cancellation.
    q = -0.5 * (b + jnp.where(b < 0, -1.0, 1.0) * jnp.sqrt(jnp.maximum(discriminant, 0.0)))
    roots = jnp.stack([_over(q, a), _over(c, q)])
    roots = jnp.where(
        jnp.isfinite(roots), roots, jnp.where(jnp.isfinite(roots[::-1]), roots[::-1], 0.0)
    )
    v = jnp.where(sign > 0, roots.max(), roots.min())

    def newton(_, v):
        step = _over(excess(v), slope(v))
        return v - jnp.where(jnp.isfinite(step), step, 0.0)

    v = jax.lax.fori_loop(0, _NEWTON_STEPS, newton, jax.lax.stop_gradient(v))
    terms = scene.system.energies(t0, y.at[index].set(v), scene.effects)
    size = sum((jnp.abs(x) for x in terms), jnp.abs(energy))
    solved = jnp.abs(excess(v)) <= _RESIDUAL * size
    # The derivatives are those of two steps of Newton's method: the first two orders are exact.
    v = jax.lax.stop_gradient(v)
    for _ in range(2):
        v = v - jnp.where(solved, _over(excess(v), slope(v)), 0.0)
    # Unless the energy is quadratic, a negative discriminant at 0 excludes nothing.
    far = jnp.sqrt(jnp.abs(_over(c, a)))
    bends = jnp.stack([0.5 * jax.grad(slope)(x) for x in (far, -far)])
    quadratic = (jnp.abs(bends - a) <= _QUADRATIC * jnp.abs(a)).all()
    forbidden = (discriminant < 0) & quadratic
    why = jnp.where(forbidden, int(Status.FORBIDDEN), int(Status.NOT_COMPLETED))
    status = jnp.where(solved, int(Status.OK), why)
    return nan_unless(solved, y.at[index].set(v)), status


def _over(a: Array, b: Array) -> Array:
    """a / b, infinite where b is 0, without NaN in derivatives."""
    return jnp.where(b == 0, jnp.inf, a / jnp.where(b == 0, 1.0, b))


@functools.partial(jax.jit, static_argnames="index")
def _completed(scene, t0, y0s, energies, sign, *, index: int):
    solve = jax.vmap(lambda y, energy: _solve(scene, t0, y, energy, sign, index))
    return solve(y0s, energies)


def least_energies(scene: Scene, event: Reaches, shown: tuple[int, int], qp: Array) -> Array | None:
    """(n,) least energy of states on a section; None unless one entry is left to choose.

    The edge of the allowed region is where this is the energy of the motions.

    Args:
      scene: the scene, with an energy.
      event: the section.
      shown: the entries of the coordinates.
      qp: (n, 2) their values.
    """
    left = [i for i in range(len(scene.y0)) if i not in (event.entry, *shown)]
    if len(left) != 1 or event.entry in shown:
        return None
    return _least_energies(scene, event.level, qp, entries=(event.entry, *shown, left[0]))


@functools.partial(jax.jit, static_argnames="entries")
def _least_energies(scene, level, qp, *, entries: tuple[int, ...]):
    taken, q, p, free = entries

    def least(point):
        def energy(v):
            y = jnp.zeros(4).at[jnp.array([taken, q, p])].set(jnp.append(level, point))
            return energy_of(scene, jnp.zeros(()), y.at[free].set(v))

        zero = jnp.zeros(())
        slope = jax.grad(energy)
        b, a = slope(zero), 0.5 * jax.grad(slope)(zero)
        return energy(-0.5 * b / a)

    return jax.vmap(least)(qp)
