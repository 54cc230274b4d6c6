"""The names of scenes, solvers and hard cases, with their parameters, within milliseconds.

They are read from the text of the files that define them, since importing these loads JAX, which
takes seconds. The values of parameters are checked when a scene is made; here only misspelt names
and texts that are not numbers are refused.
"""

import ast
import contextlib
import functools
import inspect
import math
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import jaxdyn
from jaxdyn import _scene_files
from jaxdyn._arithmetic import setting
from jaxdyn._text import choice, fail

_PACKAGE = Path(__file__).parents[1]
_NEXT_NAME = re.compile(r"[,;\s]+(?=\w+\s*=)")  # the separators before a further NAME=
_LINES = re.MULTILINE | re.DOTALL


class Parameter(NamedTuple):
    """A parameter of a scene."""

    default: Any
    meaning: str


class SceneText(NamedTuple):
    """The contents of the docstring of a scene's function.

    Attributes:
      summary: summary of the scene in one line.
      problems: numbers of the problems of the course that it answers.
      parameters: the parameters by name.
    """

    summary: str
    problems: tuple[int, ...]
    parameters: dict[str, Parameter]


def scenes() -> dict[str, SceneText]:
    """The scenes whose parameters are numbers, by name."""
    found = {}
    for path in (_PACKAGE / "scenes").glob("*.py"):
        body = ast.parse(path.read_text(encoding="utf-8")).body
        constants = _constants(body)
        for node in body:
            if isinstance(node, ast.FunctionDef) and _is_ready_made(node):
                found[node.name] = _scene_text(node, functools.partial(_value, constants))
    return dict(sorted(found.items()))


def of_file(name: str) -> SceneText:
    """The contents of the docstring of a scene in a file of the user."""
    if (text := _scene_files.text_of(name)) is not None:
        numbers = jaxdyn.formulations.xpp.Maker(text).defaults
        first = text.strip().partition("\n")[0]
        summary = first.lstrip('#%" ') if first[:1] in ("#", "%", '"') else Path(name).stem
        return SceneText(summary, (), {key: Parameter(x, "") for key, x in numbers.items()})
    return _scene_text(_scene_files.place(name).node, _literal)


def _literal(default: ast.expr) -> Any:
    """A default value that is a number or a string; otherwise its source, which is not executed."""
    with contextlib.suppress(ValueError):
        return ast.literal_eval(default)
    return ast.unparse(default)


def _is_ready_made(function: ast.FunctionDef) -> bool:
    """Whether a function makes a scene, and all its parameters have defaults."""
    named = any(ast.unparse(x).startswith("ready_made(") for x in function.decorator_list)
    given = function.args
    return named and len(given.defaults) == len(given.args) and None not in given.kw_defaults


def _value(constants: dict[str, Any], default: ast.expr) -> Any:
    return eval(compile(ast.Expression(default), "a default", "eval"), constants)


def _constants(body: list[ast.stmt]) -> dict[str, Any]:
    """The constants of a file that consist of numbers and `math` only, for defaults."""
    found: dict[str, Any] = {"math": math}
    for node in body:
        if isinstance(node, ast.Assign | ast.AugAssign):
            with contextlib.suppress(NameError):  # names that the file imports or defines
                exec(compile(ast.Module([node], []), "a constant", "exec"), found)
    return found


def _scene_text(function: ast.FunctionDef, value: Callable[[ast.expr], Any]) -> SceneText:
    """The contents of a docstring, with the value of each default."""
    given, text = function.args, inspect.cleandoc(ast.get_docstring(function) or "")
    first = text.partition("\n")[0]
    cited = re.search(r"problems? ([\d, and]+)", first)
    meanings = dict(re.findall(r"^\s+(\w+): (.+?)(?=^\s+\w+: |\n\s*\n|^\w|\Z)", text, _LINES))
    names = [x.arg for x in (*given.args, *given.kwonlyargs)]
    defaults = [x for x in (*given.defaults, *given.kw_defaults) if x is not None]
    return SceneText(
        summary=re.sub(r"\s*\([^()]*problems? [^()]*\)", "", first).rstrip("."),
        problems=tuple(int(n) for n in re.findall(r"\d+", cited[1])) if cited else (),
        parameters={
            name: Parameter(value(x), " ".join(meanings.get(name, "").split()))
            for name, x in zip(names, defaults, strict=True)
        },
    )


def scene_settings(name: str, texts: Iterable[str] | None) -> dict[str, str]:
    """The settings of a scene by name, from the texts "NAME=VALUE" of a command line.

    Raises:
      ValueError: there is no such scene or parameter (the nearest one is suggested), a text has no
        "=", or a value is of another kind than the parameter.
    """
    found = _by_name(texts or ())
    if _scene_files.is_in_file(name):
        return {parameter_name(f"parameter of {name}", key, name): found[key] for key in found}
    zoo = scenes()
    known = zoo[_scene_files.choose(name, zoo)].parameters
    for key, text in found.items():
        choice(f"parameter of {name}", key, known)
        setting(key, text, known[key].default)
    return found


def parameter_name(option: str, parameter: str, name: str) -> str:
    """The name of a parameter, or of an entry of one such as m.0, as the scene spells it.

    Raises:
      ValueError: the scene has no such parameter.
    """
    whole = parameter.partition(".")[0]
    if not _scene_files.is_in_file(name):
        choice(option, whole, scenes()[name].parameters)
        return parameter
    _scene_files.check_parameter(name, option, whole)
    # Names are case-insensitive in equations as text.
    return parameter.lower() if name.endswith(_scene_files.TEXT) else parameter


def _by_name(texts: Iterable[str]) -> dict[str, str]:
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise fail("--set", "NAME=VALUE", repr(text))
        if "=" in value:
            each = " ".join(f"--set {one.strip()}" for one in _NEXT_NAME.split(text))
            raise fail("--set", "one NAME=VALUE", repr(text), f"Repeat it: {each}.")
        found[name.strip()] = value.strip()
    return found


def solver_names() -> tuple[str, ...]:
    """The values of --solver in lower case: the instances that `jaxdyn.solvers` exports."""
    tree = ast.parse((_PACKAGE / "solvers" / "__init__.pyi").read_text(encoding="utf-8"))
    names = (x.name for node in tree.body if isinstance(node, ast.ImportFrom) for x in node.names)
    return tuple(name.lower() for name in names if name.isupper())


def hard_cases() -> dict[str, str]:
    """The statement of each hard case, by name: the first two fields of a `Case`, literals."""
    folder = _PACKAGE / "hard"
    body = ast.parse((folder / "collection.py").read_text(encoding="utf-8")).body
    (topics,) = (
        [x.id for x in node.value.elts if isinstance(x, ast.Name)]
        for node in body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple)
    )
    found = {}
    for topic in topics:
        tree = ast.parse((folder / "cases" / f"{topic}.py").read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "Case":
                name, holds = (ast.literal_eval(x) for x in node.args[:2])
                found[name] = holds
    return found
