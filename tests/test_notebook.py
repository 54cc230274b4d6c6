"""A notebook runs: scenes, motions and results are shown as tables, with pictures."""

import warnings
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parent / "notebook.ipynb"
_LIMIT = 300  # seconds a cell

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """The data that each cell of code shows, by type, after all of them ran in a new kernel."""
    client = pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    folder = {"metadata": {"path": str(tmp_path_factory.mktemp("notebook"))}}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the packages that run it
        client.NotebookClient(notebook, timeout=_LIMIT, resources=folder).execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not [x for cell in cells for x in cell.outputs if x.output_type in ("error", "stream")]
    return [cell.outputs[-1]["data"] for cell in cells]


def test_scenes_and_motions_are_tables_with_a_picture(outputs):
    for data, head in zip(outputs[:2], ("Scene pendulum", "Trajectory of pendulum"), strict=True):
        assert data["text/plain"].startswith(head)
        assert f"<strong>{head}</strong>" in data["text/html"]
        assert 'src="data:image/png;base64,' in data["text/html"]


def test_results_are_tables(outputs):
    assert "<table" in outputs[2]["text/html"]
    assert "<img" not in outputs[2]["text/html"]


def test_a_saved_motion_is_loaded_and_figures_show_themselves(outputs):
    assert outputs[3]["text/plain"] == "True"
    assert len(outputs[4]["image/png"]) > 1000
