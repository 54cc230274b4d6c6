"""Tutorials: Markdown with Python, run as notebooks, with their outputs on the site.

Each block of Python is a cell. If a cell fails, the tutorial ends with its error.
"""

import re
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from nbclient import NotebookClient
from nbformat import v4

_FOLDER = Path(__file__).parent / "tutorials"
_BLOCK = re.compile(r"^```python\n(.*?)^```\n?", re.DOTALL | re.MULTILINE)
_SECONDS = 600  # the longest wait for one cell


def files() -> dict[str, Path]:
    """The tutorials by the names of their pages, such as "tutorials/proof", in order."""
    found = sorted(_FOLDER.glob("*.md"))
    return {f"tutorials/{path.stem.partition('_')[2]}": path for path in found}


def notebook(text: str):
    """The notebook of a tutorial, without outputs."""
    cells = []
    for i, piece in enumerate(_BLOCK.split(text)):
        if piece.strip():
            make = v4.new_code_cell if i % 2 else v4.new_markdown_cell
            cells.append(make(piece.strip(), id=f"cell-{i}"))
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return v4.new_notebook(cells=cells, metadata={"kernelspec": kernel})


def tutorial_record(path: Path) -> dict[str, Any]:
    """Run a tutorial in a temporary folder; returns the notebook with its outputs.

    Raises:
      nbclient.exceptions.CellExecutionError: a cell fails.
    """
    found = notebook(path.read_text())
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(found, timeout=_SECONDS, kernel_name="python3")
        # The log of the kernel is of no interest here; errors of cells are raised.
        client.execute(cwd=folder, stderr=subprocess.DEVNULL)
    return {"notebook": found}
