"""What the commands of `orbits` share: options, the test of files before the work, progress."""

from pathlib import Path
from typing import Annotated

import typer

from jaxdyn._checks import fail
from orbits.newton import Iteration

NOT_FOUND = 1  # exit code: no orbit was found

SceneArgument = Annotated[str, typer.Argument(metavar="SCENE", help="A scene of `jaxdyn list`.")]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="One of its numbers.")
]
PlotOption = Annotated[Path | None, typer.Option(help="Draw the orbits (.png, .pdf, .svg).")]
AnimateOption = Annotated[Path | None, typer.Option(help="Animate the orbit (.gif, .mp4).")]
SaveOption = Annotated[Path | None, typer.Option("--save", help="Write a file (.json).")]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")]


def check_files(plot: Path | None, animate: Path | None, save_to: Path | None) -> None:
    """Refuse a file that cannot be written before the work, not after it."""
    if plot or animate:
        from jaxdyn import animate as moving
        from jaxdyn import plots

        for path, suffixes in ((plot, plots.SUFFIXES), (animate, moving.SUFFIXES)):
            if path:
                plots.checked_path(path, suffixes)
    if save_to and (save_to.is_dir() or not save_to.parent.is_dir()):
        raise fail("file", "a file in a folder that exists", f"'{save_to}'", "Make it first.")


def progress(step: Iteration) -> str:
    """A line on one step of Newton's method."""
    return (
        f"  step {step.index:2d}   largest error {step.residual:9.2e}   "
        f"period {step.period:.12f}   moved {step.step:.1e}"
    )
