"""Constant symplectic forms that a rate may keep, found in floats; `structure` proves them.

Forms of `invariant_forms` are recognised if their entries are simple rational multiples of one of
them, as with masses 1/2 and 3/2, where all coordinates have one unit and all velocities one.
"""

import itertools
import math
from fractions import Fraction

import numpy as np

from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.analysis.monodromy import WEIGHTS, invariant_forms
from jaxdyn.balls.arithmetic import arb, precision
from orbits.proof.closing_equations import ClosingEquations
from orbits.proof.posing import pivots, points_near

_POINTS = 6
_SPREAD = 0.3  # spread of the points, relative to each entry's size
_LARGEST = 1000  # largest denominator
_ROUNDED = 1e-8  # largest difference of an entry from its fraction
_BITS = 128


def forms_of(system: ClosingEquations) -> list[np.ndarray]:
    """(k, k) candidates for a symplectic form, whose entries are fractions; [] if none is found."""
    k = system.field.k
    if k % 2:
        return []
    slopes, each = _slopes(system), np.array(system.sizes)
    if system.generator is not None:
        slopes.append(system.generator.astype(float))
    if not slopes:
        return []
    above = np.triu_indices(k, 1)
    # What is kept is found in the sizes of the entries, and recognised in their units.
    null = np.array(
        [form[above] for form in invariant_forms([map_in_units(x, each) for x in slopes])]
    )
    chosen = pivots(null, len(null)) if len(null) else None
    if chosen is None:
        return []
    null = null / np.outer(each, each)[above]
    basis = _as_fractions(np.linalg.solve(null[:, chosen].T, null).tolist())
    if basis is None:
        return []
    found = []
    for weights in WEIGHTS[: 1 if len(basis) == 1 else None]:
        total = np.full((k, k), Fraction(0), object)
        for weight, row in zip(itertools.cycle(weights), basis, strict=False):
            for (i, j), x in zip(np.transpose(above), row, strict=True):
                total[i, j] += weight * x
                total[j, i] -= weight * x
        found.append(total)
    return found


def _slopes(system: ClosingEquations) -> list[np.ndarray]:
    """(k, k) derivatives of the rate at points near the orbit."""
    k, found = system.field.k, []
    with precision(_BITS):
        for t, y in points_near(system, _SPREAD, _POINTS):
            try:
                flat = system.field.slopes(system.field.inputs(arb(t), y))[k:]
            except ArithmeticError:
                continue
            table = np.array([float(x) for x in flat]).reshape(k, k)
            if np.isfinite(table).all():
                found.append(table)
    return found


def _as_fractions(rows: list[list[float]]) -> list[list[Fraction]] | None:
    """The same numbers as fractions; None if one is not near a simple one."""
    found = [[Fraction(x).limit_denominator(_LARGEST) for x in row] for row in rows]
    pairs = zip(itertools.chain(*rows), itertools.chain(*found), strict=True)
    near = all(math.isclose(x, y, rel_tol=0.0, abs_tol=_ROUNDED) for x, y in pairs)
    return found if near else None
