"""Messages of Python functions in the words of a command line: options in place of arguments.

Messages of functions name arguments, as in ``start: expected ...`` and "Widen within=.", and other
functions. At a command line there are options instead, and no functions.
"""

import itertools
import re
from collections.abc import Collection, Mapping, Sequence

#: Arguments in messages, and the options of other names from which commands fill them.
_OF_OTHER_NAME = {
    "Deflated": ("unlike",),
    "Force.on": ("drive", "input"),
    "frequencies": ("within",),
    "guess": ("free",),
    "parameter": ("parameters",),
    "y": ("start",),
}
#: What arguments that are no options are called instead.
_NO_OPTIONS = {"make": "scene", "data": "table", "text": "file"}
#: The name at the beginning of a message, before what was expected.
_NAMED = re.compile(r"(?P<name>[A-Za-z_][\w.]*): expected ")
#: An argument with its value, if one is given.
_ARGUMENT = re.compile(
    r"(?<![\w.`=-])(?<!--set )(?<!--free )(?P<name>[a-z]\w*)="
    r"(?P<value>\[[^\]]*\]|\{[^}]*\}|\"[^\"]*\"|'[^']*'|[\w-][\w.+-]*\w(?:\([^)]*\))?|\w)?"
)
_SETTING = re.compile(r"--(?:set|free) \w+=\S*")
_SOLVER = re.compile(r"\b(?:jaxdyn\.)?solvers\.(?P<name>[A-Z][A-Z0-9_]*)\b")
#: What only a program can use; not what defines a scene, since a scene may be in a file of Python.
_PYTHON = re.compile(
    r"\b(?:jaxdyn|orbits|vibration)\.(?!ode\b|lagrangian\b)\w|(?<![\w`-])[a-z_]\w*(?:=(?!=|\.?\d)|\(\))"
)
_OF_SCENES = re.compile(r"\bjaxdyn\.(?:ode|lagrangian)\b|\bSystem\b|\bScene\b")
_SENTENCE = re.compile(r"(?<=[.?!]) (?=[A-Z`-])")


def in_options(
    message: str,
    options: Collection[str],
    parameters: Collection[str] = (),
    given: Mapping[str, str] | None = None,
) -> str:
    """A message with options in place of arguments, without advice that only a program can follow.

    Args:
      message: the message of a function.
      options: the options of the command, such as "--start".
      parameters: the parameters of the scene, which --set changes.
      given: the values given by --set, whose names the message may begin with.
    Example:
      >>> in_options("start: expected 3 entries, got 2. Widen within=. See jaxdyn.simulate.",
      ...            ["--start", "--within"])
      '--start: expected 3 entries, got 2. Widen --within.'
    """
    found = _NAMED.match(message)
    if found and found["name"] not in (given or {}):
        option = _option(found["name"], options)
        name = option or _NO_OPTIONS.get(found["name"], found["name"])
        message = f"{name}{message[found.end('name') :]}"
    stated, *advice = _SENTENCE.split(message)
    phrased = [x if _OF_SCENES.search(x) else _with_options(x, options, parameters) for x in advice]
    return " ".join([stated, *(x for x in phrased if not _is_for_programs(x))])


def _is_for_programs(sentence: str) -> bool:
    rest = _SETTING.sub("", sentence)
    return bool(_PYTHON.search(rest)) and not _OF_SCENES.search(rest)


def _option(name: str, options: Collection[str]) -> str | None:
    """The option for an argument; it may be called by the singular of its name."""
    names = (name, name.removesuffix("s"), *_OF_OTHER_NAME.get(name, ()))
    spelled = (f"--{one.replace('_', '-')}" for one in names)
    return next((one for one in spelled if one in options), None)


def _with_options(sentence: str, options: Collection[str], parameters: Collection[str]) -> str:
    def option_of(argument: re.Match) -> str:
        name, value = argument["name"], argument["value"] or ""
        option = _option(name, options)
        value = _SOLVER.sub(lambda solver: solver["name"].lower(), value)
        if option is None and name in parameters and "--set" in options:
            return f"--set {name}={value.strip(_QUOTES)}"
        if option is None:
            return argument[0]
        is_plain = re.fullmatch(r"[\d.eE+-]+|[a-z][a-z0-9_]*|\"\w+\"", value)
        return f"{option} {value.strip(_QUOTES)}" if is_plain else option

    phrased = _ARGUMENT.sub(option_of, sentence)
    return _SOLVER.sub(lambda solver: f"{solver['name'].lower()}", phrased)


_QUOTES = "\"'"


def settings_of(arguments: Sequence[str]) -> dict[str, str]:
    """The numbers that --set gives in the arguments of a command."""
    texts = [
        *(text for flag, text in itertools.pairwise(arguments) if flag == "--set"),
        *(text.removeprefix("--set=") for text in arguments if text.startswith("--set=")),
    ]
    return {name: value for name, _, value in (text.partition("=") for text in texts)}
