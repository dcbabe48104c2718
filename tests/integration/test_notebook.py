"""Public functions show progress and links in a notebook, and the page is served beside it."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any

import nbclient
import nbformat
import numpy as np
import pandas as pd
import pytest

import overtaking as ot
from overtaking.core import notebook

if TYPE_CHECKING:
    from pathlib import Path

GENERATE = """
from pathlib import Path
from tempfile import TemporaryDirectory
import overtaking.core.notebook as notebook
import overtaking as ot

notebook.DELAY_S = {delay_s}
with TemporaryDirectory() as folder:
    out = Path(folder) / "data"
    ot.generate_dataset("pinto2023", num_simulations=8, seed=1, out=out{arguments});
"""


SERVE = """
import http.client
import os
import signal
import overtaking as ot

data = ot.generate_dataset("pinto2023", num_simulations=2, seed=1, out="data")
server = ot.serve_viewer(data)
line = http.client.HTTPConnection(server.url.split("/")[2], timeout=60)
line.request("GET", "/")
assert line.getresponse().status == 200
line.close()
"""

IMPORT = """
import overtaking.core.notebook as notebook
import overtaking as ot

notebook.DELAY_S = notebook._INTERVAL_S = 0.0
columns = {
    "recording": {"length_m": 4.4, "width_m": 1.8},
    "columns": {"vehicle": "id", "time": "t [s]", "x": "x [m]", "y": "y [m]"},
}
shown = []
update = notebook._CellProgress.__call__
notebook._CellProgress.__call__ = lambda *numbers: (shown.append(numbers[1:]), update(*numbers))[1]
ot.import_recording("table", "table.csv", "data", columns=columns)
assert len(shown) > 1 and shown[0][1] > 1000, shown
"""

STOP = """
try:
    os.kill(os.getpid(), signal.SIGINT)  # As the stop button of a notebook does.
except KeyboardInterrupt:
    pass
line.request("GET", "/")
assert line.getresponse().status == 200
server.close()
try:
    line.connect()
except OSError:
    print("closed")
"""


def run_cells(folder: Path, *sources: str) -> list[list[Any]]:
    """The outputs of cells that a real kernel runs."""
    document: Any = nbformat.v4.new_notebook(cells=[*map(nbformat.v4.new_code_cell, sources)])
    nbclient.NotebookClient(
        document, timeout=600, resources={"metadata": {"path": folder}}
    ).execute()
    return [cell.outputs for cell in document.cells]


def run_cell(folder: Path, *, delay_s: float, arguments: str = "") -> list[Any]:
    """The outputs of a cell that generates eight simulations."""
    return run_cells(folder, GENERATE.format(delay_s=delay_s, arguments=arguments))[0]


@pytest.mark.ci
def test_a_notebook_shows_one_line_that_ends_with_all_simulations(tmp_path: Path):
    (output,) = run_cell(tmp_path, delay_s=0.0)
    assert output.output_type == "display_data"
    assert output.data["text/plain"] == "generate_dataset: 8 of 8"


@pytest.mark.ci
def test_a_notebook_shows_nothing_for_short_work(tmp_path: Path):
    assert run_cell(tmp_path, delay_s=3600.0) == []


@pytest.mark.ci
def test_a_notebook_shows_nothing_beside_the_progress_of_the_caller(tmp_path: Path):
    arguments = ", progress=lambda done, total: None"
    assert run_cell(tmp_path, delay_s=0.0, arguments=arguments) == []


@pytest.mark.ci
def test_a_notebook_shows_the_bytes_of_a_table_that_is_read(tmp_path: Path):
    time = np.arange(0.0, 20.0, 0.1)
    aside = np.clip((time - 2.0) / 3.0, 0.0, 1.0) - np.clip((time - 14.0) / 3.0, 0.0, 1.0)
    paths = {
        1: (30.0 * time, 3.5 * aside),
        2: (40.0 + 24.0 * time, 0.0 * time),
        3: (27.0 * time - 60.0, 0.0 * time + 3.5),
    }
    table = pd.concat(
        pd.DataFrame({"id": number, "t": time, "x": x, "y": y}) for number, (x, y) in paths.items()
    )
    table.to_csv(tmp_path / "table.csv", index=False)
    outputs = run_cells(tmp_path, IMPORT)[0]
    texts = [output.data["text/plain"] for output in outputs if "data" in output]
    assert texts == ["import_recording: 3 of 3"]


@pytest.mark.ci
def test_a_page_is_served_beside_the_event_loop_of_a_notebook(tmp_path: Path):
    (link,), closed = run_cells(tmp_path, SERVE, STOP)
    assert link.output_type == "display_data"
    url = link.data["text/plain"]
    assert url.startswith("http://127.0.0.1:")
    assert link.data["text/html"] == f'<a href="{url}" target="_blank">{url}</a>'
    assert [output.text for output in closed] == ["closed\n"]


def test_a_program_without_a_kernel_shows_no_progress():
    assert notebook.notebook_progress("generate") is None


def test_each_public_function_with_progress_shows_it_in_a_notebook(
    monkeypatch: pytest.MonkeyPatch,
):
    titles: list[str] = []

    class Called(Exception):
        pass

    def record(title: str) -> None:
        titles.append(title)
        raise Called

    monkeypatch.setattr(notebook, "notebook_progress", record)
    modules = [ot, ot.carla, ot.law, ot.learning, ot.logic, ot.whatif]
    functions = {name: getattr(module, name) for module in modules for name in dir(module)}
    reporting = [
        name
        for name, function in functions.items()
        if inspect.isfunction(function) and "progress" in inspect.signature(function).parameters
    ]
    for name in reporting:
        with pytest.raises(Called):
            functions[name]()
    assert titles == reporting
    assert len(reporting) > 20
