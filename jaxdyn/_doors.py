"""The attributes of a package: names that have moved or changed, and folders it does not list.

A name that has moved keeps its old place for one minor version, where it warns, and so does the old
name of anything that was renamed. Folders that few need, such as the gallery, are reached as
attributes, but are not among the public names.
"""

import importlib
import sys
import warnings
from collections.abc import Callable, Collection, Mapping
from typing import Any, TypeVar

from jaxdyn._text import suggestion

_Class = TypeVar("_Class", bound=type)

#: Modules whose frames a warning skips, to name the line of the user.
_OURS = {"jaxdyn", "orbits", "equinox", "abc", "dataclasses", "lazy_loader", "importlib"}


def attribute_getter(
    package: str,
    listed: Callable[[str], Any] | None = None,
    *,
    moved: Mapping[str, str] | None = None,
    renamed: Mapping[str, str] | None = None,
    modules: Mapping[str, str] | None = None,
    folders: Collection[str] = (),
) -> Callable[[str], Any]:
    """The ``__getattr__`` of a package.

    Args:
      package: its name.
      listed: finds the public names, where they are not attributes already.
      moved: the module, below the package, of each name that has moved.
      renamed: the new name of each name that has changed.
      modules: for each module that has moved, the module in which its names are now.
      folders: the folders that are not public names.
    """
    new = {old: (package, name) for old, name in (renamed or {}).items()}
    new |= {name: (f"{package}.{place}", name) for name, place in (moved or {}).items()}

    new |= {name: (place, "") for name, place in (modules or {}).items()}

    def __getattr__(name: str) -> Any:
        if name in folders:
            return importlib.import_module(f"{package}.{name}")
        if name not in new:
            module = sys.modules.get(package)
            if listed is not None and name in getattr(module, "__all__", ()):
                return listed(name)
            known = [] if module is None or name.startswith("_") else dir(module)
            message = f"module {package!r} has no attribute {name!r}"
            raise AttributeError(". ".join(filter(None, (message, suggestion(name, known)))))
        place, now = new[name]
        _warn(f"{package}.{name}", f"{place}.{now}".rstrip("."))
        found = importlib.import_module(place)
        return getattr(found, now) if now else found

    return __getattr__


def renamed(**names: str) -> Callable[[_Class], _Class]:
    """A class decorator that keeps old names of attributes and methods: using them warns.

    A record also accepts its fields by their old names. A subclass that overrides a method by its
    old name overrides that of the new one.

    Args:
      names: the new name of each of them by its old one.
    """

    def decorate(cls: _Class) -> _Class:
        def __init_subclass__(subclass: type, **kwargs: Any) -> None:
            super(cls, subclass).__init_subclass__(**kwargs)
            for old, new in names.items():
                if old in vars(subclass):
                    _warn(f"{subclass.__qualname__}.{old}", new)
                    setattr(subclass, new, vars(subclass)[old])

        for old, new in names.items():
            setattr(cls, old, _alias(f"{cls.__qualname__}.{old}", new))
        fields = getattr(cls, "_field_names", ())  # of a `Record`
        cls._renamed = {old: new for old, new in names.items() if new in fields}
        cls.__init_subclass__ = classmethod(__init_subclass__)
        return cls

    return decorate


def _alias(old: str, new: str) -> property:
    def found(self: Any) -> Any:
        _warn(old, new)
        return getattr(self, new)

    return property(found)


def with_present_names(
    owner: str, given: Mapping[str, Any], renamed: Mapping[str, str]
) -> dict[str, Any]:
    """Arguments of a scene or a record by their present names; an old one warns.

    Where both names are given, the old one stays, to be refused as an unknown argument.
    """
    new = {old: now for old, now in renamed.items() if old in given and now not in given}
    for old, now in new.items():
        _warn(f"{old} of {owner}", now)
    return {new.get(name, name): x for name, x in given.items()}


def _warn(old: str, new: str) -> None:
    text = f"{old} is now {new}; the old name is removed in the next version."
    frame, level = sys._getframe(1), 2
    # Frames of the libraries are in between where a class is made.
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in _OURS:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, DeprecationWarning, stacklevel=level)
