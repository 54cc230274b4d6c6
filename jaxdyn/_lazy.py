"""Packages whose public names are imported when they are first used.

`import jaxdyn` and the help of a command then load neither JAX nor Matplotlib. The names are
those of the package's stub, `__init__.pyi`, which type checkers and editors read too: one list
for all of them, as in SPEC 1 of Scientific Python. Its package `lazy_loader` is not used because
there a submodule takes the place of a function of its name (`jaxdyn.simulate`) if it is imported
before the function is first asked for.
"""

import ast
import importlib
import sys
from pathlib import Path
from types import ModuleType


def attach(name: str) -> None:
    """Give a package the public names of its stub: `__all__`, `dir`, and attributes on demand.

    Call it in the package's `__init__.py` with ``__name__``.
    """
    package = sys.modules[name]
    package.__class__ = _Package
    stub = Path(package.__file__ or "").with_suffix(".pyi")
    # Past `__setattr__`, which asks for them.
    package.__dict__["_homes"] = _homes(stub.read_text(encoding="utf-8"), name)
    package.__dict__["__all__"] = sorted(package._homes)


class _Package(ModuleType):
    """A package that imports its public names when they are first used."""

    #: Public name -> module that it is imported from, None where it is itself a submodule.
    _homes: dict[str, str | None]

    def __getattr__(self, name: str):
        if name not in self._homes:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        home = self._homes[name]
        if home is None:
            return importlib.import_module(f"{self.__name__}.{name}")
        value = getattr(importlib.import_module(home), name)
        self.__dict__[name] = value
        return value

    def __setattr__(self, name: str, value) -> None:
        # Import binds each submodule as an attribute of its package once it is loaded. Where the
        # submodule is the home of a public name that is the same, the name keeps its meaning.
        path = f"{self.__name__}.{name}"
        if isinstance(value, ModuleType) and self._homes.get(name) == path == value.__name__:
            value = getattr(value, name)
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*self._homes, *(name for name in self.__dict__ if name.startswith("__"))})


def _homes(stub: str, package: str) -> dict[str, str | None]:
    """Where each public name of a stub comes from."""
    return {
        alias.name: None if node.module == package else node.module
        for node in ast.parse(stub).body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
