"""The API reference: every public name once, as pages that autodoc fills from the docstrings.

Public names are those in `__all__` of the packages and folders, and those that modules named there
define. An object with two public names is documented under the shorter one. Each folder has a page,
and so does each class that has methods, which are listed by kind.
"""

import functools
import importlib
import inspect
import textwrap
import types
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import jax

PACKAGES = {name: importlib.import_module(name) for name in ("jaxdyn", "orbits")}
_KINDS = {"function": "Functions", "class": "Classes", "value": "Values"}
#: The names that follow are complete, whichever module was named before.
_ABSOLUTE = ".. py:currentmodule:: None\n"
_DIRECTIVES = {"function": "autofunction", "class": "autoclass"}


class Member(NamedTuple):
    """A documented member of a class: its name, and "property", "method" or "class method"."""

    name: str
    kind: str


class Entry(NamedTuple):
    """A public name as the reference shows it.

    Attributes:
      name: the dotted name.
      kind: "function", "class" or "value".
      thing: what it names.
      members: the methods and properties of a class that its own body documents.
    """

    name: str
    kind: str
    thing: Any
    members: tuple[Member, ...] = ()


class Target(NamedTuple):
    """The target of a name in a text: the documented name, and whether it is a module."""

    name: str
    module: bool


def pages(formulas: Mapping[str, str] = MappingProxyType({})) -> dict[str, str]:
    """The pages of the reference as reStructuredText, by their names: folders, and classes.

    Args:
      formulas: HTML that functions show in addition to their docstrings, by their names.
    """
    found = {}
    for chapter, entries in chapters().items():
        found[chapter] = _chapter_page(chapter, entries, formulas)
        found |= {entry.name: _class_page(entry) for entry in entries if entry.members}
    return found


@functools.cache
def chapters() -> dict[str, tuple[Entry, ...]]:
    """The entries of each folder, by its dotted name."""
    found: dict[str, list[Entry]] = {}
    for name, thing in _public():
        found.setdefault(_chapter(name), []).append(_entry(name, thing))
    return {chapter: tuple(sorted(found[chapter])) for chapter in sorted(found)}


@functools.cache
def targets() -> dict[str, Target]:
    """The target of each public name, under all its dotted names, including modules."""
    homes = {id(thing): name for name, thing in _public()}
    found = {}
    for name, thing in _everything():
        if isinstance(thing, types.ModuleType):
            found[name] = Target(thing.__name__, True)
        elif id(thing) in homes:
            found[name] = Target(homes[id(thing)], False)
    for entries in chapters().values():
        for entry in entries:
            found |= {member.name: Target(member.name, False) for member in entry.members}
    return found | {name: Target(name, True) for name in PACKAGES}


def summary(name: str) -> str:
    """The first line of the docstring of a folder."""
    return (inspect.getdoc(_module(name)) or "").partition("\n")[0]


def _chapter_page(name: str, entries: Iterable[Entry], formulas: Mapping[str, str]) -> str:
    """The page of a folder: its docstring, tables of its names, and names without a page."""
    parts = [_title(name), _directive("automodule", name), _ABSOLUTE]
    by_kind = {
        kind: [entry for entry in entries if entry.kind == kind]
        for kind in _KINDS
        if any(entry.kind == kind for entry in entries)
    }
    own = [entry for entry in entries if entry.members]
    if own:
        parts.append(_directive("toctree", "", ":hidden:", "", *(entry.name for entry in own)))
    for kind, of in by_kind.items():
        parts.append(_title(_KINDS[kind], "-"))
        if kind != "value":
            parts.append(
                _directive("autosummary", "", ":nosignatures:", "", *(entry.name for entry in of))
            )
        parts += [_document(entry, formulas) for entry in of if not entry.members]
    modules = [one for one in _modules() if one.startswith(f"{name}.") and _home(one) == name]
    if modules:
        parts.append(_title("Modules", "-"))
        parts += [_directive("automodule", one) for one in modules]
    return "\n".join(parts)


def _class_page(entry: Entry) -> str:
    """The page of a class: its docstring, and its members by kind."""
    body = []
    for kind, title in (
        ("property", "Properties"),
        ("method", "Methods"),
        ("class method", "Class methods"),
    ):
        names = [member.name for member in entry.members if member.kind == kind]
        if names:
            directive = "autoproperty" if kind == "property" else "automethod"
            body += ["", f".. rubric:: {title}", ""]
            body += [line for name in names for line in (f".. {directive}:: {name}", "")]
    inherited = _inherited_members(entry)
    if inherited:
        body += ["", ".. rubric:: Inherited", "", ", ".join(f"``{one}``" for one in inherited)]
    return "\n".join([_title(entry.name), _directive("autoclass", entry.name, "", *body)])


def _document(entry: Entry, formulas: Mapping[str, str]) -> str:
    if entry.kind == "value":
        return _directive("py:data", entry.name, "", f"``{_short(entry.thing)}``")
    shown = formulas.get(entry.name, "").splitlines()
    block = [
        ".. raw:: html",
        "",
        '   <div class="formulas">',
        *(f"   {x}" for x in shown),
        "   </div>",
    ]
    return _directive(_DIRECTIVES[entry.kind], entry.name, "", *(block if shown else []))


def _title(text: str, line: str = "=") -> str:
    return f"{text}\n{line * len(text)}\n"


def _directive(name: str, argument: str, *lines: str) -> str:
    return "\n".join(
        [f".. {name}:: {argument}".rstrip(), *(f"   {one}".rstrip() for one in lines), ""]
    )


@functools.cache
def _modules() -> tuple[str, ...]:
    """The modules that public names are in, other than folders with a page."""
    found = {thing.__name__ for _, thing in _everything() if isinstance(thing, types.ModuleType)}
    return tuple(sorted(one for one in found if _is_ours(one) and one not in chapters()))


def _home(module: str) -> str:
    """The page of a module: its folder's, or that of the package."""
    return next(
        one for one in (".".join(module.split(".")[:2]), module.split(".")[0]) if one in chapters()
    )


def _chapter(name: str) -> str:
    """The page on which a name is documented: its package, or its folder."""
    parts = name.split(".")
    return ".".join(parts[:2]) if len(parts) > 2 else parts[0]


def _module(name: str) -> types.ModuleType:
    package, *rest = name.split(".")
    return functools.reduce(getattr, rest, PACKAGES[package])


def _public() -> Iterator[tuple[str, Any]]:
    """(dotted name, object) of every public name except modules, each object once."""
    seen: set[int] = set()
    for name, thing in sorted(_everything(), key=lambda one: (one[0].count("."), one[0])):
        # Equal constants may be one object, but are documented under both names.
        known = id(thing) in seen and callable(thing)
        if not isinstance(thing, types.ModuleType) and not known:
            seen.add(id(thing))
            yield name, thing


def _everything() -> Iterator[tuple[str, Any]]:
    """(dotted name, object) of everything with a public name, including modules."""
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
    """The public names of a module: its `__all__`, or the names that it defines itself."""
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
    if inspect.isclass(thing):
        return Entry(name, "class", thing, tuple(_members(name, thing)))
    return Entry(name, "function" if callable(thing) else "value", thing)


def _members(name: str, cls: type) -> Iterator[Member]:
    """The documented methods and properties that a class defines itself."""
    for key, value in vars(cls).items():
        if key.startswith("_"):
            continue
        inner = getattr(cls, key) if isinstance(value, classmethod | staticmethod) else value
        inner = inner.fget if isinstance(inner, property) else inner
        # The default of a field may be a function of another library.
        ours = callable(inner) and _is_ours(getattr(inner, "__module__", None) or "")
        if ours and getattr(inner, "__doc__", None):
            kind = (
                "property"
                if isinstance(value, property)
                else "class method"
                if isinstance(value, classmethod | staticmethod)
                else "method"
            )
            yield Member(f"{name}.{key}", kind)


def _inherited_members(entry: Entry) -> list[str]:
    """The documented members that a class inherits from documented classes of ours."""
    own = {member.name.rpartition(".")[2] for member in entry.members}
    homes = {id(one.thing): one for of in chapters().values() for one in of if one.kind == "class"}
    found = {}
    for base in entry.thing.__mro__[1:]:
        for member in homes[id(base)].members if id(base) in homes else ():
            found.setdefault(member.name.rpartition(".")[2], member.name)
    return sorted(name for key, name in found.items() if key not in own)


def _short(value: Any) -> str:
    text = repr(value) if not isinstance(value, jax.Array) else f"array of shape {value.shape}"
    return textwrap.shorten(text, 200)
