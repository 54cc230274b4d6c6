"""The command `jaxdyn list`: scenes with their parameters, problems, texts about a word."""

from collections.abc import Mapping
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

import jaxdyn
from jaxdyn import _scene_files
from jaxdyn._text import fail, suggestion
from jaxdyn.cli import completion, topics
from jaxdyn.cli.docstrings import SceneText, of_file, scenes
from jaxdyn.cli.screen import Screen
from jaxdyn.cli.shared import JsonOption

_MENTIONED = "a scene, or a word that a scene, effect, guide, command or problem mentions"
_TRY = "Try a more common word, or its beginning; `jaxdyn list` shows all scenes."
_MOST_WHOLE = 4  # scenes found by a word that are listed with all their numbers


def list_command(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENE or WORD]...",
            help="Scenes, words about them, or FILE.py:NAME of yours; all if none is given.",
            autocompletion=completion.scene,
        ),
    ] = None,
    as_object: JsonOption = False,
    problems: Annotated[
        bool, typer.Option("--problems", help="The problems of the course, with their answers.")
    ] = False,
) -> None:
    """List scenes with their parameters; with a word, also effects, guides, commands, problems."""
    if problems and names:
        raise fail("--problems", "no scene beside it", names[0], "It lists problems.")
    out = Screen(as_object)
    if problems:
        found = jaxdyn.course.problems()
        if as_object:
            out.result({n: problem.as_dict() for n, problem in found.items()})
        else:
            out.print(_problems(found))
        return
    texts = _texts(names or [])
    chosen = _matching_scenes(names) if names else scenes()
    if as_object:
        out.result({name: _description(scene) for name, scene in chosen.items()})
        return
    found_by_word = bool(names) and any(name not in chosen for name in names)
    if found_by_word and len(chosen) > _MOST_WHOLE:
        out.print(_beside("scene", {name: scene.summary for name, scene in chosen.items()}))
        out.print("[dim]jaxdyn list SCENE shows its numbers.[/dim]")
    elif chosen:
        out.print(_scenes(chosen))
    for heading, rows in texts.items():
        if rows:
            out.print(_beside(heading, rows))


def _matching_scenes(words: list[str]) -> dict[str, SceneText]:
    """The scenes that are named, and those whose name or text contains a word."""
    zoo, found = scenes(), {}
    for word in words:
        if _scene_files.is_in_file(word):
            found[word] = of_file(word)
        elif word in zoo:
            found[word] = zoo[word]
        else:
            about = topics.about(word, zoo)
            first = topics.about(word, {name: _headline(zoo[name]) for name in about})
            found |= {name: zoo[name] for name in dict.fromkeys([*first, *about])}
    return found


def _headline(scene: SceneText) -> SceneText:
    """What the text of a scene says before its parameters."""
    return scene._replace(parameters={})


def _texts(words: list[str]) -> dict[str, dict[str, str]]:
    """The texts of each kind about words that are not names of scenes, by a heading."""
    zoo = scenes()
    asked = [word for word in words if word not in zoo and not _scene_files.is_in_file(word)]
    found = {"effect": {}, "guide of the site": {}, "command": {}, "problem": {}, "word": {}}
    for word in asked:
        found["effect"] |= topics.effects(word)
        found["command"] |= topics.commands(word)
        found["guide of the site"] |= topics.guides(word)
        found["problem"] |= {f"jaxdyn course {n}": x for n, x in topics.problems(word).items()}
        found["word"] |= topics.meanings(word)
        if not any([*found.values(), *topics.about(word, zoo)]):
            found["guide of the site"] |= topics.guides(word, times=1)
        if not any([*found.values(), *topics.about(word, zoo)]):
            raise fail("list", _MENTIONED, repr(word), suggestion(word, zoo) or _TRY)
    return found


def _beside(heading: str, rows: Mapping[str, str]) -> Table:
    table = Table(heading, "its meaning here" if heading == "word" else "what it is about")
    for name, text in rows.items():
        table.add_row(escape(name), escape(text))
    return table


def _scenes(zoo: dict[str, SceneText]) -> Table:
    table = Table("scene", "problems", "what it is, and its numbers")
    for name, scene in zoo.items():
        lines = [f"[bold]{escape(scene.summary)}[/bold]"]
        for key, p in scene.parameters.items():
            meaning = f": {p.meaning}" if p.meaning else ""
            lines.append(escape(f"{key} = {_text_of(p.default)}{meaning}"))
        table.add_row(name, ", ".join(map(str, scene.problems)), "\n".join(lines), end_section=True)
    return table


def _problems(problems: "dict[int, jaxdyn.course.page.Problem]") -> Table:
    """Each problem with its answer and the public names that its page uses."""
    table = Table("problem", "what it is about", "the answer, and the names that its page uses")
    for n, problem in problems.items():
        names = "\n".join([f"[italic]{escape(problem.answer)}[/italic]", *problem.names])
        about = f"{escape(problem.title)}\n[dim]jaxdyn course {n}[/dim]"
        table.add_row(str(n), about, names, end_section=True)
    return table


def _text_of(default) -> str:
    if isinstance(default, tuple):
        return ", ".join(f"{x:.6g}" if isinstance(x, float) else str(x) for x in default)
    return f"{default:.6g}" if isinstance(default, float) else str(default)


def _description(scene: SceneText) -> dict:
    numbers = {name: p._asdict() for name, p in scene.parameters.items()}
    return {**scene._asdict(), "parameters": numbers}
