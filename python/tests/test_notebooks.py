"""The notebooks of docs/python/notebooks run from their first cell to their last, and hold no outputs."""

import os
from pathlib import Path

import pytest

import needs

nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")

SOURCES = Path(os.environ.get("SHUTTERBUG_SOURCES", Path(__file__).parents[2]))
NOTEBOOKS = sorted((SOURCES / "docs/python/notebooks").glob("*.ipynb"))


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_there_are_notebooks():
    assert {n.stem for n in NOTEBOOKS} >= {"first_picture", "augment", "diagnose", "board"}


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda n: n.stem)
def test_a_notebook_runs(file, device, tmp_path, monkeypatch):
    if file.stem == "diagnose":
        needs.long("docs/python/diagnose.md has the same diagnosis, and runs")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    # What a kernel and matplotlib keep for themselves stays here too.
    for name in ("IPYTHONDIR", "MPLCONFIGDIR", "JUPYTER_RUNTIME_DIR"):
        monkeypatch.setenv(name, str(tmp_path / name))
    (tmp_path / "work").mkdir()
    notebook = nbformat.read(file, as_version=4)
    assert not any(cell.outputs or cell.execution_count for cell in code_cells(notebook)), f"{file}: outputs are not stripped"
    client = nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(tmp_path / "work")}})
    client.execute()
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    assert any(o.output_type == "display_data" and "image/png" in o.data for o in outputs), "control: it draws"
    said = "".join(o.text for o in outputs if o.output_type == "stream" and o.name == "stderr")
    assert "Warning" not in said and "Traceback" not in said, said


def test_a_notebook_that_fails_is_seen(tmp_path):
    """The control: an assertion that does not hold ends the run."""
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("assert 1 + 1 == 3")])
    with pytest.raises(nbclient.exceptions.CellExecutionError):
        nbclient.NotebookClient(notebook, timeout=60, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}).execute()
