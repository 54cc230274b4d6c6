"""The plane of Suvakov and Dmitrasinovic: three equal bodies that start in line, L = 0.

Positions (-1, 0), (1, 0), (0, 0), velocities (a, b), (a, b), (-2a, -2b), G = m = 1. Such a start
is fixed by the time reversal R that exchanges the outer bodies and rotates the plane by half a
turn, so every periodic motion from it returns to the fixed set of R after half of its period, up to
a rotation. This halves the time to integrate, and a rotation of the plane does not spoil the
condition.

Reference: Suvakov, Dmitrasinovic (2013), Physical Review Letters 110, 114301.
"""

import dataclasses
from concurrent.futures import Executor
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxdyn._checks import check_first, positive
from jaxdyn.scenes import three_body
from orbits.analysis.same import same_orbit
from orbits.analysis.words import word
from orbits.closing.closings import point_symmetry, reversal
from orbits.discovery.chunks import Box
from orbits.discovery.journal import Find
from orbits.discovery.search import SearchResult, search
from orbits.discovery.seeds import row, rows
from orbits.orbit import Orbit, relocate
from orbits.shooting.finding import find

#: The time reversal that fixes collinear starts with equal outer velocities.
IN_LINE = point_symmetry([1, 0, 2], (-1, -1), reversing=True)
#: Published starts and periods, to the digits printed: name -> (a, b, T). Of the two starts
#: printed for each yin-yang, which lie half a period apart on one orbit, the first.
NAMED = {
    "figure-eight": (0.34711, 0.53273, 6.3259),
    "butterfly I": (0.30689, 0.12551, 6.2356),
    "butterfly II": (0.39295, 0.09758, 7.0039),
    "butterfly III": (0.40592, 0.23016, 13.8658),
    "bumblebee": (0.18428, 0.58719, 63.5345),
    "moth I": (0.46444, 0.39606, 14.8939),
    "moth II": (0.43917, 0.45297, 28.6703),
    "moth III": (0.38344, 0.37736, 25.8406),
    "goggles": (0.08330, 0.12789, 10.4668),
    "dragonfly": (0.08058, 0.58884, 21.2710),
    "yarn": (0.55906, 0.34919, 55.5018),
    "yin-yang I": (0.51394, 0.30474, 17.3284),
    "yin-yang II": (0.41682, 0.33033, 55.7898),
}
_WINDOW = 5.0  # length of a window of the period
_ESCAPED = 8.0  # distance from the centre; orbits up to T = 70 stay within it
_ALIKE = 1e-8  # relative; the eight and its nearest neighbour differ by 1.6e-7
_NAMED_ALIKE = 1e-3  # relative, for T |E|^(3/2) computed from the printed digits


@dataclasses.dataclass(frozen=True)
class Plane:
    """The result of a search of the plane.

    Attributes:
      found: the orbits, in the frame of the plane.
      names: their published names; "" for others.
    """

    found: SearchResult
    names: tuple[str, ...]

    def starts(self) -> np.ndarray:
        """(n, 3) a, b and T of each orbit."""
        finds = self.found.finds
        return np.array([[*f.y0[6:8], f.period] for f in finds]).reshape(-1, 3)

    def families(self) -> int:
        """Number of different pairs of word and T |E|^(3/2), to check `same_orbit`."""
        kept: list[Find] = []
        for f in self.found.finds:
            if not any(f.label == k.label and _near(f, k.invariant, _ALIKE) for k in kept):
                kept.append(f)
        return len(kept)


def search_plane(
    samples: int = 512,
    *,
    longest: float = 70.0,
    seed: int = 0,
    rng: int | np.random.Generator | None = None,
    chunk: int = 8,
    path: str | Path | None = None,
    executor: Executor | None = None,
    progress: bool = False,
) -> Plane:
    """The periodic orbits of the plane with velocities in [0, 1] x [0, 1], with their words.

    Args:
      samples: number of starts.
      longest: longest period.
      seed: seed of the samples.
      rng: instead of `seed`: the seed, or a generator that draws it.
      chunk: see `search`, like the following.
      path: file to which results are appended.
      executor: runs the chunks.
      progress: show a bar.
    """
    positive("longest", longest, "It is a period.")
    limit = np.concatenate([np.full(6, _ESCAPED), np.full(6, np.inf)])
    found = search(
        three_body(),
        Box((0.0, 0.0), (1.0, 1.0), rows),
        samples,
        longest=longest,
        closing=reversal(IN_LINE),
        windows=max(1, round(longest / _WINDOW)),
        limit=limit,
        normal=in_plane,
        label=word,
        seed=seed,
        rng=rng,
        chunk=chunk,
        path=path,
        executor=executor,
        progress=progress,
    )
    return Plane(found, _names(found))


@check_first
def in_plane(orbit: Orbit) -> Orbit:
    """The same orbit moved, rotated, reflected and scaled to the plane's starts, a, b >= 0."""
    y = np.asarray(orbit.y0)
    r, v = y.reshape(2, 3, 2)
    r, v = r - r.mean(axis=0), v - v.mean(axis=0)
    size = np.linalg.norm(r[1])
    along = r[1] / size
    # Time reversal, reflection and exchange of the outer bodies make both signs arbitrary.
    a = abs(v[0] @ along) * np.sqrt(size)
    b = abs(along[0] * v[0, 1] - along[1] * v[0, 0]) * np.sqrt(size)
    scene = orbit.scene.starting(jnp.asarray(rows(np.array([[a, b]]))[0]), orbit.period / size**1.5)
    return relocate(orbit, scene)


def _names(found: SearchResult) -> tuple[str, ...]:
    """Published names of the orbits found; printed starts are refined before they are compared."""
    names = [""] * len(found)
    for name, (a, b, period) in NAMED.items():
        energy = -2.5 + 3 * (a * a + b * b)
        near = [
            i
            for i, f in enumerate(found.finds)
            if _near(f, period * abs(energy) ** 1.5, _NAMED_ALIKE)
        ]
        if not near:
            continue
        scene, seed = row(a, b, period)
        orbit = find(scene, seed.y0, seed.period, closing=reversal(IN_LINE), throw=False)
        orbits = found.orbits()
        for i in near:
            if orbit.ok and same_orbit(orbits[i], orbit):
                names[i] = name
    return tuple(names)


def _near(f: Find, invariant: float, tolerance: float) -> bool:
    return abs(f.invariant - invariant) <= tolerance * invariant
