"""The problem that is solved: the checked arguments that `fit` and `train` have in common."""

import inspect
import reprlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_kind
from jaxdyn.fitting import measurements
from jaxdyn.fitting.measurements import Measured
from jaxdyn.fitting.segments import Model
from jaxdyn.scene import Scene, check_scene

#: The remedy where arguments are traced.
OUTSIDE = "Call it outside jit, grad and vmap."


class Problem(NamedTuple):
    """A model, the guess of its parameters and the measurements.

    Attributes:
      model: the map from parameters and initial states to measured quantities.
      theta: (p,) the guess.
      scene: the scene of the guess.
      table: the measurements, in the units of the scene.
      leaves: the guess, with None in place of everything that is not a number.
    """

    model: Model
    theta: Array
    scene: Scene
    table: Measured
    leaves: Any


def pose(
    make: Callable[..., Scene],
    guess: Any,
    data: Any,
    columns: Sequence[str] | None,
    observe: Mapping[str, Callable] | None,
    options: Mapping[str, Any],
) -> Problem:
    """The problem that these arguments of `fit` state, with all entries of the start unknown.

    Args:
      make: function of the parameters that returns the scene; see `fit`.
      guess: initial values of the parameters; see `fit`.
      data: the measurements; see `fit`.
      columns: the columns that are used; all by default.
      observe: further columns by name; see `fit`.
      options: options of `solve`.
    Raises:
      ValueError: `make` does not return a scene, the guess has no numbers, or a column has an
        unknown name.
    """
    numbers = list(data.values()) if isinstance(data, Mapping) else data
    _checks.check_on_host("fit", (guess, numbers), OUTSIDE)
    leaves, rest = eqx.partition(guess, _is_number)
    leaves = jax.tree.map(lambda x: _checks.array("guess", x, (...,)), leaves)
    flat, tree = jax.tree.flatten(leaves)
    if not flat:
        raise _checks.fail("guess", "numbers", reprlib.repr(guess), 'For example {"g": 9.8}.')
    by_name = _by_name(make, guess)
    if not by_name:
        _checks.check_callable("make", make, "params")
    scene = make(**guess) if by_name else make(guess)
    check_kind("make(guess)", scene, (Scene,))
    _checks.check_untraced("make(guess)", scene, OUTSIDE)
    check_scene(scene)
    table = measurements.read_measurements(data, columns)
    found = measurements.columns_of(scene, table.names, observe)
    model = Model(
        make=make,
        by_name=by_name,
        tree=tree,
        shapes=tuple(x.shape for x in flat),
        rest=rest,
        columns=found,
        free=(True,) * len(scene.y0),
        options=tuple(options.items()),
    )
    theta = jnp.concatenate([jnp.ravel(x) for x in flat])
    return Problem(model, theta, scene, table.in_units_of(scene, found), leaves)


def _is_number(x: Any) -> bool:
    if isinstance(x, bool) or not eqx.is_array_like(x):
        return False
    return np.dtype(getattr(x, "dtype", type(x))).kind in "fiu"


def _by_name(make: Callable, guess: Any) -> bool:
    if not callable(make):
        raise _checks.fail("make", "a function that returns a scene", repr(make)[:60])
    if not isinstance(guess, dict):
        return False
    parameters = inspect.signature(make).parameters
    takes_any = any(p.kind is p.VAR_KEYWORD for p in parameters.values())
    known = [name for name in guess if name in parameters]
    near = [name for name in guess if _text.suggestion(str(name), parameters)]
    if not (known or near or takes_any) and len(parameters) == 1:
        return False  # the dictionary is the only argument
    for name in () if takes_any else guess:
        _checks.choice("guess", name, parameters)
    named = [p for p in parameters.values() if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
    if missing := [p.name for p in named if p.default is p.empty and p.name not in guess]:
        remedy = "Give each a guess, or a default in make."
        raise _checks.fail("guess", "values for " + ", ".join(missing), "none", remedy)
    return True
