"""Where functions of the state first cross zero along a motion: the search behind `events`.

Every accepted step is sampled at a few places, reached by steps of the method itself (an
interpolant would be accurate to 7 digits only), for values and slopes. `stretches` decides
between which of these places a value may have crossed zero unseen; there the sampling is refined
until the values decide, or the spacing reaches its minimum. So a value that dips below zero and
comes back within a step is found, to rounding. The time found is polished to full precision.

A value that is within rounding of zero at the start is on the side to which its slope points. So
a motion that starts on an event (after a bounce, say) has left it, and does not meet it again
until it returns.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.integrate.event_search.event_values import (
    SIDE_ROUNDINGS,
    Sight,
    bends,
    first_side,
    looked,
)
from jaxdyn.integrate.event_search.polish import Bracket, polished
from jaxdyn.integrate.event_search.stretches import settled
from jaxdyn.integrate.flow import march
from jaxdyn.integrate.observing import Watch
from jaxdyn.integrate.step_control import StepControl
from jaxdyn.solvers import Method
from jaxdyn.solvers.sizes import allowed
from jaxdyn.status import Status

#: Parts of a step, or of a panel of it, at which events are sampled besides its beginning. Not
#: evenly spaced, or a value with a period of a quarter of a step would look the same everywhere.
_LOOK_PLACES = np.array([0.23, 0.49, 0.77, 1.0])
_MIN_PANEL = (
    2.0**-24
)  # of a step: between samples this close a value has no extremum except by rounding
#: Tolerances that the error of the step to an event may be: it is a part of a step with one.
_TRUSTED_ERROR = 1e3
_MAX_PANELS = 4096  # in a step at most, for a value that oscillates near zero
_PANEL_GROWTH = 4.0  # of the panel length after a settled panel


class Crossing(NamedTuple):
    """The first crossing: time (infinite if there is none), state, event index, `Status`."""

    t: Array
    y: Array
    event: Array
    status: Array


def first_crossing(field, events, y0, t0, t1, limits, *, method: Method):
    """The state (k,) where the search ended, and the first crossing; no derivatives.

    Args:
      field: a module with ``rate(t, y)`` and ``project(t, y)``.
      events: modules with ``value(t, y)`` and ``direction``.
      y0: (k,) start.
      t0: () start time.
      t1: () end time, before or after t0.
      limits: see `flow`.
      method: see `flow`.
    """
    sight = Sight(field, events, method)
    watch = _Lookout(sight)
    out, seen, sizes = march(field, y0, t0, t1, jnp.zeros(0), limits, method=method, watch=watch)
    hs, ys = polished(sight, seen.t0, seen.y0, seen.bracket)
    which = jnp.argmin(jnp.abs(hs))
    h, y = hs[which], ys[:, which]
    # A step is checked at its end; of the shorter one to the event only this is known.
    there = jnp.where(jnp.isfinite(h), h, 0.0)
    step = method.in_loops(1).advance(field.rate, seen.t0, there, seen.y0)
    size = StepControl.norm(step.error / allowed(limits.tolerance, sizes, seen.y0, y))
    moved = jnp.isfinite(h) & (h != 0)
    unseen = (out.status == int(Status.OK)) & moved & ~(size < _TRUSTED_ERROR)
    status = jnp.where(unseen, int(Status.UNSEEN_WITHIN_STEP), out.status)
    status = jnp.where(jnp.isnan(seen.end.side).any(), int(Status.NOT_FINITE), status)
    return out.y1, Crossing(t=seen.t0 + h, y=y, event=which, status=status)


class _Look(NamedTuple):
    """Events at one time, or at several along a first axis."""

    part: Array  # () of the step
    g: Array  # (E,) values
    slope: Array  # (E,) in time
    side: Array  # (E,) sign of the value, 0 where it stays at zero


class _Seen(NamedTuple):
    """What the watch remembers; one entry for each of the E events."""

    end: _Look  # at the last accepted node; NaN side once a value was NaN
    t0: Array  # () last accepted node before the events found
    y0: Array  # (k,)
    bracket: Bracket
    noise: Array  # (E,) values up to this are rounding
    speeds: Array  # (E,) at the start, one rounding of a slope
    bends: Array  # (E,) one rounding of a second derivative
    begun: Array  # () whether a step has been accepted


class _Survey(NamedTuple):
    """A step while it is searched panel by panel, each beginning where the last one ended."""

    n: Array  # () panels so far
    begin: _Look
    end: Array  # () of the panel, as part of the step
    bracket: Bracket  # in parts of the step


class _Lookout(Watch):
    sight: Sight
    direction: Array | float = 1.0

    @property
    def wanted(self) -> Array:
        """(E,) the signs after the crossings that count, 0 for both."""
        return jnp.array([float(event.direction) for event in self.sight.events])

    def towards(self, direction):
        return _Lookout(self.sight, direction)

    def start(self, t0, y0):
        at = self.sight.field, self.sight.events, self.direction * t0, y0
        here = looked(*at)
        zero = jnp.zeros_like(here.values)
        end = _Look(part=jnp.ones_like(t0), g=here.values, slope=here.slopes, side=zero)
        noise = here.rounding + jnp.abs(t0) * here.speeds
        begun = jnp.zeros((), bool)
        return _Seen(
            end=end,
            t0=t0,
            y0=y0,
            bracket=Bracket.none(zero),
            noise=noise,
            speeds=here.speeds,
            bends=bends(*at),
            begun=begun,
        )

    def see(self, keep, t0, y0, t1, y1, memory):
        del y1
        h = self.direction * (t1 - t0)
        begin = self.direction * t0
        g, slope = memory.end.g, self.direction * memory.end.slope
        first = first_side(
            g, slope, h, memory.noise, speeds=memory.speeds, bends=memory.bends, wanted=self.wanted
        )
        side = jnp.where(memory.begun, memory.end.side, first)
        survey = self._surveyed(keep, begin, y0, h, memory, side)
        low, high, towards = survey.bracket
        bracket = Bracket(low * h, high * h, towards)
        begun = jnp.ones((), bool)
        seen = memory._replace(end=survey.begin, t0=begin, y0=y0, bracket=bracket, begun=begun)
        memory = jax.tree.map(lambda new, old: jnp.where(keep, new, old), seen, memory)
        return memory, memory.bracket.found.any() | jnp.isnan(memory.end.side).any()

    def _surveyed(self, keep, t: Array, y: Array, h: Array, memory: _Seen, side: Array) -> _Survey:
        """The step after all its panels, or after the one in which something happens first."""
        begin = memory.end._replace(part=jnp.zeros_like(t), side=side)
        start = _Survey(
            n=jnp.zeros((), int), begin=begin, end=jnp.ones_like(t), bracket=Bracket.none(side)
        )
        noise = SIDE_ROUNDINGS * memory.noise

        def panel(survey: _Survey) -> _Survey:
            looks = self._looks(t, y, h, survey.begin, survey.end, noise)
            return _judged(survey, looks, h, noise, self.wanted)

        def going(survey: _Survey) -> Array:
            over = survey.bracket.found | jnp.isnan(survey.begin.side)
            return keep & (survey.begin.part < 1) & ~over.any()

        return jax.lax.while_loop(going, panel, start)

    def _looks(self, t: Array, y: Array, h: Array, begin: _Look, end: Array, noise) -> _Look:
        """The events at the beginning of a panel, at the places within it and at its end."""
        parts = begin.part + _LOOK_PLACES[:-1] * (end - begin.part)
        parts = jnp.concatenate([begin.part[None], parts, end[None]])
        g, slope, _ = self.sight.after(t, y, parts[1:] * h)
        sides = [begin.side]
        for value in g:
            sides.append(jnp.where(jnp.abs(value) <= noise, sides[-1], jnp.sign(value)))
        g, slope = (jnp.concatenate([a[None], b]) for a, b in ((begin.g, g), (begin.slope, slope)))
        return _Look(part=parts, g=g, slope=slope, side=jnp.stack(sides))


def _judged(survey: _Survey, looks: _Look, h: Array, noise: Array, wanted: Array) -> _Survey:
    """The next panel, or the first stretch of this one that has to be refined."""
    width = survey.end - survey.begin.part
    exhausted = (width < _MIN_PANEL) | (survey.n >= _MAX_PANELS)
    s = looks.side
    known = settled(h * looks.part, looks.g, looks.slope, s, noise) | exhausted
    across = (s[:-1] * s[1:] < 0) & ((wanted == 0)[None] | (wanted[None] == s[1:]))
    unclear, n = _first(~known), len(_LOOK_PLACES)
    hit = _first(across)
    into, found = (unclear < n) & (unclear <= hit), hit < unclear
    begin = jax.tree.map(lambda x: x[jnp.where(into, unclear, n)], looks)
    # No sliver is left over at the end of the step.
    following = jnp.where(
        survey.end + (_PANEL_GROWTH + 1) * width < 1, survey.end + _PANEL_GROWTH * width, 1.0
    )
    end = jnp.where(into, looks.part[jnp.minimum(unclear, n - 1) + 1], following)
    at = jnp.minimum(hit, n - 1)
    here = found & across[at]
    low, high = (jnp.where(here, looks.part[at + i], jnp.inf) for i in (0, 1))
    return _Survey(n=survey.n + 1, begin=begin, end=end, bracket=Bracket(low, high, s[at + 1]))


def _first(flags: Array) -> Array:
    """() index of the first row of (n, E) flags with a flag set, n if there is none."""
    rows = flags.any(axis=1)
    return jnp.where(rows.any(), jnp.argmax(rows), len(rows))
