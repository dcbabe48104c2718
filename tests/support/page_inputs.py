"""Files that pages of the documentation expect, not written by the readers of the package."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
from pyarrow import csv
from scenariogeneration import xodr
from tests.support import recordings

from overtaking.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).resolve().parents[2]

COLUMN_MAP = """
[columns]
vehicle = "id"
time = "t [s]"
x = "x [m]"
y = "y [m]"
length = "length [m]"
width = "width [m]"
type = "kind"

[types]
car = ["car"]
truck = ["truck"]

[road]
kind = "motorway"
speed_limit_kmh = 120
"""


def write_table(path: Path) -> None:
    """A table with one overtake; the maps of the pages state the units of its columns."""
    columns = recordings.states()
    names = ("id", "t", "x", "y", "length", "width", "kind")
    csv.write_csv(pa.table({name: columns[name] for name in names}), path)


def write_paper_table(path: Path) -> None:
    """The study's table of ten simulations."""
    data = path.with_name("simulations-of-table")
    assert main(["generate", "-n", "10", "--seed", "1", "--quiet", "--out", str(data)]) == 0
    export = ["export", str(data), "--format", "pinto2023", "--quiet", "--out", str(path)]
    assert main(export) == 0
    shutil.rmtree(data)


def write_map(path: Path) -> None:
    """A motorway of two lanes, 1 km long."""
    road = xodr.create_road(xodr.Line(1000), 40, left_lanes=0, right_lanes=2, lane_width=3.5)
    road.add_type(xodr.RoadType.motorway, speed=120, speed_unit="km/h")
    odr = xodr.OpenDrive("town")
    odr.add_road(road)
    odr.adjust_roads_and_lanes()
    odr.write_xml(str(path))


def write_driver(path: Path) -> None:
    """The driver that `drive-it-yourself.md` shows."""
    page = (ROOT / "docs" / "how-to" / "drive-it-yourself.md").read_text(encoding="utf-8")
    _, _, block = page.partition("<!-- save: my_driver.py -->\n```python\n")
    path.write_text(block.partition("```")[0], encoding="utf-8")


def write_folder_of_tables(path: Path) -> None:
    path.mkdir()
    for number in range(3):
        write_table(path / f"{number}.csv")


WRITERS: dict[str, Callable[[Path], object]] = {
    "scene.xml": lambda path: path.write_text(recordings.commonroad(), encoding="utf-8"),
    "highd/01_tracks.csv": lambda path: recordings.highd(path.parent),
    "exid/01_tracks.csv": lambda path: recordings.exid(path.parent),
    "trajectories.csv": lambda path: path.write_text(recordings.ngsim(), encoding="utf-8"),
    "own.csv": write_table,
    "map.toml": lambda path: path.write_text(COLUMN_MAP, encoding="utf-8"),
    "tracks.csv": write_table,
    "table.csv": write_paper_table,
    "my_driver.py": write_driver,
    "network.onnx": lambda path: shutil.copy(ROOT / "examples" / "rl" / "learned.onnx", path),
    "town.xodr": write_map,
    "recordings": write_folder_of_tables,
}
"""Functions that write the files, by the name of the file."""
