"""Families that close upon themselves (isolas): the first orbit again.

A step that passes the first member comes near it, from behind. Where orbits may start anywhere on
themselves, the parameter and the period tell, else all unknowns. If the orbit there is the first
one, the family is closed.
"""

import numpy as np

from orbits.analysis.same import same_orbit
from orbits.families.bifurcations import zero_between
from orbits.families.family import Member
from orbits.families.surface import Point, Surface


def met_again(surface: Surface, first: Member, a: Member, b: Member) -> Member | None:
    """The first member as it is met again between two neighbours; None if it is not."""

    def compared(point: Point, x: np.ndarray) -> np.ndarray:
        if surface.shrinks:
            return x[-1:] if surface.equations.make is None else x[-2:]
        return point.equations.place(x)

    here = first.point
    x0, tangent, units = (compared(here, x) for x in (here.x, first.tangent, here.units))

    def offset(member: Member) -> np.ndarray:
        return (compared(member.point, member.point.x) - x0) / units

    def along(_: Surface, member: Member) -> float:
        return float(tangent / units @ offset(member))

    if not along(surface, a) < 0 <= along(surface, b):
        return None
    length = np.linalg.norm(offset(b) - offset(a))
    if max(np.linalg.norm(offset(member)) for member in (a, b)) > 2 * length:
        return None
    found = zero_between(surface, a, b, along)
    if found is None or not (found.orbit.ok and first.orbit.ok):
        return None
    return found if same_orbit(first.orbit, found.orbit) else None
