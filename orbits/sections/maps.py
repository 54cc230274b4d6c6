"""The Poincare map of a section: a differentiable function of the section coordinates.

The map completes a start (by the section, and by the energy where one is given), follows the
motion to its next crossing and reads the coordinates there. Its derivative is that of the flow
projected along the motion onto the section, since `crossings` differentiates the time of the
crossing too, and restricted to an energy surface if an energy is given. At a fixed point its
eigenvalues are the non-trivial multipliers of the orbit.
"""

from typing import Annotated

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import Scene, Status, _text
from jaxdyn._checks import as_float, check_first, check_shape, fail, finite, numbers, whole
from jaxdyn._numerics import nan_unless, zero_of
from jaxdyn.integrate.event_search.all_crossings import crossings
from jaxdyn.integrate.events import Event, Every, Reaches, as_events
from jaxdyn.integrate.spans import MAX_STEPS
from jaxdyn.scene import check_scene
from orbits.sections.completion import complete
from orbits.sections.coordinates import entry, fixed_entry, list_names, names_of, unknown_of


class Mapped(eqx.Module):
    """The image of a point under a Poincare map.

    Attributes:
      q: (d,) section coordinates; NaN unless the status is OK.
      y: (k,) state.
      t: () time since the start.
      status: () `Status` code.
    """

    q: Array
    y: Array
    t: Array
    status: Annotated[Array, Status]

    __repr__ = _text.fields
    _repr_html_ = _text.html


class PoincareMap(eqx.Module):
    """The map from a point of a section to a later crossing; made by `poincare_map`.

    Attributes:
      scene: the scene.
      event: the section.
      energy: () energy of all points; None where the section alone completes a state.
      span: () longest time to the crossing.
      rtol: relative tolerance of a step.
      names: names of the d section coordinates.
      unknown: name of the entry that the energy determines, if one is given.
      sign: see `complete`.
      iterates: number of crossings.
    """

    scene: Scene
    event: Event
    energy: Array | None
    span: Array
    rtol: float = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)
    unknown: str | None = eqx.field(static=True)
    sign: int = eqx.field(static=True)
    iterates: int = eqx.field(static=True)

    __repr__ = _text.fields
    _repr_html_ = _text.html

    def __call__(self, q) -> Array:
        """(d,) coordinates of the crossing that follows the point q (d,); NaN where there is none.

        The map is differentiable any number of times in forward mode, and in reverse mode, also in
        its numbers; jit and vmap work.
        """
        return self.step(q).q

    def step(self, q) -> Mapped:
        """The crossing that follows the point q (d,), with its state, time and status."""
        y, status = self._start(q)
        # A forbidden point is replaced by an allowed state, to avoid NaN in derivatives.
        y = jnp.where(status == Status.OK, y, self.scene.y0)
        t0 = self._phase
        found = crossings(
            self.scene.starting(y),
            self.event,
            t0 + self.span,
            t0=t0,
            most=self.iterates,
            rtol=self.rtol,
            max_steps=MAX_STEPS,
            throw=False,
        )
        few = jnp.where(found.count < self.iterates, int(Status.FEW_CROSSINGS), int(Status.OK))
        failed = jnp.where(found.status == Status.OK, few, found.status)
        failed = jnp.where(few == Status.OK, int(Status.OK), failed)
        status = jnp.where(status == Status.OK, failed, status)
        right = status == Status.OK
        # Makes derivatives NaN where there is no crossing; in reverse mode they would be 0.
        nothing = zero_of((self, q))
        y1 = nan_unless(right, found.ys[-1] + nothing)
        entries = jnp.array([entry(self.scene, "names", name) for name in self.names])
        t = nan_unless(right, found.ts[-1] - t0 + nothing)
        return Mapped(q=y1[entries], y=y1, t=t, status=status)

    def jacobian(self, q) -> Array:
        """(d, d) derivative of the map at the point q (d,)."""
        return _jacobian(self, numbers("q", q))

    def state(self, q) -> Array:
        """(k,) the state on the section with the coordinates q (d,)."""
        return self._start(q)[0]

    @property
    def _phase(self) -> Array:
        return self.event.phase if isinstance(self.event, Every) else jnp.zeros(())

    def _start(self, q) -> tuple[Array, Array]:
        q = numbers("q", q)
        check_shape(
            "q", q.shape, (len(self.names),), f"One entry for each of {list_names(self.names)}."
        )
        given = dict(zip(self.names, q, strict=True))
        if self.energy is not None:
            found = complete(
                self.scene,
                self.event,
                given,
                energy=self.energy,
                unknown=self.unknown,
                sign=self.sign,
            )
            return found.y0s[0], found.status[0]
        if isinstance(self.event, Reaches):
            given[names_of(self.scene)[self.event.entry]] = self.event.level
        y = jnp.stack([given[name] for name in names_of(self.scene)])
        return y, jnp.asarray(int(Status.OK))


@eqx.filter_jit
def _jacobian(poincare: PoincareMap, q: Array) -> Array:
    return jax.jacfwd(poincare)(q)


@check_first
def poincare_map(
    scene: Scene,
    event: Event,
    *,
    energy=None,
    unknown: str | None = None,
    sign: int | None = None,
    crossings: int = 1,
    span=None,
    rtol: float = 1e-13,
) -> PoincareMap:
    """The Poincare map of a section as a function of the section coordinates.

    The coordinates are all entries of the state, in their order, except for the one that the event
    fixes and, where an energy is given, the one that it determines.

    Args:
      scene: the scene; its start is not used.
      event: `events.Reaches` with a direction, or `events.Every` for a stroboscopic map.
      energy: () energy of all points; leave it out where it is not conserved, or should vary.
      unknown: name of the entry that the energy determines; see `complete`.
      sign: see `complete`.
      crossings: number of crossings that make one application of the map.
      span: () longest time of one application; the scene's own span by default.
      rtol: relative tolerance of a step.
    Returns:
      A function of (d,) coordinates; see `PoincareMap`.
    Raises:
      ValueError: `event` is of another kind or has no direction, `energy` is given with
        `events.Every`, or a number is out of range.
    Example:
      >>> import jaxdyn, orbits
      >>> from jaxdyn import scenes
      >>> from jaxdyn.integrate import events
      >>> scene = scenes.henon_heiles(t1=20.0)
      >>> P = orbits.sections.poincare_map(scene, events.Reaches(0, 0.0, 1), energy=1 / 12)
      >>> P.names, P([0.1, 0.0]).shape
      (('y', 'vy'), (2,))
      >>> float(abs(jax.numpy.linalg.det(P.jacobian([0.1, 0.0])) - 1)) < 1e-10
      True
    """
    check_scene(scene)
    if not isinstance(event, Reaches | Every):
        remedy = "The coordinates of a section are entries of the state."
        raise fail("event", "events.Reaches or events.Every", repr(event), remedy)
    as_events(event, len(scene.y0))
    if isinstance(event, Reaches) and not event.direction:
        remedy = "Both directions would be two sections in one."
        raise fail("event", "one with a direction, 1 or -1", "0 for both", remedy)
    span = scene.t1 if span is None else span
    left = {fixed_entry(event)} - {None}
    name = None
    if energy is not None:
        if isinstance(event, Every):
            raise fail("energy", "none for a stroboscopic map", energy, "Leave it out.")
        energy = finite("energy", as_float(energy))
        index = unknown_of(scene, event, unknown)
        left, name = left | {index}, names_of(scene)[index]
    return PoincareMap(
        scene=scene,
        event=event,
        energy=energy,
        span=finite("span", as_float(span)),
        rtol=rtol,
        names=tuple(x for i, x in enumerate(names_of(scene)) if i not in left),
        unknown=name,
        sign=(event.direction or 1) if sign is None else sign,
        iterates=whole("crossings", crossings),
    )
