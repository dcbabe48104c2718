"""The tables of the literature as plain values, with the references that they cite."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from overtaking.analysis.literature import reading
from overtaking.analysis.literature.records import MEMBERS, DrivingDataset
from overtaking.core.errors import check_choice

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from overtaking.data.load import Dataset

TABLES = ("systems", "datasets", "factors", "studies")
"""Names of the tables."""

BOXES = "boxes3d"
"""The condition on 3D bounding boxes."""

_COLUMNS = {word: column for column, words in MEMBERS.items() for word in words}

WORDS = (*_COLUMNS, BOXES)
"""Conditions that a data set can be selected by."""

_OWN = "own"  # Source and reference of a data set of the user.
_SLOWEST_IMAGES_PER_S = 0.1
_MS_PER_H = 3.6e6


def answer(
    table: str,
    *,
    wanted: Collection[str] = (),
    own: Dataset | None = None,
    is_corrected: bool = True,
) -> dict[str, Any]:
    """One of the tables.

    Args:
        table: One of `TABLES`.
        wanted: Conditions that a data set must meet, out of `WORDS`.
        own: A data set of this package to add, whatever is wanted.
        is_corrected: Whether to apply corrections; if not, values are as printed.

    Returns:
        `rows`, and `references` with the citation of each id that a row names.

    Raises:
        ConfigError: There is no such table or condition.
    """
    check_choice(table, TABLES, what="table", where="literature")
    read = getattr(reading, table)
    has_corrections = table in ("systems", "datasets")
    found = list((read(is_corrected=is_corrected) if has_corrections else read()).values())
    rows = [dataclasses.asdict(row) for row in found]
    if table == "datasets":
        found = select(found, wanted)
        rows = [dataclasses.asdict(row) | {"doubts": doubts(row)} for row in found]
        rows += [_own_row(own)] if own is not None else []
    return {"rows": rows, "references": _references(found)}


def _references(rows: Iterable[Any]) -> dict[str, str]:
    """What the rows cite, by id."""
    cited: set[str] = set()
    for row in rows:
        cited |= {row.source, getattr(row, "reference", row.source)}
        cited |= {one.source for one in getattr(row, "corrections", ())}
    return {id_: one.citation for id_, one in reading.references().items() if id_ in cited}


def select(rows: Iterable[DrivingDataset], wanted: Collection[str]) -> list[DrivingDataset]:
    """The data sets that meet all conditions, in their order.

    Args:
        rows: The data sets.
        wanted: Conditions out of `WORDS`.

    Raises:
        ConfigError: There is no such condition.
    """
    for word in wanted:
        check_choice(word, WORDS, what="condition", where="literature datasets")
    return [row for row in rows if all(_has(row, word) for word in wanted)]


def _has(row: DrivingDataset, word: str) -> bool:
    return row.boxes_3d if word == BOXES else word in getattr(row, _COLUMNS[word])


def doubts(row: DrivingDataset) -> list[str]:
    """Contradictions within a row, a clause each.

    A doubt is no correction: it shows that a value is wrong, not which one is right.
    """
    images, scenes, annotated = row.num_images or 0, row.num_scenes or 0, row.num_annotated_frames
    fewest = _SLOWEST_IMAGES_PER_S * (row.duration_h or 0.0) * 3600.0
    checks = {
        "lidar, or its clouds, missing": _differ("lidar" in row.sensors, row.num_lidar_clouds),
        "radar, or its clouds, missing": _differ("radar" in row.sensors, row.num_radar_clouds),
        "3D boxes in one half of the table only": row.boxes_3d != ("3d" in row.annotations),
        "more scenes than images": 0 < images < scenes,
        "more annotated frames than images": 0 < images < (annotated or 0),
        "less than an image in ten seconds": 0 < images < fewest,
    }
    return [text for text, is_so in checks.items() if is_so]


def _differ(has_sensor: bool, num_clouds: int | None) -> bool:
    return num_clouds is not None and has_sensor != (num_clouds > 0)


def _own_row(data: Dataset) -> dict[str, Any]:
    """A data set of this package as a row, from its manifest and its tables.

    Every frame holds position, heading and size of every vehicle: a 3D bounding box. Dawn stands,
    as the paper's horizon line does, for a sun that is low ahead.

    Args:
        data: The data set; frames and states are not read.
    """
    simulations, weather = data.table("simulations"), data.table("weather")
    num_frames = simulations["num_frames"].to_numpy().astype("int64")
    duration = num_frames * simulations["frame_interval_ms"].to_numpy()
    identity = data.manifest.identity
    num_classes = len(data.table("vehicles")["kind"].unique())
    occurs = {
        "night": weather["night"].to_numpy(zero_copy_only=False).any(),
        "rain": (weather["rain_percent"].to_numpy() > 0).any(),
        "dawn": weather["low_sun"].to_numpy(zero_copy_only=False).any(),
    }
    return {
        "id": data.name,
        "name": data.name,
        "year": int(data.manifest.provenance.started[:4]),
        "num_scenes": len(data),
        "duration_h": float(duration.sum()) / _MS_PER_H,
        "num_images": 0,
        "num_lidar_clouds": 0,
        "num_radar_clouds": 0,
        "num_annotated_frames": int(num_frames.sum()),
        "boxes_3d": True,
        "num_map_layers": 0,
        "min_classes": num_classes,
        "max_classes": num_classes,
        "conditions": tuple(word for word in occurs if occurs[word]),
        "locations": f"{'Recorded' if identity.source else 'Simulated'} on {identity.road.name}",
        "sensors": (),
        "traffic": ("highway",),
        "annotations": ("3d",),
        "reference": _OWN,
        "source": _OWN,
        "corrections": (),
        "doubts": [],
    }
