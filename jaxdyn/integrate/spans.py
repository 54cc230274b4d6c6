"""Host-side checks of tolerances, steps, the span and its samples; how samples share programs.

A program is compiled for each shape of its arguments, takes about 10 MiB and is kept. So samples
are filled up to a power of 8, or of 2, and the padding is cut off again on the host.
"""

import dataclasses
import functools
import itertools
import math
import reprlib
import sys
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks
from jaxdyn._checks import as_float, refuse_unreal, too_large
from jaxdyn.integrate.march import Limits
from jaxdyn.scene import Scene, check_scene
from jaxdyn.solvers import Solver
from jaxdyn.solvers.choice import RTOL as RTOL

#: Default of the number of steps.
MAX_STEPS = 1_000_000
_RTOL_FLOOR, _RTOL_CEILING = 1e-16, 1e-2
_ANY = np.iinfo(np.int32).max  # number of steps that is never reached
_MAX_BYTES = 2**32  # most memory for all samples of a run
#: Number of entries of all samples (1 MiB) up to which few programs matter more than memory.
_FEW_ENTRIES = 1 << 17
#: By default the absolute tolerance is rtol times this part of the sizes of a motion. Entries near
#: zero lose fewer digits than they would with the whole sizes, and no motion of size 1 takes more
#: than a tenth more steps.
_SHARE = 0.25
#: Most samples of a span whose times are kept for later calls, and the number of spans kept.
_KEPT_SAMPLES, _KEPT_SPANS = 10_000, 32
_COPIES_IN_MEMORY = 4  # copies of the samples in a run: nodes, states, temporaries (measured)
T = TypeVar("T")


class Share(NamedTuple):
    """An absolute tolerance in parts of the sizes of a motion; see `solvers.stepper`."""

    value: Any


class SolverOptions(NamedTuple):
    """The solver keywords of public functions, as one record; see `simulate`.

    An `atol` may also be a `Share`.
    """

    rtol: Any = RTOL
    atol: Any = None
    solver: Solver | None = None
    max_steps: int = MAX_STEPS
    max_step: Any = None
    breaks: Any = ()


def host_floats(x, name: str = "number") -> Array | np.ndarray:
    """x in 64-bit floats, on the host if it has a value."""
    if _checks.is_traced(x):
        return jnp.asarray(x, float)
    refuse_unreal(x, name)
    try:
        return np.asarray(x, float)  # a jnp operation costs as much as a short solve
    except OverflowError as error:
        raise too_large(name, x) from error
    except (TypeError, ValueError) as error:
        raise _checks.fail(name, "numbers", reprlib.repr(x)) from error


def tolerances(rtol, atol) -> Array | np.ndarray:
    """(3,) relative and absolute tolerance, checked, and one in parts of the motion's sizes."""
    shared = atol is None or isinstance(atol, Share)
    atol = atol.value if isinstance(atol, Share) else atol
    if any(map(_checks.is_traced, (rtol, atol))):
        absolute = _SHARE * rtol if atol is None else atol
        pair = (0.0, absolute) if shared else (absolute, 0.0)
        return jnp.stack([host_floats(x) for x in (rtol, *pair)])
    relative = "It is the relative error of one step."
    rtol = _number("rtol", rtol, relative)
    if not _RTOL_FLOOR <= rtol <= _RTOL_CEILING:
        wanted = f"between {_RTOL_FLOOR} and {_RTOL_CEILING}"
        raise _checks.fail("rtol", wanted, rtol, relative + " Errors of steps add up.")
    atol = _number("atol", _SHARE * rtol if atol is None else atol, "It is in units of the state.")
    if not sys.float_info.min <= atol < math.inf:  # XLA flushes smaller ones to 0
        raise _checks.fail("atol", "> 0", atol, "It is in units of the state.")
    return np.array([rtol, 0.0, atol] if shared else [rtol, atol, 0.0])


def _number(name: str, x, remedy: str) -> float:
    if isinstance(x, float):
        return x
    if np.ndim(x) or not isinstance(x, int | np.number | np.ndarray | Array):
        raise _checks.fail(name, "one number", repr(x), remedy)
    return float(as_float(x))


def span(scene: Scene, t1=None, t0=0.0, rtol: Any = 0.0) -> tuple[Array, Array]:
    """Start () and end () of a motion of a scene; they and the scene are checked.

    A `t1` of None means the scene's own end. Both are NumPy arrays unless traced.
    """
    own = check_scene(scene, rtol).t1
    t1 = own if t1 is None else t1
    return _checks.host_array("t0", t0, ()), _checks.host_array("t1", t1, ())


def sampled_span(scene: Scene, t1, t0, samples, rtol: Any) -> tuple[Array, Array, Array]:
    """The result of `span`, and the times (s,) of samples, given as an array or as a number."""
    t0, t1 = span(scene, t1, t0, rtol)
    if isinstance(samples, int | np.integer) and not isinstance(samples, bool):
        samples = _checks.whole("samples", samples, remedy="Or an array of times.")
        _check_memory(scene, int(samples))
        if _checks.is_traced((t0, t1)):
            return t0, t1, jnp.linspace(t1 if samples == 1 else t0, t1, int(samples))
        asked = float(t0), float(t1), int(samples)
        ts = (_kept_times if samples <= _KEPT_SAMPLES else _evenly_spaced)(*asked)
        # A program to which the times were donated has deleted them.
        return t0, t1, _evenly_spaced(*asked) if ts.is_deleted() else ts
    ts = _checks.host_array("samples", samples, (None,), "Pass an array of times, or their number.")
    _check_memory(scene, len(ts))
    if not _checks.is_traced((ts, t0, t1)):
        inside = np.concatenate([t0[None], ts, t1[None]])
        if (np.diff(inside) * (1.0 if inside[-1] >= inside[0] else -1.0) < 0).any():
            raise _checks.fail(
                "samples",
                f"times in order from t0 = {t0} to t1 = {t1}",
                f"{np.asarray(ts)}",
                "Sort them, or move t0 or t1.",
            )
    # `jnp.linspace` and `as_float` would compile a program for each number of samples.
    return t0, t1, jnp.asarray(ts, float)


def _evenly_spaced(t0: float, t1: float, n: int) -> Array:
    # It is kept for later calls, so it must not belong to a trace that happens to be under way.
    with jax.ensure_compile_time_eval():
        return jax.device_put(np.linspace(t1 if n == 1 else t0, t1, n))


#: Moving the times to the device takes as long as five empty programs.
_kept_times = functools.lru_cache(_KEPT_SPANS)(_evenly_spaced)


def _check_memory(scene: Scene, samples: int) -> None:
    """Raise if the samples do not fit in memory: a few copies of each time and state."""
    size = 8 * samples * (len(scene.y0) + 1) * _COPIES_IN_MEMORY
    if size > _MAX_BYTES:
        most = _MAX_BYTES * samples // size
        raise _checks.fail(
            "samples",
            f"at most {most:.2g} of them",
            f"{samples}, which need {size / 2**30:.3g} GiB",
            "Take fewer, or simulate in pieces, each from where the last one ended.",
        )


def limits(options: SolverOptions, dt=None) -> Limits:
    """The limits of a solve, checked: the step if `dt` is given, else the tolerances.

    Args:
      options: tolerances and the number of steps.
      dt: step length of a method of fixed step.
    """
    most = options.max_steps
    if _checks.is_traced(most):
        most = jnp.stack([most, jnp.asarray(_ANY)])
    else:
        most = np.array([_checks.whole("max_steps", most), _ANY])
    if dt is not None:
        remedy = "It is the length of a step, also backwards in time."
        length = _checks.positive("dt", _checks.array("dt", dt, (), remedy), remedy)
        return Limits(host_floats(length)[None], most)
    found = Limits(tolerances(options.rtol, options.atol), most)
    # `np.size` alone takes as long as all other checks.
    breaks = options.breaks
    if options.max_step is None and (
        breaks == () if type(breaks) is tuple else not np.size(breaks)
    ):
        return found
    longest = None
    if options.max_step is not None:
        remedy = "It is a time, the longest step."
        checked = _checks.array("max_step", options.max_step, (), remedy)
        longest = host_floats(_checks.positive("max_step", checked, remedy))
    remedy = "Times at which the rate changes."
    breaks = _checks.array("breaks", breaks, (None,), remedy) if np.size(breaks) else ()
    return found._replace(max_step=longest, breaks=breaks)


def padding(n: int, k: int) -> int:
    """The number of samples to add to n samples of a state (k,) for a program that others share.

    Programs have a power of 8 of samples, at least 64, or a power of 2 for long states or very many
    samples.
    """
    shared = 8 ** next(i for i in itertools.count(2) if 8**i >= n)
    return (shared if shared * k <= _FEW_ENTRIES else 1 << (n - 1).bit_length()) - n


def fill(ts: Array, ys: Array) -> tuple[Array, Array]:
    """Times (s,) and states (s, k), padded with the last ones; unchanged if traced."""
    if _checks.is_traced((ts, ys)):
        return ts, ys
    more = padding(*ys.shape)
    last = np.minimum(np.arange(len(ts) + more), len(ts) - 1)
    # On the host: slices and conversions in JAX would compile for each number of samples.
    return jax.device_put(np.asarray(ts)[last]), jax.device_put(np.asarray(ys)[last])


def cut_rows(values: T, filled: int, n: int) -> T:
    """Arrays with a row for each of `filled` samples cut to the first n rows; others unchanged."""

    def rows(x: Any) -> Any:
        mine = np.shape(x)[:1] == (filled,) and not _checks.is_traced(x)
        return jax.device_put(np.asarray(x)[:n]) if mine else x

    return jax.tree.map(rows, values)


def of_samples(function: Callable[..., T]) -> Callable[..., T]:
    """Decorate a function of a motion that repeating the last sample does not change.

    Results with a row for each sample are cut to the given samples.
    """

    @functools.wraps(function)
    def shared(motion: Any, *args, **kwargs) -> T:
        n = len(motion.ts)
        if not n:
            return function(motion, *args, **kwargs)
        ts, ys = fill(motion.ts, motion.ys)
        # Fields that the values do not depend on would make more kinds of programs.
        bare = {"error": None, "dt": None, "method": None, "stiff": False, "switched": False}
        longer = dataclasses.replace(motion, ts=ts, ys=ys, **bare)
        return cut_rows(function(longer, *args, **kwargs), len(ts), n)

    return shared
