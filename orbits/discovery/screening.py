"""Guesses by the thousand: close returns of motions, and a batched Newton's method.

Motions are integrated side by side, at a loose tolerance, and a small residual of the closing
condition gives a guess. A batched Newton's method with finite differences then refines all guesses
at once; those that end at a collision, an escape or a rest state, or do not converge, are dropped.
The others are left to `find`.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxdyn import Scene, System, ensemble
from jaxdyn.ensemble.watches import CloseReturn, Together, Until
from jaxdyn.scales import at_start, groups
from orbits.closing.closings import Closing
from orbits.closing.given import is_driven

#: Maximum steps of a motion; a near collision takes many times more.
MAX_STEPS = 5000
_SCREENING, _REFINING = 1e-9, 1e-11  # tolerances
_ROWS = 512  # rows of the compiled program's queue
_BLOCK = 64  # guesses of one batch of Newton's method: one shape, one compilation
#: Units of the period, as shares of its guess, in the two runs of Newton's method. With the first,
#: in which the period is 2 pi, it stays near the guess. Where errors hardly grow, an orbit may be
#: far from the guess: one that has not converged in the first run does so in the second.
_UNITS = (1 / (2 * np.pi), 1.0)
_ITERATIONS = 20  # steps of each run
_DIFFERENCE = 1e-6  # relative; the Jacobian is accurate to some 1e-4, enough for Newton's method
_SOLVED = 1e-7  # closing error that finite differences do not reduce further
_NEAR = 1e-6  # closing error below which `find` converges to this orbit
_RANK = 1e-7  # relative: smaller singular values of the Jacobian count as zero
#: The damping at first, its factors after a step that fails and one that reduces the residual, and
#: the damping at which a guess is given up.
_DAMPING, _GROW, _SHRINK, _HOPELESS = 0.1, 4.0, 0.25, 1e4
#: Relative to the guess: the period or path length below which an orbit is a rest state, and the
#: size beyond which it has escaped.
_TRIVIAL, _ESCAPE = 0.02, 100.0


class Guesses(NamedTuple):
    """Starts and periods of motions that nearly close.

    Attributes:
      index: (g,) index of the start of each.
      y0s: (g, k) starts.
      periods: (g,) full periods.
      gaps: (g,) residuals of the closing condition.
    """

    index: np.ndarray
    y0s: np.ndarray
    periods: np.ndarray
    gaps: np.ndarray

    def take(self, which) -> "Guesses":
        """The guesses with the given indices, a slice or an array."""
        return jax.tree.map(lambda column: column[which], self)


class ClosingGap(eqx.Module):
    """A gap for `CloseReturn`: the residual of a closing condition.

    Attributes:
      system: the system of the states.
      closing: the condition.
      rows: (m,) sizes of the residual's entries, in which it is measured.
    """

    system: System
    closing: Closing
    rows: Array

    def __call__(self, y: Float[Array, " k"], start: Float[Array, " k"]) -> Array:
        """(m,) residual of the closing condition."""
        return self.closing.residual(self.system, y, start, jnp.zeros(())) / self.rows


class Beyond(eqx.Module):
    """Whether some entry of a state is larger than a limit.

    Attributes:
      limit: (k,) or () largest magnitudes; infinite for no limit.
    """

    limit: Array

    def __call__(self, t: Array, y: Float[Array, " k"]) -> Array:
        """() whether some entry is beyond its limit."""
        del t
        return (jnp.abs(y) > self.limit).any()


def close_returns(
    scene: Scene,
    y0s,
    closing: Closing,
    *,
    shortest: float,
    longest: float,
    windows: int,
    close: float,
    limit,
    each: np.ndarray,
) -> Guesses:
    """Where motions nearly close: the smallest residual within each window of the period.

    Args:
      scene: the scene.
      y0s: (n, k) starts.
      closing: the closing condition, without an unknown turn.
      shortest: shortest period.
      longest: longest period.
      windows: number of parts of that range, each of which has its own guess.
      close: largest residual of a guess, in units of `each`.
      limit: (k,) or () magnitudes of the state beyond which a motion has escaped.
      each: (k,) sizes of the entries of a state, as of `sizes_of_starts`.
    Returns:
      The guesses, in the order of the starts.
    """
    edges = np.linspace(shortest, longest, windows + 1) / closing.parts
    gap = ClosingGap(scene.system, closing, jnp.asarray(closing.residual_units(each)))
    watch = Together(
        CloseReturn.of(scene, later=edges[:-1], before=edges[1:], gap=gap),
        Until(Beyond(jnp.asarray(limit, float))),
    )
    ends = ensemble.run(
        scene,
        y0s,
        edges[-1],
        rtol=_SCREENING,
        max_steps=MAX_STEPS,
        threads=1,  # chunks of a search run side by side
        watch=watch,
        chunk=_ROWS,
    )
    best = ends.seen[0].best
    index, window = np.nonzero(best.distance <= close)
    return Guesses(
        index=index,
        y0s=np.asarray(y0s, float)[index],
        periods=closing.parts * best.after[index, window],
        gaps=best.distance[index, window],
    )


def sizes_of_starts(scene: Scene, y0s, longest: float) -> np.ndarray:
    """(k,) sizes of the entries of motions whose periods are not known yet.

    Args:
      scene: the scene.
      y0s: (n, k) starts of the motions. The result is the median of their sizes, which single
        starts far away or near a collision hardly change.
      longest: longest period.
    """
    found = np.asarray(_at_starts(scene, jnp.asarray(y0s, float), jnp.asarray(longest, float)))
    known = np.where((found > 0) & np.isfinite(found), found, np.nan)
    known = np.where(np.isnan(known).all(axis=0), 1.0, known)
    return np.nanmedian(known, axis=0)


@eqx.filter_jit
def _at_starts(scene: Scene, y0s: Array, span: Array) -> Array:
    zero, own = jnp.zeros(()), groups(scene.system)
    return jax.vmap(lambda y0: at_start(scene.field, own, zero, y0, span)[0].sizes)(y0s)


def refine(scene: Scene, closing: Closing, guesses: Guesses, each: np.ndarray) -> Guesses:
    """Refined guesses, of those that Newton's method moves close to an orbit; `each`: sizes."""
    blocks = [
        _refine_block(scene, closing, guesses.take(slice(i, i + _BLOCK)), each)
        for i in range(0, len(guesses.index), _BLOCK)
    ]
    return jax.tree.map(lambda *columns: np.concatenate(columns), *blocks) if blocks else guesses


def _refine_block(scene: Scene, closing: Closing, guesses: Guesses, each: np.ndarray) -> Guesses:
    """Newton's method for up to `_BLOCK` guesses; those that do not reach an orbit are dropped."""
    n = len(guesses.index)
    batch = _Batch(scene, closing, is_driven(scene), each)
    base = np.pad(guesses.y0s, ((0, _BLOCK - n), (0, 0)), constant_values=np.nan)
    periods = np.pad(guesses.periods, (0, _BLOCK - n), constant_values=np.nan)
    x = np.concatenate([base[:, closing.free(base.shape[1])], periods[:, None]], axis=1)
    path, size = batch.path(x, base), np.abs(base / each).max(axis=1)
    free = np.broadcast_to(each[closing.free(base.shape[1])], (_BLOCK, x.shape[1] - 1))
    f, jac = batch(x, base)
    damping = np.full(_BLOCK, _DAMPING)
    for unit in np.repeat(_UNITS, _ITERATIONS):
        units = np.concatenate([free, unit * periods[:, None]], axis=1)
        norm = np.linalg.norm(f, axis=1)
        busy = np.isfinite(norm) & (np.abs(f).max(axis=1) > _SOLVED) & (damping < _HOPELESS)
        if not busy.any():
            break
        new = np.full_like(x, np.nan)  # NaN for finished guesses, which then cost nothing
        steps = _steps(f[busy], jac[busy] * units[busy, None], (damping * norm)[busy])
        new[busy] = x[busy] + steps * units[busy]
        new_f, new_jac = batch(new, base)
        better = np.linalg.norm(new_f, axis=1) < norm
        x[better], f[better], jac[better] = new[better], new_f[better], new_jac[better]
        damping = np.where(better, _SHRINK, _GROW) * damping
    gaps = np.abs(f).max(axis=1)
    starts = batch.starts(x, base)
    with np.errstate(invalid="ignore"):
        good = (gaps <= _NEAR) & (np.abs(starts / each).max(axis=1) < _ESCAPE * size)
        good &= (x[:, -1] > _TRIVIAL * periods) & (batch.path(x, base) > _TRIVIAL * path)
    good = np.flatnonzero(good)
    return Guesses(
        index=guesses.index[good], y0s=starts[good], periods=x[good, -1], gaps=gaps[good]
    )


def _steps(f: np.ndarray, jac: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """(b, n) the shortest damped Newton steps, as in `newton`."""
    bad = np.isnan(jac.sum(axis=(1, 2)))[:, None]
    u, s, vt = np.linalg.svd(np.where(bad[:, None], 0.0, jac), full_matrices=False)
    weight = np.where(s > _RANK * s[:, :1], s, 0.0) / (s * s + damping[:, None] ** 2)
    step = -np.einsum("bij,bi,bki,bk->bj", vt, weight, u, f, optimize=True)
    return np.where(bad, np.nan, step)


class _Batch(NamedTuple):
    """The closing equations of a block of guesses x = (free entries of the start, period)."""

    scene: Scene
    closing: Closing
    fixed: bool  # whether the period is fixed
    each: np.ndarray  # (k,) sizes of the entries of a state, in which residuals are measured

    def starts(self, x: np.ndarray, base: np.ndarray) -> np.ndarray:
        """(b, k) starts of the guesses."""
        return np.asarray(_starts(self.scene.system, self.closing, x[:, :-1], base))

    def path(self, x: np.ndarray, base: np.ndarray) -> np.ndarray:
        """(b,) path lengths over the period at the initial speed."""
        return np.asarray(_speeds(self.scene, self.starts(x, base), self.each)) * x[:, -1]

    def __call__(self, x: np.ndarray, base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual (b, m) and Jacobian (b, m, p + 1); NaN where undefined."""
        b, p = x.shape[0], x.shape[1] - 1
        h = _DIFFERENCE * np.append(self.each[self.closing.free(len(self.each))], 0.0)
        shifted = np.stack([x] + [x + h * np.eye(p + 1)[i] for i in range(p)], axis=1)
        starts = self.starts(shifted.reshape(b * (p + 1), -1), np.repeat(base, p + 1, axis=0))
        ends = ensemble.run(
            self.scene,
            starts,
            np.repeat(x[:, -1], p + 1) / self.closing.parts,
            rtol=_REFINING,
            max_steps=MAX_STEPS,
            threads=1,
            chunk=_ROWS,
        ).y1
        rows = jnp.asarray(self.closing.residual_units(self.each))
        found = _residual(self.scene, self.closing, rows, ends, starts)
        missed, slope = (np.asarray(a) for a in found)
        missed, slope = missed.reshape(b, p + 1, -1), slope.reshape(b, p + 1, -1)
        columns = (missed[:, 1:] - missed[:, :1]) / h[:-1, None]
        last = 0.0 * slope[:, :1] if self.fixed else slope[:, :1] / self.closing.parts
        return missed[:, 0].copy(), np.swapaxes(np.concatenate([columns, last], axis=1), 1, 2)


@eqx.filter_jit
def _starts(system: System, closing: Closing, u: Array, base: Array) -> Array:
    return jax.vmap(lambda u, base: closing.start(system, u, base))(u, base)


@eqx.filter_jit
def _speeds(scene: Scene, y0s: Array, each: Array) -> Array:
    return jax.vmap(lambda y: jnp.linalg.norm(scene.rate(jnp.zeros(()), y) / each))(y0s)


@eqx.filter_jit
def _residual(
    scene: Scene, closing: Closing, rows: Array, ends: Array, starts: Array
) -> tuple[Array, Array]:
    """The residual of the closing condition, and its derivative with respect to the end time."""

    def one(end, start):
        rate = scene.rate(jnp.zeros(()), end)
        miss = ClosingGap(scene.system, closing, rows)
        return jax.jvp(lambda y: miss(y, start), (end,), (rate,))

    return jax.vmap(one)(ends, starts)
