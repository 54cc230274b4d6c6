"""The command `orbits family`: how an orbit of a scene changes with one of its numbers."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np
import typer
from jaxtyping import Array
from rich.console import Console
from rich.table import Table

from jaxdyn import Scene, catalogue
from jaxdyn._checks import choice, fail, positive, whole
from jaxdyn.cli.shared import JsonOption, PlotOption, SceneArgument, SetOption
from orbits import family_files, load
from orbits.cli.find import searched
from orbits.cli.shared import (
    NOT_FOUND,
    SaveOption,
    check_files,
    failure,
    numbers,
    progress,
)
from orbits.continuation import continue_family
from orbits.family import Member
from orbits.family_files import Entry, Listing, listing

_ASIDE, _LATER = 0.1, 0.3  # a state and a time where a drive or a damper acts, if any does


def family_command(
    name: SceneArgument,
    settings: SetOption = None,
    parameter: Annotated[
        str | None, typer.Option(help="The number that changes; the energy if left out.")
    ] = None,
    from_orbit: Annotated[
        Path | None, typer.Option(help="Begin with the orbit in this file.")
    ] = None,
    period: Annotated[float | None, typer.Option(help="Guess for the first orbit.")] = None,
    members: Annotated[int, typer.Option(help="How many orbits at most.")] = 50,
    step: Annotated[float, typer.Option(help="Length of the first step.")] = 0.05,
    down: Annotated[bool, typer.Option("--down", help="Towards smaller values first.")] = False,
    within: Annotated[
        str | None, typer.Option(metavar="A,B", help="Bounds on the number, or on the period.")
    ] = None,
    energies: Annotated[
        str | None, typer.Option(metavar="A,B", help="Bounds on the energy.")
    ] = None,
    plot: PlotOption = None,
    save_to: SaveOption = None,
    as_object: JsonOption = False,
) -> None:
    """The family of a scene's orbit: periods, stability, and what is special on the way."""
    console = Console(stderr=as_object, highlight=False, soft_wrap=True)
    check_files(plot, None, save_to)
    whole("--members", members)
    positive("--step", step, "It is a length in the space of the unknowns.")
    bounds, levels = _bounds("--within", within), _bounds("--energies", energies)
    values = catalogue.numbers(name, catalogue.settings(settings or ()))
    scene = catalogue.entries()[name].make(**values)
    make, value = (None, None) if parameter is None else maker(name, values, parameter)
    if from_orbit is None:
        orbit = searched(scene, period, report=lambda step: console.print(progress(step)))
    else:
        orbit = load(from_orbit)[0]
    if not orbit.ok:
        if as_object:
            print(json.dumps({"scene": name} | failure(orbit)))  # noqa: T201
        console.print(f"[red]no orbit[/red]: {orbit.message}")
        raise typer.Exit(NOT_FOUND)
    found = continue_family(
        orbit,
        make,
        value,
        step=step,
        members=members,
        down=down,
        within=bounds,
        energies=levels,
        report=lambda member: console.print(_passed(member)),
    )
    family = listing(found, parameter)
    if not as_object:
        _print(family, console)
    if save_to:
        family_files.save(save_to, family)
        console.print(f"saved to {save_to}")
    if plot:
        from orbits import drawing

        drawing.family(family, plot)
        console.print(f"drawn in {plot}")
    if as_object:
        print(json.dumps({"scene": name} | family_files.as_json(family)))  # noqa: T201


def maker(
    name: str, values: dict[str, Any], parameter: str
) -> tuple[Callable[[Array], Scene], float]:
    """The scene of the catalogue for each value of one of its numbers, and the value it has.

    Args:
      name: of the scene.
      values: the other numbers that are not as the scene has them by itself.
      parameter: name of the number.
    Raises:
      ValueError: a number that the scene does not have, or that no derivative can be taken by.
    """
    entry = catalogue.entries()[name]
    defaults = {p.name: p.default for p in entry.parameters}
    value = (defaults | values)[choice("--parameter", parameter, defaults)]
    remedy = "Its motion must be smooth in it."
    if isinstance(value, bool | str) or not isinstance(value, int | float):
        raise fail("--parameter", "one number", f"{parameter} = {value!r}", remedy)

    def make(x: Array) -> Scene:
        return entry.make(**{**values, parameter: x})

    try:
        slopes = jax.jacfwd(lambda x: _rates(make(x)))(float(value))
    except (jax.errors.JAXTypeError, TypeError) as error:
        got = f"{parameter}, which shapes the scene of {name}"
        raise fail("--parameter", "one that only changes numbers", got, remedy) from error
    if not np.any(slopes):
        remedy = "The start is found anyway; without --parameter the energy changes."
        raise fail("--parameter", "one that changes the forces", parameter, remedy)
    return make, float(value)


def _rates(scene: Scene) -> Array:
    """(2, k) of the scene as it moves at its start, and at a place nearby at a later time."""
    y0 = jax.lax.stop_gradient(scene.y0)
    aside = scene.system.project(_LATER, y0 + _ASIDE)
    return jnp.stack([scene.rate(jnp.zeros(()), y0), scene.rate(_LATER, aside)])


def _bounds(option: str, text: str | None) -> tuple[float, float]:
    if text is None:
        return -np.inf, np.inf
    bounds = numbers(option, text)
    if not (len(bounds) == 2 and bounds[0] < bounds[1]):
        raise fail(option, "two bounds, the lower one first", repr(text))
    return bounds[0], bounds[1]


def _passed(member: Member) -> str:
    """A line on a member as it is found, for those who wait."""
    number = "" if np.isnan(member.parameter) else f"number {member.parameter:.10g}   "
    return f"  {number}period {member.orbit.period:.12g}   {member.stability.verdict}"


def _print(family: Listing, console: Console) -> None:
    # Without a parameter there is no first column.
    names = () if family.parameter is None else (family.parameter,)
    table = Table(*names, "period", "energy", "linear stability", "special")
    for entry in (*family.members, *family.special):
        table.add_row(*_row(entry)[-len(table.columns) :])
    console.print(table)
    console.print(f"{len(family.members)} orbits; the end: {family.end}")


def _row(entry: Entry) -> tuple[str, ...]:
    numbers = f"{entry.parameter:.10g}", f"{entry.orbit.period:.12g}", f"{entry.energy:.12g}"
    return *numbers, entry.verdict, entry.kind or ""
