"""Numbers as arithmetic expressions: ``pi/2``, ``sqrt(2)``, ``30*deg``; nothing else is evaluated.

A text may contain numbers, + - * / ** and parentheses, the constants pi, e and deg (one degree in
radians), and the functions sqrt, sin and cos. Only these nodes of Python's syntax tree are
evaluated: no names, calls or attributes of Python itself can be reached.
"""

import ast
import math
import operator
import re
from typing import Any

from jaxdyn._text import choice, fail

CONSTANTS = {"pi": math.pi, "e": math.e, "deg": math.pi / 180}
FUNCTIONS = {"sqrt": math.sqrt, "sin": math.sin, "cos": math.cos}
_OPERATORS = {
    **{ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul},
    **{ast.Div: operator.truediv, ast.Pow: math.pow},
    **{ast.UAdd: operator.pos, ast.USub: operator.neg},
}
#: A list as Python writes it.
_BRACKETS = re.compile(r"\s*\[(.*)\]\s*", re.DOTALL)
_NESTED = "Rows of numbers are given in Python only: write the scene to a file, see `mine.py:name`."
_LONGEST = 200  # characters: longer texts may nest too deeply for the parser


def value(text: str) -> float:
    """The number that a text denotes.

    Args:
      text: a number, or arithmetic with numbers.
    Raises:
      ValueError: the text does not denote a finite number.
    Example:
      >>> value("pi/2"), value("-30*deg"), value("1e-3")
      (1.5707963267948966, -0.5235987755982988, 0.001)
    """
    try:
        return float(text)  # also inf and nan
    except ValueError:
        pass
    try:
        if len(text) > _LONGEST:
            raise ValueError("too long")
        result = _value(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, ValueError, ArithmeticError, RecursionError, MemoryError) as error:
        raise fail("number", "a number", repr(text), remedy(text)) from error
    return result


def remedy(text: str) -> str:
    """What to do about a text that `value` refuses."""
    if "^" in text:
        return f"Write a power as {text.replace('^', '**')}."
    return f"It may be arithmetic with {', '.join([*CONSTANTS, *FUNCTIONS])}."


def setting(name: str, text: str, default: Any) -> Any:
    """The value of a parameter from its text, of the type of its default.

    Args:
      name: the parameter's name, for the message.
      text: a number, comma-separated numbers (in brackets, if you like), a boolean or a word.
      default: the parameter's default; () for a parameter that has words, such as units.
    Raises:
      ValueError: the text is of another type.
    Example:
      >>> setting("sides", "1,2,pi/2", (3.0, 2.0, 1.0)), setting("n", "4", 1)
      ((1.0, 2.0, 1.5707963267948966), 4)
      >>> setting("position", "[0, 1]", (0.0, 0.0))
      (0.0, 1.0)
      >>> setting("units", "AU, Msun, day", ())
      ('AU', 'Msun', 'day')
    """
    if isinstance(default, str):
        return text
    if isinstance(default, bool):
        return choice(name, text.lower(), ("true", "false")) == "true"
    if isinstance(default, tuple) and not default:  # names
        return tuple(word.strip() for word in text.split(","))
    inner = _BRACKETS.fullmatch(text) if isinstance(default, tuple) else None
    plain = inner[1] if inner else text
    if "[" in plain:
        raise fail(name, "comma-separated numbers", repr(text), _NESTED)
    try:
        numbers = [value(part) for part in plain.split(",")]
    except ValueError:
        wanted = "a number, or comma-separated numbers"
        raise fail(name, wanted, repr(text), remedy(text)) from None
    if isinstance(default, tuple):
        return tuple(numbers)
    if len(numbers) > 1:
        raise fail(name, "one number", repr(text))
    whole = isinstance(default, int) and numbers[0].is_integer()
    return int(numbers[0]) if whole else numbers[0]


def _value(node: ast.expr) -> float:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return float(number)
        case ast.Name(id=name) if name in CONSTANTS:
            return CONSTANTS[name]
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(operand))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left), _value(right))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            return FUNCTIONS[name](_value(argument))
    raise ValueError(ast.dump(node))
