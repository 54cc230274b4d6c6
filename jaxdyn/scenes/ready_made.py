"""The decorator of all functions of ready-made scenes: it checks parameters and gives a name."""

import functools
from collections.abc import Callable, Mapping
from typing import TypeVar, cast

from jaxdyn._arguments import like_defaults
from jaxdyn._doors import with_present_names
from jaxdyn.scene import Scene

F = TypeVar("F", bound=Callable[..., Scene])


#: Parameters that were renamed in version 0.3: the old name -> the new one.
RENAMED = {"l": "length"}


def ready_made(
    *rows: str, but: tuple[str, ...] = (), renamed: Mapping[str, str] | None = None
) -> Callable[[F], F]:
    """A decorator for a function that makes a scene, which then has the function's name.

    Args:
      rows: see `jaxdyn._arguments.like_defaults`, which checks the shapes of the numbers.
      but: see `jaxdyn._arguments.like_defaults`.
      renamed: the new names of parameters by the old ones, which still work and warn.
    Example:
      >>> from jaxdyn import scenes
      >>> scenes.cannonball(speed=20.0).name
      'cannonball'
    """

    def decorated(make: F) -> F:
        checked = like_defaults(*rows, but=but)(make)

        @functools.wraps(make)
        def named(*args, **kwargs) -> Scene:
            made = checked(*args, **with_present_names(make.__name__, kwargs, renamed or {}))
            scene = object.__new__(type(made))
            # Unlike `dataclasses.replace`, this does not check all parts again.
            scene.__dict__.update(made.__dict__, name=make.__name__)
            return scene

        vars(named)["renamed"] = renamed or {}
        return cast(F, named)

    return decorated
