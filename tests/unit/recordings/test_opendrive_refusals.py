"""What an OpenDRIVE file may hold and the model does not: each refused with the reason."""

import math
from pathlib import Path

import pytest

from overtaking.core.errors import ImportFormatError
from overtaking.recordings.opendrive import read_opendrive

from .opendrive_text import FLAT, LINE, ONE_LANE, document, lane, road, section

BENT = (
    '<geometry s="0" x="0" y="0" hdg="0" length="250"><line/></geometry>'
    '<geometry s="250" x="250" y="0" hdg="0.3" length="250"><line/></geometry>'
)
GAP = BENT.replace('x="250"', 'x="251"').replace("0.3", "0")
BACK = (
    '<geometry s="0" x="0" y="0" hdg="0" length="250"><line/></geometry>'
    f'<geometry s="250" x="250" y="0" hdg="{math.pi}" length="250"><line/></geometry>'
)
SHORT = LINE.replace("500", "400")
HILL = (
    '<elevation s="0" a="0" b="0" c="0" d="0"/><elevation s="50" a="0" b="0" c="0.001" d="-1e-5"/>'
)
STEP = FLAT + FLAT.replace('s="0" a="3"', 's="50" a="3.2"')
ROLL = '<superelevation s="0" a="0" b="0.001" c="0" d="0"/>'
ALL_ALONG = '<width sOffset="0" a="3.5" b="0.001" c="0" d="0"/>'
SLOWER = '<speed max="20"/>'


@pytest.mark.parametrize(
    ("text", "element", "reason"),
    [
        (
            road(header='junction="12"'),
            "road",
            'a junction: expected a road outside junctions, got junction "12"',
        ),
        (road(header='rule="XYZ"'), "road", 'attribute rule: expected RHT or LHT, got "XYZ"'),
        (road(length="0"), "road", "attribute length: expected more than 0"),
        (road(length="1e6"), "road", "attribute length: expected more than 0 and at most 100000"),
        (road(length="nan"), "road", "attribute length: expected a finite number"),
        (road(plan=""), "road", "has no geometry"),
        (
            road(plan=LINE.replace("<line/>", "")),
            "geometry",
            "expected line or arc or spiral or paramPoly3 or poly3, got 0 of them",
        ),
        (
            road(plan=LINE.replace("<line/>", '<paramPoly3 aU="0"/>')),
            "paramPoly3",
            "expected an attribute bU, got none",
        ),
        (
            road(plan=LINE.replace("<line/>", '<poly3 a="0"/>')),
            "poly3",
            "expected an attribute b, got none",
        ),
        (
            road(plan=LINE.replace("<line/>", '<arc curvature="0.2"/>')),
            "road",
            "expected bends of at least 10 m radius, got 5.00 m",
        ),
        (road(plan=BENT), "geometry", "does not join: expected at most 0.05 m and 0.1 rad"),
        (road(plan=BACK), "geometry", "does not join: expected at most 0.05 m and 0.1 rad"),
        (road(plan=GAP), "geometry", "does not join: expected at most 0.05 m and 0.1 rad"),
        (
            road(plan=SHORT),
            "road",
            "does not end with its line: expected a line of 500 m, got 400 m",
        ),
        (
            road(plan=LINE.replace("0.5", "NaN")),
            "geometry",
            'attribute hdg: expected a finite number, got "NaN"',
        ),
        (
            road(plan=LINE.replace('x="10"', 'x="1e999"')),
            "geometry",
            "attribute x: expected a number of size",
        ),
        (road(plan=LINE.replace('x="10" ', "")), "geometry", "expected an attribute x, got none"),
        (road(elevation=HILL), "road", "grade: expected 0 to 100000 m, and -0.2 to 0.2"),
        (road(elevation=STEP), "elevation", "steps after s = 50.0 m: expected a flat road"),
        (road(lateral=ROLL), "superelevation", "is banked after s = 0.0 m: expected a flat road"),
        (
            road(lateral='<shape s="0" t="0" a="1" b="0" c="0" d="0"/>'),
            "shape",
            "bends the surface",
        ),
        (road(sections=" "), "lanes", "expected a <laneSection> from s = 0 on, got 0 sections"),
        (
            road(sections=section(s=5, right=ONE_LANE)),
            "lanes",
            "expected a <laneSection> from s = 0 on",
        ),
        (
            road(
                sections=section(right=ONE_LANE)
                + section(s=9, right=ONE_LANE)
                + section(s=8, right=ONE_LANE)
            ),
            "laneSection",
            "attribute s: expected ascending values, got 8",
        ),
        (
            road(sections=section()),
            "laneSection",
            "at s = 0.0 m, right side: expected 1 to 8 driving lanes, got 0",
        ),
        (
            road(sections=section(right=[lane(-n) for n in range(1, 10)])),
            "laneSection",
            "expected 1 to 8 driving lanes, got 9",
        ),
        (
            road(sections=section(right=[lane(-1), lane(-2, kind="median"), lane(-3)])),
            "lane",
            '-2 at s = 0.0 m: expected driving lanes side by side, got "median"',
        ),
        (
            road(sections=section(right=[lane(-1), lane(-3)])),
            "lane",
            "attribute id: expected ids -1, -2, ... without gaps",
        ),
        (
            road(sections=section(right=[lane(-1, width=1.5)])),
            "lane",
            "-1 has a width: expected 2 to 6 m, got 1.500 m",
        ),
        (
            road(sections=section(right=[lane(-1, width=6.5)])),
            "lane",
            "-1 has a width: expected 2 to 6 m",
        ),
        (
            road(sections=section(right=[lane(-1, width=-3.0)])),
            "width",
            "of lane -1: expected a width of at least 0",
        ),
        (
            road(sections=section(right=[lane(-1, width='<border sOffset="0" a="-3"/>')])),
            "lane",
            "-1 has no width: expected a <width> from sOffset = 0 on, got <border>",
        ),
        (
            road(
                header='rule="RHT"',
                sections=section(right=[lane(-1, attributes='direction="reversed"')]),
            ),
            "lane",
            "-1 has a direction: expected that of the lanes on its side of the reference line",
        ),
        (
            road(sections=section(right=[lane(-1, attributes='direction="both"')])),
            "lane",
            "-1 has a direction: expected that of the lanes on its side of the reference line",
        ),
        (
            road(kind='<type s="0" type="motorway"><speed max="-5"/></type>'),
            "speed",
            "attribute max: expected more than 0",
        ),
        (
            road(kind='<type s="0" type="motorway"><speed max="5" unit="knots"/></type>'),
            "speed",
            'attribute unit: expected m/s, km/h or mph, got "knots"',
        ),
        (
            road(sections=section(right=[lane(-1, more=SLOWER), lane(-2)])),
            "road",
            "has several speed limits: expected one for all driving lanes, got 20.00 m/s, none",
        ),
        (
            road(sections=section(right=[lane(-1, width=ALL_ALONG)])),
            "width",
            "of lane -1 varies after s = 0.0 m: expected a constant 3.500 m",
        ),
        (
            road(sections=section(right=[lane(-1), lane(-2, kind="border", width=200)])),
            "road",
            "is beyond the model",
        ),
    ],
)
def test_what_is_not_supported_is_refused_by_road_line_element_and_reason(
    tmp_path: Path, text: str, element: str, reason: str
):
    path = tmp_path / "map.xodr"
    path.write_text(document(text), encoding="utf-8")
    lanes = "right" if "right side" in reason else None
    with pytest.raises(ImportFormatError) as caught:
        read_opendrive(path, 7, lanes=lanes)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"map.xodr: road 7: line 3: <{element}> ")
    assert reason in message
