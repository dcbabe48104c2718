"""Readers of recordings and maps as targets of `fuzz.py`: hand-made files, and who must bear them.

Each entry of `READERS` holds the arguments of a `FigureTarget`.
"""

import importlib
import random
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from damage import damaged_bytes, damaged_text
from measure import ROOT

sys.path.insert(0, str(ROOT))

_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")

Named = tuple[str, str | bytes]
"""The name of a file and its content."""


def _scenes(_folder: Path) -> list[Named]:
    """Scenarios of both versions, with a bend, cuts, an oncoming vehicle and a speed sign."""
    made: Any = importlib.import_module("tests.support.recordings")
    bend = made.Bend(length=120.0, cuts=(40.0, 80.0), curvature=1.0 / 900.0)
    movers = [
        made.Mover(number=1, s=10.0, last=12, moves=((0.6, 1),), ramp=0.8),
        made.Mover(number=2, s=40.0, speed=20.0, last=12),
        made.Mover(number=3, s=100.0, speed=-20.0, lane=3, last=12),
    ]
    sign = (
        '<trafficSign id="500"><trafficSignElement><trafficSignID>274</trafficSignID>'
        "<additionalValue>33.25</additionalValue></trafficSignElement></trafficSign>"
    )
    texts = (made.commonroad(movers, bend, version=one, more=sign) for one in ("2018b", "2020a"))
    return [("scene.xml", text.replace("><", ">\n<")) for text in texts]


def _highd(folder: Path) -> list[Named]:
    """The three files of a recording with both carriageways."""
    made: Any = importlib.import_module("tests.support.recordings")
    lower = [made.Mover(number=one.number, s=one.s, moves=one.moves) for one in made.OVERTAKE]
    made.highd(folder, lower=lower, upper=[made.Mover(number=11), made.Mover(number=12, s=50.0)])
    return [(path.name, path.read_text(encoding="utf-8")) for path in folder.glob("*.csv")]


_TRAFFIC = ((1, 10.0, 30.0, 0), (2, 60.0, 24.0, 0), (3, 0.0, 33.0, 1), (4, 30.0, 28.0, 2))


def _movers() -> list[Any]:
    """Traffic in three lanes, in which vehicle 1 moves left."""
    made: Any = importlib.import_module("tests.support.recordings")
    return [
        made.Mover(number=number, s=s, speed=speed, lane=lane, last=40,
                   moves=((1.5, 1),) if number == 1 else (), ramp=2.0)
        for number, s, speed, lane in _TRAFFIC
    ]  # fmt: skip


def _exid(folder: Path) -> list[Named]:
    """The three files of an exiD recording."""
    made: Any = importlib.import_module("tests.support.recordings")
    made.exid(folder, _movers(), rate=10, turn=0.5)
    return [(path.name, path.read_text(encoding="utf-8")) for path in folder.glob("*.csv")]


def _ngsim(_folder: Path) -> list[Named]:
    """NGSIM's table, with names and without."""
    made: Any = importlib.import_module("tests.support.recordings")
    text = made.ngsim(_movers())
    bare = "\n".join(line.rsplit(",", 1)[0].replace(",", "  ") for line in text.splitlines()[1:])
    return [("ngsim.csv", text), ("ngsim.csv", bare + "\n")]


def _any_table(folder: Path) -> list[Named]:
    """A table as text and as Parquet, 24 frames a second; the map of its columns lies beside it."""
    import pyarrow as pa
    import pyarrow.csv as pacsv
    import pyarrow.parquet as pq

    made: Any = importlib.import_module("tests.support.recordings")
    table = pa.table(made.states(_movers(), interval_ms=1000 / 24))
    pacsv.write_csv(table, folder / "table.csv")
    pq.write_table(table, folder / "table.parquet")
    (folder / "map.toml").write_text(_MAP, encoding="utf-8")
    return [
        ("table.csv", (folder / "table.csv").read_text("utf-8")),
        ("table.parquet", (folder / "table.parquet").read_bytes()),
    ]


def _column_maps(folder: Path) -> list[Named]:
    """Maps of the columns of the table beside them: one that fits, and the maps of the package."""
    from overtaking.recordings.column_map import MAPS

    _any_table(folder)
    shipped = [path.read_text(encoding="utf-8") for path in sorted(MAPS.glob("*.toml"))]
    return [("map.toml", text) for text in (*[_MAP] * len(shipped), *shipped)]


_MAP = """
[recording]
point = "centre"

[columns]
vehicle = "id"
time = "t [s]"
x = "x [m]"
y = "y [m]"
length = "length [m]"
width = "width [m]"
type = "kind"
heading = "yaw [deg]"

[types]
car = ["car"]

[road]
speed_limit_kmh = 120
heading_deg = 0
borders_m = [0, 3.5, 7, 10.5]
"""


def _maps(_folder: Path) -> list[Named]:
    """A map with a road in a junction, and one with a lane offset, a roll and two sections."""
    made: Any = importlib.import_module("tests.unit.recordings.opendrive_text")
    sections = "".join(made.section(s=s, left=made.LEFT, right=made.RIGHT) for s in (0, 250))
    roll = '<superelevation s="0" a="0.01" b="0" c="0" d="0"/>'
    offset = '<laneOffset s="0" a="0.5" b="0" c="0" d="0"/>'
    roads = (
        made.road(offset=offset, lateral=roll, sections=sections),
        made.road(road_id="8", header='junction="2"'),
    )
    return [("map.xodr", made.document(*roads).replace("><", ">\n<"))]


def _tables(folder: Path) -> list[Named]:
    """The paper's table of two short simulations, as text and as Parquet."""
    import overtaking as ot

    short = {
        "time.horizon_s": "2",
        "time.attempt_deadline_s": "1",
        "traffic.vehicles": "2..3",
    }
    ot.generate_dataset(
        "pinto2023-physical", num_simulations=2, seed=1, out=folder / "data", overrides=short
    )
    paths = [folder / "table.csv", folder / "table.parquet"]
    for path in paths:
        ot.export_dataset(folder / "data", path)
    return [(paths[0].name, paths[0].read_text("utf-8")), (paths[1].name, paths[1].read_bytes())]


def _damaged(given: Named, chance: random.Random) -> tuple[str, bytes]:
    """Most damage is refused at once; other numbers in a whole file get farther."""
    name, content = given
    if isinstance(content, bytes):
        return name, damaged_bytes(content, chance)
    if chance.random() < 0.5 or not _NUMBER.search(content):
        return name, damaged_text(content, chance)
    for _ in range(chance.choice((1, 2, 8))):
        start, stop = chance.choice([found.span() for found in _NUMBER.finditer(content)])
        content = content[:start] + _other(content[start:stop], chance) + content[stop:]
    return name, content.encode()


def _other(number: str, chance: random.Random) -> str:
    """Another number than one that was there."""
    value = float(number)
    near = (value + 1.0, value - 1.0, value * 10.0, value * 0.1, -value, value * 1e-300)
    return chance.choice(
        (*(f"{one:g}" for one in near), f"{round(value) + 1}", "0", "1e8", "1e-308")
    )


def _reads(file_format: str) -> Callable[[tuple[str, bytes], Path], None]:
    """What reads a damaged recording and makes simulations of all that it finds."""

    def read(given: tuple[str, bytes], folder: Path) -> None:
        from overtaking.recordings.formats import read_recording

        path = folder / given[0]
        before = path.read_bytes() if path.exists() else given[1]
        path.write_bytes(given[1])
        try:
            main = folder / "01_tracks.csv" if file_format in ("exid", "highd") else path
            options = {"columns": folder / "map.toml"} if file_format == "table" else {}
            main = folder / "table.csv" if path.suffix == ".toml" else main
            scenes = read_recording(file_format, main, options).scenes
            scenes.trajectories(range(min(len(scenes), 50)))
        finally:
            path.write_bytes(before)

    return read


def _read_map(given: tuple[str, bytes], folder: Path) -> None:
    from overtaking.recordings.opendrive import read_opendrive

    path = folder / given[0]
    path.write_bytes(given[1])
    read_opendrive(path, 7)


READERS: tuple[dict[str, Any], ...] = tuple(
    {"name": name, "corpus": corpus, "damaged": _damaged, "call": call}
    for name, corpus, call in (
        ("column_map", _column_maps, _reads("table")),
        ("commonroad", _scenes, _reads("commonroad")),
        ("exid", _exid, _reads("exid")),
        ("highd", _highd, _reads("highd")),
        ("ngsim", _ngsim, _reads("ngsim")),
        ("opendrive", _maps, _read_map),
        ("pinto2023", _tables, _reads("pinto2023")),
        ("table", _any_table, _reads("table")),
    )
)
