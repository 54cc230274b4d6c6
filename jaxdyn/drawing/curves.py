"""Smooth curves through the samples of a motion, even if they are few.

Between two samples the state is the polynomial of degree 5 with the values, rates and second
derivatives of both, and the points follow from it. For uniform circular motion the error is 3e-5 of
the radius with 6 samples per turn and 2e-3 with 3; fewer are not enough for a meaningful picture.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.sketch import Kind

CURVE_SAMPLES = 2000  # number of samples with which a curve looks smooth in a picture of any size


class Outline(NamedTuple):
    """The identity of a shape of a scene: kind, name, corners (m, k), number among like shapes."""

    kind: Kind
    name: str
    corners: tuple[int, int]
    number: int


class Part(NamedTuple):
    """A smooth part of a motion: times (s,), points (s, n, d), corners (s, m, k, d) of outlines."""

    ts: np.ndarray
    points: np.ndarray
    outlines: dict[Outline, np.ndarray]


def samples_reached(piece: Trajectory) -> int:
    """The number of samples that a run reached."""
    good = np.isfinite(np.asarray(piece.ys)).all(axis=1)
    return len(good) if good.all() else int(np.argmin(good))


def fine(piece: Trajectory, count: int, pieces: int, entries: Sequence[int] = ()) -> Part:
    """The curve through the first `count` samples of one of `pieces` pieces.

    For a system without points it is a curve in its state space; if entries are given, in these
    entries of the state.
    """
    scene = piece.scene
    ts, ys = states(piece, count, pieces)
    if entries:
        return Part(ts, ys[:, None, list(entries)], {})
    points, *corners = (np.asarray(x) for x in _places(scene, ts, ys))
    return Part(ts, points, dict(zip(_outlines(scene), corners, strict=True)))


def states(piece: Trajectory, count: int, pieces: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (s,) and states (s, k) on the curve of `fine`."""
    ts, ys = np.asarray(piece.ts[:count]), np.asarray(piece.ys[:count])
    parts = _parts(count, pieces)
    if parts < 2:
        return ts, ys
    return _refine(ts, (ys, *map(np.asarray, _rates(piece.scene, ts, ys))), parts)


def quantities(
    piece: Trajectory, count: int, pieces: int, of: Callable[[Scene, Array, Array], dict]
) -> dict[str, np.ndarray]:
    """Quantities (s,) by name at the times of `states`, interpolated as the states are.

    They are not evaluated at the interpolated states: where forces are large, the errors of these
    would make a conserved energy vary between the samples.
    """
    ts, ys = np.asarray(piece.ts[:count]), np.asarray(piece.ys[:count])
    found = _derivatives(piece.scene, ts, ys, of)
    parts, known = _parts(count, pieces), [np.stack([*x.values()], axis=1) for x in found]
    values = known[0] if parts < 2 else _refine(ts, tuple(known), parts)[1]
    return dict(zip(found[0], values.T, strict=True))


def _parts(count: int, pieces: int) -> int:
    """The number of parts from sample to sample with which a curve looks smooth."""
    return -(-CURVE_SAMPLES // (pieces * (count - 1))) if count > 1 else 1


def _refine(ts: np.ndarray, known: tuple[np.ndarray, ...], parts: int):
    """Times and states (s, k) on the curve, with `parts` parts from sample to sample."""
    y, v, a = known
    x = np.arange(parts) / parts
    times = ts[:-1, None] + np.diff(ts)[:, None] * x
    h = np.diff(ts)[:, None]
    start, bend, step = h * v[:-1], h**2 * a[:-1] / 2, np.diff(y, axis=0)
    miss = step - start - bend, h * v[1:] - start - 2 * bend, h**2 * a[1:] / 2 - bend
    # The polynomial of degree 5 corrects that of degree 2 by its errors at the end.
    cubic = 10 * miss[0] - 4 * miss[1] + miss[2]
    quartic = -15 * miss[0] + 7 * miss[1] - 2 * miss[2]
    quintic = 6 * miss[0] - 3 * miss[1] + miss[2]
    powers = np.stack([x**k for k in range(6)])
    curve = np.stack([y[:-1], start, bend, cubic, quartic, quintic])
    inner = np.einsum("cp,csk->spk", powers, curve).reshape(-1, y.shape[1])
    return np.append(times.ravel(), ts[-1]), np.concatenate([inner, y[-1:]])


def _outlines(scene: Scene) -> list[Outline]:
    """The shapes of a scene's sketch, in its order."""
    found: list[Outline] = []
    for shape in eqx.filter_eval_shape(scene.sketch, jnp.zeros(()), jnp.asarray(scene.y0)):
        *several, k, _ = shape.at.shape
        same = sum(other.kind == shape.kind and other.name == shape.name for other in found)
        found.append(
            Outline(kind=shape.kind, name=shape.name, corners=(math.prod(several), k), number=same)
        )
    return found


@eqx.filter_jit
def _rates(scene: Scene, ts, ys) -> tuple[Array, Array]:
    """(s, k) first and second time derivatives of the states."""

    def at(t, y):
        rate = scene.rate(t, y)
        return jax.jvp(scene.rate, (t, y), (jnp.ones_like(t), rate))

    return jax.vmap(at)(ts, ys)


@eqx.filter_jit
def _derivatives(scene: Scene, ts, ys, of: Callable) -> tuple[dict, dict, dict]:
    """Quantities (s,) by name along a motion, and their first and second time derivatives."""

    def along(fn):
        return lambda t, y: jax.jvp(fn, (t, y), (jnp.ones_like(t), scene.rate(t, y)))[1]

    value = functools.partial(of, scene)
    first = along(value)
    second = along(first)
    return jax.vmap(lambda t, y: (value(t, y), first(t, y), second(t, y)))(ts, ys)


@eqx.filter_jit
def _places(scene: Scene, ts, ys) -> tuple[Array, ...]:
    """(s, n, d) the points, then the corners (s, m, k, d) of each shape."""

    def at(t, y):
        r = scene.system.places(t, y)
        shapes = (shape.at.reshape(-1, *shape.at.shape[-2:]) for shape in scene.sketch(t, y))
        return (r if r.shape[0] else y[None], *shapes)

    return jax.vmap(at)(ts, ys)
