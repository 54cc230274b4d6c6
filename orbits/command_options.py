"""What the commands of `orbits` share: the test of files before the work, lines on progress."""

from pathlib import Path
from typing import Annotated

import typer

from jaxdyn._checks import fail
from jaxdyn.image_files import animation_path, picture_path
from orbits.newton import Iteration

NOT_FOUND = 1  # exit code: no orbit was found

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
