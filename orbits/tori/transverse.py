"""Growth across a torus: the moduli of its multipliers.

A displacement from the circle grows by D phi from u(theta) to u(theta + rho). The directions along
the torus, which are u' and without a drive the flow, are mapped to themselves. In the rest of the
space a displacement, followed over many returns and made orthonormal after each of them, grows per
return by the moduli, whose logarithms are weighted Birkhoff averages of that in each return: these
converge faster than any power of the number of returns where the rotation is far from resonances.

Reference: Das, Saiki, Sander & Yorke (2017), Nonlinearity 30, 4111, for the averages.
"""

import numpy as np

from orbits.closing.given import is_driven
from orbits.tori import circle
from orbits.tori.invariance import Flow, Metric, Unknowns, rates

#: Returns before the averages, in which displacements turn to the directions that grow most, and in
#: the averages.
_BEFORE, _RETURNS = 1000, 4000


def moduli(flow: Flow, found: Unknowns, metric: Metric) -> np.ndarray:
    """(k - d,) moduli of the multipliers of an invariant circle across its torus, largest first."""
    k, each = found.points.shape[1], metric.each
    slopes = flow.ends(found.points, found).slopes.start * each / each[:, None]
    theta = found.rotation * np.arange(_BEFORE + _RETURNS + 1)
    along = _tangents(flow, found) / each[:, None]
    maps, tangents = _at(slopes, theta[:-1]), _at(along, theta)
    d = tangents.shape[2]
    frame = np.linalg.qr(np.concatenate([tangents[0], np.eye(k)], axis=1))[0][:, :k]
    logs = np.empty((_RETURNS + _BEFORE, k - d))
    for i, step in enumerate(maps):
        moved = np.concatenate([tangents[i + 1], step @ frame[:, d:]], axis=1)
        frame, r = np.linalg.qr(moved)
        logs[i] = np.log(np.abs(np.diag(r)[d:]))
    return np.sort(np.exp(average(logs[_BEFORE:])))[::-1]


def average(values: np.ndarray) -> np.ndarray:
    """The weighted Birkhoff average of values (n, ...) along a quasi-periodic sequence."""
    s = (np.arange(len(values)) + 0.5) / len(values)
    weights = np.exp(-1 / (s * (1 - s)))
    return weights @ values / weights.sum()


def _tangents(flow: Flow, found: Unknowns) -> np.ndarray:
    """(N, k, d) tangents of the torus at the points of the circle."""
    points = found.points
    around = circle.rotation(len(points), circle.angles(len(points)))[1] @ points
    if is_driven(flow.scene):
        return around[:, :, None]
    return np.stack([around, np.asarray(rates(flow.scene, points))], axis=2)


def _at(values: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """(s, ...) a function of theta, given by values (N, ...) at the angles of the points."""
    n = len(values)
    modes = np.fft.fft(values, axis=0) / n
    turns = np.exp(1j * np.fft.fftfreq(n, 1 / n)[None] * theta[:, None])
    return np.tensordot(turns, modes, 1).real
