"""Eigenvalues of a computed matrix, each with an error bar, and the verdict on stability.

An error E of a matrix A moves an eigenvalue by at most cond |E| to first order, with cond the
condition number of that eigenvalue, |left vector| |right vector| over their product. For multiple
eigenvalues cond is infinite; Elsner's bound

    (2 |A|)^(1 - 1/k) |E|^(1/k)

holds there too, and is taken where it is smaller. (All norms of matrices are 2-norms.)

Where other eigenvalues have parallel eigenvectors, the matrix of eigenvectors is singular and does
not give the condition number of a simple one. In an orthonormal basis that begins with its own
eigenvector, the matrix is [[value, h], [0, B]], and E moves the eigenvalue by at most

    |E| (1 + 2 (|h| + |E|) / d),    d = sep - 2 |E|,

with sep the least singular value of B - value, if |E| (|h| + |E|) < d^2 / 4.

An error bar is that bound for `ERROR_SAFETY` times the stated error, to which rounding is added. A
verdict is "undecided" wherever the bars leave it open.

If more is known of an error than its norm, the bound is smaller, by orders of magnitude where
eigenvalues nearly coincide. Let L and R be the matrices of left and right eigenvectors. L A R is
diagonal, and its error is F = L E R. By Gershgorin's theorem, with row i divided and column i
multiplied by s, one eigenvalue of A + E is within

    |F_ii| + sum_j |F_ij| / s

of eigenvalue i, if that disc meets no other. The number s is the largest for which the growth of
the other discs, s |F_ji|, takes at most half of the gap between them and disc i. Entry by entry, F
is bounded by the largest of several changes of A under looser tolerances, times `_SAFETY_ENTRIES`,
plus what these changes do not show: rounding, and a part of the norm of the error.

Reference: Stewart, Sun (1990), Matrix Perturbation Theory, chapters IV and V.1 (Gershgorin); Elsner
(1985), Linear Algebra Appl. 71, 77.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from jaxdyn._checks import check_first

#: Safety factor on an estimated error, of which only the order of magnitude is known.
ERROR_SAFETY = 3.0
#: Safety factor on each entry of an error, larger since one may vanish by chance. With it, no bar
#: was below the true error (from 80 and 113 bits) of 272 multipliers, those of 17 orbits of three
#: bodies at four tolerances; with a factor of 3 two were.
_SAFETY_ENTRIES = 10.0
#: Rounding error of a matrix, relative to its norm. Jacobians of the ready-made scenes in forward
#: and in reverse mode differ by up to 3 units of rounding (measured).
ROUNDING = 4 * np.finfo(float).eps
#: Multipliers whose absolute values agree to this many places are ordered by their angle.
_PLACES = 9


class Eigenvalues(NamedTuple):
    """The eigenvalues of a matrix, or of a stack of them.

    Attributes:
      values: (..., k) complex.
      bars: (..., k) error bar of each.
    """

    values: np.ndarray
    bars: np.ndarray

    def reorder(self, order: np.ndarray) -> "Eigenvalues":
        """The eigenvalues in the order of indices (..., k)."""
        return Eigenvalues(*(np.take_along_axis(x, order, axis=-1) for x in self))


def eigenvalues(matrix, error=0.0, changes=None, unseen=0.0) -> Eigenvalues:
    """The eigenvalues of a matrix with their error bars; host only.

    Args:
      matrix: (..., k, k) finite matrices.
      error: (...) norm of the error besides rounding.
      changes: (s, ..., k, k) changes of the matrix under looser tolerances, which are at least as
        large as its error, if known.
      unseen: (...) norm of the error that `changes` do not show, besides rounding.
    Returns:
      The eigenvalues in no particular order; see `rate_eigenvalues` and `map_eigenvalues`.
    """
    matrix = np.asarray(matrix)
    k = matrix.shape[-1]
    if not k:
        return Eigenvalues(np.zeros(matrix.shape[:-1], complex), np.zeros(matrix.shape[:-1]))
    values, right = np.linalg.eig(matrix)
    size = norm(matrix)
    error_bound = np.asarray(ERROR_SAFETY * (ROUNDING * size + error))[..., None]
    elsner = (2 * size[..., None]) ** (1 - 1 / k) * error_bound ** (1 / k)
    u, s, vh = np.linalg.svd(right)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        left = (_adjoint(vh) / s[..., None, :]) @ _adjoint(u)
        condition = np.linalg.norm(left, axis=-1) * np.linalg.norm(right, axis=-2)
        # It is infinite or NaN for parallel eigenvectors.
        bars = np.fmin(condition * error_bound, elsner)
        for place in zip(*np.nonzero(bars == elsner), strict=True):
            *which, i = place
            vector, value = right[(*which, slice(None), i)], values[place]
            apart = _bound_by_separation(
                matrix[tuple(which)], value, vector, float(error_bound[(*which, 0)])
            )
            bars[place] = np.fmin(bars[place], apart)
        if changes is not None:
            shown = np.abs(left @ np.asarray(changes) @ right).max(axis=0)
            hidden = (ERROR_SAFETY * (ROUNDING * size + unseen))[..., None, None]
            norms = [np.linalg.norm(x, axis=axis) for x, axis in ((left, -1), (right, -2))]
            hidden_entries = hidden * norms[0][..., :, None] * norms[1][..., None, :]
            bars = np.fmin(bars, _radii(values, _SAFETY_ENTRIES * shown + hidden_entries))
    return Eigenvalues(values.astype(complex), bars)


def _bound_by_separation(a: np.ndarray, value: complex, vector: np.ndarray, error: float) -> float:
    """Bound on the shift of a simple eigenvalue, from its distance to others; NaN if it fails."""
    basis = np.linalg.qr(np.column_stack([vector, np.eye(len(a))]))[0]
    x, others = basis[:, 0], basis[:, 1:]
    rest = others.conj().T @ a @ others
    coupling = np.linalg.norm(x.conj() @ a @ others) + error
    shifted = rest - value * np.eye(len(rest))
    room = np.linalg.svd(shifted, compute_uv=False).min(initial=np.inf) - 2 * error
    if not room > 0 or error * coupling >= room**2 / 4:
        return np.nan
    return error * (1 + 2 * coupling / room)


def _radii(values: np.ndarray, error: np.ndarray) -> np.ndarray:
    """(..., k) Gershgorin radii of a diagonal matrix with an error; infinite where two discs meet.

    Args:
      values: (..., k) the diagonal.
      error: (..., k, k) bounds on the absolute values of what is added.
    """
    k = values.shape[-1]
    own = np.diagonal(error, axis1=-2, axis2=-1)
    found = np.full(values.shape, np.inf)
    for i in range(k):
        others = np.arange(k) != i
        gaps = np.abs(values[..., others] - values[..., i, None])
        across, back = error[..., i, others].sum(axis=-1), error[..., others, i]
        rest = error[..., others, :].sum(axis=-1) - back
        # Each of the two discs may take half of the gap between them.
        room = (gaps - rest - own[..., i, None]) / 2
        s = (room / np.maximum(back, np.finfo(float).tiny)).min(axis=-1, initial=np.inf)
        spread = np.where(across > 0, across / s, 0.0)
        apart = (s > 0) & (spread < room.min(axis=-1, initial=np.inf))
        found[..., i] = np.where(apart, own[..., i] + spread, np.inf)
    return found


def balance(matrix: np.ndarray) -> np.ndarray:
    """(..., k) units d of the entries of x in which no entry of a matrix A (..., k, k) is large.

    Large means larger than the spectral radius r of |A|, which no units change: d_i is the largest
    product of entries of |A| / r along a path from i, so |A_ij| d_j <= r d_i. Eigenvalues are the
    same in any units, but their rounding errors, which are relative to the largest entry, are small
    only in these. The units are powers of 2, so that scaling rounds nothing.
    """
    size = np.abs(np.asarray(matrix, float))
    radius = np.abs(np.linalg.eigvals(size)).max(axis=-1, initial=0.0)[..., None, None]
    shares = np.divide(size, radius, out=np.zeros_like(size), where=radius > 0)
    d = np.ones(size.shape[:-1])
    for _ in range(size.shape[-1]):
        d = np.maximum(d, (shares * d[..., None, :]).max(axis=-1, initial=0.0))
    return np.exp2(np.round(np.log2(d)))


def map_in_units(matrices: np.ndarray, each: np.ndarray) -> np.ndarray:
    """(..., k, k) linear maps of states, converted to units (..., k) of their entries."""
    return np.asarray(matrices) * each[..., None, :] / each[..., :, None]


def rate_eigenvalues(jacobian, error=None) -> Eigenvalues:
    """The eigenvalues of dx/dt = A x [1/s], the largest real part first.

    Args:
      jacobian: (..., k, k) A, in any units of the entries of x.
      error: (...) norm of its error besides rounding; if given, A is not rescaled: all entries of
        x should be in one unit.
    """
    if error is None:
        found = eigenvalues(map_in_units(jacobian, balance(jacobian)))
    else:
        found = eigenvalues(jacobian, error)
    return found.reorder(np.lexsort((found.values.imag, -found.values.real)))


def map_eigenvalues(monodromy, error=0.0, changes=None, unseen=0.0) -> Eigenvalues:
    """The eigenvalues of a map x -> M x, the largest absolute value first."""
    found = eigenvalues(monodromy, error, changes, unseen)
    sizes = np.round(np.abs(found.values), _PLACES)
    return found.reorder(np.lexsort((-found.values.imag, -sizes)))


@check_first
def rate_verdict(found: Eigenvalues) -> np.ndarray:
    """(...) "stable" where all real parts are certainly < 0, "unstable" where one is > 0.

    It is "undecided" otherwise, as at a centre.
    """
    return _verdict(found.values.real, found.bars)


def is_centre(found: Eigenvalues) -> bool:
    """Whether all eigenvalues (k,) of dx/dt = A x may be imaginary, and none is 0."""
    re, im = np.abs(found.values.real), np.abs(found.values.imag)
    return bool((re <= found.bars).all() and (im > found.bars).all())


def map_verdict(found: Eigenvalues, conservative) -> np.ndarray:
    """(...) "stable" where no perturbation grows, "unstable" where one certainly does.

    It is "undecided" otherwise.

    Args:
      found: eigenvalues of the map over one period.
      conservative: (...) whether the map is symplectic. Each multiplier off the unit circle then
        has a partner 1 / conj(lambda) at the same angle; so one that is alone within its bar, and
        not real, is on the circle and stays there.
    """
    values, bars = found
    growing = _verdict(np.abs(values) - 1, bars)
    others = ~np.eye(values.shape[-1], dtype=bool)
    gaps = np.abs(values[..., :, None] - values[..., None, :])
    alone = ~((gaps < bars[..., :, None] + bars[..., None, :]) & others).any(axis=(-2, -1))
    turning = (np.minimum(np.abs(values - 1), np.abs(values + 1)) >= bars).all(axis=-1)
    held = np.where(alone & turning, "stable", "undecided")
    return np.where(np.asarray(conservative) & (growing != "unstable"), held, growing)


def bound_by_product(found: Eigenvalues, log_product: float, error: float = 0.0) -> Eigenvalues:
    """The eigenvalues (k,), the least certain one recomputed from the others and the determinant.

    It is the determinant over the product of the others, if each of these is larger than its bar.
    Without this, the smallest would be noise where eigenvalues differ by more than 16 digits.

    Args:
      found: the eigenvalues.
      log_product: logarithm of the determinant, which is positive.
      error: error of that logarithm.
    """
    values, bars = (np.array(x) for x in found)
    with np.errstate(divide="ignore", invalid="ignore"):
        unsure = np.where(bars > 0, bars / np.abs(values), 0.0)
    if not len(values):
        return found
    i = int(np.argmax(unsure))
    others = np.arange(len(values)) != i
    if not (unsure[others] < 1).all():
        return found
    log_value = log_product - np.log(values[others]).sum()
    value, spread = np.exp(log_value), error - np.log1p(-unsure[others]).sum()
    # |value| (exp(spread) - 1), where one factor may be below the smallest float, one overflow
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        bar = np.exp(log_value.real + spread + np.log(-np.expm1(-spread)))
    if bar < bars[i]:
        values[i], bars[i] = value, bar
    return Eigenvalues(values, bars)


def pair_reciprocals(found: Eigenvalues) -> Eigenvalues:
    """The eigenvalues (k,) of a symplectic map, with bars widened to the error of their pairing.

    Each eigenvalue z has a partner w with z conj(w) = 1; the deviation from that is an error of the
    two. One on the unit circle is its own partner: its deviation from the circle is an error.
    """
    values, bars = found
    off = np.abs(values[:, None] * np.conj(values) - 1)
    size = np.abs(values)
    seen = size[:, None] * bars + size * bars[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = (off / seen).min(axis=1, initial=np.inf)
    return Eigenvalues(values, np.where(wider > 1, wider * bars, bars))


def _verdict(growth: np.ndarray, bars: np.ndarray) -> np.ndarray:
    decided = np.where((growth < -bars).all(axis=-1), "stable", "undecided")
    return np.where((growth > bars).any(axis=-1), "unstable", decided)


def _adjoint(matrix: np.ndarray) -> np.ndarray:
    return np.conj(np.swapaxes(matrix, -1, -2))


def norm(matrix: np.ndarray) -> np.ndarray:
    """(...) 2-norm of matrices (..., k, k); 0 for matrices without entries."""
    return np.linalg.svd(matrix, compute_uv=False).max(axis=-1, initial=0.0)


def with_bars(values: Any, bars: Any) -> str:
    """Numbers with their error bars, with the digits that the bars leave, at most twelve.

    Example:
      >>> with_bars([0.123456789], [2e-4]), with_bars([1 + 2j], [1e-9])
      ('0.1235 (+-2e-04)', '1+2j (+-1e-09)')
    """
    return ", ".join(
        f"{_certain(x, bar)} (+-{bar:.0e})" for x, bar in zip(values, bars, strict=True)
    )


def _certain(x: Any, bar: float) -> str:
    """A number without the digits that are below its error bar."""
    size = abs(x)
    if not (math.isfinite(size) and math.isfinite(bar)):
        return f"{x:.6g}"
    # One digit more than is certain, to hide the rounding of the output.
    places = math.log10(size / bar) + 1 if bar and size else 12
    return f"{x:.{min(12, max(1, math.ceil(places)))}g}"


def signed_least(values: np.ndarray, bars: np.ndarray) -> float:
    """The least absolute value of several numbers, with the sign of the product of all.

    As a test function it changes sign where a real number passes 0, but not where a complex pair
    comes near it. It is 0 within the error bar, and 1 if there are no numbers.
    """
    if not len(values):
        return 1.0
    least = int(np.argmin(np.abs(values)))
    if abs(values[least]) <= bars[least]:
        return 0.0
    real = values[np.abs(values.imag) <= bars].real
    return float(np.prod(np.sign(real)) * abs(values[least]))


def signed_least_sum(values: np.ndarray, bars: np.ndarray) -> float:
    """`signed_least` of the sums of two of the values."""
    i, j = np.triu_indices(len(values), 1)
    return signed_least(values[i] + values[j], bars[i] + bars[j])
