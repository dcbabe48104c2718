"""Records of the literature: system, data set, factor, study, correction and reference.

Pydantic checks them when they are read: types, names, and that every source is on record.
"""

from collections.abc import Callable, Collection
from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, ConfigDict, Field
from pydantic.dataclasses import dataclass

from overtaking.knowledge.quantities import SOURCE_KINDS
from overtaking.knowledge.toml_reader import load_toml

Mark = Literal["--", "-", "+", "++"]
"""The paper's marks of comfort and safety, from little to much."""

Condition = Literal["night", "rain", "snow", "dawn"]
Sensor = Literal["video", "lidar", "gps", "thermal_camera", "radar"]
Traffic = Literal["urban", "highway", "residential", "rural", "campus"]
Annotation = Literal["pixel", "instance", "point_cloud", "2d", "3d"]

MEMBERS: dict[str, tuple[str, ...]] = {
    "conditions": get_args(Condition),
    "sensors": get_args(Sensor),
    "traffic": get_args(Traffic),
    "annotations": get_args(Annotation),
}
"""The values that each set-valued column of a data set can hold, as in the paper's table."""

Value = str | int | float | bool | tuple[str, ...] | None
"""A cell of a table; None: not reported."""


def _among(known: Callable[[], Collection[str]]) -> AfterValidator:
    """A check that a name is known; the names are looked up when a record is read."""

    def check(name: str) -> str:
        if name not in known():
            raise ValueError(f"one of {', '.join(known())}")
        return name

    return AfterValidator(check)


Cited = Annotated[str, _among(lambda: load_toml("literature/sources.toml"))]
"""The id of a reference."""

_CHECKED = ConfigDict(extra="forbid", strict=True)


@dataclass(frozen=True, kw_only=True, config=_CHECKED)
class Reference:
    """A publication that a record cites.

    Attributes:
        id: Short name by which records cite it.
        citation: Author, year, title, and a DOI or an official number.
        kind: One of `knowledge.quantities.SOURCE_KINDS`.
        checked: Whether we read the values in the source itself.
    """

    id: str
    citation: str
    kind: Annotated[str, _among(lambda: SOURCE_KINDS)]
    checked: bool


@dataclass(frozen=True, kw_only=True, config=_CHECKED)
class Correction:
    """A cell of the paper's table that is wrong.

    Attributes:
        column: Name of the column.
        printed: The value in the paper.
        value: The right value; None if there is none.
        source: Id of the reference that shows it.
        why: What the reference shows, in one sentence.
    """

    column: str
    printed: Value
    value: Value
    source: Cited
    why: str

    def __post_init__(self) -> None:
        """Refuse a correction that corrects nothing."""
        if self.value == self.printed:
            raise ValueError("another value than the printed one")


@dataclass(frozen=True, kw_only=True, config=_CHECKED)
class System:
    """A driving system or driver assistance system.

    Attributes:
        id: Short name.
        name: Its name.
        does: What it does.
        sae_level: Level of driving automation by SAE J3016, 0 to 5.
        comfort: Its effect on comfort.
        safety: Its effect on safety.
        source: Id of the reference of the row.
        corrections: The corrections that were applied.
    """

    id: str
    name: str
    does: str
    sae_level: Annotated[int, Field(ge=0, le=5)]
    comfort: Mark
    safety: Mark
    source: Cited
    corrections: tuple[Correction, ...] = ()


@dataclass(frozen=True, kw_only=True, config=_CHECKED)
class DrivingDataset:
    """A driving data set; None is a dash in the paper's table.

    Attributes:
        id: Short name.
        name: Its name.
        year: Year of publication.
        num_scenes: Number of scenes.
        duration_h: Total length of its recordings [h].
        num_images: Number of colour images.
        num_lidar_clouds: Number of point clouds of lidars.
        num_radar_clouds: Number of point clouds of radars.
        num_annotated_frames: Number of labelled frames.
        boxes_3d: Whether objects have 3D bounding boxes.
        num_map_layers: Number of map layers.
        min_classes: Number of object classes; the smallest if it varies.
        max_classes: The largest; equals `min_classes` if it does not vary.
        conditions: Light and weather that occur in it.
        locations: Where it was recorded.
        sensors: Sensors that recorded it.
        traffic: Kinds of road in it.
        annotations: Kinds of label in it.
        reference: Id of the reference that presents it.
        source: Id of the reference of the row.
        corrections: The corrections that were applied.
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
    conditions: tuple[Condition, ...]
    locations: str
    sensors: tuple[Sensor, ...]
    traffic: tuple[Traffic, ...]
    annotations: tuple[Annotation, ...]
    reference: Cited
    source: Cited
    corrections: tuple[Correction, ...] = ()


@dataclass(frozen=True, kw_only=True, config=_CHECKED)
class Factor:
    """A factor that makes driving easy or hard.

    Attributes:
        id: Short name.
        name: Its name.
        kind: Whether it can be seen (explicit) or must be inferred (implicit).
        acts: How it acts.
        columns: Columns of our tables that measure it, as table.column.
        source: Id of the reference.
    """

    id: str
    name: str
    kind: Literal["explicit", "implicit"]
    acts: str
    columns: tuple[str, ...]
    source: Cited


@dataclass(frozen=True, kw_only=True, config=_CHECKED)
class StudyFactor:
    """A factor in a study of overtaking.

    Attributes:
        name: Its name.
        columns: Columns of our tables that measure it, as table.column.
        category: A: vehicle ahead, B: other vehicles, C: ego; None: not reported.
        accuracy_percent: Accuracy of the study's model with this factor and those before it
            [0, 100]; None: factors are not ranked.
    """

    name: str
    columns: tuple[str, ...]
    category: Literal["A", "B", "C"] | None = None
    accuracy_percent: float | None = None


@dataclass(frozen=True, kw_only=True, config=_CHECKED)
class Study:
    """A study of overtaking decisions.

    Attributes:
        id: Short name.
        name: Authors and year.
        about: Its subject.
        finding: Its result.
        source: Id of the reference.
        factors: The factors, by rank if it ranked them.
        remark: Where the paper's text contradicts its table; None if it does not.
    """

    id: str
    name: str
    about: str
    finding: str
    source: Cited
    factors: tuple[StudyFactor, ...]
    remark: str | None = None
