"""Scenes in a file of the user: functions, as "mine.py:roessler", or texts, as "lorenz.ode".

What a file contains is read from its text, within milliseconds and without running it. A Python
file is run only when a scene is made that the user has named; an XPPAUT file never is (see
`jaxdyn.formulations.xpp`).
"""

import ast
import contextlib
import functools
import importlib.util
import inspect
import re
import sys
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from jaxdyn._text import choice, fail

#: The ending of an XPPAUT file, which is never run.
TEXT = ".ode"
#: The beginning of the names of modules that are such files.
_MODULE = "scenes in "
_NAME = re.compile(r"(?P<path>.*\.py)(?::(?P<function>\w+))?", re.DOTALL)


class Place(NamedTuple):
    """Where the function that makes a scene is written.

    Attributes:
      path: the file.
      function: the function's name.
      node: the function's syntax tree.
    """

    path: Path
    function: str
    node: ast.FunctionDef

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of its parameters."""
        given = self.node.args
        return tuple(x.arg for x in (*given.args, *given.kwonlyargs))


def is_in_file(name: str) -> bool:
    """Whether a name is that of a file, or of a function in one."""
    return name.endswith(TEXT) or _NAME.fullmatch(name) is not None


def choose(name: str, known: Iterable[str]) -> str:
    """The name; raises unless it is among those of ready-made scenes, and suggests the nearest."""
    if re.search(r"[./]", name):
        wanted = "one that `jaxdyn list` shows, FILE.py:NAME or FILE.ode"
        remedy = "jaxdyn.read_bodies reads tables of bodies, `orbits show` saved orbits."
        raise fail("scene", wanted, repr(name), remedy)
    return choice("scene", name, known, "jaxdyn list")


def text_of(name: str) -> str | None:
    """The content of an XPPAUT file; None for a name of another kind.

    Raises:
      ValueError: the file cannot be read.
    """
    if not name.endswith(TEXT):
        return None
    try:
        return Path(name).read_text(encoding="utf-8-sig")  # editors of Windows write a mark
    except UnicodeDecodeError:
        return Path(name).read_text(encoding="latin-1")  # older files, whose comments have accents
    except OSError as error:
        got = f"{name} ({error.strerror})"
        raise fail("scene", "a file of XPPAUT that can be read", got) from error


def check_parameter(name: str, what: str, parameter: str) -> None:
    """Raise ValueError unless a Python file's function has a parameter; not for other files."""
    if not name.endswith(TEXT):
        choice(what, parameter, place(name).parameters)


def place(name: str) -> Place:
    """The place of the function that a name denotes, found from the text of its file.

    A file without a function's name must have one public function that needs no arguments.

    Raises:
      ValueError: there is no such file or function, the file is not Python, or the function needs
        arguments.
    """
    parts = _NAME.fullmatch(name)
    assert parts is not None
    path = Path(parts["path"])
    try:
        body = ast.parse(path.read_text(encoding="utf-8"), str(path)).body
    except OSError as error:
        raise fail("scene", "a Python file that exists", str(path)) from error
    except (SyntaxError, ValueError) as error:
        raise fail("scene", "a Python file", f"{path}, which cannot be parsed: {error}") from error
    defined = [node.name for node in body if isinstance(node, ast.FunctionDef)]
    functions = {node.name: node for node in map(_as_function, body) if node is not None}
    if parts["function"] is None:
        found = _only(functions, defined, path)
    else:
        public = {key: x for key, x in functions.items() if key[0] != "_"}
        _check_is_function(parts["function"], functions, body)
        found = choice(f"function of {path}", parts["function"], public)
    missing = _without_default(functions[found])
    if missing:
        got = f"{path}:{found}, where {', '.join(missing)} has no default"
        remedy = "Give each parameter a default, which --set changes."
        raise fail("scene", "a function that needs no arguments", got, remedy)
    return Place(path, found, functions[found])


def _check_is_function(name: str, functions: Collection[str], body: list[ast.stmt]) -> None:
    """Raise ValueError for a name of a scene, or of something else that is no function."""
    targets = [x for node in body if isinstance(node, ast.Assign) for x in node.targets]
    assigned = {x.id for x in targets if isinstance(x, ast.Name)}
    if name in assigned - set(functions):
        remedy = f"Write `{name} = lambda: ...`, or a function."
        raise fail("scene", "a function that returns a scene", f"{name}, which is none", remedy)


def _only(functions: dict[str, ast.FunctionDef], defined: list[str], path: Path) -> str:
    """The one function that makes a scene: by its annotation, or as the only one without arguments.

    A lambda counts if no function is `defined` by ``def``: it may be a helper.
    """
    public = {key: x for key, x in functions.items() if key[0] != "_"}
    ready = [key for key, x in public.items() if not _without_default(x)]
    marked = [key for key in ready if _returns_scene(public[key])]
    candidates = marked or [key for key in ready if key in defined] or ready or list(public)
    if len(candidates) != 1:
        names = ", ".join(f"{path}:{key}" for key in candidates)
        remedy = f"Name one of {names}." if candidates else "Write a function that returns one."
        raise fail("scene", "a file with one function that makes it", str(path), remedy)
    return candidates[0]


def _as_function(node: ast.stmt) -> ast.FunctionDef | None:
    """The function that a statement defines, also as ``name = lambda ...``; None if it does not."""
    if isinstance(node, ast.FunctionDef):
        return node
    if isinstance(node, ast.Assign) and isinstance(node.value, ast.Lambda):
        target = node.targets[0]
        if isinstance(target, ast.Name):
            returned = ast.Return(node.value.body)
            return ast.FunctionDef(target.id, node.value.args, [returned], [])
    return None


def _without_default(function: ast.FunctionDef) -> list[str]:
    """The names of the parameters of a function that a call must give."""
    given = function.args
    by_position = [x.arg for x in (*given.posonlyargs, *given.args)]
    by_name = zip(given.kwonlyargs, given.kw_defaults, strict=True)
    return [
        *by_position[: len(by_position) - len(given.defaults)],
        *(x.arg for x, default in by_name if default is None),
    ]


def _returns_scene(function: ast.FunctionDef) -> bool:
    returned = "" if function.returns is None else ast.unparse(function.returns)
    return returned.strip("\"'").rpartition(".")[2] == "Scene"


def load(name: str) -> Callable[..., Any]:
    """The function that a name denotes; its file is run.

    Raises:
      ValueError: see `place`.
    """
    found = place(name)
    return vars(_module(found.path.resolve(), found.path.stat().st_mtime_ns))[found.function]


@functools.cache
def _module(path: Path, changed: int) -> Any:
    """The module of a file as it was when it was last changed."""
    del changed
    spec = importlib.util.spec_from_file_location(f"{_MODULE}{path}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # It may import its neighbours, as if it were run as a program.
    folder = str(path.parent)
    sys.path.insert(0, folder)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except SystemExit as error:
        remedy = 'What is only for a program belongs below `if __name__ == "__main__":`.'
        raise fail(
            "scene", "a file that can be imported", f"{path}, which exits", remedy
        ) from error
    finally:
        sys.path.remove(folder)
    return module


@contextlib.contextmanager
def locate_errors() -> Iterator[None]:
    """Context in which an exception from a line of such a file becomes an error naming the line.

    An exception raised by this library, whether called by such a line or not, stays as it is.

    Raises:
      ValueError: a line of the file raised an exception, in itself or in a package that it uses.
    """
    try:
        yield
    except OSError:  # names its file
        raise
    except Exception as error:
        modules = _modules(error)
        theirs = [i for i, name in enumerate(modules) if name.startswith(_MODULE)]
        ours = [i for i, name in enumerate(modules) if name.startswith(("jaxdyn", "orbits"))]
        if not theirs or theirs[-1] < ours[-1]:
            raise
        at = traceback.extract_tb(error.__traceback__)[theirs[-1]]
        place = f"{at.filename}, line {at.lineno}, in {at.name}"
        got = f"{type(error).__name__}: {error}"
        raise ValueError(f'{place}: "{at.line}" raised {got}') from error


def is_raised_by(error: BaseException) -> bool:
    """Whether a line of such a file raised an error, or called what raised it."""
    return any(name.startswith(_MODULE) for name in _modules(error)) or (
        error.__cause__ is not None and is_raised_by(error.__cause__)
    )


def _modules(error: BaseException) -> list[str]:
    """The modules in which an error passed, the outermost first."""
    return [frame.f_globals["__name__"] for frame, _ in traceback.walk_tb(error.__traceback__)]


def defaults(function: Callable[..., Any]) -> dict[str, Any]:
    """The defaults of a function's parameters by name."""
    parameters = inspect.signature(function).parameters.values()
    return {p.name: p.default for p in parameters if p.default is not p.empty}
