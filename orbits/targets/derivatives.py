"""Orbits and special points as functions of the numbers of their scenes, for `jax.grad`.

`orbits/analysis/sensitivity.py` has the derivatives of orbits, `special_orbits` in `families` those
of special orbits, `jaxdyn.continuation` those of special equilibria.
"""

from collections.abc import Mapping, Sequence
from typing import Any, overload

from jaxdyn import Scene
from jaxdyn import continuation as points
from jaxdyn._checks import check_kind, fail
from jaxdyn.continuation.family import Equilibrium
from jaxdyn.continuation.sensitivity import DifferentiablePoint
from jaxdyn.integrate.phase import Phase
from orbits.analysis.sensitivity import (
    DifferentiableChain,
    DifferentiableOrbit,
    differentiable_orbit,
)
from orbits.closing.closings import Hold
from orbits.families.family import Member
from orbits.families.special_orbits import (
    DifferentiableSpecialOrbit,
    SpecialOrbit,
    differentiable_special,
)
from orbits.hybrid.legs import HybridOrbit, Leg
from orbits.orbit import Orbit
from orbits.shooting.segment import Make


@overload
def differentiable(scene: Scene, orbit: Orbit, *, hold: Hold = ()) -> DifferentiableOrbit: ...
@overload
def differentiable(
    scene: Sequence[Leg] | Mapping[str, Phase], orbit: HybridOrbit
) -> DifferentiableChain: ...
@overload
def differentiable(scene: Make, orbit: Equilibrium) -> DifferentiablePoint: ...
@overload
def differentiable(
    scene: Make | Scene, orbit: Member | SpecialOrbit, *, hold: Hold = ()
) -> DifferentiableSpecialOrbit: ...
def differentiable(scene: Any, orbit: Any, *, hold: Hold = ()) -> Any:
    """The orbit or special point of a scene near a known one, for `jax.grad`, `jax.jvp` and so on.

    Args:
      scene: the scene whose numbers are differentiated with respect to: the orbit's own, or a
        traced copy of it. For a chain of legs, the legs or the phases from which it was found. For
        a special point of a family, the function parameter -> scene, as for `continue_family` and
        `jaxdyn.continue_equilibria`, with these numbers; in a family in energy, the scene.
      orbit: what `find` or `find_hybrid` returned, or a special point: one of ``family.special``.
      hold: conditions, as for `find` or `continue_family`; they select an orbit of a family. Chains
        and equilibria take none. The name of an entry stands for the orbit's value; if that is the
        value at the start of the scene, there are derivatives with respect to the latter.
    Returns:
      The numbers of `orbit`, equal to those found, with their first derivatives with respect to
      every number of the scene (and of the conditions). Of an orbit or a chain: ``period``, ``y0``,
      ``multipliers()``, for orbits also ``amplitude(name)``. Of a special orbit: ``parameter``, in
      a family in energy its energy, and ``orbit``. Of an equilibrium: ``parameter``, ``state`` and
      ``frequency``.
    Raises:
      ValueError: `orbit` does not close, or not with the numbers of the scene or the conditions;
        legs are given with an orbit, or a scene or conditions with a chain; a condition is traced
        by `jax.jit` or `jax.vmap`; the point is not a special one, or not a generic one: the
        multiplier is not simple, or does not change with the parameter; or it is a branch point and
        the scene has symmetries or integrals besides the flow and those that it names.
    Limits: first derivatives only; further ones are NaN. Under `jax.jit` and `jax.vmap` only
      numbers of the scene may be traced: not `orbit`, and no numbers of conditions.
      Where numbers are traced, and are not those with which the orbit was found, all results are
      NaN: find it again, outside of the transformation. Derivatives are accurate to rounding times
      the growth of errors over the orbit: that of the figure-eight's period with respect to a mass
      to 1e-11, compared with differences of order 6. A branch point has derivatives only with
      respect to numbers that preserve it, as they do if they preserve a symmetry; this is not
      verified, except by `design`, which finds it again. Chains have no derivatives of their
      special points. `jaxdyn.continuation.differentiable` has an example of a Hopf point.
    Example:
      >>> import equinox as eqx, orbits
      >>> from jaxdyn import scenes
      >>> swing = orbits.find(scenes.oscillator(k=4.0), [1.0, 0.0], 3.0)
      >>> def period(scene):
      ...     return orbits.differentiable(scene, swing, hold=orbits.Energy(2.0)).period
      >>> round(float(eqx.filter_grad(period)(swing.scene).system.m[0]), 9)  # T = pi sqrt(m)
      1.570796327
    """
    check_kind("orbit", orbit, (Orbit, HybridOrbit, Equilibrium, Member, SpecialOrbit))
    if isinstance(orbit, Orbit | HybridOrbit):
        return differentiable_orbit(scene, orbit, hold)
    _check_makes_scenes(scene, orbit)
    if isinstance(orbit, Equilibrium):
        if hold:
            raise fail("hold", "none for an equilibrium", "conditions", "Leave it out.")
        return points.differentiable(scene, orbit)
    return differentiable_special(orbit, scene, hold=hold)


def _check_makes_scenes(scene: Any, point: Any) -> None:
    """Raise ValueError unless it is a function, or the scene of a special orbit."""
    if callable(scene) or (isinstance(scene, Scene) and not isinstance(point, Equilibrium)):
        return
    expected = "a function parameter -> scene for a special point"
    raise fail("scene", expected, type(scene).__name__, "See make= of continue_family.")
