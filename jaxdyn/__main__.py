"""The command line: `jaxdyn list`, `jaxdyn run SCENE`."""

import json
import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from jaxdyn import _checks, catalogue, energy
from jaxdyn._config import configure
from jaxdyn.simulate import RTOL, Trajectory, simulate
from jaxdyn.solvers import DOPRI8, NYSTROM12, VERNER9

app = typer.Typer(
    help="Simulate, draw and check the scenes of a course on dynamics.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
STOPPED = 1  # exit code: the motion did not reach its end
MISUSE = 2  # exit code: the input makes no sense
_SOLVERS = {"nystrom12": NYSTROM12, "verner9": VERNER9, "dopri8": DOPRI8}


@app.callback()
def _settings() -> None:
    configure()


@app.command("list")
def list_command(
    as_object: Annotated[bool, typer.Option("--json", help="One JSON object.")] = False,
) -> None:
    """Every scene with its course problems, its numbers, their defaults and units."""
    zoo = catalogue.entries()
    if as_object:
        print(json.dumps({name: _described(entry) for name, entry in zoo.items()}))  # noqa: T201
        return
    table = Table("scene", "problems", "what it is, and its numbers")
    for name, entry in zoo.items():
        lines = [f"[bold]{escape(entry.summary)}[/bold]"]
        for p in entry.parameters:
            lines.append(escape(f"{p.name} = {_shown(p.default)}: {p.meaning}"))
        table.add_row(name, ", ".join(map(str, entry.problems)), "\n".join(lines), end_section=True)
    Console(highlight=False).print(table)


@app.command("run")
def run_command(
    name: Annotated[str, typer.Argument(help="A scene of `jaxdyn list`.")],
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="One of its numbers.")
    ] = None,
    t1: Annotated[float | None, typer.Option(help="End of the span; the scene's own.")] = None,
    samples: Annotated[int, typer.Option(help="How many times to sample.")] = 400,
    rtol: Annotated[float, typer.Option(help="Relative tolerance of a step.")] = RTOL,
    solver: Annotated[str, typer.Option(help="auto, nystrom12, verner9 or dopri8.")] = "auto",
    plot: Annotated[Path | None, typer.Option(help="Draw it (.png, .pdf, .svg).")] = None,
    animate: Annotated[Path | None, typer.Option(help="Animate it (.gif, .mp4).")] = None,
    as_object: Annotated[bool, typer.Option("--json", help="One JSON object.")] = False,
) -> None:
    """Simulate a scene, say how well its energy is kept, and draw it if asked."""
    console = Console(stderr=as_object, highlight=False, soft_wrap=True)
    scene = catalogue.build(name, dict(_pair(text) for text in settings or ()))
    _checks.choice("solver", solver, ("auto", *_SOLVERS))
    motion = simulate(
        scene, t1, samples=samples, rtol=rtol, solver=_SOLVERS.get(solver), throw=False
    )
    result = _result(name, motion)
    if as_object:
        print(json.dumps(result))  # noqa: T201
    else:
        _print(result, console)
    if plot:
        from jaxdyn.plots import time_series, trajectory

        draw = trajectory if motion.r.shape[1] else time_series
        draw(motion, path=plot)
        console.print(f"drawn in {plot}")
    if animate:
        from jaxdyn.animate import animate as make_animation

        make_animation(motion, animate)
        console.print(f"animated in {animate}")
    if not motion.ok:
        console.print(f"[red]stopped[/red]: {motion.message}")
        raise typer.Exit(STOPPED)


def main() -> None:
    """Run the command line; one line and exit code 2 for input that makes no sense."""
    try:
        app()
    except ValueError as error:
        print(f"error: {' '.join(str(error).split())}", file=sys.stderr)  # noqa: T201
        raise SystemExit(MISUSE) from None


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise _checks.fail("--set", "NAME=VALUE", repr(text))
    return name.strip(), value.strip()


def _shown(default) -> str:
    if isinstance(default, tuple):
        return ", ".join(f"{x:.6g}" if isinstance(x, float) else str(x) for x in default)
    return f"{default:.6g}" if isinstance(default, float) else str(default)


def _described(entry: catalogue.Entry) -> dict:
    numbers = {p.name: {"default": p.default, "meaning": p.meaning} for p in entry.parameters}
    return {"summary": entry.summary, "problems": entry.problems, "parameters": numbers}


def _result(name: str, motion: Trajectory) -> dict:
    drift = float(energy.drift(motion))
    labels = motion.scene.system.labels()
    return {
        "scene": name,
        "status": motion.status_code.name,
        "message": motion.message,
        "t": _finite(motion.ts),
        "labels": [f"{label} [{unit}]" for label, unit in labels],
        "y": _finite(motion.ys),
        "energy_drift": drift if np.isfinite(drift) else None,
        "steps": int(motion.steps),
        "rejected": int(motion.rejected),
    }


def _finite(values) -> list:
    values = np.asarray(values)
    return np.where(np.isfinite(values), values.astype(object), None).tolist()


def _print(result: dict, console: Console) -> None:
    last = result["y"][-1]
    console.print(f"[bold]{result['scene']}[/bold] at t = {result['t'][-1]:g}:")
    for label, value in zip(result["labels"], last, strict=True):
        shown = "not reached" if value is None else format(value, ".12g")
        console.print(f"  {escape(label):24} {shown}")
    drift = result["energy_drift"]
    if drift is not None:
        console.print(f"change of energy, relative to its parts: {drift:.1e}")
    console.print(f"{result['steps']} steps, {result['rejected']} rejected")


if __name__ == "__main__":
    main()
