"""A scene from an ordinary differential equation dy/dt = rate(t, y, params).

It is for equations that are not mechanics, or are written down already: the state is any array
(k,), or a pytree that is stored as one, there are no material points, and an energy or other
integrals only if they are given.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._records import check_repeatable
from jaxdyn.formulations.functions import (
    as_params,
    call,
    check_function,
    finite_params,
    name_entries,
    vector,
)
from jaxdyn.formulations.structure import Structure, flatten_start
from jaxdyn.scene import Scene, System
from jaxdyn.system import check_value

_SHAPES = "A list of numbers, or a pytree with arrays of any shape, such as {'y': y0}."
_INDICES = (
    "Integers in params become floats: let the function capture those that index an array, or make "
    "them a static field of an eqx.Module."
)


class Ode(System):
    """A state (k,) whose rate is a function; see `ode`, which makes the scene.

    Attributes:
      function: (t, y, params) -> (k,), without params where they are None.
      params: a pytree of numbers, or None.
      names: (name, unit) of each of the k entries.
      energy: (t, y, params) -> (), or None.
      conserved: names and functions of further integrals.
      moves: names of candidates for continuous symmetries, and their generators:
        (y, params) -> (k,), without params where they are None.
      second_order: whether the state is [q, v] with dq/dt = v and dv/dt independent of v.
      structure: the pytree that the functions take and return in place of (k,); None for (k,).
    """

    function: Callable = eqx.field(static=True)
    params: Any
    names: tuple[tuple[str, str], ...] = eqx.field(static=True)
    energy: Callable | None = eqx.field(static=True, default=None)
    conserved: tuple[tuple[str, Callable], ...] = eqx.field(static=True, default=())
    moves: tuple[tuple[str, Callable], ...] = eqx.field(static=True, default=())
    second_order: bool = eqx.field(static=True, default=False)
    structure: Structure | None = eqx.field(static=True, default=None)

    def labels(self):
        return self.names

    def parameter_names(self):
        """The name that the rate gives to `params` where that is one number."""
        names = list(inspect.signature(self.function).parameters)
        alone = eqx.is_array(self.params) and not self.params.ndim
        return {"params": (names[2],)} if alone and len(names) > 2 else {}

    def tree(self, y: Array) -> Any:
        """What the functions take for states (..., k): a pytree where the start was one, else y.

        Example:
          >>> import jaxdyn
          >>> def spring(t, y):
          ...     return {"x": y["v"], "v": -y["x"]}
          >>> scene = jaxdyn.ode(spring, {"x": 1.0, "v": 0.0}, 2.0)
          >>> motion = jaxdyn.simulate(scene)
          >>> states = scene.system.tree(motion.ys)
          >>> round(float(states["x"][-1]), 6), bool((states["v"] == motion["v"]).all())
          (-0.416147, True)
        """
        return y if self.structure is None else self.structure.tree_of(y)

    def rate(self, t, y, effects):
        del effects
        return self._flatten("rate", call(self.function, self.params, t, self.tree(y)), y)

    def _flatten(self, name: str, value: Any, y: Array) -> Array:
        """The value of a function that returns something like the state, as an array (k,)."""
        if self.structure is None or value is None:
            return vector(name, value, y)
        return self.structure.flatten(name, value, y)

    def energies(self, t, y, effects):
        del effects
        if self.energy is None:
            return ()
        return (vector("energy", call(self.energy, self.params, t, self.tree(y)), y),)

    def integrals(self, t, y):
        tree = self.tree(y)
        values = {name: call(function, self.params, t, tree) for name, function in self.conserved}
        return {name: vector(name, value, y) for name, value in values.items()}

    def generators(self, y):
        tree = self.tree(y)
        values = {name: call(function, self.params, tree) for name, function in self.moves}
        return {name: self._flatten(name, value, y) for name, value in values.items()}

    def check(self, t, y):
        del t, y
        finite_params(self.params)


def ode(
    rate: Callable,
    y0,
    t1=1.0,
    *,
    names: Sequence[str | tuple[str, str]] | None = None,
    params: Any = None,
    energy: Callable | None = None,
    integrals: Mapping[str, Callable] | None = None,
    generators: Mapping[str, Callable] | None = None,
    second_order: bool = False,
    name: str | None = None,
) -> Scene:
    """The scene of an ordinary differential equation dy/dt = rate(t, y, params).

    Args:
      rate: a function of time (), state (k,) and `params` that returns (k,), an array of
        `jax.numpy` or a list of k numbers; of (t, y) alone where there are no parameters. It needs
        derivatives in forward mode: a callback, or a function with a `jax.custom_vjp`, needs a
        `jax.custom_jvp` instead.
      y0: (k,) start; or a pytree of arrays, such as ``{"x": 1.0, "v": [0.0, 1.0]}``, which all
        functions then take and return in place of (k,). The scene stores it as (k,), and
        ``scene.system.tree(motion.ys)`` is the motion as such a pytree.
      t1: () span worth seeing, the default of `simulate`; for `orbits.find` a guess of the period.
      names: names of the k entries, each a name or a pair (name, unit); y0, y1, ... if left out, or
        the keys of a pytree, "x" and "v[0]", in the order of `jax.tree.leaves`, which sorts
        dictionaries: index entries by name, as in ``motion["x"]``. An entry with the unit "rad" is
        an angle: values that differ by 2 pi are the same. Entries with the same unit share a size,
        to which tolerances are relative; an entry without a unit has its own. Give the modes of a
        wave one unit: small modes are then resolved only relative to the large ones. The unit of
        time is that of a rate among them, as ms of "mV/ms", otherwise s.
      params: any pytree of numbers: derivatives go through them, `jax.vmap` runs over them, and
        new values do not compile again. Integers become floats: let the function capture those
        that index an array, or make them a static field of an `eqx.Module`.
      energy: a function of the arguments of `rate` that returns (). It need not be conserved:
        `analysis.energy.drift` shows whether it is.
      integrals: further quantities by name, functions like `energy` that return () or (d,). Those
        that are conserved give an orbit its unit multipliers (`orbits.stability`).
      generators: generators of continuous symmetries by name, each a function of the state (k,),
        and of `params` if there are any, that returns (k,): the rate at which the symmetry moves
        the state, for a rotation by an angle in radians. `orbits.relative` closes an orbit up to
        one that is linear in the state. They are candidates, as integrals are.
      second_order: True where y = [q, v] with dq/dt = v and dv/dt does not depend on v, which is
        checked: then the default is a method for such equations, mostly about twice as fast.
      name: the name of the scene, the title of pictures; that of `rate` by default.
    Returns:
      A scene without material points, for everything that takes one.
    Raises:
      ValueError: `rate`, `energy`, an integral or a generator is not such a function or returns
        another shape; `y0`, `t1` or `params` are not finite numbers; `names` are not k different
        ones.
    Limits: a program is compiled for each function, so define them once, not as a lambda in a
      loop; numbers that they capture are constants, and the scene is refused once they have
      changed. Files hold the numbers of such a scene, not its functions: it is given again to
      read them.
    Example:
      >>> import jax.numpy as jnp, jaxdyn
      >>> from jaxdyn.analysis import energy
      >>> def hunt(t, y, p):
      ...     prey, predators = y
      ...     return [prey * (p["birth"] - predators), predators * (prey - 1.0)]
      >>> def level(t, y, p):
      ...     prey, predators = y
      ...     return prey - jnp.log(prey) + predators - p["birth"] * jnp.log(predators)
      >>> scene = jaxdyn.ode(hunt, [2.0, 1.0], 5.0, names=["prey", "predators"],
      ...                    params={"birth": 1.5}, integrals={"level": level})
      >>> motion = jaxdyn.simulate(scene, rtol=1e-12)
      >>> round(float(motion["prey"][-1]), 6)
      1.504716
      >>> float(energy.drift(motion, "level")) < 1e-12
      True
    """
    y0, names, structure = flatten_start(y0, names)
    y0, t1 = _checks.array("y0", y0, (None,), _SHAPES), _checks.array("t1", t1, ())
    given, params = params, as_params(params)
    extra = _by_name("integrals", integrals, "momentum")
    if "energy" in dict(extra):
        raise _checks.fail("integrals", "other names", "'energy'", "Pass it as energy=.")
    moves = _by_name("generators", generators, "turn")
    functions = {"rate": rate} | ({} if energy is None else {"energy": energy})
    functions |= {f"integrals {key!r}": function for key, function in extra}
    for called, function in functions.items():
        check_function(called, function, params, "t", "y")
    for key, function in moves:
        check_function(f"generators {key!r}", function, params, "y")
    system = Ode(
        function=rate,
        params=params,
        names=name_entries(names, "y", len(y0)),
        energy=energy,
        conserved=extra,
        moves=moves,
        second_order=bool(second_order),
        structure=structure,
    )
    t, each = jnp.zeros(()), "One for each entry of y0."
    try:
        check_value("rate", y0.shape, each, lambda t, y: system.rate(t, y, ()), t, y0)
    except Exception:
        _check_order(system, t, y0)
        _check_indices(system, given, t, y0)
        raise
    check_repeatable(system, "rate", t, y0, ())
    if energy is not None:
        one = "An energy is one number."

        def energy_of(t, y):
            return call(energy, params, t, system.tree(y))

        check_value("energy", (), one, energy_of, t, y0)
    for key, _ in moves:
        called = f"generators {key!r}"
        check_value(called, y0.shape, each, lambda y, key=key: system.generators(y)[key], y0)
    scene = Scene(system, y0=y0, t1=t1, name=_text.name_of(rate) if name is None else name)
    if second_order and not _checks.is_traced(scene):
        scene.check()  # `solve` does not check, and a wrong claim gives wrong motions
    return scene


def _check_order(system: Ode, t: Array, y: Array) -> None:
    """Raise ValueError for a rate of (y, t): one that returns a rate if called in that order."""
    try:
        swapped = jax.eval_shape(lambda: system.rate(y, t, ())).shape == y.shape
    except Exception:
        return  # the error in the right order is more helpful
    if swapped:
        got = "one of (y, t), as for scipy.integrate.odeint"
        raise _checks.fail("rate", "a function of (t, y)", got, "Exchange its first two arguments.")


def _check_indices(system: Ode, given: Any, t: Array, y: Array) -> None:
    """Raise ValueError for a rate that needs integers in `params` to stay integers."""

    def works(params: Any) -> bool:
        try:
            jax.eval_shape(lambda: call(system.function, params, t, system.tree(y)))
        except Exception:
            return False
        return True

    if not works(system.params) and works(given):
        raise _checks.fail("params", "numbers that may be floats", "integers", _INDICES)


def _by_name(what: str, given: Any, example: str) -> tuple[tuple[str, Callable], ...]:
    if given is None:
        return ()
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        remedy = f'For example {{"{example}": function}}.'
        raise _checks.fail(what, "functions by name", repr(given), remedy)
    return tuple(given.items())
