"""Pictures of the site: written as PNG files, with the captions of pages."""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

_DPI = 110


def write(figure: Figure, folder: Path, name: str, look: str) -> dict[str, Any]:
    """Write a figure to a folder; returns its file, its size [px], and its caption."""
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name}.png", dpi=_DPI)
    width, height = (round(_DPI * side) for side in figure.get_size_inches())
    return {"file": f"{name}.png", "look": look, "width": width, "height": height}
