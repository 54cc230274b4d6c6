"""The proof that a periodic orbit exists, is locally unique, and is stable or unstable."""

import math

import jax.numpy as jnp
import numpy as np

from jaxdyn import Scene, _checks
from jaxdyn._checks import check_first
from jaxdyn._progress import report_progress
from jaxdyn.analysis.monodromy import symplectic_form
from jaxdyn.ball_arithmetic.arithmetic import arb, precision
from jaxdyn.ball_arithmetic.decimals import decimal
from jaxdyn.ball_arithmetic.motion import bits_of
from jaxdyn.ball_arithmetic.tube import SLOPE_DIGITS, NotEnclosed, tube
from jaxdyn.formulations.newton import FreePoints
from orbits.closing.closings import choreography
from orbits.orbit import Orbit, SearchError
from orbits.proof.certificate import Certificate
from orbits.proof.closing_equations import ClosingEquations
from orbits.proof.krawczyk import Test, krawczyk_test
from orbits.proof.posing import equations_of, integrals_of, table
from orbits.proof.refinement import LEAST_DIGITS, MOST_DIGITS, solve
from orbits.proof.stability import multipliers
from orbits.proof.stability.spectrum import Spectrum, spectrum
from orbits.proof.stability.structure import forms_of, structure
from orbits.proof.theorems import missing

# ---- Whether equal bodies of an orbit follow one curve at equal times apart, as a choreography

_DIGITS = 30.0  # digits to which the bodies are enclosed within a period


def on_one_curve(
    scene: Scene, system: ClosingEquations, numbers: list[arb], bits: int
) -> bool | None:
    """Whether equal bodies follow one curve at equal times apart; None if not proved or applicable.

    On such a curve, after the n-th part of any period each body is where one of them was at first,
    whatever the order in which they follow each other.
    """
    points = scene.points(jnp.zeros(()), scene.y0) if scene.has_points else None
    other = system.drive is not None or system.reversals is not None
    if points is None or other or not isinstance(scene.system, FreePoints):
        return None
    n, d = points.r.shape
    if n < 2 or 2 * n * d != len(scene.y0) or not np.array_equal(points.m, points.m[:1].repeat(n)):
        return None
    if system.generator is not None:
        return None
    tables = [table(one.symmetry, np.eye(len(scene.y0), dtype=int)) for one in choreography(n, d)]
    if any(np.array_equal(system.goal, one) for one in tables):
        return True
    if system.parts != 1:
        return None
    report_progress("enclosing where the bodies are after a part of the period")
    try:
        first, *_ = _bodies(_after_part(system, numbers, n, bits), n)
    except NotEnclosed:
        return None
    with precision(bits):
        bodies = _bodies(system.start(numbers), n)
    apart = all(any(not a.overlaps(b) for a, b in zip(first, x, strict=True)) for x in bodies)
    return False if apart else None


def _after_part(system: ClosingEquations, numbers: list[arb], n: int, bits: int) -> list[arb]:
    """(k) the state after the n-th part of the period."""
    with precision(bits):
        starts, period = system.start(numbers), system.period(numbers) / n
        at = system.field, arb(0), [x.mid() for x in starts], starts
        span = period.mid(), period
        return tube(*at, span, _DIGITS, bits, sizes=system.sizes).box


def _bodies(state: list[arb], n: int) -> list[list[arb]]:
    """Position and velocity of each of n bodies, from a state [r, v]."""
    d = len(state) // (2 * n)
    at = [state[i : i + d] for i in range(0, len(state), d)]
    return [at[i] + at[n + i] for i in range(n)]


# ---- The proof that a periodic orbit exists, is locally unique, and is stable or unstable

_BOX = 10.0  # digits by which a box is wider than the error of its centre
_LEAST_RADIUS = 1e-300  # least radius of a box, which is a float
_SPARE = 6.0  # digits of the centre and of the arithmetic beyond those that are requested
#: Digits that are added where multipliers cannot be separated: for some published three-body
#: orbits, 32 digits are five too few.
_SHARPER = 12
#: An orbit in doubles is at most this factor farther from the true one than its closing error
#: implies [measured: 0.02 at most].
_NEAR = 100.0
#: Bits of the first trial beyond those of the digits; each further trial doubles them.
_EXTRA_BITS = 64
_TRIALS = 4
#: Contraction above which a failure is not due to the step alone, and above which a proof is
#: hopeless.
_LEAST_CONTRACTION, _MOST_CONTRACTION = 0.5, 1e20
#: Radius, relative to the step, of the box that replaces one that is too narrow; and the step,
#: relative to the radius of the box, above which a proof is hopeless.
_WIDER, _WIDEST = 10.0, 1e3
_MORE = "Try more digits: orbits.prove(orbit, digits=60)."
_ANOTHER = "More digits do not help; find the orbit again, from another guess."


@check_first
def prove(orbit: Orbit, digits: int = 30, *, throw: bool = False) -> Certificate:
    """A certificate that a true periodic orbit exists near one in doubles.

    It says that the equations of motion, whose numbers are exactly the scene's binary floats, have
    a periodic solution within the enclosures of the certificate, and that this is the only one
    within its radius with the held numbers. The test is Krawczyk's (`krawczyk`) on closing
    equations that integrals make square (`closing_equations`), over tubes of Taylor series whose
    remainders are bounded by Cauchy's estimates (`enclosure` and `tube` of
    ``jaxdyn/ball_arithmetic/``); integrals and symmetries are proved as identities (`theorems`); no
    step rests on a rounded number.

    Args:
      orbit: what `find` returned.
      digits: approximate digits of the enclosures, 15 to 1000; with more of them, more unstable
        orbits can be proved.
      throw: raise if nothing is proved.
    Returns:
      The certificate; unless it is `proved`, its reason says what to try.
    Raises:
      ValueError: the rate is not made of elementary functions, its states satisfy constraints, or
        python-flint is missing.
      SearchError: nothing is proved (``throw=True``).
    Limits: one segment, hence orbits of moderate instability; `proved` without `verdict_proved`
      where multipliers cannot be separated, even with twelve more digits, which are tried in a
      narrower box and double the time. Multipliers have some ten digits fewer than the start. The
      period need not be the shortest one.
    Reference: Krawczyk (1969), Computing 4, 187; Kapela, Zgliczynski (2003), Nonlinearity 16,
      1899 (choreographies); Kapela, Simo (2007), Nonlinearity 20, 1241 (the eight's stability).
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> swing = orbits.find(scenes.pendulum(angle=2.0), period=2.7, hold="theta")
      >>> proof = orbits.prove(swing)
      >>> proof.proved, proof.period.mid[:20]
      (True, '2.665870942834925864')
    """
    _checks.whole("digits", digits, LEAST_DIGITS, MOST_DIGITS, "They are decimal digits.")
    report_progress("writing the closing equations as formulas")
    try:
        system = equations_of(orbit)
    except SearchError as error:
        return _no_proof(orbit, f"no centre is found: {error}", throw)
    found = _prove(orbit, system, digits, throw)
    if found.proved and not (found.verdict_proved or found.multipliers):
        # Close encounters widen derivatives far more than motions.
        sharper = _prove(orbit, system, min(digits + _SHARPER, MOST_DIGITS), False)
        return sharper if sharper.multipliers else found
    return found


def _prove(orbit: Orbit, system: ClosingEquations, digits: float, throw: bool) -> Certificate:
    """The certificate of a box about the numbers of the orbit, solved to a number of digits."""
    try:
        numbers, lost = solve(system, digits + _SPARE)
    except SearchError as error:
        return _no_proof(orbit, f"no centre is found: {error}", throw)
    distance = _distance(system, numbers)
    if distance > _NEAR * 10**lost * max(orbit.rtol, orbit.residual):
        message = (
            f"the nearest solution is {distance:.1e} away, in the sizes of entries, from that given"
        )
        return _no_proof(orbit, f"{message}, whose digits are wrong. {_ANOTHER}", throw)
    radius = max(10.0 ** (_BOX - digits), _LEAST_RADIUS)
    return certify(orbit, system, numbers, radius, digits + lost, throw=throw)


def _distance(system: ClosingEquations, numbers: list[arb]) -> float:
    """How far a solution is from the orbit in doubles, in units."""
    off = np.array([float(x) for x in numbers]) - np.array(system.values)
    return float(np.abs(off / system.units).max())


def certify(
    orbit: Orbit,
    system: ClosingEquations,
    numbers: list[arb],
    radius: float,
    digits: float,
    *,
    bits: int | None = None,
    units: np.ndarray | None = None,
    throw: bool = False,
) -> Certificate:
    """The certificate of a box about given numbers, or why there is none.

    Args:
      orbit: the orbit in doubles.
      system: its closing equations.
      numbers: all their numbers, at the centre of the box.
      radius: radius of the box, in units of each unknown.
      digits: decimal digits of the series.
      bits: precision; by default it is raised until the test passes, or fails for another reason.
      units: (n) units of the unknowns; those of the closing equations by default.
      throw: raise if nothing is proved.
    """
    report_progress("proving the symmetries and integrals")
    lacking = missing(system)
    if lacking:
        return _no_proof(orbit, f"It is not proved {lacking}.", throw)
    extra, reason, bits_used, slope_digits = _EXTRA_BITS, "", bits or 0, SLOPE_DIGITS
    units = system.units[system.unknowns] if units is None else units
    for _ in range(_TRIALS):
        bits_used = bits or bits_of(digits + _SPARE) + extra
        report_progress(f"enclosing the motion with {bits_used} bits")
        try:
            test = krawczyk_test(
                system, numbers, arb(radius), digits, bits_used, slope_digits, units
            )
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            reason = str(error)
            if bits:
                break
        else:
            if test.passed:
                degenerate = _degenerate(system, test, bits_used)
                if degenerate:
                    return _no_proof(orbit, f"{degenerate} {_ANOTHER}", throw, bits_used)
                box = radius, tuple(units.tolist())
                return _certificate(orbit, system, numbers, test, box, digits, bits_used)
            reason = (
                f"Krawczyk's test fails: the closing error moves the centre by {test.step:.1e} "
                f"in a box of {radius:.1e}, with contraction {test.contraction:.1e}."
            )
            if _LEAST_CONTRACTION < test.contraction < _MOST_CONTRACTION:
                # Raise the digits of the derivatives, unless they are not the reason.
                if slope_digits > digits + _SPARE:
                    break
                slope_digits += math.log10(test.contraction) + _SPARE
                continue
            if bits or test.contraction > _MOST_CONTRACTION or test.step > _WIDEST * radius:
                break
            if test.contraction * _WIDER * test.step < _LEAST_CONTRACTION * radius:
                # A wider box contains the effects of rounding and remainders, and still contracts.
                radius = _WIDER * test.step
                continue
        extra *= 2
    return _no_proof(orbit, f"{reason} {_MORE}", throw, bits_used)


def _degenerate(system: ClosingEquations, test: Test, bits: int) -> str:
    """Why the zero of the closing equations may not be an isolated orbit; "" if it is one."""
    numbers = test.numbers
    with precision(bits):
        if not system.period(numbers) > 0:
            return "The period may be 0 or negative."
        rate = system.field.rate(arb(0), system.start(numbers))
        if system.drive is None and not any(bool(abs(x) > 0) for x in rate):
            return "The start may be an equilibrium."
        if not system.spared_hold(test.tube.box, numbers):
            return f"The integrals {list(system.integrals)} may depend on each other at the end."
    return ""


def _no_proof(orbit: Orbit, reason: str, throw: bool, bits: int = 0) -> Certificate:
    if throw:
        raise SearchError(reason)
    return Certificate(orbit=orbit, proved=False, reason=reason, bits=bits, digits=0.0, radius="0")


def _certificate(
    orbit: Orbit,
    system: ClosingEquations,
    numbers: list[arb],
    test: Test,
    box: tuple[float, tuple[float, ...]],
    digits: float,
    bits: int,
) -> Certificate:
    report_progress("enclosing the multipliers")
    found = _spectrum(orbit, system, test, digits, bits)
    with precision(bits):
        complex_ones = [z for z in found.values if bool(z.imag > 0)]
        stable = found.verdict == "stable"
        return Certificate(
            orbit=orbit,
            proved=True,
            reason=_reason(system),
            bits=bits,
            digits=digits,
            radius=repr(box[0]),
            units=box[1],
            centre=tuple(_exact(numbers[i]) for i in system.unknowns),
            names=tuple(system.names[i] for i in system.unknowns),
            held=tuple(
                (system.names[i], system.values[i])
                for i in system.held
                if system.drive is None or system.names[i] != "period"
            ),
            period=decimal(system.period(test.numbers)),
            y0=tuple(decimal(x) for x in system.start(test.numbers)),
            multipliers=tuple((decimal(z.real), decimal(z.imag)) for z in found.values),
            exponents=tuple(decimal(multipliers.rotation_number(z)) for z in complex_ones)
            if stable
            else (),
            verdict=found.verdict,
            verdict_proved=found.verdict != "undecided",
            choreography=on_one_curve(orbit.scene, system, test.numbers, bits),
        )


def _spectrum(
    orbit: Orbit, system: ClosingEquations, test: Test, digits: float, bits: int
) -> Spectrum:
    scene = orbit.scene
    own = symplectic_form(scene, scene.y0)
    forms = forms_of(system) if own is None else [np.asarray(own)]
    known = structure(system, integrals_of(system, scene), _generators(scene), forms)
    return spectrum(system, test.numbers, test.tube.slopes, known, digits, bits)


def _generators(scene: Scene) -> list[tuple[np.ndarray, np.ndarray]]:
    """(A, b) for each candidate y' = A y + b for a symmetry."""
    k = len(scene.y0)
    origin = {n: np.asarray(g) for n, g in scene.system.generators(jnp.zeros(k)).items()}
    units = [scene.system.generators(e) for e in jnp.eye(k)]
    pairs = []
    for name, offset in origin.items():
        pairs.append((np.array([np.asarray(u[name]) - offset for u in units]).T, offset))
    return pairs


def _reason(system: ClosingEquations) -> str:
    text = "Krawczyk's test of the closing equations"
    if not system.integrals:
        return f"{text}."
    count, known = len(system.spared), ", ".join(system.integrals)
    return f"{text}; {count} of them follow from the others, as the motion conserves: {known}."


def _exact(x: arb) -> str:
    mantissa, exponent = x.mid().man_exp()
    return f"{int(mantissa)}*2^{int(exponent)}"
