"""A torus of two frequencies about an elliptic periodic orbit, from the orbit's Floquet vector."""

import math

import numpy as np

from jaxdyn import Scene, _checks, _text
from jaxdyn._checks import check_first
from orbits.analysis.monodromy import return_in_basis, tangents_in
from orbits.analysis.stability import stability
from orbits.closing.given import driven
from orbits.closing.sizes import largest_entry, sizes
from orbits.orbit import Orbit, SearchError
from orbits.tori import circle
from orbits.tori.invariance import Unknowns, mean_energy
from orbits.tori.record import Torus, TorusOutcome
from orbits.tori.refinement import refine

#: Default largest error of invariance, in the sizes of the entries.
GOAL = 1e-11
#: Number of modes of the first attempt, and the default of the largest number.
FEWEST_MODES, MOST_MODES = 6, 60
_ELLIPTIC = 1e-6  # distance of a multiplier from the unit circle below which it may be on it


@check_first
def torus(
    orbit: Orbit,
    amplitude: float,
    *,
    pair: int = 0,
    rotation: float | None = None,
    goal: float = GOAL,
    max_modes: int = MOST_MODES,
    throw: bool = True,
) -> Torus:
    """The invariant torus of a given amplitude about an elliptic periodic orbit.

    A pair of multipliers exp(+-i nu) of the orbit belongs to tori around it, one for each amplitude
    (and energy), on which the map over the time T turns a circle by rho, close to nu. The circle
    begins with the Floquet vector, and is solved as a Fourier series with as many modes as its
    coefficients need.

    Args:
      orbit: a periodic orbit. In a driven scene T is its period; otherwise T is free and the energy
        of the orbit is kept, or its period if the scene has no energy.
      amplitude: component of the circle's first harmonic along the Floquet vector, which has norm 1
        in the units of the state; the rest of the harmonic is orthogonal to that vector in the
        sizes of the entries. The tori of a family begin at 0, which is the orbit.
      pair: number of the pair of multipliers on the unit circle, in the order of
        `Stability.nontrivial`.
      rotation: angle rho to reach instead of the amplitude, which is then a guess [rad]. It should
        be close to that of a torus of the guessed amplitude, in the same sense.
      goal: largest error of invariance, in the sizes of the entries.
      max_modes: largest number of Fourier modes.
      throw: raise unless a torus was found; with False check `Torus.outcome`.
    Returns:
      The torus, its rotation, and its error of invariance between the points of the circle.
    Raises:
      ValueError: `orbit` is not an orbit, or has no such pair of multipliers; `amplitude` or `goal`
        is not positive; `max_modes` is less than `FEWEST_MODES`.
      SearchError: no torus was found (``throw=True``).
    Limits: host only; scenes without damping and without constraints; tori of two frequencies, that
      of the orbit or the drive and one more. Where rho / 2 pi is close to a fraction with a small
      denominator, there is a gap in the family.
    Reference: Gomez & Mondelo (2001), Physica D 157, 283; Olikara & Scheeres (2012), Adv.
      Astronaut. Sci. 145, 911; Jorba (2001), Nonlinearity 14, 943.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> stick = scenes.shaken_pendulum(angle=0.0, frequency=60.0)
      >>> swing = orbits.find(stick, period=6.28318530718 / 60)
      >>> found = orbits.torus(swing, 0.1)
      >>> found.ok, found.error < 1e-11
      (True, True)
    """
    _checks.check_untraced("orbit", orbit, "Tori are found on the host.")
    amplitude = float(_checks.positive("amplitude", amplitude, "It is the norm of a state."))
    _checks.positive("goal", goal, "It is an error in the sizes of the entries.")
    _checks.whole("max_modes", max_modes, FEWEST_MODES)
    if not orbit.ok:
        raise _checks.fail("orbit", "a periodic orbit", orbit.outcome.name, orbit.message)
    nu, w = floquet_vector(orbit, pair)
    n = 2 * FEWEST_MODES + 1
    y0 = np.asarray(orbit.y0)
    turns = np.exp(1j * circle.angles(n))[:, None]
    start = Unknowns(y0 + amplitude * (turns * w).real, nu, orbit.period)
    held = _held_quantity(orbit.scene)
    level = mean_energy(orbit.scene, y0[None])[0] if held == "energy" else math.nan
    target = ("amplitude", amplitude) if rotation is None else ("rotation", float(rotation))
    blank = Torus(
        scene=orbit.scene,
        points=start.points,
        time=start.time,
        rotation=nu,
        amplitude=amplitude,
        energy=level,
        error=math.nan,
        outcome=TorusOutcome.NO_CONVERGENCE,
        held=held,
        rtol=orbit.rtol,
    )
    found = refine(blank, start, w, target, goal=goal, max_modes=max_modes)
    if throw and not found.ok:
        raise SearchError(found.message)
    return found


def floquet_vector(orbit: Orbit, pair: int) -> tuple[float, np.ndarray]:
    """The angle nu > 0 of a pair of multipliers on the unit circle, and its unit vector (k,)."""
    found = stability(orbit)
    on_circle = [z for z in found.nontrivial if z.imag > _ELLIPTIC and abs(abs(z) - 1) < _ELLIPTIC]
    _checks.whole("pair", pair, 0)
    if pair >= len(on_circle):
        raise _checks.fail(
            "orbit",
            f"at least {_text.number_of(pair + 1, 'pair')} of multipliers on the unit circle",
            f"{len(on_circle)}",
            "Tori surround elliptic orbits; orbits.stability has the multipliers.",
        )
    each = sizes(orbit.scene)
    basis = tangents_in(orbit.scene, each)
    m = return_in_basis(orbit, orbit.rtol, basis, each).m
    values, vectors = np.linalg.eig(m)
    i = int(np.argmin(np.abs(values - on_circle[pair])))
    w = each * (basis @ vectors[:, i])
    w = w / w[largest_entry(w, each)]
    return float(np.angle(on_circle[pair])), w / np.linalg.norm(w)


def _held_quantity(scene: Scene) -> str:
    if driven(scene):
        return "drive"
    return "energy" if scene.has_energy else "time"
