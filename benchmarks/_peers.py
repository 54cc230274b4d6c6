"""The same three-body problem (G = m = 1, in the plane) for other integrators.

Peers are optional: `importable` says with one line which are left out.
"""

import functools
import importlib.util

import diffrax
import jax
import numpy as np

from benchmarks._timing import Run
from jaxdyn import Scene


def importable(*modules: str) -> bool:
    """Whether all of these can be imported; prints a line if not."""
    missing = [m for m in modules if importlib.util.find_spec(m) is None]
    if missing:
        print(f"left out: {' and '.join(missing)} not installed (pip install jaxdyn[benchmark])")
    return not missing


def heyoka(y0: np.ndarray, period: float, tol: float) -> Run:
    """Taylor series of an order that heyoka chooses by the tolerance (Biscani, Izzo 2021)."""
    import heyoka as hy

    integrator = hy.taylor_adaptive(_heyoka_equations(), y0.copy(), tol=tol)
    return _heyoka_run(integrator, y0, period)


def heyoka_monodromy(
    y0: np.ndarray, period: float, tol: float, *, compact: bool, precise: bool = False
) -> Run:
    """The derivative (12, 12) of the end with respect to the start, by heyoka.

    Args:
      y0: (12,) start.
      period: () span.
      tol: tolerance, of the state and the tangents together.
      compact: build in a second and run slower, instead of building for a minute.
      precise: in 80-bit floats, for a reference.
    """
    import heyoka as hy

    number = np.longdouble if precise else float
    equations = hy.var_ode_sys(_heyoka_equations(), hy.var_args.vars, order=1)
    start = np.concatenate([y0, np.eye(len(y0)).ravel()]).astype(number)
    integrator = hy.taylor_adaptive(
        equations, start, tol=number(tol), compact_mode=compact, fp_type=number
    )
    run = _heyoka_run(integrator, start, number(period))
    k = len(y0)
    return lambda: run()[k:].reshape(k, k)


def heyoka_batch(period: float, lanes: int, tol: float, y0s: np.ndarray) -> np.ndarray:
    """Ends of many motions (n, 12), n a multiple of `lanes`, by heyoka's batch mode."""
    integrator = _heyoka_lanes(lanes, tol)
    ends = []
    for start in y0s.reshape(-1, lanes, y0s.shape[1]):
        integrator.set_time(0.0)
        integrator.state[:] = start.T
        integrator.propagate_until(np.full(lanes, period))
        ends.append(integrator.state.T.copy())
    return np.concatenate(ends)


@functools.cache
def _heyoka_lanes(lanes: int, tol: float):
    import heyoka as hy

    return hy.taylor_adaptive_batch(_heyoka_equations(), np.zeros((12, lanes)), tol=tol)


def heyoka_precise(period: float, y0s: np.ndarray) -> np.ndarray:
    """Ends of many motions (n, 12), computed in 80-bit floats."""
    import heyoka as hy

    number = np.longdouble
    integrator = hy.taylor_adaptive(
        _heyoka_equations(), np.zeros(12, number), tol=number(1e-18), fp_type=number
    )
    runs = [_heyoka_run(integrator, y0.astype(number), number(period)) for y0 in y0s]
    return np.array([run() for run in runs]).astype(float)


def _heyoka_equations() -> list:
    import heyoka as hy

    names = [f"{axis}{i}" for i in range(3) for axis in "xy"]
    q, v = hy.make_vars(*names), hy.make_vars(*["v" + name for name in names])
    acceleration = [0.0] * 6
    for i in range(3):
        for j in set(range(3)) - {i}:
            dx, dy = q[2 * j] - q[2 * i], q[2 * j + 1] - q[2 * i + 1]
            weight = (dx * dx + dy * dy) ** -1.5
            acceleration[2 * i] = acceleration[2 * i] + dx * weight
            acceleration[2 * i + 1] = acceleration[2 * i + 1] + dy * weight
    return [*zip(q, v, strict=True), *zip(v, acceleration, strict=True)]


def _heyoka_run(integrator, start: np.ndarray, period) -> Run:
    zero = period * 0

    def run() -> np.ndarray:
        integrator.time = zero
        integrator.state[:] = start
        integrator.propagate_until(period)
        return integrator.state.copy()

    return run


def diffrax_dopri8(scene: Scene, tol: float) -> Run:
    """diffrax.Dopri8 with everything as shipped, compiled."""
    y0, period = np.asarray(scene.y0), float(scene.t1)
    return lambda: np.asarray(_dopri8(scene.field, y0, period, tol))


def diffrax_vmap(scene: Scene, tol: float, y0s: np.ndarray) -> np.ndarray:
    """Ends of many motions (n, k) by vmap of diffrax.Dopri8 as shipped."""
    return np.asarray(_dopri8_vmap(scene.field, y0s, float(scene.t1), tol))


@jax.jit
def _dopri8_vmap(field, y0s, period, tol):
    return jax.vmap(lambda y0: _dopri8(field, y0, period, tol))(y0s)


@jax.jit
def _dopri8(field, y0, period, tol):
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, field: field.rate(t, y)),
        diffrax.Dopri8(),
        0.0,
        period,
        None,
        y0,
        args=field,
        stepsize_controller=diffrax.PIDController(rtol=tol, atol=tol),
    )
    assert solution.ys is not None
    return solution.ys[-1]


def scipy_dop853(y0: np.ndarray, period: float, tol: float) -> Run:
    """SciPy's DOP853 with a right-hand side compiled by numba."""
    from scipy.integrate import solve_ivp

    rate = _numba_rate()
    return lambda: solve_ivp(rate, (0.0, period), y0, "DOP853", rtol=tol, atol=tol).y[:, -1]


@functools.cache
def _numba_rate():
    import numba

    @numba.njit
    def rate(t, y):
        out = np.zeros(12)
        out[:6] = y[6:]
        for i in range(3):
            for j in range(i + 1, 3):
                dx, dy = y[2 * j] - y[2 * i], y[2 * j + 1] - y[2 * i + 1]
                r2 = dx * dx + dy * dy
                weight = 1.0 / (r2 * np.sqrt(r2))
                out[6 + 2 * i] += weight * dx
                out[7 + 2 * i] += weight * dy
                out[6 + 2 * j] -= weight * dx
                out[7 + 2 * j] -= weight * dy
        return out

    return rate
