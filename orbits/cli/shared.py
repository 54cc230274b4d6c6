"""What the commands of `orbits` share: reading their words, progress, failures, pictures."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from jaxdyn import simulate
from jaxdyn._checks import fail
from jaxdyn.image_files import animation_path, picture_path
from orbits.newton import Iteration
from orbits.problem import Orbit

NOT_FOUND = 1  # exit code: no orbit was found
_FRAMES = 180

SaveOption = Annotated[Path | None, typer.Option("--save", help="Write a file (.json).")]


def check_files(plot: Path | None, animate: Path | None, save_to: Path | None) -> None:
    """Refuse a file that cannot be written before the work, not after it."""
    picture_path(plot)
    if animate:
        animation_path(animate)
    if save_to and (save_to.is_dir() or not save_to.parent.is_dir()):
        raise fail("file", "a file in a folder that exists", f"'{save_to}'", "Make it first.")


def progress(step: Iteration) -> str:
    """A line on one step of Newton's method."""
    return (
        f"  step {step.index:2d}   largest error {step.residual:9.2e}   "
        f"period {step.period:.12f}   moved {step.step:.1e}"
    )


def numbers(option: str, text: str) -> list[float]:
    """The numbers in A,B,..."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise fail(option, "numbers with commas between", repr(text)) from None


def failure(orbit: Orbit) -> dict:
    """Why there is no orbit, and the best iterate, as a JSON object."""
    error = orbit.residual if math.isfinite(orbit.residual) else None
    best = {"period": orbit.period, "y0": [float(x) for x in orbit.y0], "largest_error": error}
    return {"outcome": orbit.outcome.name, "message": orbit.message, "best_iterate": best}


def draw(
    orbits: Sequence[Orbit],
    titles: Sequence[str],
    plot: Path | None,
    animate: Path | None,
    console: Console,
) -> None:
    """A picture of orbits and an animation of the last one, where they are asked for."""
    if plot:
        from orbits import drawing

        drawing.orbits(orbits, plot, titles)
        console.print(f"drawn in {plot}")
    if animate:
        from jaxdyn.drawing import animate as make_animation

        make_animation(simulate(orbits[-1].scene, samples=_FRAMES), animate)
        console.print(f"animated in {animate}")
