"""Sizes: no function that takes long to read. A file is a concept, as long as that is."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILES = sorted(
    str(path.relative_to(ROOT))
    for package in ("jaxdyn", "orbits")
    for path in (ROOT / package).rglob("*.py")
)
MAX_FUNCTION_LINES = 60


def _lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function from its `def`; its own docstring is left out.

    A public function documents each argument in lines of their own, which are no reason to split
    it; a signature of many lines is one.
    """
    first = function.body[0]
    text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    documented = first.end_lineno - first.lineno + 1 if text else 0
    return function.end_lineno - function.lineno + 1 - documented


def test_functions_are_short():
    long = []
    for file in FILES:
        for node in ast.walk(ast.parse((ROOT / file).read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                long += [(file, node.name)] if _lines(node) > MAX_FUNCTION_LINES else []
    assert not long, f"functions of more than {MAX_FUNCTION_LINES} lines"
