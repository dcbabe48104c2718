"""Whatever the bytes: a recording or one error of ours, and never another exception."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.support.recordings import Bend, Mover, commonroad, highd

from overtaking.core.errors import ConfigError, ImportFormatError
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.highd import read_highd
from overtaking.recordings.scenes import scenes

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SHORT = [
    Mover(number=1, s=10.0, lane=0, last=12, moves=((0.6, 1),), ramp=0.8),
    Mover(number=2, s=40.0, speed=20.0, last=12),
]
SCENE = commonroad(SHORT, Bend(length=100.0, cuts=(60.0,))).encode()
NASTY = [
    *(
        b"",
        b"nan",
        b"-inf",
        b"1e999",
        b"1e8",
        b"-1e8",
        b"1e-308",
        b"0",
        b"-1",
        b"1.5",
        b"999999999",
    ),
    *(b"9" * 70, "١".encode(), b"0x1p3", b"1_0", b"same", b"opposite", b"<x/>", b"&amp;", b"&x;"),
    *(b"<!DOCTYPE a [<!ENTITY x 'y'>]>", b"12", b"999999999", b"\xff", b"\x00"),
]
FEW = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])


def edits(content: bytes) -> st.SearchStrategy[list[tuple[int, int, bytes]]]:
    pieces = st.one_of(st.binary(max_size=6), st.sampled_from(NASTY))
    one = st.tuples(st.integers(0, len(content)), st.integers(0, 12), pieces)
    return st.lists(one, max_size=4)


def apply(content: bytes, changes: list[tuple[int, int, bytes]]) -> bytes:
    for place, length, inserted in changes:
        content = content[:place] + inserted + content[place + length :]
    return content


def check(read: Callable[[], object], name: str) -> None:
    """Read in each way that there is; the only errors are ours, in one line that names the file."""
    try:
        found = scenes(read())  # type: ignore[arg-type]
    except (ImportFormatError, ConfigError) as error:
        message = str(error)
        assert "\n" not in message
        assert len(message) < 1500
        assert (
            name in message or "scene" in message or "ZAM" in message or "highd" in message.lower()
        )
        return
    run = found.trajectories(range(len(found)))
    assert run.state_mask[:, 0].sum() == run.num_frames.sum()


def numbers_of(content: bytes) -> list[tuple[int, int]]:
    """Where numbers stand between tags."""
    return [found.span(1) for found in re.finditer(rb">([-0-9.e+]+)<", content)]


PLACES = numbers_of(SCENE)


def test_the_scene_that_is_damaged_is_whole_to_begin_with(tmp_path: Path):
    path = tmp_path / "scene.xml"
    path.write_bytes(SCENE)
    found = scenes(read_commonroad(path))
    assert found.counts["candidate_overtakes"] == 1


@FEW
@given(changes=edits(SCENE))
def test_damaged_scenes_never_escape(tmp_path: Path, changes):
    path = tmp_path / "scene.xml"
    path.write_bytes(apply(SCENE, changes))
    check(lambda: read_commonroad(path), path.name)


@pytest.mark.ci
@FEW
@given(place=st.sampled_from(PLACES), value=st.sampled_from(NASTY))
def test_nasty_numbers_never_escape(tmp_path: Path, place, value):
    path = tmp_path / "scene.xml"
    path.write_bytes(SCENE[: place[0]] + value + SCENE[place[1] :])
    check(lambda: read_commonroad(path), path.name)


@FEW
@given(size=st.integers(0, len(SCENE)))
def test_truncated_scenes_never_escape(tmp_path: Path, size):
    path = tmp_path / "scene.xml"
    path.write_bytes(SCENE[:size])
    check(lambda: read_commonroad(path), path.name)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY a "b">]><commonRoad/>',
            "entities are refused",
        ),
        ("<OpenDRIVE/>", "expected <commonRoad>"),
        ('<commonRoad commonRoadVersion="2017a"/>', "2018b or 2020a"),
        ('<commonRoad commonRoadVersion="2020a" timeStepSize="0"/>', "timeStepSize"),
        (
            '<commonRoad commonRoadVersion="2020a" timeStepSize="0.1" benchmarkID="x"/>',
            "expected lanelets, got none",
        ),
    ],
)
def test_what_is_no_such_scenario_is_refused_in_one_line(tmp_path: Path, text, message):
    path = tmp_path / "scene.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ImportFormatError, match=message):
        read_commonroad(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "<exact>5</exact></time>",
            "<exact>7</exact></time>",
            "expected time step 8 or later, got 6",
        ),
        (
            "<exact>5</exact></time>",
            "<exact>4</exact></time>",
            "expected time step 5 or later, got 4",
        ),
        ("<exact>5</exact></time>", "<exact>5.5</exact></time>", "no time step"),
        ("<exact>30</exact></velocity>", "<exact>1e7</exact></velocity>", "not that of a vehicle"),
        ("<length>4.5</length>", "<length>450</length>", "no size of a vehicle"),
        ("<rectangle>", "<polygon>", "well-formed|is not known"),
        ('<obstacle id="2">', '<obstacle id="1">', "an id that another has"),
        ('<adjacentLeft ref="12"', '<adjacentLeft ref="13"', "neighbours that do not fit"),
    ],
)
def test_what_contradicts_itself_is_refused_with_its_line(tmp_path: Path, old, new, message):
    movers = [Mover(number=1, s=10.0, speed=30.0, last=12), Mover(number=2, s=60.0, last=12)]
    text = commonroad(movers, Bend(length=100.0), version="2018b")
    assert old in text
    path = tmp_path / "scene.xml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ImportFormatError, match=rf"scene\.xml.* line \d+.*({message})"):
        read_commonroad(path)


# --- highD ---


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("highd")


@pytest.mark.ci
@FEW
@given(name=st.sampled_from(["tracks", "tracksMeta", "recordingMeta"]), data=st.data())
def test_damaged_tables_never_escape(folder: Path, name, data):
    path = highd(folder, lower=SHORT)
    victim = folder / f"01_{name}.csv"
    content = victim.read_bytes()
    victim.write_bytes(apply(content, data.draw(edits(content))))
    check(lambda: read_highd(path), "01_")


@FEW
@given(name=st.sampled_from(["tracks", "tracksMeta", "recordingMeta"]), data=st.data())
def test_nasty_cells_never_escape(folder: Path, name, data):
    path = highd(folder, lower=SHORT)
    victim = folder / f"01_{name}.csv"
    lines = victim.read_bytes().splitlines()
    row = data.draw(st.integers(0, len(lines) - 1))
    cells = lines[row].split(b",")
    cells[data.draw(st.integers(0, len(cells) - 1))] = data.draw(st.sampled_from(NASTY))
    lines[row] = b",".join(cells)
    victim.write_bytes(b"\n".join(lines) + b"\n")
    check(lambda: read_highd(path), "01_")
