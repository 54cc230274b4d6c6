"""What there is to draw of a motion: the paths of its points, and the lines that join them.

A picture needs a curve that looks smooth however few samples a motion has. Between two samples
it is the polynomial of degree 5 with the places, velocities and accelerations that the scene has
at both. Of a turning at a steady rate it misses by 3e-5 of the radius with 6 samples a turn, by
2e-3 with 3; a motion with fewer needs more samples to be seen at all.

Not every material point is worth a path: those inside a rod or a body only stand for its mass.
What moves as one rigid body is seen from the motion itself: what links join, and what keeps its
distance from that.
"""

import re
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdyn import _checks
from jaxdyn.phases import Chain, pieces_of
from jaxdyn.scene import Scene
from jaxdyn.simulate import Trajectory

CURVE = 2000  # samples of a curve that looks smooth at any size of a picture
_RIGID = 1e-6  # of the size of a motion: less is no change of a distance


class Paths(NamedTuple):
    """What a picture needs of a motion.

    Attributes:
      ts: (s,) times, of the part that the run got to.
      xyz: (s, n, D) drawn coordinates there, D = 2 or 3; (time, x) for motion on a line.
      labels: (D,) what the axes say.
      second: the unit of time as it stands behind a number: " s", or nothing where G = 1.
      equal: whether all axes have one scale.
      stopped: why the run stopped early; empty if it did not.
      links: pairs of ends joined by a line: numbers of points, or places (d,) of anchors.
      outlines: (s, k, D) each, curves drawn with the links: rims of wheels, a ramp.
      traced: numbers of the points whose paths are drawn, each in a colour of its own.
      corners: numbers of the samples where a later phase of a chain begins.
    """

    ts: np.ndarray
    xyz: np.ndarray
    labels: tuple[str, ...]
    second: str
    equal: bool
    stopped: str
    links: tuple[tuple, ...]
    outlines: tuple[np.ndarray, ...]
    traced: tuple[int, ...]
    corners: tuple[int, ...]


def paths(motion: Trajectory | Chain, links=None) -> Paths:
    """What there is to draw of a motion, a chain of phases or a part of a run that stopped.

    Points move in a plane, in space or on a line; a state of two or three entries without
    points is drawn itself.

    Args:
      motion: what `simulate` or `phases.run` returned.
      links: pairs of ends instead of those that the system has; see `System.links`.
    Raises:
      ValueError: a batch of motions, links that make no sense, nothing to draw.
    """
    pieces = pieces_of(motion)
    system = pieces[0].scene.system
    good = [_reached(piece) for piece in pieces]
    parts = [_fine(piece, n, len(pieces)) for piece, n in zip(pieces, good, strict=True) if n]
    ts, curves, sampled = map(
        np.concatenate, zip(*(parts or [_fine(pieces[0], 0, 1)]), strict=True)
    )
    shapes = [np.shape(curve) for curve in system.outlines(pieces[0].ts[0], pieces[0].ys[0])]
    r, *outlines = np.split(curves, -np.cumsum([k for k, _ in shapes[::-1]])[::-1], axis=1)
    n, d = r.shape[1:]
    if d > 3:
        raise _checks.fail(
            "motion",
            "material points, or a state of at most 3 entries",
            f"no points and a state of {d}",
            "Draw its entries against time with drawing.time_series.",
        )
    ends = system.links() if links is None else links
    joined = tuple(tuple(_end(end, n, d) for end in _pair(link)) for link in ends)
    symbols, second = _axis_labels(pieces[0], d)
    stopped = why_stopped(motion, second)
    corners = tuple(np.cumsum([len(part[0]) for part in parts])[:-1].tolist())
    last = joined, tuple(outlines), _traced(sampled[:, :n], joined), corners
    if d > 1:
        return Paths(ts, r, symbols, second, True, stopped, *last)
    time = np.broadcast_to(ts[:, None, None], r.shape)
    labels = (f"t [{second.strip()}]" if second else "t", *symbols)
    return Paths(ts, np.concatenate([time, r], axis=2), labels, second, False, stopped, *last)


def _reached(piece: Trajectory) -> int:
    """How many samples a run got to."""
    good = np.isfinite(np.asarray(piece.ys)).all(axis=1)
    return len(good) if good.all() else int(np.argmin(good))


def why_stopped(motion: Trajectory | Chain, second: str = " s") -> str:
    """A line that says why and when a run stopped early; empty if it did not."""
    last = pieces_of(motion)[-1]
    good = _reached(last)
    if good == len(last.ts):
        return ""
    what = re.split(r"[.(] ?|: ", last.message)[0].strip()
    return f"{what} (t = {last.ts[good - 1]:.4g}{second})" if good else what


def _fine(piece: Trajectory, count: int, pieces: int) -> tuple[np.ndarray, ...]:
    """Times and places (s, n, d) on the curve through `count` samples, and places of these.

    The corners of outlines come after the points.
    """
    ts = np.asarray(piece.ts[:count])
    r, v, a = (np.asarray(x) for x in _derivatives(piece.scene, piece.ts[:count], piece.ys[:count]))
    parts = -(-CURVE // (pieces * max(count - 1, 1)))
    if parts < 2 or count < 2:
        return ts, r, r
    x = np.arange(parts) / parts
    times = ts[:-1, None] + np.diff(ts)[:, None] * x
    h = np.diff(ts)[:, None, None]
    start, bend, step = h * v[:-1], h**2 * a[:-1] / 2, np.diff(r, axis=0)
    miss = step - start - bend, h * v[1:] - start - 2 * bend, h**2 * a[1:] / 2 - bend
    # The polynomial of degree 5: what degree 2 misses at the end, in place and derivatives.
    cubic = 10 * miss[0] - 4 * miss[1] + miss[2]
    quartic = -15 * miss[0] + 7 * miss[1] - 2 * miss[2]
    quintic = 6 * miss[0] - 3 * miss[1] + miss[2]
    powers = np.stack([x**k for k in range(6)])
    curve = np.stack([r[:-1], start, bend, cubic, quartic, quintic])
    places = np.einsum("kp,ksnd->spnd", powers, curve).reshape(-1, *r.shape[1:])
    return np.append(times.ravel(), ts[-1]), np.concatenate([places, r[-1:]]), r


@eqx.filter_jit
def _derivatives(scene: Scene, ts, ys):
    """(s, n, d) places, velocities and accelerations; of the state where there are no points."""

    def corners(t, y):
        return jnp.concatenate(scene.system.outlines(t, y))

    def moving(t, y):
        r, v, _ = scene.system.points(t, y)
        if not r.shape[0]:
            return y[None], scene.rate(t, y)[None]
        if not scene.system.outlines(t, y):
            return r, v
        outlines = jax.jvp(corners, (t, y), (jnp.ones_like(t), scene.rate(t, y)))
        return tuple(jnp.concatenate(pair) for pair in zip((r, v), outlines, strict=True))

    def at(t, y):
        (r, v), (_, a) = jax.jvp(moving, (t, y), (jnp.ones_like(t), scene.rate(t, y)))
        return r, v, a

    return jax.vmap(at)(ts, ys)


def _traced(r: np.ndarray, links) -> tuple[int, ...]:
    """Numbers of the points whose paths say something: free points, ends of rods, one a body.

    Judged by the samples (s, n, d): on the curve between them distances are not kept exactly.
    """
    if not len(r):
        return tuple(range(r.shape[1]))
    size = max(np.ptp(r, axis=(0, 1)).max(), np.finfo(float).tiny)
    extent = np.linalg.norm(np.ptp(r, axis=0), axis=-1)
    bodies = _bodies(r, links, _RIGID * size)
    inside = set().union(*(body.all for body in bodies))
    shown = set(range(r.shape[1])) - inside
    length = np.linalg.norm(np.diff(r, axis=0), axis=-1).sum(axis=0)
    for body in bodies:
        moving = [i for i in body.ends if extent[i] > _RIGID * size]
        if len(body.ends) > 2 and moving:
            # The least winding for its size: the axis of a top, not its spinning arms.
            moving = [min(moving, key=lambda i: length[i] / extent[i] ** 2)]
        shown |= set(moving)
    return tuple(sorted(shown))


class _Body(NamedTuple):
    """Points that move as one rigid body: those that links join, and those with all others."""

    ends: set[int]
    all: set[int]


def _bodies(r: np.ndarray, links, change: float) -> list[_Body]:
    """What moves as one body: links whose ends keep their distances, and points inside."""
    thin = r[:: max(1, len(r) // 100)]
    apart = np.linalg.norm(thin[:, :, None] - thin[:, None, :], axis=-1)
    rigid = np.ptp(apart, axis=0) <= change
    bodies: list[set[int]] = []
    for link in links:
        ends = {end for end in link if isinstance(end, int)}
        fits = [body for body in bodies if all(rigid[i, j] for i in body for j in ends)]
        bodies = [body for body in bodies if body not in fits] + [ends.union(*fits)]
    every = range(r.shape[1])
    joined = set().union(*bodies)
    found = []
    for ends in bodies:
        inner = {k for k in every if k not in joined and all(rigid[k, i] for i in ends)}
        found.append(_Body(ends, ends | (inner if len(ends) > 1 else set())))
    return found


def _axis_labels(piece: Trajectory, d: int) -> tuple[tuple[str, ...], str]:
    """(d,) names and units of the directions, and the unit of time; the state says which."""
    units = dict(piece.scene.labels())
    named = [(x, units.get(x, units.get(x + "1", "m"))) for x in "xyz"[:d]]
    plain = all(unit == "1" for _, unit in named)
    return tuple(x if plain else f"{x} [{unit}]" for x, unit in named), "" if plain else " s"


def _pair(link):
    if not isinstance(link, tuple | list) or len(link) != 2:
        raise _checks.fail("links", "pairs of ends", repr(link), "Such as [(0, 1), (1, 2)].")
    return link


def _end(end, n: int, d: int):
    """A point's number, or an anchor's coordinates (d,), checked."""
    if not isinstance(end, int | np.integer):
        return np.asarray(_checks.array("links", end, (d,), "An anchor has d coordinates."))
    if not 0 <= int(end) < n:
        raise _checks.fail("links", f"a point's number, 0 to {n - 1}", end)
    return int(end)


def place(drawn: Paths, end, sample: int) -> np.ndarray:
    """(D,) where the end of a link is at a sample."""
    if isinstance(end, int):
        return drawn.xyz[sample, end]
    return end if drawn.equal else np.array([drawn.ts[sample], *end])


def segments(drawn: Paths, sample: int) -> list[np.ndarray]:
    """The lines (k, D) of all links and outlines at a sample."""
    rods = [np.stack([place(drawn, end, sample) for end in link]) for link in drawn.links]
    return rods + [outline[sample] for outline in drawn.outlines]


def places(drawn: Paths) -> np.ndarray:
    """(p, D) all that a picture must have room for: the points, anchors of links, outlines."""
    flat = drawn.xyz.reshape(-1, drawn.xyz.shape[-1])
    ends = (0, len(drawn.ts) - 1) if len(drawn.ts) else ()
    return np.concatenate([flat, *(line for sample in ends for line in segments(drawn, sample))])


def in_time(drawn: Paths, count: int) -> np.ndarray:
    """(count,) numbers of samples nearest to evenly spaced times."""
    wanted = np.linspace(drawn.ts[0], drawn.ts[-1], count)
    way = 1.0 if drawn.ts[-1] >= drawn.ts[0] else -1.0
    after = np.clip(np.searchsorted(way * drawn.ts, way * wanted), 1, len(drawn.ts) - 1)
    nearer = np.abs(drawn.ts[after - 1] - wanted) < np.abs(drawn.ts[after] - wanted)
    return after - nearer
