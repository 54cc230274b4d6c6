"""Sizes: no file, function or folder that takes long to look through."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(
    str(path.relative_to(ROOT))
    for package in ("jaxdyn", "orbits")
    for path in (ROOT / package).rglob("*.py")
)
MAX_LINES = 300
MAX_FUNCTION_LINES = 60
MAX_FILES = 15
#: Collections of files of one kind, which nobody has to look through.
COLLECTIONS = {"jaxdyn/course", "jaxdyn/scenes"}


def _lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function from its `def`; its own docstring is left out.

    A public function documents each argument in lines of their own, which are no reason to split
    it; a signature of many lines is one.
    """
    first = function.body[0]
    text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    documented = first.end_lineno - first.lineno + 1 if text else 0
    return function.end_lineno - function.lineno + 1 - documented


@pytest.mark.parametrize("file", FILES)
def test_files_and_functions_are_short(file):
    text = (ROOT / file).read_text()
    assert len(text.splitlines()) <= MAX_LINES
    functions = [
        node
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]
    long = {f.name: n for f in functions if (n := _lines(f)) > MAX_FUNCTION_LINES}
    assert not long, f"{file}: functions of more than {MAX_FUNCTION_LINES} lines"


def test_no_folder_is_crowded():
    folders: dict[str, list[str]] = {}
    for file in FILES:
        folders.setdefault(file.rpartition("/")[0], []).append(file)
    for folder in set(folders) - COLLECTIONS:
        modules = [file for file in folders[folder] if not file.endswith("__init__.py")]
        assert len(modules) <= MAX_FILES, folder
