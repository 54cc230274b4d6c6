"""Host-side checks of arguments, with one message format, and their conversion to float arrays.

Every message reads ``name: expected ..., got .... What to do.`` and is a ValueError. Values
that are traced (inside jit, grad or vmap) are unknown and pass.
"""

import collections.abc
import functools
import inspect
import math
import reprlib
import types
import typing
import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn._text import check_digits as check_digits
from jaxdyn._text import choice as choice
from jaxdyn._text import fail as fail
from jaxdyn._text import flag as flag
from jaxdyn._text import whole as whole

# ---- Conversion of numbers to float arrays, the leaves of a scene

#: Puts a NumPy array on the device, in a fifth of the time of `jnp.asarray` (5 us of 29).
_put_on_device = jax.jit(lambda x: x)


#: The tightest relative tolerance of a step in 32-bit floats, 8 of their roundings.
NARROW_RTOL = 1e-6
_NARROW = (
    "32-bit floats: about five digits of a motion are right over some periods, fewer over long "
    "spans and where it is sensitive; how many is not known. jaxdyn.configure() enables 64 bits."
)


def float64(rtol: Any = 0.0) -> None:
    """Raise unless 64-bit floats are enabled; warn if a tolerance needs only 32 bits."""
    if jax.config.jax_enable_x64:
        return
    if is_traced(rtol) or not rtol >= NARROW_RTOL:
        remedy = (
            "Call jaxdyn.configure() first. In 32 bits only motions without constraints are "
            f"computed, by simulate, solve and ensembles, with rtol={NARROW_RTOL:g} or more."
        )
        raise fail("floats", "64-bit floats", "JAX's default of 32 bits", remedy)
    warnings.warn(_NARROW, stacklevel=2)


def as_float(x: Any) -> Array:
    """A number or numbers as a float array; the converter of fields that hold them.

    The floats have 64 bits where these are enabled; data in fewer bits are converted exactly.

    Raises:
      ValueError: complex numbers or dates, text that is no number, None.
    """
    refuse_unreal(x)
    if isinstance(x, jax.Array):
        return x if x.dtype == float and not x.weak_type else jnp.asarray(x, dtype=float)
    try:
        if is_plain(x) or (isinstance(x, np.ndarray | np.number) and x.dtype.kind in "fiu"):
            return _put_on_device(np.asarray(x, float))
        return jnp.asarray(x, dtype=float)
    except OverflowError as error:
        raise too_large("number", x) from error
    except (TypeError, ValueError) as error:
        if not _says_no_number(x):
            raise
        raise fail("number", "numbers", reprlib.repr(x)) from error


def _says_no_number(x: Any) -> bool:
    """Whether x, or an entry of it, is text or None, or x has names."""
    entries = jax.tree.leaves(x, is_leaf=lambda one: one is None)
    text = (one is None or isinstance(one, str) or _dtype_kind(one) in "USO" for one in entries)
    return isinstance(x, dict) or any(text)


def _dtype_kind(x: Any) -> str:
    return getattr(getattr(x, "dtype", None), "kind", "f")


def too_large(name: str, x: Any) -> ValueError:
    """The error for a whole number that is too large for any float."""
    return fail(name, "numbers of at most 1.8e308", reprlib.repr(x))


def refuse_unreal(x: Any, name: str = "number") -> None:
    """Raise ValueError for complex numbers, and for dates and durations.

    A date or a duration of NumPy is a number only in some unit, and the conversion of a complex
    number would drop its imaginary part.
    """
    if isinstance(x, list | tuple) and not is_plain(x):
        for leaf in jax.tree.leaves(x):
            refuse_unreal(leaf, name)
    kind = "c" if type(x) is complex else _dtype_kind(x)
    if kind in ("m", "M"):
        remedy = "Subtract dates from each other, and divide by a unit: x / np.timedelta64(1, 's')."
        raise fail(name, "numbers", f"{x!r}, in units of NumPy", remedy)
    if kind == "c":
        raise fail(name, "real numbers", "complex ones", "Pass their real and imaginary parts.")


def refuse_narrow(x: Any, name: str, remedy: str = "Compute it in 64 bits.") -> None:
    """Raise ValueError for a result in floats of fewer bits than those that are enabled, 64 or 32.

    Input in fewer bits is converted; a result that was computed in them has lost half its digits.
    """
    dtype, least = getattr(x, "dtype", None), 8 if jax.config.jax_enable_x64 else 4
    if dtype is not None and dtype.itemsize < least and jnp.issubdtype(dtype, jnp.floating):
        raise fail(name, f"{8 * least}-bit floats", f"an array of {dtype}", remedy)


def refuse_made_before(name: str, *numbers: Any) -> None:
    """Raise ValueError for numbers that `as_float` made before 64-bit floats were enabled."""
    for x in numbers:
        refuse_narrow(x, name, "It was made before jaxdyn.configure(). Make it again.")


def is_plain(x: Any) -> bool:
    """Whether x is a Python number, or a list or tuple of them; True and False do not count."""
    kinds = {*map(type, x)} if isinstance(x, list | tuple) else {type(x)}
    return kinds <= {float, int}


def floats(*numbers: Any) -> tuple[Array, ...]:
    """Several numbers, each as a float array."""
    return tuple(map(as_float, numbers))


# ---- Host-side checks of arguments, with one message format

_NUMBERS = (float, int, np.ndarray, jax.Array, type(None))
_WITH_VALUES = frozenset({float, int, np.ndarray, type(None)})


def is_traced(x: Any) -> bool:
    """True while x is inside a jax transformation and has no known value."""
    # The usual cases, in a tenth of the time that a search through a pytree takes; a Tracer, which
    # is a jax.Array for isinstance, is tested for before these.
    if type(x) in _WITH_VALUES or (type(x) is tuple and not x):
        return False
    if isinstance(x, jax.core.Tracer):
        return True
    if isinstance(x, _NUMBERS):
        return False
    # `any` of a generator would take twice as long.
    for leaf in jax.tree.leaves(x):
        if isinstance(leaf, jax.core.Tracer):
            return True
    return False


def check_untraced(
    name: str, x: Any, remedy: str = "Call it outside of jit, grad and vmap."
) -> None:
    """Raise for traced values, where they are needed on the host."""
    if is_traced(x):
        raise fail(name, "numbers", "values traced by jit, grad or vmap", remedy)


def check_on_host(
    name: str, x: Any, remedy: str = "Call it outside of jit, grad and vmap."
) -> None:
    """Raise for traced values, and inside of jit, where whatever is computed is traced."""
    check_untraced(name, (x, jnp.zeros(())), remedy)


def array(name: str, x: Any, shape: tuple[int | None, ...], remedy: str = "") -> Array:
    """The input as a finite float array of this shape, where None allows any length."""
    return finite(name, array_of_shape(name, x, shape, remedy), remedy)


def host_array(name: str, x: Any, shape: tuple[int | None, ...], remedy: str = "") -> Any:
    """The result of `array` as a NumPy array if x has a value, for further use on the host."""
    if is_traced(x):
        return array(name, x, shape, remedy)
    if type(x) is float and not shape and math.isfinite(x):
        return np.asarray(x)  # the usual case, in a fifth of the time
    refuse_unreal(x, name)
    try:
        _refuse_other_than_numbers(x)
        values = np.asarray(x, float)
    except (TypeError, ValueError, OverflowError) as error:
        raise fail(name, "numbers", reprlib.repr(x), remedy) from error
    check_shape(name, values.shape, shape, remedy)
    return finite(name, values, remedy)


def array_of_shape(name: str, x: Any, shape: tuple, remedy: str = "") -> Array:
    """The input as a float array of this shape; see `check_shape`."""
    x = numbers(name, x, remedy)
    check_shape(name, x.shape, shape, remedy)
    return x


def grid(first: Any, second: Any) -> tuple[np.ndarray, np.ndarray, Array, Array]:
    """The axes (a,) and (b,) of a grid, and both of its numbers (a b,) at each of its points."""
    given = ("first", first), ("second", second)
    first, second = (np.asarray(array(name, x, (None,))) for name, x in given)
    if not len(first) or not len(second):
        raise fail("grid", "at least one number each way", f"{len(first)} x {len(second)}")
    xs, ys = (jnp.asarray(x.ravel()) for x in np.meshgrid(first, second, indexing="ij"))
    return first, second, xs, ys


def check_shape(name: str, got: tuple, shape: tuple, remedy: str = "") -> None:
    """Raise unless the shape fits: None allows any length, and a final ... any further axes."""
    if got == shape:
        return
    front = shape[:-1] if shape[-1:] == (...,) else shape
    compared = got[: len(front)] if front != shape else got
    fits = len(compared) == len(front) and all(
        w is None or s == w for s, w in zip(compared, front, strict=True)
    )
    if not fits:
        words = ["any" if w is None else "..." if w is ... else str(w) for w in shape]
        wanted = ", ".join(words) + ("," if len(words) == 1 else "")
        raise fail(name, f"shape ({wanted})", f"shape {got}", remedy)


def numbers(name: str, x: Any, remedy: str = "") -> Array:
    """The input as a float array, of any shape and value."""
    refuse_unreal(x, name)
    try:
        _refuse_other_than_numbers(x)
        return as_float(x)
    except (TypeError, ValueError, OverflowError) as error:
        raise fail(name, "numbers", reprlib.repr(x), remedy) from error


def _refuse_other_than_numbers(x: Any) -> None:
    """Raise TypeError unless x is numeric."""
    if is_plain(x) or getattr(x, "dtype", None) == np.float64:
        return
    # numpy would convert the text "1" and the boolean True to the number 1.
    for leaf in jax.tree.leaves(x):
        if isinstance(leaf, str | bool | complex) or _dtype_kind(leaf) in "bcUSO":
            raise TypeError


def finite(name: str, x: Array, remedy: str = "") -> Array:
    """The array; raises if any entry is NaN or infinite."""
    if not is_traced(x):
        values = np.asarray(x)
        if not np.isfinite(values).all():
            bad = ~np.isfinite(values)
            where = "" if values.ndim == 0 else f" at index {np.argwhere(bad)[0].tolist()}"
            raise fail(name, "finite numbers", f"{values[bad][0]}{where}", remedy)
    return x


def positive(name: str, x: Any, remedy: str = "") -> Array:
    """x as an array; raises unless every entry is > 0."""
    return _above_zero(name, x, remedy, np.greater, "> 0")


def at_least_zero(name: str, x: Any, remedy: str = "") -> Array:
    """x as an array; raises unless every entry is >= 0."""
    return _above_zero(name, x, remedy, np.greater_equal, ">= 0")


def _above_zero(name: str, x: Any, remedy: str, holds, wanted: str) -> Array:
    x = numbers(name, x, remedy)
    if not is_traced(x):
        finite(name, x, remedy)
        values = np.asarray(x)
        if not (right := holds(values, 0)).all():
            raise fail(name, wanted, values[~right].ravel()[0], remedy)
    return x


# ---- The kind of the first argument of public functions: a scene, a motion, an orbit, a family
#
# One decorator serves all of them, so that a scene given in place of an orbit is refused with what
# to call first. It also notices functions whose captured numbers have changed since a scene was
# made.

_LONGEST = 60  # characters of a value in a message
_BY_POSITION = "Arguments are passed by position: lambda x: function(name=x) passes one by name."
F = TypeVar("F", bound=Callable)

#: The kinds of matrices that may be given in place of a scene.
_MATRICES = [(kind, "Scene") for kind in ("ndarray", "ArrayImpl", "list", "matrix")]

#: What to do with what was given instead, by the names of both kinds.
_REMEDIES = {
    ("Scene", "Orbit"): "Find one first: orbits.find(scene).",
    ("Scene", "Trajectory"): "Simulate it first: jaxdyn.simulate(scene).",
    ("Scene", "Family"): "Find an orbit, then continue it: orbits.continue_family(orbit).",
    ("Scene", "EquilibriumFamily"): "Follow one: jaxdyn.continue_equilibria(make, parameter).",
    ("Scene", "Torus"): "Find an orbit, then orbits.torus(orbit).",
    ("Scene", "Manifold"): "Compute it first: orbits.manifold(scene).",
    ("Orbit", "Scene"): "Pass orbit.scene.",
    ("Orbit", "Trajectory"): "Pass orbit.trajectory().",
    ("Orbit", "Family"): "Continue it first: orbits.continue_family(orbit).",
    ("Orbit", "Torus"): "Compute one first: orbits.torus(orbit).",
    ("Orbit", "Manifold"): "Compute it first: orbits.manifold(orbit).",
    ("Orbit", "Report"): "Make one first: orbits.report(orbit).",
    ("Trajectory", "Scene"): "Pass motion.scene.",
    ("Trajectory", "Orbit"): "Find one first: orbits.find(motion.scene).",
    ("HybridTrajectory", "Trajectory"): "Pass one of motion.pieces.",
    ("HybridTrajectory", "Scene"): "Pass the scene of one of motion.pieces.",
    ("Family", "Orbit"): "Pass the orbit of one of family.members.",
    ("EquilibriumFamily", "Family"): "Equilibria have jaxdyn.continuation.switch_branch and "
    "jaxdyn.drawing.equilibria.",
    ("Family", "EquilibriumFamily"): "Orbits have orbits.switch_branch and orbits.drawing.family.",
    ("Family", "Scene"): "Pass the scene of an orbit of one of family.members.",
    **dict.fromkeys(_MATRICES, "Matrices M, C, K make one: scenes.linear_system(M=M, C=C, K=K)."),
    ("SearchResult", "Orbit"): "Pass one of result.orbits.",
    ("Outcome", "Orbit"): "Pass the orbit itself.",
    ("Orbit", "Stability"): "Pass orbits.stability(orbit).",
    ("Family", "Stability"): "Pass the stability of one of family.members, or draw them all: "
    'orbits.drawing.family(family, quantity="multiplier").',
}


def check_first(function: F) -> F:
    """A decorator that raises ValueError unless the first argument is of the annotated kind."""
    first, *_ = inspect.signature(function).parameters.values()
    kinds, of_sequences = _kinds(first.annotation)
    several = first.kind is inspect.Parameter.VAR_POSITIONAL

    @functools.wraps(function)
    def checked(*args, **kwargs):
        if args or first.name in kwargs:
            for x in args if several else (args[0] if args else kwargs[first.name],):
                if type(x) not in kinds:
                    check_kind(first.name, x, kinds, of_sequences)
                check_functions(x)
        return function(*args, **kwargs)

    vars(checked)["first_kinds"] = (*kinds, *(of_sequences and (list, tuple)))
    return cast(F, checked)


def check_kind(name: str, x: Any, kinds: tuple[type, ...], of: tuple[type, ...] = ()) -> None:
    """Raise ValueError unless x is of one of these kinds, or a list or tuple of the kinds `of`."""
    if isinstance(x, kinds):
        return
    if of and isinstance(x, list | tuple):
        for i, one in enumerate(x):
            check_kind(f"{name}[{i}]", one, of)
        return
    *others, last = (f"{_article(kind)} {kind.__name__}" for kind in kinds or of)
    wanted = f"{', '.join(others)} or {last}" if others else last
    called = getattr(x, "__name__", None) if callable(x) else None
    if called:
        needs = "..." if _needs_arguments(x) else ""
        raise fail(name, wanted, called, f"Call it: {called}({needs}).")
    given = type(x).__name__
    remedies = (_REMEDIES.get((given, kind.__name__)) for kind in kinds or of)
    remedy = next(filter(None, remedies), "")
    text = repr(x)
    short = len(text) <= _LONGEST and "\n" not in text and not remedy
    raise fail(name, wanted, text if short else f"{_article(type(x))} {given}", remedy)


def _needs_arguments(function: Callable) -> bool:
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:  # some builtins have none
        return False
    single = (p for p in parameters if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD))
    return any(p.default is p.empty for p in single)


def check_callable(name: str, function: Any, *arguments: str, remedy: str = "") -> None:
    """Raise ValueError unless a function can be called with these arguments, by position."""
    wanted = f"a function of ({', '.join(arguments)})"
    if not callable(function):
        raise fail(name, wanted, repr(function)[:_LONGEST])
    try:
        signature = inspect.signature(function)
    except ValueError:  # some builtins have none
        return
    try:
        signature.bind(*arguments)
    except TypeError as error:
        raise fail(name, wanted, f"one of {signature}", remedy or _BY_POSITION) from error


def check_functions(x: Any) -> None:
    """Raise ValueError if a number that a function in x, or in its scene, captured has changed."""
    owner = x if hasattr(x, "check_functions") else getattr(x, "scene", None)
    check = getattr(owner, "check_functions", None)
    if check is not None:
        check()


def _kinds(annotation: Any) -> tuple[tuple[type, ...], tuple[type, ...]]:
    """The classes that an annotation names, and those of the entries of its sequences."""
    kinds, entries = [], []
    for part in _parts(annotation):
        if typing.get_origin(part) is collections.abc.Sequence:
            entries += _parts(typing.get_args(part)[0])
        else:
            kinds.append(typing.get_origin(part) or part)
    return tuple(kinds), tuple(entries)


def _parts(annotation: Any) -> tuple[Any, ...]:
    return typing.get_args(annotation) if isinstance(annotation, types.UnionType) else (annotation,)


def _article(kind: type) -> str:
    return "an" if kind.__name__[0] in "AEIOU" else "a"
