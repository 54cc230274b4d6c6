"""The topology of a planar three-body orbit: how its triangles wind around the collisions.

Up to position, size and rotation, three bodies in the plane are a point of a sphere. Collinear
configurations are its equator; on it lie the three collisions, which divide it into three arcs,
one for each body in the middle. A motion without collisions is a loop on the sphere without
these three points: a word in the free group of two letters, invariant under deformation of the
orbit.

Passing down through the arc of body i and up through that of body j is g_i g_j^-1; with
g_3 = 1, a = g_1 and b = g_2, and capitals for inverses, that spells the words of Suvakov and
Dmitrasinovic (Physical Review Letters 110 (2013) 114301), up to the start of the loop.
"""

import itertools

import numpy as np

from jaxdyn._checks import check_first, fail
from jaxdyn.formulations.newton import FreePoints
from jaxdyn.integrate.trajectory import explanation, raise_unless_ok
from jaxdyn.status import IntegrationError, Status
from orbits.motion import at_s, logarithmic_places, quick_solve
from orbits.orbit import Orbit

_SAMPLES = 2048  # samples of one period at first
_FEWEST = 256  # fewest samples added at a time
_SWING = 0.4  # [rad] largest turn of a triangle's side between samples; a passage takes more
_RTOL = 1e-12  # tolerance of the samples
_REFINEMENTS = 40  # halvings of an interval where the triangle turns faster


@check_first
def syzygies(orbit: Orbit) -> tuple[int, ...]:
    """The body in the middle (1, 2, 3) at each collinear passage of a period, in order.

    The first one is from positive to negative area (1, 2, 3 counterclockwise before it).

    Raises:
      ValueError: the orbit is not of three free points in the plane.
      IntegrationError: the motion runs into a collision.
    """
    if not has_word(orbit):
        raise fail("orbit", "three free points in the plane", "another system")
    r = _positions(orbit)
    u, w = r[:, 1] - r[:, 0], r[:, 2] - r[:, 0]
    area = u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]
    up = area > 0
    after = np.roll(up, -1)
    passed = np.flatnonzero(up != after)
    middles = [_middle(r[i], r[(i + 1) % len(r)], area[i], area[(i + 1) % len(r)]) for i in passed]
    if len(passed) and not up[passed[0]]:
        middles = middles[1:] + middles[:1]
    return tuple(middles)


def has_word(orbit: Orbit) -> bool:
    """Whether `syzygies` and `word` apply: three free points in the plane."""
    system = orbit.scene.system
    return isinstance(system, FreePoints) and system.d == 2 and len(system.m) == 3


def _positions(orbit: Orbit) -> np.ndarray:
    """(s, 3, 2) positions over a period, close enough to see each passage.

    Where bodies attract each other, a motion with encounters is sampled at equal parts of
    logarithmic time: in plain time an encounter may shift from one run to the next by more than its
    duration. Other motions are sampled in plain time, whose program a report needs anyway.

    Raises:
      IntegrationError: the motion runs into a collision, where its triangle turns ever faster.
    """
    places, logarithmic = np.arange(_SAMPLES) * orbit.period / _SAMPLES, False
    for tried in range(_REFINEMENTS):
        ts, ys, status = _states(orbit, places, logarithmic=logarithmic)
        r, v = (ys[:, i : i + 6].reshape(-1, 3, 2) for i in (0, 6))
        sides, changes = (np.roll(x, -1, axis=1) - x for x in (r, v))
        # The angle between samples would not do: near a collision a side turns by 2 pi unnoticed.
        rates = (np.linalg.norm(changes, axis=-1) / np.linalg.norm(sides, axis=-1)).max(axis=1)
        swings = np.diff(ts) * np.maximum(rates[1:], rates[:-1])
        if (swings <= _SWING).all():
            return r
        of_encounters = None if tried else logarithmic_places(orbit.scene, _SAMPLES, _RTOL)
        if of_encounters is not None:
            places, logarithmic = of_encounters, True
            continue
        raise_unless_ok(status, orbit.scene)
        # Add a power of two of new times, where it turns most: few lengths, few compilations.
        count = 2 ** int(np.ceil(np.log2(max(_FEWEST, (swings > _SWING).sum()))))
        most = np.sort(np.argsort(-swings)[:count])
        middles = 0.5 * (places[most] + places[most + 1])
        places = np.sort(np.concatenate([places, middles]))
    raise IntegrationError(explanation(Status.STEP_COLLAPSED, orbit.scene))


def _states(
    orbit: Orbit, places: np.ndarray, *, logarithmic: bool
) -> tuple[np.ndarray, np.ndarray, Status]:
    """(s,) times and (s, k) states at places (s,) in plain or logarithmic time, NaN if not reached.

    The status says whether all were reached.
    """
    if logarithmic:
        ts, ys = map(np.asarray, at_s(orbit.scene, places, _RTOL))
        return ts, ys, Status.OK if np.isfinite(ys).all() else Status.STEP_COLLAPSED
    flow = quick_solve(orbit.scene, orbit.period, ts=places, rtol=_RTOL, solver=orbit.solver)
    return places, np.asarray(flow.ys), Status(int(flow.status))


def _middle(before, after, area_before, area_after) -> int:
    share = area_before / (area_before - area_after)
    r = before + share * (after - before)
    # Seen from the body in the middle, the others are in opposite directions.
    dots = [(r[(i + 1) % 3] - r[i]) @ (r[(i + 2) % 3] - r[i]) for i in range(3)]
    return int(np.argmin(dots)) + 1


@check_first
def word(orbit: Orbit) -> str:
    """The free-group word of a planar three-body orbit, cyclically reduced, in canonical form.

    Orbits that differ by the start of the period, the labels of the bodies, a reflection or the
    direction of time have the same word.

    Raises:
      ValueError: the orbit is not of three free points in the plane.
      IntegrationError: the motion runs into a collision.
    Example:
      >>> import orbits
      >>> from jaxdyn import scenes
      >>> orbits.analysis.word(orbits.find(scenes.three_body(), closing=orbits.choreography(3)))
      'ABab'
    """
    return canonical(spell(syzygies(orbit)))


def spell(middles: tuple[int, ...]) -> str:
    """The word of a sequence of bodies in the middle, of which the first is passed downwards."""
    down, up = {1: "a", 2: "b", 3: ""}, {1: "A", 2: "B", 3: ""}
    return "".join((down if i % 2 == 0 else up)[body] for i, body in enumerate(middles))


def canonical(letters: str) -> str:
    """The alphabetically first of all words of the same orbit.

    Raises:
      ValueError: `letters` contains others than a, b and their inverses A, B.
    Example:
      >>> canonical("BabA") == canonical("abAB")
      True
    """
    if set(letters) - set("abAB"):
        raise fail("word", "letters a, b, A, B", repr(letters))
    reduced = _reduce(letters)
    return min(
        (
            turned
            for relabelled in _relabel(reduced)
            for sense in (relabelled, relabelled[::-1].swapcase())
            for turned in _turns(sense)
        ),
        default="",
    )


def _reduce(letters: str) -> str:
    """The cyclically reduced word, with adjacent inverses cancelled, also across the ends."""
    kept: list[str] = []
    for letter in letters:
        if kept and kept[-1] == letter.swapcase():
            kept.pop()
        else:
            kept.append(letter)
    while len(kept) > 1 and kept[0] == kept[-1].swapcase():
        kept = kept[1:-1]
    return "".join(kept)


def _turns(letters: str) -> list[str]:
    return [letters[i:] + letters[:i] for i in range(max(1, len(letters)))]


def _relabel(letters: str) -> list[str]:
    """The words with the bodies in every order, and those of the mirror image."""
    found = []
    for order in itertools.permutations((1, 2, 3)):
        # a = g_1 g_3^-1 and b = g_2 g_3^-1, in the bodies' new numbers.
        one, two, three = order
        meaning = {"a": spell((one, three)), "b": spell((two, three))}
        meaning |= {k.upper(): v[::-1].swapcase() for k, v in meaning.items()}
        again = _reduce("".join(meaning[letter] for letter in letters))
        # A mirror image exchanges the two hemispheres: g becomes its inverse.
        found += [again, again.swapcase()]
    return found
