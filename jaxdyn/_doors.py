"""The front door of a package: names that have moved, and folders that it does not list.

A name that has moved keeps its old place for one minor version, where it warns. Folders that few
need, such as the gallery, are reached as attributes, but are not among the public names.
"""

import importlib
import warnings
from collections.abc import Callable, Collection, Mapping
from typing import Any


def opened(
    package: str,
    listed: Callable[[str], Any],
    *,
    moved: Mapping[str, str],
    folders: Collection[str] = (),
) -> Callable[[str], Any]:
    """The ``__getattr__`` of a package.

    Args:
      package: its name.
      listed: finds the public names.
      moved: the module, below the package, of each name that has moved.
      folders: those that are no public names.
    """

    def __getattr__(name: str) -> Any:
        if name in folders:
            return importlib.import_module(f"{package}.{name}")
        if name not in moved:
            return listed(name)
        place = f"{package}.{moved[name]}"
        told = f"{package}.{name} is now {place}.{name}; the old name goes with the next version."
        warnings.warn(told, DeprecationWarning, stacklevel=2)
        return getattr(importlib.import_module(place), name)

    return __getattr__
