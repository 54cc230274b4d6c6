"""Families of equilibria and curves in units of their own, whatever the units of the scenes.

All equations of this package are in units in which entries of the state, parameters and time are
numbers of order 1, so that lengths, ranks and residuals are meaningful. `InUnits` is the scene in
these units, and `Units` converts points from and to the units of the scene, in which members, files
and results are. The first member of a family decides the units (`scales_at_rest`); entries that
grow along it have their largest size so far. Special points have the units of the member before
them, and so do branches that begin there.

The value of a parameter does not determine its size. The size follows from the change of the rate
or its derivatives with the parameter, relative to the terms of the same row of A y, where that
change is largest.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.analysis.eigenvalues import Eigenvalues
from jaxdyn.analysis.scales_at_rest import at_rest, terms
from jaxdyn.continuation.branch import Chart
from jaxdyn.continuation.curve import CurvePoint
from jaxdyn.continuation.family import Equilibrium
from jaxdyn.continuation.kinds import Kind
from jaxdyn.scales import Groups, groups
from jaxdyn.scene import Scene

Point = TypeVar("Point", Equilibrium, CurvePoint)


class _Scaled(eqx.Module):
    """A scene in units of its entries and of time."""

    scene: Scene
    each: Array
    time: Array

    def rate(self, t: Array, z: Array) -> Array:
        """The rate (k,) in these units."""
        return self.scene.rate(t * self.time, z * self.each) * (self.time / self.each)

    def energies(self, t: Array, z: Array) -> tuple[Array, ...]:
        """The terms () whose sum is the energy, in its own unit."""
        return self.scene.field.energies(t * self.time, z * self.each)


class InUnits(eqx.Module):
    """The scene for each value of the parameters, all in units.

    Attributes:
      make: the scene for each value of the parameters.
      each: (k,) units of the entries of the state.
      parameters: (m,) units of the parameters.
      time: () unit of time.
    """

    make: Callable = eqx.field(static=True)
    each: Array
    parameters: Array
    time: Array

    def __call__(self, *values: Array) -> _Scaled:
        """The scene for values of the parameters."""
        own = [value * unit for value, unit in zip(values, self.parameters, strict=True)]
        return _Scaled(self.make(*own), self.each, self.time)


class Units(NamedTuple):
    """Units of state, parameters and time.

    Attributes:
      each: (k,) units of the entries of the state.
      parameters: (m,) units of the parameters.
      time: unit of time.
    """

    each: np.ndarray
    parameters: np.ndarray
    time: float

    @classmethod
    def of(cls, numbers: np.ndarray, entries: int) -> "Units":
        """The units in a record, for a state with this many entries."""
        return cls(numbers[:entries], numbers[entries:-1], float(numbers[-1]))

    @property
    def numbers(self) -> np.ndarray:
        """(k + m + 1,) all units, in the order of records."""
        return np.concatenate([self.each, self.parameters, [self.time]])

    @property
    def x(self) -> np.ndarray:
        """(k + m,) units of state and parameters."""
        return np.append(self.each, self.parameters)

    def scene(self, make: Callable) -> InUnits:
        """The scenes in these units."""
        return InUnits(make, *map(jnp.asarray, self))

    def inward(self, point: Point) -> Point:
        """A point in these units, whose tangent has unit length in them."""
        back = Units(1 / self.each, 1 / self.parameters, 1 / self.time)
        return back._scale(point)

    def outward(self, point: Point, known: Groups | None = None) -> Point:
        """A point in these units, converted to those of the scene.

        If the groups of its entries are given, it is a member: its units are at least the sizes of
        its entries.
        """
        scaled, units = self._scale(point), self
        if known is not None:
            now = np.asarray(known.sizes(jnp.abs(scaled.state)))
            units = self._replace(each=np.maximum(self.each, now))
        return dataclasses.replace(scaled, units=units.numbers)

    def _scale(self, point: Point) -> Point:
        """A point multiplied by these units; its rates are divided by the unit of time."""
        time = self.time
        values, bars = (x / time for x in point.eigenvalues)
        fold = (point.kind if isinstance(point, Equilibrium) else point.curve) != Kind.HOPF
        form = time**2 if isinstance(point, Equilibrium) and point.is_double else time
        common = {
            "state": point.state * self.each,
            "eigenvalues": Eigenvalues(values, bars),
            "frequency": point.frequency / time,
            # Lyapunov coefficients are relative to the frequency.
            "coefficient": point.coefficient / (form if fold else 1.0),
        }
        if isinstance(point, Equilibrium):
            tangent = point.tangent * self.x
            return dataclasses.replace(
                point,
                **common,
                parameter=float(point.parameter * self.parameters[0]),
                slopes=point.slopes * (self.each[:, None] / time / self.x),
                tangent=tangent / np.linalg.norm(tangent),
                cubic=point.cubic / form,
            )
        squares = np.full(len(point.unknowns) - len(point.x) - len(self.each), time**-2.0)
        units = np.concatenate([self.x, self.each, squares])
        tangent, left = point.tangent * units, point.left / self.each
        forms = {"a": time**2}
        return dataclasses.replace(
            point,
            **common,
            parameters=point.parameters * self.parameters,
            unknowns=point.unknowns * units,
            tangent=tangent / np.linalg.norm(tangent[: len(point.x)]),
            left=left / np.linalg.norm(left),
            normal_form={key: x / forms.get(key, time) for key, x in point.normal_form.items()},
        )


class ChartInUnits(Chart[Point]):
    """A branch of equilibria near a member, in units.

    Attributes:
      units: the units.
      make: the scenes in them.
      known: groups of the state's entries, which give later members larger units.
    """

    def __init__(self, make: Callable, units: Units, known: Groups | None = None):
        self.units, self.make, self.known = units, units.scene(make), known

    def inward(self, member: Point) -> Point:
        return self.units.inward(member)

    def outward(self, member: Point) -> Point:
        return self.units.outward(member, None if member.kind else self.known)


def units_of(make: Callable, point: Equilibrium | CurvePoint) -> Units:
    """The units in which a point was found."""
    if point.units is None:  # from a file that has none
        return units_at(make, point.x, len(point.state))
    return Units.of(point.units, len(point.state))


def units_at(make: Callable, x: np.ndarray, entries: int) -> Units:
    """The units at an equilibrium x (n,): a state with this many entries, then the parameters."""
    y, values = x[:entries], x[entries:]
    scene = make(*map(jnp.asarray, values))
    each, time, _ = at_rest(scene.field, groups(scene.system), y)
    each = np.asarray(each)
    own = terms(scene.field, y, each) @ each
    changes = np.asarray(_changes(make, jnp.asarray(y), jnp.asarray(values), jnp.asarray(each)))
    shares = np.divide(changes, own[:, None], out=np.zeros_like(changes), where=own[:, None] > 0)
    most = shares.max(axis=0)
    return Units(each, 1 / np.where((0 < most) & (most < np.inf), most, 1.0), float(time))


@eqx.filter_jit
def _changes(make: Callable, y: Array, values: Array, each: Array) -> Array:
    """(k, m) largest derivative of each rate, or of its slopes times sizes, by each parameter."""

    def by_parameters(y):
        return jax.jacfwd(lambda values: make(*values).rate(jnp.zeros(()), y))(values)

    by_both = jax.jacfwd(by_parameters)(y) * each[None, None]
    found = jnp.abs(jnp.concatenate([by_parameters(y)[..., None], by_both], axis=2))
    return jnp.max(jnp.where(jnp.isfinite(found), found, 0.0), axis=2)
