"""The equations of a chain of legs and their Jacobian, as functions of one vector x of unknowns.

The unknowns are the start of the first leg, the duration of each leg, and the parameter of a
family. The equations are the event that ends each leg, its further conditions, and the closing of
the chain. Times are unknowns, not found by a search for events: a landing without relative velocity
grazes the ground, where the time of an event has no derivative, while these equations are regular.
The price is that a solution may pass the end of a leg before its time; the bounds of a leg exclude
that.

In units all of them are of order 1: a state is in units of the sizes of its entries along the
chain, a time in units of its guess, and an equation in units of its change when the states change
by their sizes.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._numerics import value_and_jacfwd
from jaxdyn.integrate.phase import Phase
from jaxdyn.integrate.simulation import solve, solve_to_end
from jaxdyn.solvers import Method
from orbits.closing.sizes import sizes
from orbits.hybrid.legs import HybridOrbit, Leg, Path
from orbits.hybrid.phases import legs_of
from orbits.orbit import Outcome

#: A function from the parameter of a family to legs, or to phases with their legs along a path.
MakeChain = Callable[[Array], Sequence[Leg] | Mapping[str, Phase]]


class Unknowns(NamedTuple):
    """The unknowns, by name.

    Attributes:
      start: (k,) start of the first leg.
      spans: (n,) duration of each leg.
      parameter: () parameter of a family, else 0.
    """

    start: np.ndarray
    spans: np.ndarray
    parameter: float


class LinearizedChain(NamedTuple):
    """The equations at given unknowns.

    Attributes:
      value: (m,) left-hand sides, zero at a solution.
      jacobian: (m, u) derivatives with respect to the unknowns.
      starts: the start of each leg, and that of the leg after the last.
      ends: the end of each leg.
    """

    value: np.ndarray
    jacobian: np.ndarray
    starts: list[np.ndarray]
    ends: list[np.ndarray]


class ChainEquations(NamedTuple):
    """The equations of a chain of legs.

    Attributes:
      legs: the legs in order; their scenes' starts and spans are not used.
      closes: (end, start) -> closing error.
      make: the legs for each value of the parameter of a family; None without one.
      path: the path through the phases that `make` returns; () if it returns legs.
    """

    legs: tuple[Leg, ...]
    closes: Callable[[Array, Array], Array]
    make: MakeChain | None = None
    path: Path = ()

    @classmethod
    def of(cls, orbit: HybridOrbit, make: MakeChain | None = None) -> "ChainEquations":
        """The equations of a known chain."""
        return cls(orbit.legs, orbit.closes, make, orbit.path)

    def unpack(self, x: np.ndarray) -> Unknowns:
        """The unknowns that x consists of; the last span is its last entry."""
        spans = np.delete(x[-len(self.legs) - self._along :], -2 if self._along else [])
        start = x[: len(x) - len(self.legs) - self._along]
        return Unknowns(start, spans, float(x[-2]) if self._along else 0.0)

    def place(self, x: np.ndarray) -> np.ndarray:
        """(u,) all unknowns, since none are states between segments."""
        return x

    def pack(self, start, spans, parameter: float = 0.0) -> np.ndarray:
        """x (u,) of these unknowns."""
        spans, more = np.asarray(spans, float), [parameter] * self._along
        return np.concatenate([start, spans[:-1], more, spans[-1:]])

    @property
    def _along(self) -> bool:
        return self.make is not None

    def legs_at(self, parameter: float) -> tuple[Leg, ...]:
        """The legs at a value of the family's parameter."""
        if self.make is None:
            return self.legs
        return legs_of(self.make(jnp.asarray(parameter, float)), self.path)

    def linearize(self, x: np.ndarray, rtol) -> LinearizedChain:
        """The equations and their Jacobian.

        Legs are passed one by one on the host, so that each kind of leg is compiled once for chains
        of any length.
        """
        unknowns = self.unpack(x)
        k, n = len(unknowns.start), len(self.legs)
        columns = np.eye(len(x))
        spans = columns[np.append(k + np.arange(n - 1), len(x) - 1)]
        start, slope = map(np.asarray, _nearest_start(self.legs[0].scene, unknowns.start))
        first = slope @ columns[:k]
        along = first
        starts, ends, values, rows = [start], [], [], []
        rtol = np.asarray(rtol, float)  # a Python number would be compiled in
        for i in range(n):
            passed = self._pass_leg(i, starts[-1], unknowns, rtol)
            (y, errors, end), slopes = jax.tree.map(np.asarray, passed)
            by_start, by_span, *by_parameter = slopes
            along, row = (
                by_start[j] @ along
                + np.outer(by_span[j], spans[i])
                + sum(np.outer(slope[j], columns[-2]) for slope in by_parameter)
                for j in (0, 1)
            )
            starts.append(y)
            ends.append(end)
            values.append(errors)
            rows.append(row)
        errors, slopes = jax.tree.map(np.asarray, closing_error(self.closes, starts[-1], start))
        jacobian = np.concatenate([*rows, slopes[0] @ along + slopes[1] @ first])
        return LinearizedChain(np.concatenate([*values, errors]), jacobian, starts, ends)

    def _pass_leg(self, i: int, y: np.ndarray, unknowns: Unknowns, rtol: np.ndarray):
        span = unknowns.spans[i]
        if self.make is None:
            return pass_leg(self.legs[i], y, span, rtol)
        parameter = np.asarray(unknowns.parameter)
        return _pass_family_leg(self.make, self.path, i, y, span, parameter, rtol)

    def sizes(self, first: LinearizedChain, spans: np.ndarray, parameter=0.0) -> list[np.ndarray]:
        """(k,) sizes of the entries of each leg's state, the largest of legs with equal labels."""
        legs = self.legs_at(parameter)
        own_sizes = [
            sizes(leg.scene.starting(y, t))
            for leg, y, t in zip(legs, first.starts[:-1], spans, strict=True)
        ]
        labels = [leg.scene.labels() for leg in legs]
        return [
            np.max([z for z, other in zip(own_sizes, labels, strict=True) if other == own], axis=0)
            for own in labels
        ]

    def residual_units(
        self, first: LinearizedChain, spans: np.ndarray, leg_sizes, parameter=0.0
    ) -> np.ndarray:
        """(m,) the change of each equation when the states change by their sizes."""
        found = [
            np.asarray(_change(leg, end, t, size))
            for leg, end, t, size in zip(
                self.legs_at(parameter), first.ends, spans, leg_sizes, strict=True
            )
        ]
        both = closing_error(self.closes, first.starts[-1], first.starts[0])[1]
        found.append(sum(np.abs(np.asarray(slope)) @ leg_sizes[0] for slope in both))
        rows = np.concatenate(found)
        return np.where(rows > 0, rows, 1.0)

    def orbit(
        self, x: np.ndarray, *, residual: float, outcome: Outcome, iterations: int, rtol: float
    ) -> HybridOrbit:
        """The chain at unknowns x; FOUND only if it satisfies the bounds of its legs."""
        unknowns = self.unpack(x)
        starts = self.linearize(x, rtol).starts[:-1]
        placed = tuple(
            dataclasses.replace(leg, scene=leg.scene.starting(y, t))
            for leg, y, t in zip(
                self.legs_at(unknowns.parameter), starts, unknowns.spans, strict=True
            )
        )
        found = HybridOrbit(
            legs=placed,
            closes=self.closes,
            residual=residual,
            outcome=outcome,
            iterations=iterations,
            rtol=rtol,
            path=self.path,
        )
        if found.ok and not found.keeps_bounds:
            return dataclasses.replace(found, outcome=Outcome.BOUND_PASSED)
        return found

    def over_periods(self, times: int) -> "ChainEquations":
        """The equations of the same chains, with `times` periods counted as one."""
        return self._replace(legs=self.legs * times, path=self.path * times)

    def repeat(self, x: np.ndarray, times: int, rtol) -> np.ndarray:
        """x of the same chain for the equations `over_periods`."""
        del rtol  # nothing is integrated
        unknowns = self.unpack(x)
        spans = np.tile(unknowns.spans, times)
        return self.over_periods(times).pack(unknowns.start, spans, unknowns.parameter)

    def residual(self, start, spans, rtol, solvers: Sequence[Method | None], periods: int = 1):
        """(m,) the errors of the equations after some periods, by given methods of integration.

        The errors of the ends are those in the last period. The closing errors are summed over all
        periods: if the closing is the difference of two states, the sum is that of the last state
        from the start.
        """
        y, closing, errors = np.asarray(start), 0.0, []
        for _ in range(periods):
            first, errors = y, []
            for leg, span, solver in zip(self.legs, spans, solvers, strict=True):
                y, miss = _end(leg, y, np.asarray(span), np.asarray(rtol, float), solver=solver)
                errors.append(np.asarray(miss))
            closing = closing + np.asarray(closing_error(self.closes, y, first)[0])
        return np.concatenate([*errors, closing])


@eqx.filter_jit
def _change(leg: Leg, end: Array, span, entry_sizes: Array) -> Array:
    """(e,) the part of `ChainEquations.residual_units` that belongs to the ends of a leg."""

    def errors(end):
        return _ends(leg, span, end)

    return jnp.abs(jax.jacfwd(errors)(end)) @ entry_sizes


@eqx.filter_jit
def _nearest_start(scene: Scene, y: Array) -> tuple[Array, Array]:
    """The nearest start that the constraints allow, and its derivative."""
    return value_and_jacfwd(lambda y: scene.system.project(jnp.zeros(()), y))(y)


def _ends(leg: Leg, span, end: Array) -> Array:
    return jnp.asarray([event.value(span, end) for event in leg.ends], float)


@eqx.filter_jit
def _end(leg: Leg, y: Array, span, rtol, *, solver: Method | None):
    """The start of the next leg and the residual of the ends, without derivatives."""
    end = solve(leg.scene.starting(y), span, rtol=rtol, solver=solver).y1
    return leg.change(span, end), _ends(leg, span, end)


def _passage(leg: Leg, y: Array, span, rtol):
    end = solve_to_end(leg.scene.starting(y), span, rtol=rtol).y1
    both = leg.change(span, end), _ends(leg, span, end)
    return both, (*both, end)


@eqx.filter_jit
def residuals(legs: Sequence[Leg], closes, start: Array, spans: Array, rtol) -> Array:
    """(m,) the residual of a chain's equations, differentiable in every number of the chain."""
    first = y = legs[0].scene.system.project(jnp.zeros(()), start)
    found = []
    for i, leg in enumerate(legs):
        (y, errors), _ = _passage(leg, y, spans[i], rtol)
        found.append(errors)
    return jnp.concatenate([*found, closes(y, first)])


@eqx.filter_jit
def pass_leg(leg: Leg, y: Array, span, rtol):
    """The next leg's start, residual of the ends, and end, with derivatives of the first two."""

    def passed(y, span):
        return _passage(leg, y, span, rtol)

    slopes, found = jax.jacfwd(passed, argnums=(0, 1), has_aux=True)(y, span)
    return found, tuple(zip(*slopes, strict=True))


@eqx.filter_jit
def _pass_family_leg(make: MakeChain, path: Path, i: int, y: Array, span, parameter, rtol):
    """`pass_leg` of a leg of a family, with the derivatives with respect to its parameter."""

    def passed(y, span, parameter):
        return _passage(legs_of(make(parameter), path)[i], y, span, rtol)

    slopes, found = jax.jacfwd(passed, argnums=(0, 1, 2), has_aux=True)(y, span, parameter)
    return found, tuple(zip(*slopes, strict=True))


@eqx.filter_jit
def closing_error(closes, end: Array, start: Array):
    """The closing error, and its derivatives with respect to both states."""
    return value_and_jacfwd(closes, (0, 1))(end, start)


def closing_in_sizes(closes, end, start, entry_sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, k) derivatives of the closing error with respect to both states, in sizes (k,).

    Each equation is divided by the norm of its derivative with respect to the start.
    """
    both = closing_error(closes, end, start)[1]
    by_end, by_start = (np.asarray(slope) * entry_sizes for slope in both)
    rows = np.linalg.norm(by_start, axis=1, keepdims=True)
    rows = np.where(rows > 0, rows, 1.0)
    return by_end / rows, by_start / rows
