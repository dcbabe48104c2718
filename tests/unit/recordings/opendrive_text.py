"""Small OpenDRIVE texts of our own, assembled from parts that a test can replace."""

from collections.abc import Sequence

LINE = '<geometry s="0" x="10" y="-20" hdg="0.5" length="500"><line/></geometry>'
FLAT = '<elevation s="0" a="3" b="0" c="0" d="0"/>'
TYPE = '<type s="0" type="motorway"><speed max="120" unit="km/h"/></type>'


def lane(
    lane_id: int,
    *,
    kind: str = "driving",
    width: float | str = 3.5,
    mark: str = "broken",
    attributes: str = "",
    more: str = "",
) -> str:
    """A lane; `width` is a number or the text of its elements."""
    if not isinstance(width, str):
        width = f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/>'
    roadmark = f'<roadMark sOffset="0" type="{mark}"/>' if mark else ""
    return (
        f'<lane id="{lane_id}" type="{kind}" level="false" {attributes}>'
        f"<link/>{width}{roadmark}{more}</lane>"
    )


RIGHT = (
    lane(-1, kind="shoulder", width=1.0, mark="solid"),
    lane(-2, width=3.75),
    lane(-3, width=3.5, mark="solid"),
    lane(-4, kind="shoulder", width=2.5, mark="none"),
)
LEFT = (lane(1, width=3.25, mark="solid broken"), lane(2, width=3.0, mark="solid"))
ONE_LANE = (lane(-1, mark="solid"),)


def section(
    *,
    s: float | str = 0,
    left: Sequence[str] = (),
    centre: str = "solid",
    right: Sequence[str] = (),
) -> str:
    """A lane section with the mark of its centre line."""
    return (
        f'<laneSection s="{s}"><left>{"".join(left)}</left>'
        f'<center><lane id="0" type="none"><roadMark sOffset="0" type="{centre}"/></lane></center>'
        f"<right>{''.join(right)}</right></laneSection>"
    )


def road(
    *,
    road_id: str = "7",
    header: str = 'junction="-1"',
    length: str = "500",
    kind: str = TYPE,
    plan: str = LINE,
    elevation: str = FLAT,
    lateral: str = "",
    offset: str = "",
    sections: str | None = None,
) -> str:
    """A straight road, 500 m long, in which each part can be replaced."""
    if sections is None:
        sections = section(left=LEFT, right=RIGHT)
    return (
        f'<road name="r" id="{road_id}" length="{length}" {header}><link/>{kind}'
        f"<planView>{plan}</planView><elevationProfile>{elevation}</elevationProfile>"
        f"<lateralProfile>{lateral}</lateralProfile>"
        f"<lanes>{offset}{sections}</lanes><objects><object id='1'/></objects></road>"
    )


def document(*roads: str) -> str:
    """A file with some roads, one a line from line 3 on."""
    lines = ['<?xml version="1.0"?>', '<OpenDRIVE><header revMajor="1" revMinor="6"/>', *roads]
    return "\n".join(lines) + "</OpenDRIVE>"
