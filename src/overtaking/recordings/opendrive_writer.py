"""One straight road as OpenDRIVE, for simulators and for scenarios in OpenSCENARIO.

The reference line is the road's own, so that stations, offsets and lane ids are the same in the
file; where lane ids say that traffic runs against the line, the line runs the other way.
"""

from math import cos, pi, remainder, sin, tau
from typing import NamedTuple

from overtaking.core.errors import ConfigError
from overtaking.core.units import kmh_from_mps
from overtaking.model.road import DrivingSide, Lane, Road, RoadMark
from overtaking.recordings.opendrive_lanes import MARKS
from overtaking.recordings.xml import quoted

_NAMES = {mark: name for name, mark in MARKS.items()}
_NAMES[RoadMark.OTHER] = "none"  # OpenDRIVE has no word for an unknown mark.
_MARK_WIDTH = 0.15
"""Width of a painted line, as on Portuguese motorways [m]."""

_TAIL = 10.0
"""Length of the last lane section [m]: CARLA's topology, on which its Traffic Manager drives, has
pairs of successive lane sections, so a road needs two of them and is driven up to the last."""
_NO_PLACE = "+proj=tmerc +lat_0=0 +lon_0=0 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs"


class _Strip(NamedTuple):
    """A lane as the file has it: its outer border is the one away from the reference line."""

    lane_id: int
    kind: str
    width: float
    outer_mark: RoadMark


def write_opendrive(road: Road, *, road_id: str = "1") -> str:
    """The text of an OpenDRIVE 1.7 file with one road.

    Args:
        road: The road. `read_opendrive` gives it back, under the name of the file.
        road_id: Its id in the file.

    Raises:
        ConfigError: Its lane ids are not consecutive ones of one side, or it bends.
    """
    road.needs_to_be_straight("write_opendrive")
    right = road.lanes[0].lane_id < 0
    along = right == (road.driving_side is DrivingSide.RIGHT)
    strips = _strips(road)
    start = 0.0 if along else road.length
    x = road.x0 + start * cos(road.heading)
    y = road.y0 + start * sin(road.heading)
    heading = road.heading if along else remainder(road.heading + pi, tau)
    inner = _inner_edge(road) * (1.0 if along else -1.0)
    limit = kmh_from_mps(road.speed_limit)
    side = "right" if right else "left"
    name = quoted(road.name)
    rule = "RHT" if road.driving_side is DrivingSide.RIGHT else "LHT"
    stations = [0.0, road.length - _TAIL] if road.length > 2.0 * _TAIL else [0.0]
    links = [("successor",), ("predecessor",)] if len(stations) > 1 else [()]
    ordered = strips if right else strips[::-1]
    centre = f"<center>{_lane(_Strip(0, 'none', 0.0, _centre_mark(road)))}</center>"
    sections = ""
    for station, linked in zip(stations, links, strict=True):
        group = f"<{side}>{''.join(_lane(strip, linked) for strip in ordered)}</{side}>"
        section = centre + group if right else group + centre
        sections += f'<laneSection s="{station!r}">{section}</laneSection>\n'
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<OpenDRIVE><header revMajor="1" revMinor="7" name={name} version="1.00">'
        f"<geoReference><![CDATA[{_NO_PLACE}]]></geoReference></header>\n"
        f'<road name={name} length="{road.length!r}" id={quoted(road_id)} junction="-1"'
        f' rule="{rule}">\n'
        f'<type s="0" type={quoted(road.kind)}><speed max="{limit:.13g}" unit="km/h"/></type>\n'
        f'<planView><geometry s="0" x="{x!r}" y="{y!r}" hdg="{heading!r}"'
        f' length="{road.length!r}"><line/></geometry></planView>\n'
        '<elevationProfile><elevation s="0" a="0" b="0" c="0" d="0"/></elevationProfile>\n'
        f'<lanes><laneOffset s="0" a="{inner!r}" b="0" c="0" d="0"/>\n'
        f"{sections}</lanes>\n"
        "</road></OpenDRIVE>\n"
    )


def _beside(road: Road) -> tuple[Lane | None, Lane | None]:
    """The lanes beside the driving lanes, unless they lie across the reference line."""
    sign = road.lanes[0].lane_id
    found = (road.fast_side_neighbour, road.slow_side_neighbour)
    fast, slow = (lane if lane and lane.lane_id * sign > 0 else None for lane in found)
    return fast, slow


def _inner_edge(road: Road) -> float:
    """`d` of the border nearest to the reference line [m]."""
    fast, _ = _beside(road)
    return float(road.boundaries[-1]) + road.side * (fast.width if fast else 0.0)


def _strips(road: Road) -> list[_Strip]:
    """All lanes from the reference line outward; ids that the road lacks get lanes of no width."""
    fast, slow = _beside(road)
    lanes = [lane for lane in (fast, *reversed(road.lanes), slow) if lane]
    sign = 1 if lanes[0].lane_id > 0 else -1
    first = abs(lanes[0].lane_id)
    if [lane.lane_id for lane in lanes] != [sign * (first + k) for k in range(len(lanes))]:
        raise ConfigError.of(
            what="lane ids",
            where=f"road {road.name}",
            expected="consecutive ones, growing away from the reference line",
            got=str([lane.lane_id for lane in lanes]),
            next_step="number the lanes as OpenDRIVE does",
        )
    fillers = [_Strip(sign * k, "none", 0.0, RoadMark.NONE) for k in range(1, first)]
    if fillers:
        fillers[-1] = fillers[-1]._replace(outer_mark=_marks(road, lanes[0])[0].reversed)
    real = [_Strip(one.lane_id, one.kind, one.width, _marks(road, one)[1]) for one in lanes]
    return fillers + real


def _marks(road: Road, lane: Lane) -> tuple[RoadMark, RoadMark]:
    """The lines of a lane towards the reference line and away from it."""
    if road.driving_side is DrivingSide.RIGHT:
        return lane.left_mark, lane.right_mark
    return lane.right_mark, lane.left_mark


def _centre_mark(road: Road) -> RoadMark:
    """The line on the reference line, as a file states it: the first word names the left side."""
    fast, _ = _beside(road)
    innermost = fast or road.lanes[-1]
    if abs(innermost.lane_id) > 1:
        return RoadMark.NONE
    inner = _marks(road, innermost)[0]
    return inner.reversed if innermost.lane_id < 0 else inner


def _lane(strip: _Strip, linked: tuple[str, ...] = ()) -> str:
    """The element of a lane, which goes on in other sections if it has a width."""
    links = "".join(f'<{name} id="{strip.lane_id}"/>' for name in linked)
    link = f"<link>{links}</link>" if links and strip.width else ""
    width = f'<width sOffset="0" a="{strip.width!r}" b="0" c="0" d="0"/>' if strip.lane_id else ""
    mark = (
        f'<roadMark sOffset="0" type="{_NAMES[strip.outer_mark]}" weight="standard"'
        f' color="standard" width="{_MARK_WIDTH}" laneChange="{_allowed(strip)}"/>'
    )
    return (
        f'<lane id="{strip.lane_id}" type={quoted(strip.kind)} level="false">'
        f"{link}{width}{mark}</lane>\n"
    )


def _allowed(strip: _Strip) -> str:
    """Whether the line may be crossed, for simulators that ask the file and not the line."""
    broken = strip.outer_mark in (RoadMark.BROKEN, RoadMark.BROKEN_BROKEN, RoadMark.BOTTS_DOTS)
    return "both" if broken else "none"
