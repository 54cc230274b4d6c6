"""Closed curves in state space as Fourier series, given by their points at equally spaced angles.

N = 2 m + 1 points determine m modes; interpolation, rotation and derivatives are exact for curves
of at most m modes.
"""

import math

import numpy as np


def angles(n: int) -> np.ndarray:
    """(n,) equally spaced angles from 0 [rad]."""
    return 2 * math.pi / n * np.arange(n)


def rotation(n: int, shift) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (s, n) from points of a curve to those at other angles, and their derivative.

    Args:
      n: number of points, odd.
      shift: (s,) angles at which the curve is evaluated [rad].
    """
    x = np.asarray(shift)[:, None] - angles(n)[None]
    k = np.arange(1, n // 2 + 1)[:, None, None]
    values = (1 + 2 * np.cos(k * x).sum(axis=0)) / n
    slopes = -2 * (k * np.sin(k * x)).sum(axis=0) / n
    return values, slopes


def at(points: np.ndarray, theta) -> np.ndarray:
    """(s, k) the curve through points (n, k) at angles theta (s,)."""
    # A small curve far from the origin would lose digits in the sums.
    middle = points.mean(axis=0)
    return middle + rotation(len(points), theta)[0] @ (points - middle)


def resample(points: np.ndarray, n: int) -> np.ndarray:
    """(n, k) the same curve, given by another, odd number of points."""
    return at(points, angles(n))


def harmonic(points: np.ndarray) -> np.ndarray:
    """(k,) twice the complex coefficient of exp(i theta)."""
    return 2 * np.exp(-1j * angles(len(points))) @ points / len(points)
