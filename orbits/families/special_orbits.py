"""Special orbits as functions of the numbers of their scenes: where they lie, with derivatives.

Along a family the test function of a special point, g(p, numbers) = 0, has derivatives by the
implicit function theorem for the orbit, so dp = -g_numbers / g_p dnumbers. At a period doubling the
test is det(M + 1), with M the derivative of the return map: the product of all l + 1 over the
multipliers l. It is simple also where two multipliers of a conservative scene meet at -1, since
(l + 1) (1 / l + 1) = l + 1 / l + 2 passes 0 with their index. At a branch point it is the same
product of l - 1, of M on the complement of the flow and of the gradients of the integrals. At a
torus point it is |l|^2 - 1, with the critical multiplier l. At a fold, where orbits have no
derivative with respect to the parameter, it is the part w F of the closing equations F that no
change of the orbit moves, with w normal to the range of their Jacobian.

In a family in energy of a conservative scene the energy takes the place of the parameter.
"""

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene
from jaxdyn._checks import check_first, fail, is_traced
from jaxdyn._numerics import first_only, nan_unless
from jaxdyn.analysis.energy import integrals
from jaxdyn.continuation.kinds import Kind
from orbits.analysis.sensitivity import (
    DifferentiableOrbit,
    Posed,
    differentiable_orbit,
    pose,
    residual,
)
from orbits.analysis.stability import Stability, stability
from orbits.closing.closings import Condition, Energy, Hold, conditions
from orbits.closing.given import is_driven
from orbits.closing.sizes import sizes
from orbits.families.family import Member, smooth_orbit
from orbits.families.folds import ZERO, differentiable_fold
from orbits.orbit import Orbit
from orbits.shooting.equations import Equations, InUnits
from orbits.shooting.segment import Make, scene_of

#: A test counts as zero if its terms cancel to this share of their size.
_ZERO = 1e-7
_KINDS = (Kind.FOLD, Kind.BRANCH, Kind.DOUBLING, Kind.TORUS)


@dataclasses.dataclass(frozen=True)
class SpecialOrbit:
    """A special orbit, without its family.

    Attributes:
      kind: fold, branch point, period doubling or torus point.
      orbit: the orbit.
      parameter: the value of its family's parameter; in a family in energy, its energy.
    """

    kind: Kind
    orbit: Orbit
    parameter: float

    @classmethod
    def of(cls, member: "Member | SpecialOrbit") -> "SpecialOrbit":
        """The special orbit of a family's special point.

        Raises:
          ValueError: it is of another kind, or a chain of legs.
        """
        if isinstance(member, SpecialOrbit):
            return member
        if not isinstance(member, Member) or member.kind not in _KINDS:
            what = "a fold, branch point, period doubling or torus point"
            got = getattr(member, "kind", type(member).__name__) or "an ordinary orbit"
            raise fail(
                "point", what, got, "Choose one of family.special, or pass the member's .orbit."
            )
        orbit = smooth_orbit("point", member.orbit)
        value = member.energy if math.isnan(member.parameter) else member.parameter
        return cls(member.kind, orbit, value)

    @functools.cached_property
    def stability(self) -> Stability:
        """The stability of the orbit."""
        return stability(self.orbit)


class Place(NamedTuple):
    """Where an orbit of a family is to be found.

    Attributes:
      scene: its scene.
      held: the conditions that it satisfies besides closing.
    """

    scene: Scene
    held: tuple[Condition, ...]


def path_of(orbit: Orbit, make: Make | Scene, hold: Hold) -> Callable[[Array], Place]:
    """The function that maps the parameter of a family, or its energy, to the place of an orbit.

    Names of entries in `hold` stand for their values in `orbit`.
    """
    held = conditions(orbit.scene, hold, (orbit.closing,))
    if isinstance(make, Scene):
        scene = make.starting(orbit.y0, orbit.period)
        return lambda energy: Place(scene, (*held, Energy(energy)))
    return lambda parameter: Place(scene_of(orbit.scene, make, parameter), held)


class DifferentiableSpecialOrbit(NamedTuple):
    """A special orbit as a differentiable function of the numbers of its scenes.

    Attributes:
      parameter: () value of the family's parameter, or its energy in a family in energy.
      known: the orbit on which it is based.
      path: see `path_of`.
    """

    parameter: Array
    known: SpecialOrbit
    path: Callable[[Array], Place]

    @property
    def orbit(self) -> DifferentiableOrbit:
        """The orbit, with its period, start and multipliers.

        At a fold the critical multiplier is NaN.
        """
        if self.known.kind == Kind.FOLD:
            return self._at_fold()
        scene, held = self.path(self.parameter)
        return differentiable_orbit(scene, self.known.orbit, held)

    def _at_fold(self) -> DifferentiableOrbit:
        """The orbit at a fold, which is no function of the parameter; see `folds`."""
        orbit, path = self.known.orbit, self.path
        p, one = jnp.asarray(self.known.parameter), jnp.ones(())
        posed = pose(orbit, jax.lax.stop_gradient(path(p)).held)
        fixed, ahead = jax.lax.stop_gradient(
            eqx.filter_jvp(lambda p: placed(posed, path(p)), (p,), (one,))
        )
        by_parameter = residual_change(fixed, ahead, jnp.asarray(posed.x), orbit.rtol)
        place = path(self.parameter)
        found = differentiable_fold(posed, placed(posed, place), by_parameter, orbit.rtol)
        scene = place.scene.starting(found.y0, found.period)
        return DifferentiableOrbit(scene, found.angle, orbit)


def placed(posed: Posed, place: Place) -> Equations:
    """The closing equations of an orbit at a place of its family."""
    return dataclasses.replace(posed.of(place.scene), conditions=place.held)


@eqx.filter_jit
def residual_change(equations: Equations, ahead: Equations, x: Array, rtol) -> Array:
    """(m,) the change of the residual with a change of the equations."""
    return eqx.filter_jvp(lambda e: residual(e, x, rtol), (equations,), (ahead,))[1]


@check_first
def differentiable_special(
    point: Member | SpecialOrbit, make: Make | Scene, *, hold: Hold = ()
) -> DifferentiableSpecialOrbit:
    """A special orbit, its parameter and its orbit, with derivatives; see `orbits.differentiable`.

    Args:
      point: a fold, branch point, period doubling or torus point, of ``family.special``.
      make: parameter -> scene, as for `continue_family`, with the numbers that derivatives are
        taken for: those with which the point was found, or traced copies. In a family in energy,
        the scene itself; the parameter is the energy then.
      hold: the conditions of the family, as for `continue_family`.
    Raises:
      ValueError: `point` is of another kind, or not a generic one: the multiplier is not simple, or
        does not change with the parameter; or it is a branch point and the scene has symmetries or
        integrals other than the flow and those that it names; or the scenes have other numbers than
        those with which it was found.
    """
    known = SpecialOrbit.of(point)
    path = path_of(known.orbit, make, hold)
    return DifferentiableSpecialOrbit(_parameter(known, path), known, path)


def _parameter(known: SpecialOrbit, path: Callable[[Array], Place]) -> Array:
    """The parameter () at which a special orbit lies, with its first derivatives."""
    value = jnp.asarray(known.parameter)
    found = test_along(known, path, value)
    fixed = jax.lax.stop_gradient(found)
    change = first_only(found.value - fixed.value)
    step = fixed.slope @ change / (fixed.slope @ fixed.slope)
    with jax.ensure_compile_time_eval():
        zero = _zero(known)
    is_special = jnp.abs(fixed.value).max() <= zero
    # A factor NaN makes the derivatives NaN too; to select a constant NaN would make them zero.
    value = value - nan_unless(is_special, step)
    if is_traced(value):
        return value
    if np.isnan(step):
        what = f"a generic {known.kind}"
        raise fail("point", what, "one whose test has no value, or no slope along the family")
    if not is_special:
        raise fail(
            "make",
            "a function that makes scenes with the numbers with which the point was found",
            "one with others, for which the point is not special",
            "Find the point again with these; see orbits.design.",
        )
    return value


class TestValue(NamedTuple):
    """The test of a special orbit.

    Attributes:
      value: (r,) the test.
      slope: (r,) its derivative with respect to the parameter, without derivatives of its own,
        since second derivatives are not needed.
    """

    value: Array
    slope: Array


def test_along(known: SpecialOrbit, path: Callable[[Array], Place], value: Array) -> TestValue:
    """The test of a special orbit at a value of the parameter."""
    test = _TESTS[known.kind](known, path)
    here, ahead = eqx.filter_jvp(path, (value,), (jnp.ones(()),))
    found = test(here)
    fixed = jax.lax.stop_gradient((here, ahead))
    _, slope = eqx.filter_jvp(test, fixed[:1], fixed[1:])
    return TestValue(found, slope)


def _fold(known: SpecialOrbit, path: Callable[[Array], Place]) -> Callable[[Place], Array]:
    orbit, held = known.orbit, path(jnp.asarray(known.parameter)).held
    with jax.ensure_compile_time_eval():
        posed = pose(orbit, jax.lax.stop_gradient(held))
        rows = jnp.asarray(_beyond(posed.equations, posed.x, orbit.rtol))

    def test(place: Place) -> Array:
        return rows @ residual(placed(posed, place), posed.x, orbit.rtol)

    return test


def _doubling(known: SpecialOrbit, path: Callable[[Array], Place]) -> Callable[[Place], Array]:
    del path

    def test(place: Place) -> Array:
        m = differentiable_orbit(place.scene, known.orbit, place.held).return_map()
        return jnp.linalg.det(m + jnp.eye(len(m)))[None]

    return test


def _branch(known: SpecialOrbit, path: Callable[[Array], Place]) -> Callable[[Place], Array]:
    del path
    with jax.ensure_compile_time_eval():
        orbit, entry_sizes = known.orbit, sizes(known.orbit.scene)
        names = _conserved(known)
    autonomous = not is_driven(orbit.scene)

    def test(place: Place) -> Array:
        here = differentiable_orbit(place.scene, orbit, place.held)
        scene, y0 = here.scene, here.y0
        rows = [scene.rate(jnp.zeros(()), y0) / entry_sizes] if autonomous else []
        if names:
            slopes = jax.jacfwd(lambda y: integrals(scene, jnp.zeros(()), y))(y0)
            rows += [slopes[name] * entry_sizes for name in names]
        m = here.return_map() * entry_sizes[None] / entry_sizes[:, None]
        along = jnp.zeros_like(m)
        if rows:
            a = jnp.stack(rows) / jnp.linalg.norm(jnp.stack(rows), axis=1, keepdims=True)
            along = a.T @ jnp.linalg.solve(a @ a.T, a)
        across = jnp.eye(len(m)) - along
        value = jnp.linalg.det(across @ (m - jnp.eye(len(m))) @ across + along)
        return value[None]

    return test


def _conserved(known: SpecialOrbit) -> list[str]:
    """The names of the integrals, which must be those that the scene names.

    Raises:
      ValueError: there are other integrals, or symmetries other than the flow.
    """
    reasons = [reason for reason in known.stability.reasons if reason != "flow"]
    scene = known.orbit.scene
    values = integrals(scene, jnp.zeros(()), scene.y0)
    other = [reason for reason in reasons if reason not in values or values[reason].ndim]
    if other:
        expected = "a branch point without symmetries, whose integrals the scene names"
        raise fail("point", expected, ", ".join(other), "See energy= and integrals= of the scene.")
    return reasons


def _torus(known: SpecialOrbit, path: Callable[[Array], Place]) -> Callable[[Place], Array]:
    del path
    with jax.ensure_compile_time_eval():
        values = known.stability.nontrivial
    # The critical one, on the unit circle; its conjugate is there too.
    which = int(np.argmin(np.where(values.imag > 0, np.abs(np.abs(values) - 1.0), np.inf)))

    def test(place: Place) -> Array:
        multipliers = differentiable_orbit(place.scene, known.orbit, place.held).multipliers()
        return (jnp.abs(multipliers[which]) ** 2 - 1.0)[None]

    return test


#: Test functions: (known orbit, path) -> a function of a place that returns (r,) numbers, which are
#: 0 at a special orbit.
_TESTS = {Kind.FOLD: _fold, Kind.BRANCH: _branch, Kind.DOUBLING: _doubling, Kind.TORUS: _torus}


def _zero(known: SpecialOrbit) -> float:
    """Largest absolute value of a special orbit's test that counts as zero."""
    if known.kind == Kind.FOLD:
        return _ZERO
    linear = known.stability
    if known.kind == Kind.TORUS:
        return max(_ZERO, 2 * float(linear.bars.max(initial=0.0)))
    # The size of the terms that cancel in products of l + 1 or l - 1.
    return _ZERO * float(np.prod(1.0 + np.abs(linear.multipliers)))


def _beyond(equations, x: np.ndarray, rtol: float) -> np.ndarray:
    """(r, m) rows of the closing equations that no change of the unknowns moves."""
    closed = InUnits(jax.lax.stop_gradient(equations), x, rtol)
    left, values, _ = np.linalg.svd(closed(x)[1])
    rank = int((values > ZERO * values[0]).sum())
    return left[:, rank:].T / closed.units.residual
