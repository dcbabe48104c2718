"""Which data sets have what one needs, and where the figures of one contradict each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from overtaking.analysis.literature.records import MEMBERS
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from overtaking.analysis.literature.records import DrivingDataset

BOXES = "boxes3d"
"""The word for boxes in three dimensions."""

_COLUMNS = {word: column for column, words in MEMBERS.items() for word in words}

WORDS = (*_COLUMNS, BOXES)
"""What one can ask of a data set."""

_SLOWEST_IMAGES_PER_S = 0.1


def select(rows: Iterable[DrivingDataset], wanted: Collection[str]) -> list[DrivingDataset]:
    """The data sets that have all that is wanted, in their order.

    Args:
        rows: The data sets.
        wanted: Words out of `WORDS`.

    Raises:
        ConfigError: There is no such word.
    """
    for word in wanted:
        if word not in WORDS:
            raise ConfigError.of(
                what="condition",
                where="literature datasets",
                expected=f"one of {', '.join(WORDS)}",
                got=word,
                next_step="choose one of them",
            )
    return [row for row in rows if all(_has(row, word) for word in wanted)]


def doubts(row: DrivingDataset) -> list[str]:
    """Where the figures of a row contradict each other, a clause each.

    A doubt is no correction: it tells that something is wrong, not what would be right.
    """
    return [text for is_so, text in _checks(row) if is_so]


def _has(row: DrivingDataset, word: str) -> bool:
    return row.boxes_3d if word == BOXES else word in getattr(row, _COLUMNS[word])


def _checks(row: DrivingDataset) -> list[tuple[bool, str]]:
    images, scenes, annotated = row.num_images, row.num_scenes, row.num_annotated_frames
    duration_s = (row.duration_h or 0.0) * 3600.0
    return [
        (_differ("lidar" in row.sensors, row.num_lidar_clouds), "lidar, or its clouds, missing"),
        (_differ("radar" in row.sensors, row.num_radar_clouds), "radar, or its clouds, missing"),
        (row.boxes_3d != ("3d" in row.annotations), "3D boxes in one half of the table only"),
        (bool(images and scenes and scenes > images), "more scenes than images"),
        (bool(images and annotated and annotated > images), "more annotated frames than images"),
        (
            bool(images) and (images or 0) < _SLOWEST_IMAGES_PER_S * duration_s,
            "less than an image in ten seconds",
        ),
    ]


def _differ(has_sensor: bool, num_clouds: int | None) -> bool:
    return num_clouds is not None and has_sensor != (num_clouds > 0)
