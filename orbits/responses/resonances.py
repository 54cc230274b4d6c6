"""Internal resonances of free vibrations: where the frequencies of two modes have a simple ratio.

A small vibration in another mode near an orbit of period T advances by an angle theta over T, which
is the angle of a multiplier: its frequency is n + theta / (2 pi) times that of the orbit. The
integer n is known from the linear modes, where the family begins, and followed along the family.
From a pair of multipliers, the one whose vibration has an action > 0 (Krein's sign) is used. The
mode is resonant, p : q, where that ratio is p / q; there orbits of q periods branch off, and the
modes exchange energy.

Reference: Yakubovich, Starzhinskii (1975), Linear differential equations with periodic
coefficients, chapter III.
"""

import dataclasses
import itertools
import math
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import Scene, _text
from jaxdyn.analysis.energy import energy
from orbits.families.bifurcations import zero_between
from orbits.families.family import Family, Member
from orbits.families.surface import OrbitSurface, Surface
from orbits.shooting.finding import GOAL

_MOST = 5  # largest value of p or q, relative to the order
_REAL = 1e-9  # multipliers with an imaginary part below this are real


@dataclasses.dataclass(frozen=True)
class Resonance:
    """An internal resonance.

    Attributes:
      member: the orbit there.
      mode: number of the other mode, from 1.
      ratio: its frequency over that of the orbit.
    """

    member: Member
    mode: int
    ratio: Fraction

    @property
    def frequency(self) -> float:
        """Angular frequency of the orbit."""
        return 2 * math.pi / self.member.orbit.period

    @property
    def energy(self) -> float:
        """Energy of the orbit; NaN in a scene without one."""
        return self.member.energy

    def __repr__(self) -> str:
        ratio = f"{self.ratio.numerator}:{self.ratio.denominator}"
        unit = _text.rad_per_second(self.member.orbit.scene.labels())
        return f"{ratio} with mode {self.mode} at {_text.brief(self.frequency, unit)}"


def ratios(family: Family, linear: np.ndarray) -> np.ndarray:
    """(n, m) ratios of the frequencies of the other modes to that of each member.

    Args:
      family: a family of free vibrations that begins near an equilibrium.
      linear: (m,) the same ratios for the linear modes.
    """
    sign, known, rows = _sign(family, linear), np.asarray(linear, float), []
    for member in family.members:
        known = _nearest(known, sign * _turns(member))
        rows.append(known)
    return np.array(rows)


def _sign(family: Family, linear: np.ndarray) -> float:
    """1 or -1, the sign of the actions for which the first member agrees with the linear modes."""
    known, turns = np.asarray(linear, float), _turns(family.members[0])
    return min((1.0, -1.0), key=lambda s: np.abs(_nearest(known, s * turns) - known).sum())


def resonances(
    family: Family, linear: np.ndarray, others: list[int], order: int
) -> list[Resonance]:
    """The internal resonances p : q with p or q up to an order, in order along a family.

    Args:
      family: see `ratios`.
      linear: see `ratios`.
      others: (m) numbers of the other modes.
      order: largest value of the smaller one of p and q; the larger one is at most five times that.
    """
    known, sign, found = ratios(family, linear), _sign(family, linear), []
    places = list(zip(family.members, family.members[1:], known, known[1:], strict=False))
    for a, b, before, after in places:
        for i, mode in enumerate(others):
            for ratio in _fractions(before[i], after[i], order):
                member = _locate(family, a, b, ratio, sign)
                if member is not None:
                    found.append(Resonance(member, mode, ratio))
    return found


def _turns(member: Member) -> np.ndarray:
    """(m,) turns in [-1/2, 1/2] of each pair of multipliers over a period; real ones 0 or 1/2."""
    known, orbit = member.stability, member.orbit
    values, vectors = np.linalg.eig(known.monodromy)
    half, slope = len(values) // 2, np.asarray(_momenta(orbit.scene, orbit.y0))
    found = []
    for z in known.nontrivial:
        if abs(z.imag) <= _REAL:
            found.append(0.0 if z.real > 0 else 0.5)
            continue
        x = vectors[:, np.argmin(np.abs(values - z))]
        action = (np.conj(x[:half]) @ (slope @ x)).imag
        if action > 0:
            found.append(float(np.angle(z)) / (2 * np.pi))
    # A real pair has equal turns.
    real = [turn for turn in found if turn in (0.0, 0.5)]
    return np.array([*(turn for turn in found if turn not in (0.0, 0.5)), *sorted(real)[::2]])


@jax.jit
def _momenta(scene: Scene, y: Array) -> Array:
    """(n, k) derivative of the momenta with respect to the state.

    The momenta are canonical, else derivatives of the energy by the velocities, else velocities.
    """
    t = jnp.zeros(())

    def momenta(y: Array) -> Array:
        known = scene.system.canonical(t, y)
        if known is not None:
            return jnp.split(known, 2)[1]
        if scene.has_energy:
            return jnp.split(jax.grad(lambda y: energy(scene, t, y))(y), 2)[1]
        return jnp.split(y, 2)[1]

    return jax.jacfwd(momenta)(y)


def _nearest(known: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """(m,) ratios that equal these turns up to integers, each near a known ratio."""
    found = known.copy()
    whole = np.round(known[:, None] - turns)
    near = whole + turns
    pairs = sorted((abs(near[i, j] - known[i]), i, j) for i, j in np.ndindex(near.shape))
    modes, used = set(), set()
    for _, i, j in pairs:
        if i not in modes and j not in used:
            modes.add(i)
            used.add(j)
            found[i] = near[i, j]
    return found


def _fractions(a: float, b: float, order: int) -> list[Fraction]:
    """The fractions p / q between two numbers, with p or q up to an order, from the first on."""
    low, high, most = min(a, b), max(a, b), _MOST * order
    found = {
        Fraction(p, q)
        for p, q in itertools.product(range(1, most + 1), repeat=2)
        if min(p, q) <= order and low < p / q <= high
    }
    return sorted(found, reverse=bool(b < a))


def _locate(family: Family, a: Member, b: Member, ratio: Fraction, sign: float) -> Member | None:
    """The member between two others where a pair of multipliers has the angle of a ratio."""
    turned = np.exp(2j * np.pi * float(ratio))

    def product(surface: Surface, member: Member) -> float:
        """A number that changes sign where a pair leaves the unit circle at 1 or -1."""
        del surface
        return float(np.prod(member.stability.nontrivial - turned.real).real)

    def lag(surface: Surface, member: Member) -> float:
        """A number that changes sign where a pair passes the angle on the circle, even at +-1."""
        del surface
        off = sign * _turns(member) - float(ratio)
        off = off - np.round(off)
        return float(off[np.argmin(np.abs(off))])

    locked = any((np.abs(x.stability.nontrivial.imag) <= _REAL).any() for x in (a, b))
    surface = OrbitSurface(family.equations, a.orbit.rtol, GOAL)
    return zero_between(
        surface.at(a.point), a, b, product if locked and ratio.denominator <= 2 else lag
    )
