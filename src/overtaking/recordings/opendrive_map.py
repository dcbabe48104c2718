"""What roads an OpenDRIVE file has: their course, lanes and slopes, and which can be simulated."""

from dataclasses import dataclass
from pathlib import Path

from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ImportFormatError
from overtaking.model.reference_line import ReferenceLine
from overtaking.model.road import Road
from overtaking.recordings.messages import shown
from overtaking.recordings.opendrive import road_choice, roads_in
from overtaking.recordings.opendrive_lanes import Side, SideSections
from overtaking.recordings.opendrive_plan import plan
from overtaking.recordings.opendrive_route import Choice, Part, first_way, is_in_junction, read_part
from overtaking.recordings.opendrive_shape import Profile
from overtaking.recordings.xml import Element


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedRoad(ContentEquality):
    """One road of a map.

    Attributes:
        road_id: Id in the file.
        name: Name in the file, which may be empty.
        in_junction: Whether it is a way across a junction.
        length: Length of its reference line [m].
        right: Most driving lanes right of the reference line at one place.
        left: Most driving lanes left of it at one place.
        line: The reference line; None where the file states none that can be read.
        steepest: Largest slope, up or down [1]; None where none can be read.
        leads_to: Id of the road that traffic comes to without a junction, None where there is none.
        part: The part of the road that is simulated, None where it cannot be.
        road: The road as it is simulated, None where it cannot be.
        refusal: Why it cannot be simulated; None where it can be.
    """

    road_id: str
    name: str
    in_junction: bool
    length: float
    right: int
    left: int
    line: ReferenceLine | None
    steepest: float | None
    leads_to: str | None
    part: Part | None
    road: Road | None
    refusal: str | None

    @property
    def radius(self) -> float | None:
        """Radius of the sharpest bend [m]; None where the road is straight, or not readable."""
        sharpest = 0.0 if self.line is None else self.line.max_curvature
        return 1.0 / sharpest if sharpest > 0.0 else None


def list_opendrive_roads(
    path: str | Path, *, speed_limit: float | None = None, driving_side: Side | None = None
) -> list[MappedRoad]:
    """Every road of an OpenDRIVE file, in its order.

    A road that is damaged is listed with the reason; the others are read all the same.

    Args:
        path: The file, not compressed.
        speed_limit: Limit in place of all of the file's [m/s].
        driving_side: Side of the road that traffic keeps to, in place of the file's.

    Raises:
        ConfigError: The limit is out of range, or the side unknown.
        ImportFormatError: The file as a whole cannot be read.
    """
    choice = road_choice(speed_limit=speed_limit, driving_side=driving_side)
    return [_mapped(Path(path), road, choice) for road in roads_in(Path(path))]


def _mapped(path: Path, road: Element, choice: Choice) -> MappedRoad:
    """One road from its element."""
    line, steepest, length, right, left = None, None, 0.0, 0, 0
    leads_to, route, refusal = None, None, None
    try:
        length = road.number("length")
        right, left = (_most_lanes(road, side, length) for side in ("right", "left"))
        line, steepest = plan(road), _steepest(road, length)
        leads_to = first_way(road, choice).leads_to
        route = read_part(path, road, choice)
    except ImportFormatError as error:
        refusal = str(error)
    return MappedRoad(
        road_id=shown(road.attribute("id", default="")),
        name=shown(road.attribute("name", default="")),
        in_junction=is_in_junction(road),
        length=length if line is None else line.length,
        right=right,
        left=left,
        line=line,
        steepest=steepest,
        leads_to=None if leads_to is None else shown(leads_to),
        part=None if route is None else route.parts[0],
        road=None if route is None else route.road,
        refusal=refusal,
    )


def _most_lanes(road: Element, side: Side, length: float) -> int:
    """The largest number of driving lanes that lie beside each other on a side."""
    sections = SideSections.of(road, side, length).sections
    return max((len(section.driving) for section in sections), default=0)


def _steepest(road: Element, length: float) -> float:
    """The largest slope of a road, up or down [1]."""
    heights = road.optional("elevationProfile")
    profile = Profile.of([] if heights is None else heights.all("elevation"))
    slopes = [piece.slope.extremes(span) for piece, span in profile.spans(0.0, length)]
    return max((abs(slope) for ends in slopes for slope in ends), default=0.0)
