"""The command `jaxdyn run`: simulates a scene, says how its energy changes, and draws it."""

import json
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from jaxdyn import _checks, catalogue
from jaxdyn.cli.shared import (
    AnimateOption,
    JsonOption,
    PlotOption,
    SceneArgument,
    SetOption,
    SpanOption,
)
from jaxdyn.end_error import EndError, end_error
from jaxdyn.energy_change import energy_change
from jaxdyn.image_files import animation_path, picture_path
from jaxdyn.phases import Chain, pieces_of
from jaxdyn.scene import Scene
from jaxdyn.simulate import RTOL, Trajectory
from jaxdyn.solvers import DOPRI8, NYSTROM12, STOERMER14, STOERMER18, VERNER9
from jaxdyn.status import Status

STOPPED = 1  # exit code: the motion did not reach its end
_MOST_SAMPLES = 1_000_000  # all of which become text
_SOLVERS = {
    **{"nystrom12": NYSTROM12, "stoermer14": STOERMER14, "stoermer18": STOERMER18},
    **{"verner9": VERNER9, "dopri8": DOPRI8},
}


def run_command(
    name: SceneArgument,
    settings: SetOption = None,
    t1: SpanOption = None,
    samples: Annotated[int, typer.Option(help="How many times to sample, in each phase.")] = 400,
    rtol: Annotated[float, typer.Option(help="Relative tolerance of a step.")] = RTOL,
    solver: Annotated[str, typer.Option(help=f"auto, {', '.join(_SOLVERS)}.")] = "auto",
    plot: PlotOption = None,
    animate: AnimateOption = None,
    as_object: JsonOption = False,
) -> None:
    """Simulate a scene in all its phases, say how its energy changes, and draw it if asked."""
    console = Console(stderr=as_object, highlight=False, soft_wrap=True)
    picture_path(plot)
    if animate:
        animation_path(animate)
    _checks.choice("solver", solver, ("auto", *_SOLVERS))
    remedy = f"It is at most {_MOST_SAMPLES} here; jaxdyn.simulate takes more."
    _checks.whole("samples", samples, most=_MOST_SAMPLES, remedy=remedy)
    scene = catalogue.build(name, catalogue.settings(settings or ()))

    def made(scene: Scene, rtol: float) -> Trajectory | Chain:
        how = {"samples": samples, "rtol": rtol, "solver": _SOLVERS.get(solver)}
        return catalogue.entries()[name].motion(scene, t1, **how)

    motion = made(scene, rtol)
    end = end_error(motion, made, rtol=rtol)
    result = _result(name, motion, end)
    if as_object:
        print(json.dumps(result))  # noqa: T201
    else:
        _print(result, end, console)
    if plot:
        from jaxdyn import drawing

        drawing.trajectory(motion, plot)
        console.print(f"drawn in {plot}")
    if animate:
        from jaxdyn import drawing

        drawing.animate(motion, animate)
        console.print(f"animated in {animate}")
    if not _arrived(motion):
        console.print(f"[red]stopped[/red]: {motion.message}")
        raise typer.Exit(STOPPED)


def _result(name: str, motion: Trajectory | Chain, end: EndError) -> dict:
    pieces = pieces_of(motion)
    change = energy_change(motion)
    in_phases = isinstance(motion, Chain)
    ts = [np.asarray(piece.ts) for piece in pieces]
    ys = [np.asarray(piece.ys) for piece in pieces]
    if in_phases and motion.ended:  # where its last exit left it
        ts, ys = [*ts, np.asarray(motion.t)[None]], [*ys, np.asarray(motion.y)[None]]
    return {
        "scene": name,
        "status": motion.status.name if in_phases else motion.status_code.name,
        "message": motion.message,
        "t": _finite(np.concatenate(ts)),
        "labels": [_label(*label) for label in pieces[0].scene.labels()],
        "y": _finite(np.concatenate(ys)),
        "error": _finite(end.error),
        "phases": [
            {"name": phase, "t0": float(piece.ts[0]), "t1": float(piece.ts[-1])}
            for phase, piece in zip(motion.names if in_phases else (), pieces, strict=False)
        ],
        "energy_drift": change and change.size,
        "energy_changed_by": change and change.causes,
        "energy_message": change and change.message,
        "steps": sum(int(piece.steps) for piece in pieces),
        "rejected": sum(int(piece.rejected) for piece in pieces),
    }


def _label(name: str, unit: str) -> str:
    return name if unit == "1" else f"{name} [{unit}]"


def _arrived(motion: Trajectory | Chain) -> bool:
    """Whether a motion got to the end of its span, or to an end of its own."""
    if isinstance(motion, Chain):
        done = motion.ended or motion.t >= motion.pieces[-1].scene.t1
        return motion.status == Status.OK and bool(done)
    return motion.ok


def _finite(values) -> list:
    values = np.asarray(values)
    return np.where(np.isfinite(values), values.astype(object), None).tolist()


def _print(result: dict, end: EndError, console: Console) -> None:
    console.print(f"[bold]{result['scene']}[/bold] at t = {result['t'][-1]:g}:")
    for label, shown in zip(result["labels"], end.written(), strict=True):
        console.print(f"  {escape(label):24} {shown}")
    console.print(end.message)
    for phase in result["phases"]:
        console.print(f"  {phase['name']:12} from {phase['t0']:.9g} to {phase['t1']:.9g}")
    if result["energy_message"]:
        console.print(escape(result["energy_message"]))
    console.print(f"{result['steps']} steps, {result['rejected']} rejected")
