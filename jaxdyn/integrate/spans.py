"""What a run is asked for: tolerances or a step, a span and its samples, checked on the host."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._floats import as_float
from jaxdyn.integrate.step_control import Limits
from jaxdyn.scene import Scene

_RTOL_FLOOR, _RTOL_CEILING = 1e-16, 1e-2
_MOST_BYTES = 2**32  # of all samples
_COPIES = 4  # of them that a run holds at once: nodes, states and what moves between (measured)


def floats(x) -> Array | np.ndarray:
    """x in 64-bit floats, on the host if it has a value."""
    # NumPy where there is a value: a jnp operation on the host costs as much as a short solve.
    return jnp.asarray(x, float) if _checks.is_traced(x) else np.asarray(x, float)


def tolerances(rtol, atol) -> Array | np.ndarray:
    """(2,) relative and absolute tolerance, checked."""
    atol = rtol if atol is None else atol
    if _checks.is_traced((rtol, atol)):
        return jnp.stack([floats(rtol), floats(atol)])
    relative = "It is the relative error of one step."
    rtol = _number("rtol", rtol, relative)
    if not _RTOL_FLOOR <= rtol <= _RTOL_CEILING:
        wanted = f"between {_RTOL_FLOOR} and {_RTOL_CEILING}"
        raise _checks.fail("rtol", wanted, rtol, relative + " Errors of steps add up.")
    atol = _number("atol", atol, "It is in units of the state.")
    if not np.finfo(float).tiny <= atol < np.inf:  # smaller ones are 0 to XLA
        raise _checks.fail("atol", "> 0", atol, "It is in units of the state.")
    return np.array([rtol, atol])


def _number(name: str, x, remedy: str) -> float:
    if np.ndim(x) or not isinstance(x, float | int | np.number | np.ndarray | Array):
        raise _checks.fail(name, "one number", repr(x), remedy)
    return float(x)


def times(scene: Scene, t0, t1, samples) -> tuple[Array, Array, Array]:
    """Start (), end () and samples (s,) of a span, checked."""
    t0 = _checks.array("t0", t0, ())
    t1 = _checks.array("t1", scene.t1 if t1 is None else t1, ())
    if isinstance(samples, int | np.integer) and not isinstance(samples, bool):
        if samples < 1:
            raise _checks.fail("samples", "at least 1, or an array of times", samples)
        _check_memory(scene, int(samples))
        if samples == 1:
            return t0, t1, t1[None]
        if _checks.is_traced((t0, t1)):
            return t0, t1, jnp.linspace(t0, t1, samples)
        # One of JAX would be one more program for each number of samples.
        return t0, t1, as_float(np.linspace(np.asarray(t0), np.asarray(t1), samples))
    ts = _checks.array("samples", samples, (None,), "An array of times, or how many.")
    _check_memory(scene, len(ts))
    if not _checks.is_traced((ts, t0, t1)):
        inside = np.concatenate([np.asarray(x).reshape(-1) for x in (t0, ts, t1)])
        if (np.diff(inside) * (1.0 if inside[-1] >= inside[0] else -1.0) < 0).any():
            raise _checks.fail(
                "samples",
                f"times in order from t0 = {t0} to t1 = {t1}",
                f"{np.asarray(ts)}",
                "Sort them, or move t0 or t1.",
            )
    return t0, t1, ts


def _check_memory(scene: Scene, samples: int) -> None:
    """Refuse more samples than fit: of each, a few copies of its time and state."""
    size = 8 * samples * (len(scene.y0) + 1) * _COPIES
    if size > _MOST_BYTES:
        most = _MOST_BYTES * samples // size
        raise _checks.fail(
            "samples",
            f"at most {most:.2g} of them",
            f"{samples}, which need {size / 2**30:.3g} GiB",
            "Take fewer, or simulate in pieces, each from where the last one ended.",
        )


def limits(rtol, atol, max_steps: int, dt=None) -> Limits:
    """What a solve is held to, checked: a step where there is one, else the tolerances."""
    most = np.asarray(_checks.whole("max_steps", max_steps))
    return Limits(tolerances(rtol, atol) if dt is None else step_length(dt), most)


def step_length(dt) -> Array | np.ndarray:
    """(1,) a step of fixed length, checked."""
    remedy = "It is the length of a step, also backwards in time."
    return floats(_checks.positive("dt", _checks.array("dt", dt, (), remedy), remedy))[None]
