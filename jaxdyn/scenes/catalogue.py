"""All scenes by name, with their parameters, and how to make one from text.

A scene is a function of keyword parameters in one of the families. Its docstring begins with a
summary and the course problems that it answers, and documents each parameter with its unit;
`jaxdyn list` shows that text. Nothing else needs to be registered, except the phases of a scene
whose motion has corners (`corners`). A scene of the user is named by its file and function, as in
"mine.py:roessler".
"""

import dataclasses
import functools
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from jaxdyn import _checks, _scene_files
from jaxdyn._arithmetic import setting
from jaxdyn._doors import with_present_names
from jaxdyn._text import name_of
from jaxdyn.formulations import xpp
from jaxdyn.formulations.ode import Ode
from jaxdyn.integrate.phases import HybridTrajectory, simulate_phases
from jaxdyn.integrate.simulation import RTOL, simulate
from jaxdyn.integrate.trajectory import Trajectory
from jaxdyn.scene import Scene
from jaxdyn.scenes.corners import check_one_phase, has_corners, phases_of
from jaxdyn.solvers import Solver


@dataclasses.dataclass(frozen=True)
class Entry:
    """An entry of the catalogue: the function of a scene and the defaults of its parameters."""

    name: str
    make: Callable[..., Scene]
    parameters: Mapping[str, Any]

    def motion(
        self,
        scene: Scene,
        t1=None,
        *,
        samples=200,
        rtol: float = RTOL,
        solver: Solver | None = None,
        dt: float | None = None,
    ) -> Trajectory | HybridTrajectory:
        """The motion of a scene made by this entry: one smooth motion, or a chain of phases.

        Args:
          scene: made by this entry, with any parameters.
          t1: end of the span [s]; the scene's own by default.
          samples: number of samples of each phase.
          rtol: see `simulate`.
          solver: see `simulate`; in a chain, the default is that of each phase.
          dt: see `simulate`; not available for a chain.
        Raises:
          ValueError: see `simulate` and `simulate_phases`.
        """
        if not has_corners(scene):
            return simulate(
                scene, t1, samples=samples, rtol=rtol, solver=solver, dt=dt, throw=False
            )
        if dt is not None:
            raise _checks.fail("dt", "none for a motion in phases", dt, "Events adapt the steps.")
        t1 = scene.t1 if t1 is None else t1
        return simulate_phases(
            phases_of(scene), None, scene.y0, t1, samples=samples, rtol=rtol, solver=solver
        )


def entry(name: str) -> Entry:
    """The entry of a ready-made scene, or of a function in a file of the user, which is run.

    Raises:
      ValueError: there is no such scene (the nearest name is suggested), file or function.
    """
    if (text := _scene_files.text_of(name)) is not None:
        make = xpp.Maker(text, Path(name).stem)
        return Entry(name, make, make.defaults)
    if _scene_files.is_in_file(name):
        make = _scene_files.load(name)
        return Entry(name, _check_maker(name, make), _scene_files.defaults(make))
    zoo = entries()
    return zoo[_scene_files.choose(name, zoo)]


def _check_maker(name: str, make: Callable[..., Any]) -> Callable[..., Scene]:
    """A function of the user, with a check that it returns a scene.

    A scene that has the name of its rate function, mostly "rate", is named after `make` instead.
    """

    @functools.wraps(make)
    def made(*args, **kwargs) -> Scene:
        scene = make(*args, **kwargs)
        if not isinstance(scene, Scene):
            got = f"{type(scene).__name__}"
            raise _checks.fail(name, "a function that returns a Scene", got)
        if isinstance(scene.system, Ode) and scene.name == name_of(scene.system.function):
            scene = dataclasses.replace(scene, name=name_of(make))
        return scene

    return made


def entries() -> dict[str, Entry]:
    """The entries of all ready-made scenes whose parameters are numbers, by name."""
    made = {name: make for family in families() for name, make in vars(family).items()}
    return {name: _entry(name, made[name]) for name in sorted(made) if _is_scene(made[name])}


@functools.cache
def families() -> tuple[ModuleType, ...]:
    """The modules beside this one, each a family of scenes or what they share, all loaded."""
    package = __name__.rpartition(".")[0]
    names = sorted(info.name for info in pkgutil.iter_modules([str(Path(__file__).parent)]))
    return tuple(importlib.import_module(f"{package}.{name}") for name in names)


def _is_scene(make: Any) -> bool:
    """Whether `make` is a public function of numbers with defaults that returns a scene."""
    if not inspect.isfunction(make) or make.__name__.startswith("_"):
        return False
    parameters = inspect.signature(make).parameters.values()
    needs_more = any(p.default is p.empty and p.kind is not p.VAR_POSITIONAL for p in parameters)
    return not needs_more and inspect.signature(make).return_annotation is Scene


def build(name: str, settings: Mapping[str, str]) -> Scene:
    """The scene of this name with some of its parameters set from text, e.g. {"mass": "2"}.

    Raises:
      ValueError: there is no such scene or parameter (the nearest name is suggested), or a text is
        not a number.
    """
    values = numbers(name, settings)
    return entry(name).make(**values)


def build_smooth(name: str, settings: Mapping[str, str], t1=None) -> Scene:
    """The scene of `build`, if its motion stays in one phase up to t1, or in its span.

    Raises:
      ValueError: see `build`; or the motion leaves the phase in which it begins.
    """
    return check_one_phase(build(name, settings), t1)


def function_of_numbers(
    name: str, settings: Mapping[str, str], names: Sequence[str]
) -> tuple[Callable[..., Scene], list[str]]:
    """A function from numbers to the scene that has them, and their names with units.

    Args:
      name: name of the scene.
      settings: settings of its other parameters, see `build`.
      names: one name for each number, of a parameter that is one number or of an entry of the
        start.
    Raises:
      ValueError: see `build`; or a name is that of neither (the nearest is suggested).
    """
    fixed, known = numbers(name, settings), entry(name)
    units = dict(known.make(**fixed).labels())
    single = {key for key, x in known.parameters.items() if isinstance(x, float)}
    for one in names:
        _checks.choice(f"number of {name}", one, {*units, *single})
    order = list(units)

    def make(*values) -> Scene:
        given = dict(zip(names, values, strict=True))
        scene = known.make(**fixed | {key: x for key, x in given.items() if key in single})
        y0 = scene.y0
        for key in given.keys() - single:
            y0 = y0.at[order.index(key)].set(given[key])
        return scene.starting(y0)

    said = [f"{one} [{units[one]}]" if units.get(one, "1") != "1" else one for one in names]
    return make, said


def numbers(name: str, settings: Mapping[str, str]) -> dict[str, Any]:
    """The keyword arguments of a scene's function, from text; see `build`."""
    found = entry(name)
    known, values = found.parameters, {}
    for key, text in with_present_names(name, settings, getattr(found.make, "renamed", {})).items():
        _checks.choice(f"parameter of {name}", key, known)
        values[key] = setting(key, text, known[key])
    return values


def _entry(name: str, make: Callable[..., Scene]) -> Entry:
    # An effect or a force law, which has no default, is not a number.
    return Entry(name=name, make=make, parameters=_scene_files.defaults(make))
