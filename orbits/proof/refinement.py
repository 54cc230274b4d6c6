"""More digits of an orbit: its start, period and multipliers, to as many digits as requested."""

import math

import numpy as np

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn._progress import report_progress
from jaxdyn.analysis.eigenvalues import map_in_units
from jaxdyn.ball_arithmetic.arithmetic import (
    arb,
    arb_mat,
    column,
    float_matrix,
    midpoints,
    precision,
)
from jaxdyn.ball_arithmetic.motion import End, bits_of
from jaxdyn.ball_arithmetic.program import Program
from orbits.orbit import Orbit, SearchError
from orbits.proof.closing_equations import ClosingEquations
from orbits.proof.posing import ROUGH_DIGITS, equations_of
from orbits.proof.refined import NEAR, Refined
from orbits.proof.stability import multipliers

LEAST_DIGITS, MOST_DIGITS = 15, 1000
#: Digits of the calculation beyond those that are reported, besides those that the motion loses.
_SPARE = 6
_LEAST_ITERATIONS, _MOST_ITERATIONS = 2, 60
#: Assumed digits of an orbit in doubles and its Jacobian; the first step measures them.
_FIRST_DIGITS = 12.0
#: Most steps with one Jacobian, which costs about as much as four of them.
_MOST_CHORDS = 3
_ALLOWANCE = 2.0  # digits by which the gain of a step may fall short of what is expected
_LEAST_GAIN = 2.0  # with a gain of fewer digits in a step the iteration does not converge
#: Additional orders of the series in the independent last run.
_OTHER_ORDER = 7


@check_first
def refine(orbit: Orbit, digits: int = 50) -> Refined:
    """Start and period of an orbit to many digits.

    They are found by Newton's method on the closing equations (see `closing_equations` in the same
    folder), with a Jacobian in doubles as long as that gains digits in each step, and in full
    precision where it does not. Every number of the scene is taken to be its binary float exactly,
    and so are the entries that are held.

    Args:
      orbit: what `find` returned.
      digits: number of digits, 15 to 1000.
    Raises:
      ValueError: `digits` is out of range, or the rate is not made of elementary functions.
      SearchError: Newton's method does not converge.
    Limits: truncation errors are estimated, and the end is checked by a second run.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> swing = orbits.find(scenes.pendulum(angle=2.0), period=2.7, hold="theta")
      >>> orbits.refine(swing, 30).held
      ('theta', 'theta_dot')
    """
    _checks.whole("digits", digits, LEAST_DIGITS, MOST_DIGITS, "They are decimal digits.")
    report_progress("writing the closing equations as formulas")
    system = equations_of(orbit)
    numbers, lost = solve(system, digits + _SPARE)
    working = digits + _SPARE + lost
    report_progress("checking the closing error, and computing the multipliers, with other steps")
    with precision(bits_of(working)):
        again = system.motion(numbers, working, slopes=True, more=_OTHER_ORDER)
        error = _largest(system.residual(again.y, numbers), system.residual_units)
        period, start = system.period(numbers), system.start(numbers)
        # The closing error moves the solution by at most the inverse of Newton's Jacobian.
        certain = min(digits, math.floor(-_log10(error) - lost))
        values, exponents = _multipliers(system.monodromy(again.slopes, numbers), certain)
        energy = system.integrals.get("energy")
        return Refined(
            orbit=orbit,
            digits=certain,
            period=_text(period, period, certain),
            y0=tuple(
                _text(x, arb(size), certain) for x, size in zip(start, system.sizes, strict=True)
            ),
            held=tuple(system.names[i] for i in system.held),
            residual=error.str(3, radius=False),
            multipliers=values,
            exponents=exponents,
            energy=None if energy is None else _energy(system, energy, start, certain),
            angle=_text(numbers[len(system.names) - 1], arb(1), certain)
            if system.generator is not None
            else None,
        )


def _energy(system: ClosingEquations, energy, start: list, digits: int) -> str:
    program = Program.of(system.formulas.graph, [energy])
    pairs = zip(system.formulas.states, start, strict=True)
    value = program({system.formulas.time: arb(0), **dict(pairs)})[0]
    return _text(value, value, digits)


def _multipliers(matrix: arb_mat, digits: int) -> tuple:
    """The non-trivial multipliers and their rotation numbers as decimal strings."""
    # A pair of multipliers 1 +- e changes the remainder by e^2 only, so the tolerance has to be far
    # below the rounding of doubles.
    unit = multipliers.multiplicity(matrix, 10.0 ** -(digits / 2))
    exact = midpoints(matrix)
    coefficients = [c.mid() for c in multipliers.deflate(exact, unit)]
    error = arb(10) ** -(digits + _SPARE)
    found = multipliers.sorted_roots(multipliers.roots(coefficients, error))
    size = arb(1)
    certain = [digits - _lost_beside(z, found) for z in found]
    texts = tuple(
        (_text(z.real, size, n), _text(z.imag, size, n))
        for z, n in zip(found, certain, strict=True)
    )
    exponents = tuple(
        _text(multipliers.rotation_number(z), size, n) if abs(float(abs(z)) - 1) < 1e-9 else None
        for z, n in zip(found, certain, strict=True)
        if float(z.imag) > 0 or (float(z.imag) == 0 and abs(float(z.real)) > 1)
    )
    return texts, exponents


def _lost_beside(z, found: list) -> int:
    """The number of digits that a multiplier loses because it nearly meets another one."""
    apart = min((float(abs(z - other)) for other in found if other is not z), default=1.0)
    return _SPARE - math.floor(math.log10(apart)) if 0 < apart < NEAR else 0


def solve(system: ClosingEquations, digits: float) -> tuple[list[arb], float]:
    """The numbers of an orbit to a number of digits, and how many digits its motion loses.

    Raises:
      SearchError: Newton's method does not converge.
    """
    numbers, lost, before = _at_precision(system, system.centre()), 0.0, -math.inf
    inverse, lost = _inverse(system, numbers, ROUGH_DIGITS)
    inverse = arb_mat(float_matrix(inverse).tolist())
    reached, gain, index = _FIRST_DIGITS, max(_LEAST_GAIN, _FIRST_DIGITS - lost), 0
    while reached < digits or index < _LEAST_ITERATIONS:
        index += 1
        if digits - reached > _MOST_CHORDS * gain and gain < reached - lost:
            report_progress(f"Jacobian to {reached:.0f} digits")
            inverse, gain = _inverse(system, numbers, reached + lost)[0], reached - lost
        wanted = min(digits, reached + gain)
        numbers, found = _step(system, numbers, inverse, wanted + lost)
        report_progress(f"Newton step {index}: {max(found, 0.0):.0f} digits before it")
        if found < reached - _ALLOWANCE and index > 1:
            # The previous step gained less than expected.
            gain = min(gain, found - before)
            if gain < _LEAST_GAIN or index > _MOST_ITERATIONS:
                raise SearchError(
                    f"Newton's method stops at {max(found, 0.0):.0f} digits. Start from a better "
                    "orbit: orbits.find(..., rtol=1e-14)."
                )
        reached, before = min(wanted, found + gain), found
    return numbers, lost


def _step(
    system: ClosingEquations, numbers: list[arb], inverse: arb_mat, digits: float
) -> tuple[list[arb], float]:
    """The numbers after a step of Newton's method, and the number of correct digits before it."""
    with precision(bits_of(digits)):
        numbers = _at_precision(system, numbers)
        end = _motion(system, numbers, digits, slopes=False)
        error = column(system.unspared(system.residual(end.y, numbers)))
        step = [-(x.mid()) for x in (inverse * error).entries()]
        moved = _move(system, numbers, step)
        far = _largest(step, system.units[system.unknowns])
        return moved, _log10(_largest(moved, system.units)) - _log10(far)


def _inverse(system: ClosingEquations, numbers: list[arb], digits: float) -> tuple[arb_mat, float]:
    """The inverse of the Jacobian, and how many digits the motion loses."""
    with precision(bits_of(digits)):
        end = _motion(system, numbers, digits, slopes=True)
        jacobian = system.jacobian(end.y, end.slopes, numbers)
        try:
            inverse = system.inverse(jacobian)
        except ZeroDivisionError as error:
            raise SearchError("The closing equations have a singular Jacobian.") from error
        own, rows = system.units[system.unknowns], system.residual_units[system.equations]
        tables = (
            map_in_units(float_matrix(end.slopes), np.array(system.sizes)),
            float_matrix(inverse) * rows / own[:, None],
        )
        growth = max(1.0, *(np.abs(table).max() for table in tables))
        return midpoints(inverse), math.log10(growth)


def _motion(system: ClosingEquations, numbers: list[arb], digits: float, *, slopes: bool) -> End:
    try:
        return system.motion(numbers, digits, slopes=slopes)
    except ArithmeticError as error:
        raise SearchError(str(error)) from error


def _at_precision(system: ClosingEquations, numbers: list[arb]) -> list[arb]:
    """The numbers, with the exact period of a drive at the present precision."""
    if system.drive is None:
        return numbers
    place = system.embed.shape[1]
    return [system.exact_period() if i == place else x for i, x in enumerate(numbers)]


def _move(system: ClosingEquations, numbers: list[arb], step: list[arb]) -> list[arb]:
    moved = list(numbers)
    for i, change in zip(system.unknowns, step, strict=True):
        moved[i] = (moved[i] + change).mid()
    return moved


def _largest(vector: list[arb], units: np.ndarray) -> arb:
    """The largest absolute value of numbers in units."""
    found = arb(0)
    for x, unit in zip(vector, units.tolist(), strict=True):
        bound = (abs(x) / unit).upper()
        found = bound if bound > found else found
    return found


def _log10(x: arb) -> float:
    return float(x.log() / arb(10).log()) if x > 0 else -math.inf


def _text(x: arb, size: arb, digits: int) -> str:
    """A decimal string with an absolute error below 10^-digits times a size."""
    if x.mid().is_zero():
        return "0"
    shorter = max(1, digits + math.ceil(_log10(abs(x.mid())) - _log10(abs(size.mid()))))
    return arb(x.mid()).str(shorter, radius=False)
