"""Signals, which inputs follow: a sine, a step, a pulse, a sweep, a table of measured values."""

import abc
import dataclasses
import functools
from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float
from jaxdyn._numerics import nan_unless
from jaxdyn._records import Record


class Signal(Record):
    """A function of time.

    Attributes:
      jumps: whether its value jumps, so that its rate would be an impulse.
    """

    jumps: ClassVar[bool] = False

    @abc.abstractmethod
    def __call__(self, t: Array) -> Array:
        """() the value at time t ()."""

    def check(self) -> None:
        """Raise ValueError if a number is invalid; traced numbers pass."""

    def or_nan(self) -> "Signal":
        """The signal, with NaN as its value if traced numbers are invalid."""
        return self


class Harmonic(Signal):
    """A cos(omega t - phase): amplitude A, angular frequency omega [rad/s], phase [rad]."""

    amplitude: Array = eqx.field(converter=as_float)
    omega: Array = eqx.field(converter=as_float)
    phase: Array = eqx.field(converter=as_float, default=0.0)

    def __call__(self, t):
        return self.amplitude * jnp.cos(self.omega * t - self.phase)


class Step(Signal):
    """0 before the time t_on [s], the height from then on."""

    height: Array = eqx.field(converter=as_float)
    t_on: Array = eqx.field(converter=as_float, default=0.0)
    jumps: ClassVar[bool] = True

    def __call__(self, t):
        return jnp.where(t >= self.t_on, self.height, 0.0)


class Pulse(Signal):
    """A half sine with a height, from time t_on [s] for a duration [s]: a hammer, a bump."""

    height: Array = eqx.field(converter=as_float)
    duration: Array = eqx.field(converter=as_float)
    t_on: Array = eqx.field(converter=as_float, default=0.0)

    def __call__(self, t):
        share = (t - self.t_on) / self.duration
        inside = (share > 0) & (share < 1)
        return jnp.where(inside, self.height * jnp.sin(jnp.pi * share), 0.0)

    def check(self):
        _checks.positive("Pulse.duration", self.duration, "It is a time.")


class Sweep(Signal):
    """A sine with an angular frequency that changes linearly from low to high in a duration [s]."""

    amplitude: Array = eqx.field(converter=as_float)
    low: Array = eqx.field(converter=as_float)
    high: Array = eqx.field(converter=as_float)
    duration: Array = eqx.field(converter=as_float)

    def __call__(self, t):
        faster = 0.5 * (self.high - self.low) / self.duration
        return self.amplitude * jnp.sin((self.low + faster * t) * t)

    def omega(self, t: Array) -> Array:
        """() its angular frequency at time t () [rad/s]."""
        return self.low + (self.high - self.low) * t / self.duration

    def check(self):
        _checks.positive("Sweep.duration", self.duration, "It is a time.")


class Imbalance(Signal):
    """The force of a rotating imbalance along an axis, while a rotor runs up to its speed.

    The rotor turns by an angle theta, and its angular frequency omega changes linearly from low to
    high in a duration, then stays: the force is U (omega^2 cos theta + omega' sin theta), with
    U = mass times eccentricity. The phase is the angle of the axis: pi / 2 for y, if x has 0.

    Attributes:
      moment: () mass times eccentricity U [kg m].
      low: () angular frequency at time 0 [rad/s].
      high: () angular frequency from the end of the duration on [rad/s].
      duration: () duration of the run-up [s].
      phase: () angle of the axis, from the direction of the imbalance at time 0 [rad].
    """

    moment: Array = eqx.field(converter=as_float)
    low: Array = eqx.field(converter=as_float)
    high: Array = eqx.field(converter=as_float)
    duration: Array = eqx.field(converter=as_float)
    phase: Array = eqx.field(converter=as_float, default=0.0)
    jumps: ClassVar[bool] = True  # omega' does

    def __call__(self, t):
        rate = (self.high - self.low) / self.duration
        running = jnp.minimum(t, self.duration)
        theta = (self.low + 0.5 * rate * running) * running + self.high * (t - running)
        turned = theta - self.phase
        faster = jnp.where(t < self.duration, rate, 0.0)
        force = self.omega(t) ** 2 * jnp.cos(turned) + faster * jnp.sin(turned)
        return self.moment * force

    def omega(self, t: Array) -> Array:
        """() the angular frequency of the rotor at time t () [rad/s]."""
        running = jnp.minimum(t, self.duration)
        return self.low + (self.high - self.low) * running / self.duration

    def check(self):
        _checks.positive("Imbalance.duration", self.duration, "It is a time.")


def _column(name: str) -> Callable[[Any], Array]:
    """A converter of a column of numbers."""
    return functools.partial(
        _checks.numbers, name, remedy="jaxdyn.read_csv reads the numbers of a file."
    )


class Table(Signal):
    """Values at times with linear interpolation, constant before the first and after the last.

    Integration steps end at the times of the table, where the slope jumps, so that the result is as
    accurate as for a smooth signal.

    Attributes:
      ts: (n,) times [s], increasing; if they are traced and not increasing, the motion is NaN.
      values: (n,) values of the signal.
    """

    ts: Array = eqx.field(converter=_column("Table.ts"))
    values: Array = eqx.field(converter=_column("Table.values"))

    def __call__(self, t):
        return jnp.interp(t, self.ts, self.values)

    def check(self):
        ts = _checks.array("Table.ts", self.ts, (None,))
        _checks.array("Table.values", self.values, ts.shape, "One for each time.")
        if not _checks.is_traced(ts) and not (len(ts) and (np.diff(np.asarray(ts)) > 0).all()):
            raise _checks.fail("Table.ts", "increasing times", "others", "Sort the table by time.")

    def or_nan(self):
        if not _checks.is_traced(self.ts):
            return self
        increase = (jnp.diff(self.ts) > 0).all()
        return dataclasses.replace(self, values=nan_unless(increase, self.values))


def check_signal(given: Signal) -> Signal:
    """The signal, if it is one; NaN if it is traced, and its numbers are invalid.

    Raises:
      ValueError: it is not a signal, or one of its numbers is invalid.
    """
    if not isinstance(given, Signal):
        remedy = "Such as vibration.Harmonic, vibration.Step, vibration.Table."
        raise _checks.fail("signal", "a signal", repr(given), remedy)
    given.check()
    return given.or_nan()
