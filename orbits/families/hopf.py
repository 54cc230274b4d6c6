"""The orbits that begin at a Hopf point of a family of equilibria."""

import numpy as np

from jaxdyn._checks import check_first, check_on_host, fail, finite
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.continuation.family import Equilibrium, EquilibriumFamily
from jaxdyn.continuation.kinds import Kind
from jaxdyn.continuation.units import units_of
from orbits.closing.closings import PLAIN
from orbits.closing.sizes import largest_entry
from orbits.families.steps import parameter_at
from orbits.families.surface import OrbitSurface
from orbits.orbit import Orbit, SearchError
from orbits.shooting.equations import Equations
from orbits.shooting.outcomes import Trouble
from orbits.shooting.strategy import GOAL, RTOL

#: The usual distance of an orbit from an equilibrium, as a share of the sizes of its entries.
_SMALL = 1e-2
#: Shares of that distance that are tried: orbits may soon cease to be ellipses, as in fast-slow
#: systems.
_SHARES = np.array([1.0, 0.3, 0.1, 0.03, 0.01])
#: Multiples of that distance that are tried if the parameter and the period of so small an orbit
#: differ from those of the Hopf point by less than the second number, relatively: rounding would
#: then decide the direction of the family. The entries of an equilibrium may be small by chance.
_MULTIPLES, _DIFFERENT = 10.0 ** np.arange(1, 7), 1e-8
_NO_ORBIT = (
    "No orbit was found at this amplitude, which is in units of the state. Try a smaller one, or "
    "leave it out: far from the equilibrium, orbits are not ellipses, and at a degenerate Hopf "
    "point none may begin."
)
_NO_ORBIT_AT_ALL = (
    "No orbit was found at amplitudes down to 1 / 100 of the usual one. From a degenerate Hopf "
    "point none may begin; else give an amplitude, in units of the state."
)


@check_first
def from_hopf(
    family: EquilibriumFamily, point: Equilibrium, *, amplitude: float | None = None
) -> tuple[Orbit, float]:
    """An orbit that begins at a Hopf point, and its parameter.

    To first order it is the ellipse of the critical eigenvector, and its period is 2 pi over the
    frequency; the parameter follows from the closing equations with the start held at a distance.

    Args:
      family: a result of `jaxdyn.continue_equilibria`.
      point: a Hopf point of ``family.special``.
      amplitude: distance of the start from the equilibrium in the units of the state, along the
        eigenvector in the phase at which its largest entry, in sizes, is at its maximum. By default
        it is a hundredth of the sizes of the equilibrium's entries, or where these are 0 of the
        distance at which the rate is no longer linear; less where no orbit is found there, more
        where parameter and period of the orbit are still those of the Hopf point.
    Returns:
      (orbit, parameter), for `continue_family`, which by default leads away from the Hopf point.
    Raises:
      ValueError: `point` is not a Hopf point, or `amplitude` is 0 or not finite.
      SearchError: no orbit was found.
    Reference: Y. Kuznetsov, Elements of Applied Bifurcation Theory, Springer (2004), section 10.2.
    Example:
      >>> import jaxdyn, orbits
      >>> def make(mu):
      ...     return jaxdyn.ode(
      ...         lambda t, y, mu: [y[1], mu * y[1] - y[0] ** 2 * y[1] - y[0]],
      ...         [0.0, 0.0], 10.0, params=mu)
      >>> equilibria = jaxdyn.continue_equilibria(make, -1.0, [0.0, 0.0], step=0.3, members=6)
      >>> orbit, mu = orbits.from_hopf(equilibria, equilibria.special[0], amplitude=0.1)
      >>> round(mu, 4), round(orbit.period, 3)  # mu = amplitude^2 / 4
      (0.0025, 6.283)
    """
    check_on_host("from_hopf", amplitude, "See orbits.differentiable, for what it finds.")
    if point.kind != Kind.HOPF:
        raise fail("point", "a Hopf point of family.special", point.kind or "an ordinary member")
    if amplitude is not None:
        finite("amplitude", amplitude, "It is a distance in units of the state.")
        if not amplitude:
            raise fail("amplitude", "a number other than 0", amplitude)
    usual = in_sizes(family, point, _SMALL)
    distances = usual * _SHARES if amplitude is None else (amplitude,)
    orbits = (_orbit_at(family, point, distance) for distance in distances)
    smallest = next((orbit for orbit in orbits if orbit is not None), None)
    if smallest is None:
        raise SearchError(_NO_ORBIT if amplitude is not None else _NO_ORBIT_AT_ALL)
    if amplitude is not None or _differs(family, point, *smallest):
        return smallest
    for distance in usual * _MULTIPLES:
        larger = _orbit_at(family, point, distance)
        if larger is None:
            break
        if _differs(family, point, *larger):
            return larger
    return smallest  # all orbits have the same period, at the same parameter


def _orbit_at(
    family: EquilibriumFamily, point: Equilibrium, distance: float
) -> tuple[Orbit, float] | None:
    """The orbit at a distance from a Hopf point, and its parameter; None if none is found."""
    critical, period = _critical(family, point), 2 * np.pi / point.frequency
    start = point.state + distance * critical
    # The scene starts on the guess: at rest in the origin its entries would have no size.
    scene = family.make(point.parameter).starting(start, period)
    equations = Equations(scene=scene, closing=PLAIN, make=family.make)
    guess = equations.pack(start, (), angle=0.0, parameter=point.parameter, period=period)
    across = equations.pack(critical, (), angle=0.0, parameter=0.0, period=0.0)
    surface = OrbitSurface(equations, RTOL, GOAL)
    found = surface.nearest(guess, across=across)
    # Far from the equilibrium a motion that hardly moves closes, relative to the size of its start.
    if found is None or Trouble(equations, guess)(equations, found.x) is not None:
        return None
    return surface.orbit(found), parameter_at(surface, found.x)


def _differs(family: EquilibriumFamily, point: Equilibrium, orbit: Orbit, value: float) -> bool:
    """Whether parameter or period of an orbit are no longer those of the Hopf point."""
    apart = (value - point.parameter) / units_of(family.make, point).parameters[0]
    slower = orbit.period * point.frequency / (2 * np.pi) - 1
    return max(abs(apart), abs(slower)) > _DIFFERENT


def in_sizes(family: EquilibriumFamily, point: Equilibrium, share: float) -> float:
    """The amplitude at which no entry changes by more than a share of its size."""
    sizes, change = units_of(family.make, point).each, np.abs(_critical(family, point))
    return share * float(np.min(sizes[change > 0] / change[change > 0]))


def _critical(family: EquilibriumFamily, point: Equilibrium) -> np.ndarray:
    """(k,) the direction in which the orbits of a Hopf point begin, of length 1."""
    entry_sizes = units_of(family.make, point).each
    values, vectors = np.linalg.eig(map_in_units(point.jacobian, entry_sizes))
    vector = entry_sizes * vectors[:, np.argmin(np.abs(values - 1j * point.frequency))]
    found = (vector / vector[largest_entry(vector, entry_sizes)]).real
    return found / np.linalg.norm(found)
