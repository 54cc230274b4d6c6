"""The method for a scene: the requested one, checked, or the default."""

import functools
import math

import diffrax
import numpy as np

from jaxdyn import _checks
from jaxdyn._checks import check_first
from jaxdyn._records import notes_on
from jaxdyn.scene import Scene
from jaxdyn.solvers.exchange import from_diffrax
from jaxdyn.solvers.method import Method
from jaxdyn.solvers.pairs import NYSTROM12, VERNER9
from jaxdyn.solvers.stoermer import STOERMER18
from jaxdyn.solvers.taylor.method import (
    TAYLOR12,
    TAYLOR14,
    TAYLOR16,
    TAYLOR20,
    Series,
    Taylor,
    series_of,
)

#: Type of the argument ``solver``.
Solver = Method | diffrax.AbstractSolver

#: Default of the relative tolerance of a step.
RTOL = 1e-10
#: Number of operations of a rate up to which its formulas are sought; for so many that takes a
#: tenth of a second.
_LONGEST = 1000
#: The Taylor series that runs fastest, by the largest number of products at each order for which it
#: does; below, the same for tolerances looser than 1e-8, where high orders gain little.
_ORDERS = {4: TAYLOR20, 11: TAYLOR16, 16: TAYLOR14, 24: TAYLOR12}
_LOOSE_ORDERS = {4: TAYLOR16, 24: TAYLOR12}
_LOOSE = 1e-8
#: Where no force depends on velocity: the number of products up to which a series runs faster than
#: methods that evaluate forces, if these are made of powers and quotients alone, and if they are
#: polynomials. A sine or an exponential takes 12 ns to evaluate (measured), as long as tens of
#: products, and a series evaluates it once a step; a quotient takes as long as a few products.
_POWERS, _POLYNOMIALS = 7, 2
#: The same methods for velocity-independent forces: the Nystrom pair takes the derivatives.
_BY_PLACES = {
    method: Taylor(method.order, tangents=NYSTROM12)
    for method in (TAYLOR12, TAYLOR14, TAYLOR16, TAYLOR20)
}

#: The finest tolerance at which the extrapolated leapfrog is used, in roundings, which limit it
#: below: 1e-11 in 64 bits, 5e-3 in 32 bits.
_FINEST_EXTRAPOLATED = 1e-11 / 2.0**-52
#: Lengths of a state for which it is faster than the Nystrom pair: 3 points in the plane to 12 in
#: space; also shorter ones where forces are formulas of powers and quotients.
_EXTRAPOLATED_NUMBERS = range(12, 73)


def method_of(solver: Solver) -> Method:
    """The method that a `solver` argument stands for.

    Raises:
      ValueError: `solver` is a solver of diffrax that takes no steps of an ODE, or not a solver.
    """
    if isinstance(solver, Method):
        return solver
    kind = solver if isinstance(solver, type) else type(solver)
    if issubclass(kind, diffrax.AbstractSolver):
        return from_diffrax(solver)
    raise _checks.fail(
        "solver",
        "one of jaxdyn.solvers, or a Runge-Kutta solver of diffrax",
        repr(solver),
        "Leave it out for the default, which suits the scene.",
    )


@check_first
def default_solver(scene: Scene, *, rtol=RTOL, several: bool = False) -> Method:
    """The method that solves a scene if none is asked for.

    - Where forces may depend on velocity: a `Taylor` series, if the rate has one wherever it is
      finite, of at most 15 numbers and 24 products per order; else `VERNER9`.
    - Where no force depends on velocity: a series likewise, but of at most 7 products per order if
      forces are made of powers and quotients alone, and of at most 2 if they are polynomials and
      the tolerance is not below 1e-11.
    - Else, at tolerances not below 1e-11, the extrapolated leapfrog, `STOERMER18`, for states of
      12 to 72 numbers, and for fewer if forces are made of powers and quotients alone. But at
      tolerances above 1e-8 it is `NYSTROM12` for these fewer numbers, and for polynomials of at
      most 15.
    - Else `NYSTROM12`.

    A tolerance that is only known at run time counts as below 1e-11, as does a request for digits.
    The more products, the lower the order that runs fastest: `TAYLOR20` up to 4, `TAYLOR16` up to
    11, `TAYLOR14` up to 16, `TAYLOR12` up to 24; at tolerances above 1e-8 `TAYLOR16` up to 4,
    `TAYLOR12` up to 24.

    At true errors of 1e-6, 1e-9 and 1e-12 the series take, of the time of the pair: 0.77, 0.54,
    0.37 (Lorenz), 0.35, 0.28, 0.20 (Duffing), 0.24, 0.20, 0.19 (Toda's ring), 0.70, 0.72, 0.75
    (spherical pendulum), 0.60, 0.52, 0.68 (Kepler's orbit, e = 0.9), 0.82, 0.78, 0.59 (three
    restricted bodies in space), 0.71, 0.44, 0.42 (magnetic bottle), 0.79, 0.80, 0.62 (double
    pendulum), 1.01, 0.84, 0.72 (rigid body). They compile in 0.4 to 2.2 s, mostly 0.6 to 1.7 of the
    time of the pair. The leapfrog takes, of the time of `NYSTROM12`: 0.89, 0.92, 0.89
    (figure-eight), 0.65, 0.70, 0.79 (Pleiades), 0.77, 0.68, 0.61 (outer planets), 1.11, 0.83, 0.68
    (a sheet of springs); and of the time of series: 0.86, 0.93, 0.92 (Henon and Heiles), 1.08,
    0.96, 1.04 (a chain of springs with quadratic forces; the pair 0.77 at 1e-6).

    The orders rest on the twenty problems of `benchmarks.problems` and `benchmarks.classics`, and
    on the twelve of `benchmarks.others`. In the latter 90 of 96 cases are within 1.15 of the
    fastest method; the other cases are listed in `benchmarks.default_method`.

    At the same tolerance, errors of series are no larger than those of the pair in nine of ten
    runs, and a sixteenth of them in the median; those of the leapfrog are a tenth to a twentieth
    down to 1e-10, also in encounters. Rounding, which its extrapolation amplifies, lets it get no
    further than 1e-14 where the pair gets to 1e-15, and in close encounters to a few times the
    errors of the pair; hence the limit of 1e-11. For more than 12 bodies, which the pair
    vectorises, it takes 1.3 times as long.

    A series does not evaluate the rate within a step: a force in a region so small that a step
    passes over it, as a wind in a thin layer, is missed more easily than by the pair.

    For derivatives, events and ensembles, which cross several steps side by side, the pair is used.

    Outside of traces the pair takes over where the steps of another default collapse, as where
    exp(x) overflows in a rate that stays finite. Inside jit, grad and vmap it is the default for
    rates with exponentials.

    No rule sees that a motion will be stiff. `simulate`, `solve`, `until` and `crossings` find
    out: outside of traces they start again with `RADAU9` once stability, not accuracy, has limited
    a net 1000 steps. So van der Pol's oscillator with mu = 1000 takes 973 steps over 3000 s, and
    633 978 by its Taylor series.
    ``python -m benchmarks default`` has all figures.

    Args:
      scene: any scene.
      rtol: () relative tolerance; if traced, the method has to suit all tolerances.
      several: whether the method has to cross several steps side by side, as ensembles and the
        search for events ask of it. Taylor series cannot.
    """
    return _default_method(scene, rtol, several)


def _default_method(scene: Scene, rtol, several: bool) -> Method:
    """The `default_solver` of a scene whose functions have been checked."""
    notes = notes_on(scene) if type(rtol) is float else None
    if notes is None:
        method, _ = _rule(scene, rtol)
    else:
        noted, method = notes.get("method", (None, None))
        if method is None or noted != rtol:
            method, _ = _rule(scene, rtol)
            notes["method"] = rtol, method
    return method.for_tangents if several else method


def within_trace(scene: Scene, method: Method) -> Method:
    """The default method where another cannot take over, as inside jit.

    A series of exp(x) overflows where the rate may be finite, as 1 / (1 + exp(x)) is.
    """
    found = series_of(scene.field, scene.y0, longest=_LONGEST)
    if isinstance(method, Taylor) and found is not None and "exp" in found.operations:
        return method.for_tangents
    return method


def reason(scene: Scene, rtol=RTOL) -> str:
    """Why `default_solver` takes the method that it does."""
    return _rule(scene, rtol)[1]


def _rule(scene: Scene, rtol) -> tuple[Method, str]:
    """The default, and the reason for it."""
    found = series_of(scene.field, scene.y0, longest=_LONGEST)
    known = None if _checks.is_traced(rtol) else float(rtol)
    eps = float(np.finfo(_checks.as_float(scene.y0).dtype).eps)  # starts may be integers
    return _method_of_rule(found, scene.second_order, len(scene.y0), known, eps)


@functools.lru_cache  # putting the reason into words takes half as long as finding it
def _method_of_rule(
    found: Series | None, second_order: bool, k: int, rtol: float | None, eps: float
) -> tuple[Method, str]:
    """The same as `_rule`, for a state of k numbers with or without a series; no rtol means any."""
    loose = rtol is not None and rtol > _LOOSE
    if not second_order:
        series, why = _by_series(found, loose, math.inf)
        return series or VERNER9, why
    finest = _FINEST_EXTRAPOLATED * eps
    fine = rtol is None or rtol < finest
    powers = found if found is not None and not found.functions else None
    polynomial = powers is not None and powers.polynomial
    if powers is None:
        most, kind = math.inf, ""
    elif polynomial and not fine:
        most, kind = _POLYNOMIALS, "polynomial forces"
    else:
        most, kind = _POWERS, "forces that contain only powers and quotients"
    series, why = _by_series(found, loose, most, kind)
    why = f"forces do not depend on velocity, and {why}"
    if series is not None:
        return _BY_PLACES[series], why
    few = powers is not None and powers.everywhere and k < min(_EXTRAPOLATED_NUMBERS)
    if not few and k not in _EXTRAPOLATED_NUMBERS:
        return NYSTROM12, why
    if rtol is None:
        return NYSTROM12, f"{why}; the tolerance is known only at run time"
    if fine:
        limit = f"below rtol {finest:.0e}, rounding errors limit extrapolation"
        return NYSTROM12, f"{why}; {limit}"
    if loose and (few or polynomial):
        return NYSTROM12, f"{why}; above rtol 1e-8, this pair is usually as fast as extrapolation"
    return STOERMER18, f"{why}; for a state of {k} numbers, extrapolation is"


def _by_series(
    series: Series | None, loose: bool, most: float, kind: str = ""
) -> tuple[Taylor | None, str]:
    """The series to take, if any, and why.

    Args:
      series: what the series costs; None if there is none.
      loose: whether the tolerance is loose.
      most: products above which another method is faster.
      kind: the forces that this limit holds for, for the message.
    """
    if series is None:
        return None, "the rate has many operations, or no Taylor series"
    if not series.everywhere:
        return None, "the rate contains a root, which has no Taylor series at 0"
    why = f"the Taylor series of the rate needs {series.products} products per order"
    if series.products > most:
        return None, f"{why}; with more than {most}, another method is faster for {kind}"
    orders = _LOOSE_ORDERS if loose else _ORDERS
    for limit, method in orders.items():
        if series.products <= limit:
            return method, f"{why}; with at most {limit}, order {method.order} is the fastest"
    return None, f"{why}; with more than {max(orders)}, another method is faster"


def choose_method(
    scene: Scene, solver: Solver | None, *, rtol=RTOL, several: bool = False
) -> Method:
    """The requested method, if it suits the scene, or the one of `default_solver`.

    Raises:
      ValueError: `solver` requires velocity-independent forces, and the scene has others.
    """
    if solver is None:
        return _default_method(scene, rtol, several)
    method = method_of(solver)
    if method.position_only and not scene.second_order:
        raise _checks.fail(
            "solver",
            "one for forces that may depend on velocity",
            f"{method.name}, which requires velocity-independent forces",
            "Leave the solver out, or use solvers.GAUSS12 for a long run that conserves energy.",
        )
    return method


def check_method(
    scene: Scene, solver: Solver | None, dt=None, *, rtol=RTOL, several: bool = False
) -> Method:
    """`choose_method`, with a check that `dt` is given exactly if it is needed.

    Raises:
      ValueError: `dt` is given to an adaptive method, or missing.
    """
    method = choose_method(scene, solver, rtol=rtol, several=several)
    if method.adaptive and dt is not None:
        raise _checks.fail(
            "dt",
            f"none, since {method.name} chooses its steps by rtol",
            dt,
            "Leave it out, or use a solver of fixed step, such as solvers.KAHAN_LI8.",
        )
    if not method.adaptive and dt is None:
        raise _checks.fail(
            "dt",
            f"a step, since those of {method.name} are equal",
            "none",
            "Pass dt to simulate, say a hundredth of a period; events need an adaptive solver.",
        )
    return method
