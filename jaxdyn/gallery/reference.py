"""The API reference: every public name once, from the docstrings.

Public is what the `__all__` of the packages and folders say, and what modules named there define.
A name that is reachable in two ways is documented at the shorter one.
"""

import functools
import importlib
import inspect
import re
import textwrap
import types
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax

from jaxdyn.gallery.texts import colour, prose

PACKAGES = {name: importlib.import_module(name) for name in ("jaxdyn", "orbits")}
_SECTIONS = ("Args", "Attributes", "Returns", "Raises", "Limits", "Example", "Reference")
_HEAD = re.compile(rf"^({'|'.join(_SECTIONS)}):[ ]*(.*)$", re.MULTILINE)
_LONGEST = 90  # characters of a signature on one line


class Entry(NamedTuple):
    """A public name as the reference shows it.

    Attributes:
      name: the dotted name.
      kind: "function", "class" or "value".
      signature: its arguments; empty for a value.
      summary: the first line of its docstring.
      text: its docstring as HTML.
      members: the methods and properties of a class that its own body defines.
    """

    name: str
    kind: str
    signature: str
    summary: str
    text: str
    members: tuple["Entry", ...] = ()


class Chapter(NamedTuple):
    """A page of the reference: a package or a folder, its docstring and its names.

    Attributes:
      name: the dotted name.
      line: the first line of its docstring.
      text: its docstring as HTML.
      entries: what is documented there.
    """

    name: str
    line: str
    text: str
    entries: tuple[Entry, ...]


@functools.cache
def chapters() -> dict[str, Chapter]:
    """The pages of the reference by the dotted name of the folder."""
    names: dict[str, list[str]] = {}
    objects = dict(_public())
    for name in objects:
        names.setdefault(_chapter(name), []).append(name)
    return {
        chapter: Chapter(
            name=chapter,
            line=(inspect.getdoc(_module(chapter)) or "").partition("\n")[0],
            text=docstring_html(inspect.getdoc(_module(chapter)) or ""),
            entries=tuple(_entry(name, objects[name]) for name in sorted(of)),
        )
        for chapter, of in sorted(names.items())
    }


@functools.cache
def urls() -> dict[str, str]:
    """Where each public name is documented, from the top of the site."""
    homes = {id(thing): name for name, thing in _public()}
    found = {name: f"reference/{_chapter(name)}.html#{name}" for name in homes.values()}
    for name, thing in _everything():
        home = homes.get(id(thing))
        if home:
            found[name] = found[home]
        elif isinstance(thing, types.ModuleType):
            found[name] = f"reference/{_chapter(f'{name}.')}.html"
    return found


def _chapter(name: str) -> str:
    """The page of a name: its package, or its folder."""
    parts = name.split(".")
    return ".".join(parts[:2]) if len(parts) > 2 else parts[0]


def _module(name: str) -> types.ModuleType:
    package, *rest = name.split(".")
    return functools.reduce(getattr, rest, PACKAGES[package])


def _public() -> Iterator[tuple[str, Any]]:
    """(dotted name, object) of every public name that is no module, each object once."""
    seen: set[int] = set()
    for name, thing in sorted(_everything(), key=lambda one: (one[0].count("."), one[0])):
        # Equal constants may be one object, and are two names all the same.
        known = id(thing) in seen and callable(thing)
        if not isinstance(thing, types.ModuleType) and not known:
            seen.add(id(thing))
            yield name, thing


def _everything() -> Iterator[tuple[str, Any]]:
    """(dotted name, object) of all that is reachable by public names, modules included."""
    waiting = list(PACKAGES.items())
    seen = {id(module) for _, module in waiting}
    while waiting:
        path, module = waiting.pop(0)
        for name in _names(module):
            thing = getattr(module, name)
            yield f"{path}.{name}", thing
            ours = isinstance(thing, types.ModuleType) and _is_ours(thing.__name__)
            if ours and id(thing) not in seen:
                seen.add(id(thing))
                waiting.append((f"{path}.{name}", thing))


def _names(module: types.ModuleType) -> list[str]:
    """The public names of a module: its `__all__`, or what it defines itself."""
    if hasattr(module, "__all__"):
        return sorted(module.__all__)
    return [
        name
        for name, thing in vars(module).items()
        if not name.startswith("_") and getattr(thing, "__module__", None) == module.__name__
    ]


def _is_ours(name: str) -> bool:
    return name.split(".")[0] in PACKAGES


def _entry(name: str, thing: Any) -> Entry:
    text = inspect.getdoc(thing) or ""
    if inspect.isclass(thing):
        kind, members = "class", tuple(_members(name, thing))
    else:
        kind, members = ("function" if callable(thing) else "value"), ()
    if kind == "value":
        text = f"`{_short(thing)}`"
    return Entry(
        name=name,
        kind=kind,
        signature=_signature(thing) if kind != "value" else "",
        summary=text.partition("\n")[0],
        text=docstring_html(text),
        members=members,
    )


def _members(name: str, cls: type) -> Iterator[Entry]:
    """The documented methods and properties that a class defines itself."""
    for key, value in vars(cls).items():
        if key.startswith("_"):
            continue
        inner = getattr(cls, key) if isinstance(value, classmethod | staticmethod) else value
        inner = inner.fget if isinstance(inner, property) else inner
        if getattr(inner, "__doc__", None) and callable(inner):
            kind = "property" if isinstance(value, property) else "method"
            text = inspect.cleandoc(inner.__doc__)
            yield Entry(
                name=f"{name}.{key}",
                kind=kind,
                signature="" if kind == "property" else _signature(inner),
                summary=text.partition("\n")[0],
                text=docstring_html(text),
            )


def _signature(thing: Any) -> str:
    try:
        found = inspect.signature(thing)
    except (TypeError, ValueError):
        return "(...)"
    bare = [_bare(one) for one in found.parameters.values() if one.name != "self"]
    text = str(found.replace(parameters=bare, return_annotation=inspect.Signature.empty))
    if len(text) <= _LONGEST:
        return text
    marks = [str(one) for one in bare]
    star = next((i for i, one in enumerate(bare) if one.kind is one.KEYWORD_ONLY), None)
    if star is not None and not any(one.kind is one.VAR_POSITIONAL for one in bare):
        marks.insert(star, "*")
    return "(\n    " + ",\n    ".join(marks) + ",\n)"


def _bare(one: inspect.Parameter) -> inspect.Parameter:
    """A parameter without its annotation; a default that is a function by its name."""
    default = one.default
    if inspect.isfunction(default):
        default = _Name(default.__name__.strip("<>"))
    return one.replace(annotation=inspect.Parameter.empty, default=default)


class _Name(str):
    """A text whose representation is itself."""

    def __repr__(self) -> str:
        return str(self)


def _short(value: Any) -> str:
    text = repr(value) if not isinstance(value, jax.Array) else f"array of shape {value.shape}"
    return textwrap.shorten(text, 200)


def docstring_html(text: str) -> str:
    """A docstring as HTML: its sections become headings with lists."""
    pieces = _HEAD.split(text.partition("\n\nMay import:")[0])  # the rest is for contributors
    html = [prose(pieces[0])]
    for name, first, rest in zip(pieces[1::3], pieces[2::3], pieces[3::3], strict=True):
        html.append(_section(name, first, textwrap.dedent(rest.strip("\n"))))
    return "\n".join(html)


def _section(name: str, first: str, body: str) -> str:
    """A section of a docstring: a list of entries, an example, or a sentence."""
    if name == "Example":
        return f"<p><strong>{name}.</strong></p>\n{colour(body, 'pycon')}"
    if name not in ("Args", "Attributes", "Raises"):
        return prose(f"**{name}.** {first} {body}".strip())
    rows = []
    for entry in re.split(r"\n(?=\S)", body):
        key, _, about = entry.partition(":")
        about = " ".join(about.split())
        rows.append(f"- **`{key}`**: {about}" if about else f"- {key}")
    return prose("\n".join([f"**{name}.**", "", *rows]))
