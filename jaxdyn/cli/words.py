"""Words of a command that name scenes, their parameters and solvers, checked within milliseconds.

They are looked up in the text of the files that define them: importing those loads JAX, which
takes seconds. What a scene is made with is decided when it is made; here only misspelt names and
text that is no number are refused.
"""

import ast
from collections.abc import Iterable
from pathlib import Path

from jaxdyn._arithmetic import setting
from jaxdyn._text import choice, fail

_PACKAGE = Path(__file__).parents[1]
_UNKNOWN = object()  # a default that only running the file would tell


def scenes() -> dict[str, dict[str, object]]:
    """The scenes that numbers alone can make, with their parameters and defaults."""
    found = {}
    for path in (_PACKAGE / "scenes").glob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and _is_ready_made(node):
                found[node.name] = _parameters(node.args)
    return found


def _is_ready_made(function: ast.FunctionDef) -> bool:
    """Whether it makes a scene, and needs nothing but what has a default."""
    named = any(ast.unparse(x).startswith("ready_made(") for x in function.decorator_list)
    given = function.args
    return named and len(given.defaults) == len(given.args) and None not in given.kw_defaults


def _parameters(given: ast.arguments) -> dict[str, object]:
    names = [x.arg for x in (*given.args, *given.kwonlyargs)]
    values = [_literal(x) for x in (*given.defaults, *given.kw_defaults) if x is not None]
    return dict(zip(names, values, strict=True))


def scene_settings(name: str, texts: Iterable[str] | None) -> dict[str, str]:
    """The settings of a scene by name, from the texts "NAME=VALUE" of a command line.

    Raises:
      ValueError: no such scene or parameter (the nearest is suggested), a text without "=", or one
        whose value is of another kind than the parameter.
    """
    found = _by_name(texts or ())
    zoo = scenes()
    known = zoo[choice("scene", name, zoo, "jaxdyn list")]
    for key, text in found.items():
        default = known[choice(f"parameter of {name}", key, known)]
        if default is not _UNKNOWN:
            setting(key, text, default)
    return found


def _by_name(texts: Iterable[str]) -> dict[str, str]:
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise fail("--set", "NAME=VALUE", repr(text))
        found[name.strip()] = value.strip()
    return found


def solver_names() -> tuple[str, ...]:
    """What --solver takes, in small letters: the ready instances that `jaxdyn.solvers` exports."""
    tree = ast.parse((_PACKAGE / "solvers" / "__init__.py").read_text(encoding="utf-8"))
    (listed,) = (node.value for node in tree.body if isinstance(node, ast.Assign))
    return tuple(name.lower() for name in ast.literal_eval(listed) if name.isupper())


def hard_cases() -> set[str]:
    """The names of the hard cases: the first argument, always a literal, of each `Case`."""
    nodes = (
        node
        for path in (_PACKAGE / "hard").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    )
    return {
        ast.literal_eval(node.args[0])
        for node in nodes
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "Case"
    }


def _literal(node: ast.expr) -> object:
    try:
        return ast.literal_eval(node)
    except ValueError:
        return _UNKNOWN
