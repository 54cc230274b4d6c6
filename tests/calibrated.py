"""Estimated errors over true ones, of motions in closed form."""

import numpy as np

from jaxdyn.integrate.errors import gaps

EPS = float(np.finfo(float).eps)


def quotient(case, found) -> float:
    """Estimated over true error of the worst entry; true errors below a spacing count as one."""
    ys, scale = np.asarray(found.ys), np.asarray(found.scale)
    exact = np.zeros_like(ys)
    exact[:, case.entries] = case.exact(np.asarray(found.ts))
    missed = np.abs(gaps(case.scene, ys, exact)) / scale
    true = max(float(missed[:, case.entries].max()), EPS)
    return float((np.asarray(found.error) / scale)[:, case.entries].max()) / true


def calibration(way, cases, tolerances, **options) -> np.ndarray:
    """(cases, tolerances) quotients of a way to estimate errors, printed as a table."""
    rows = []
    for name, case in cases.items():
        given = {"samples": case.samples, **options}
        found = [way(case.scene, case.t1, rtol=tol, **given) for tol in tolerances]
        rows.append([quotient(case, e) for e in found])
        print(f"{name:18}", *(f"{x:8.2g}" for x in rows[-1]))
    return np.array(rows)


def assert_calibrated(quotients):
    """Within a factor of 5 in 95 of 100 cases, and never below a tenth."""
    inside = np.sum((quotients > 1 / 5) & (quotients < 5))
    assert inside >= np.floor(0.95 * quotients.size)
    assert quotients.min() > 0.1
