"""Whatever the bytes: a road or an `ImportFormatError`, never another exception."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from overtaking.core.errors import ImportFormatError
from overtaking.model.road import Road
from overtaking.recordings.opendrive import read_opendrive, survey_opendrive
from overtaking.recordings.opendrive_map import list_opendrive_roads

from .opendrive_text import LEFT, RIGHT, document, road, section

OFFSET = '<laneOffset s="0" a="0.5" b="0" c="0" d="0"/>'
ROLL = '<superelevation s="0" a="0.01" b="0" c="0" d="0"/>'
SECTIONS = section(left=LEFT, right=RIGHT) + section(s=250, left=LEFT, right=RIGHT)
WHOLE = document(
    road(offset=OFFSET, lateral=ROLL, sections=SECTIONS), road(road_id="8", header='junction="2"')
).encode()

VALUES = re.compile(rb'="([^"]*)"')
PLACES = [found.span(1) for found in VALUES.finditer(WHOLE)]
NASTY = [
    *("", "nan", "-inf", "1e999", "1e308", "-1e8", "1e8", "1e-308", "-0.0", "0", "-1", "1", "2"),
    *("3.5", "1e7", "9" * 70, "١", "0x1p3", "1_0", "true", "driving", "solid solid", "LHT"),
    *("a\nb", "&#0;", "&amp;", "\u2028", "no limit", "undefined", "town", "mph", "curb"),
]

edits = st.lists(
    st.tuples(
        st.integers(0, len(WHOLE)),
        st.integers(0, 12),
        st.one_of(st.binary(max_size=6), st.sampled_from([b"<", b">", b"/", b'"', b"&", b"]]>"])),
    ),
    max_size=4,
)


def check(path: Path, content: bytes) -> None:
    """Read a file in each way that there is."""
    path.write_bytes(content)
    for options in ({}, {"lanes": "right"}, {"lanes": "left"}, {"speed_limit": 30.0}):
        try:
            found = read_opendrive(path, 7, **options)
        except ImportFormatError as error:
            message = str(error)
            assert message.isprintable()
            assert path.name in message
        else:
            assert isinstance(found, Road)
    try:
        verdicts = survey_opendrive(path)
    except ImportFormatError:
        return
    assert all(isinstance(one, Road | ImportFormatError) for one in verdicts.values())
    assert all((one.road is None) != (one.refusal is None) for one in list_opendrive_roads(path))


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzz") / "fuzz.xodr"


def test_the_text_that_is_damaged_is_whole_to_begin_with(path: Path):
    path.write_bytes(WHOLE)
    assert read_opendrive(path, 7).num_lanes == 2
    assert read_opendrive(path, 7, lanes="left").num_lanes == 2


@given(edits=edits)
def test_damaged_bytes_never_escape(path: Path, edits: list[tuple[int, int, bytes]]):
    content = WHOLE
    for place, length, inserted in edits:
        content = content[:place] + inserted + content[place + length :]
    check(path, content)


@given(size=st.integers(0, len(WHOLE)))
def test_truncation_never_escapes(path: Path, size: int):
    check(path, WHOLE[:size])


@pytest.mark.ci
@given(
    changes=st.dictionaries(
        st.sampled_from(PLACES),
        st.one_of(
            st.sampled_from(NASTY),
            st.floats().map(repr),
            st.text(st.characters(blacklist_characters='"<&', codec="utf-8"), max_size=8),
        ),
        min_size=1,
        max_size=4,
    )
)
def test_hostile_values_never_escape(path: Path, changes: dict[tuple[int, int], str]):
    content = WHOLE
    for (start, end), value in sorted(changes.items(), reverse=True):
        content = content[:start] + value.encode() + content[end:]
    check(path, content)


@pytest.mark.ci
@given(
    place=st.integers(0, WHOLE.count(b"><")),
    tag=st.sampled_from([b"line", b"arc", b"lane", b"width", b"left", b"lanes", b"speed", b"type"]),
    count=st.integers(1, 3),
)
def test_elements_in_the_wrong_place_never_escape(path: Path, place: int, tag: bytes, count: int):
    parts = WHOLE.split(b"><")
    inserted = b"><" + b"><".join([tag + b"/"] * count) + b"><"
    check(path, b"><".join(parts[: place + 1]) + inserted + b"><".join(parts[place + 1 :]))


@pytest.mark.ci
@given(data=st.data())
def test_damaged_pieces_of_real_maps_never_escape(path: Path, shared_data: Path, data):
    name = data.draw(st.sampled_from(["Town04.xodr", "Town06.xodr", "esmini_two_plus_one.xodr"]))
    head = (shared_data / "opendrive" / name).read_bytes()[:30_000]
    cut = data.draw(st.integers(0, len(head)))
    place = data.draw(st.integers(0, cut))
    inserted = data.draw(st.binary(max_size=4))
    closed = head[: head.rfind(b"</road>", 0, cut) + 7] + b"</OpenDRIVE>"
    check(path, head[:place] + inserted + head[place:cut])
    check(path, closed[:place] + inserted + closed[place + len(inserted) :])
