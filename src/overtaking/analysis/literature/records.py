"""The nouns of the literature: a system, a data set, a factor, a study and a correction."""

from __future__ import annotations

from dataclasses import dataclass

SAE_LEVELS = range(6)
"""The levels of driving automation of SAE J3016."""

MARKS = ("--", "-", "+", "++")
"""The paper's marks of comfort and safety, from little to much."""

FACTOR_KINDS = ("explicit", "implicit")
"""Whether a factor can be seen or must be inferred."""

CONDITIONS = ("night", "rain", "snow", "dawn")
SENSORS = ("video", "lidar", "gps", "thermal_camera", "radar")
TRAFFIC = ("urban", "highway", "residential", "rural", "campus")
ANNOTATIONS = ("pixel", "instance", "point_cloud", "2d", "3d")

MEMBERS = {
    "conditions": CONDITIONS,
    "sensors": SENSORS,
    "traffic": TRAFFIC,
    "annotations": ANNOTATIONS,
}
"""What the columns of a data set that hold several things can hold, as the paper's columns."""

Value = str | int | float | bool | tuple[str, ...] | None
"""What a cell of one of the tables holds; None is what nobody says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """One cell of the paper's table that is wrong.

    Attributes:
        column: Which column.
        printed: What the paper prints.
        value: What is right.
        source: Id of the reference that shows it.
        why: What it shows, in one sentence.
    """

    column: str
    printed: Value
    value: Value
    source: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class System:
    """A system that drives, or helps to.

    Attributes:
        id: Short name.
        name: Its name.
        does: What it does.
        sae_level: Level of driving automation by SAE J3016, 0 to 5.
        comfort: What it does for comfort, one of `MARKS`.
        safety: What it does for safety, one of `MARKS`.
        source: Id of the reference of the row.
        corrections: What the paper prints otherwise; empty if values are as printed.
    """

    id: str
    name: str
    does: str
    sae_level: int
    comfort: str
    safety: str
    source: str
    corrections: tuple[Correction, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivingDataset:
    """A data set of driving; None is a dash in the paper's table.

    Attributes:
        id: Short name.
        name: Its name.
        year: When it was published.
        num_scenes: Number of scenes.
        duration_h: Length of all recordings [h].
        num_images: Number of colour images.
        num_lidar_clouds: Number of point clouds of lidars.
        num_radar_clouds: Number of point clouds of radars.
        num_annotated_frames: Number of frames that have labels.
        boxes_3d: Whether objects have boxes in three dimensions.
        num_map_layers: Number of layers of its maps.
        min_classes: Number of classes of objects, the smallest if it depends.
        max_classes: The largest; equal to `min_classes` if it does not depend.
        conditions: Those of `CONDITIONS` that occur in it.
        locations: Where it was recorded.
        sensors: Those of `SENSORS` that recorded it.
        traffic: Those of `TRAFFIC` that occur in it.
        annotations: Those of `ANNOTATIONS` that it has.
        reference: Id of the reference that presents it.
        source: Id of the reference of the row.
        corrections: What the paper prints otherwise; empty if values are as printed.
    """

    id: str
    name: str
    year: int | None = None
    num_scenes: int | None = None
    duration_h: float | None = None
    num_images: int | None = None
    num_lidar_clouds: int | None = None
    num_radar_clouds: int | None = None
    num_annotated_frames: int | None = None
    boxes_3d: bool
    num_map_layers: int | None = None
    min_classes: int | None = None
    max_classes: int | None = None
    conditions: tuple[str, ...]
    locations: str
    sensors: tuple[str, ...]
    traffic: tuple[str, ...]
    annotations: tuple[str, ...]
    reference: str
    source: str
    corrections: tuple[Correction, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Factor:
    """Something that makes driving easy or hard.

    Attributes:
        id: Short name.
        name: Its name.
        kind: One of `FACTOR_KINDS`.
        acts: How it acts.
        columns: Our columns that measure it, as table.column; empty if none does.
        source: Id of the reference.
    """

    id: str
    name: str
    kind: str
    acts: str
    columns: tuple[str, ...]
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyFactor:
    """Something that a study of overtaking looked at.

    Attributes:
        name: Its name.
        columns: Our columns that measure it, as table.column; empty if none does.
        category: A the vehicle ahead, B those around, C the ego; None if the study has none.
        accuracy_percent: Accuracy of the study's model with this factor and those before it, 0 to
            100; None if the study did not rank its factors.
    """

    name: str
    columns: tuple[str, ...]
    category: str | None = None
    accuracy_percent: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study of what decides about an overtake.

    Attributes:
        id: Short name.
        name: Authors and year.
        about: What it is about.
        finding: What it found.
        source: Id of the reference.
        factors: What it looked at, by rank if it ranked them.
        remark: Where the paper's account and its table part; None if they do not.
    """

    id: str
    name: str
    about: str
    finding: str
    source: str
    factors: tuple[StudyFactor, ...]
    remark: str | None = None
