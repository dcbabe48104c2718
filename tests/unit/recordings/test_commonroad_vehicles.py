"""Vehicles of CommonRoad scenarios: what becomes of their tracks, and who comes the other way."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.support.recordings import OVERTAKE, WIDTH, Bend, Mover, commonroad

import overtaking as ot
from overtaking.core.errors import ImportFormatError
from overtaking.model.verdicts import Verdict
from overtaking.recordings.commonroad import read_commonroad
from overtaking.recordings.scenes import scenes


def test_a_missing_speed_is_measured_and_said_to_be(write):
    text = commonroad()
    bare = text.replace("<velocity><exact>30</exact></velocity>", "")
    found = read_commonroad(write(bare))
    seven = int(np.flatnonzero(found.tracks.names == "7")[0])
    rows = slice(found.tracks.start[seven], found.tracks.start[seven + 1])
    # Along the path, so a little more than 30 m/s while it crosses lanes.
    assert found.tracks.speed[rows] == pytest.approx(30.0, abs=0.1)
    assert "velocity" in found.notes["derived"]
    assert "velocity" not in read_commonroad(write(text)).notes["derived"]


def test_pedestrians_and_predictions_without_a_path_are_left_out_and_counted(write):
    walker = commonroad([Mover(number=90, kind="pedestrian")]).split("</lanelet>")[-1]
    walker = walker.replace("</commonRoad>", "")
    found = read_commonroad(write(commonroad(more=walker)))
    assert "90" not in found.tracks.names
    assert found.notes["obstacles_left_out"] == {"pedestrian": 1}


def test_a_kind_that_the_length_contradicts_is_not_known(write):
    movers = [
        Mover(number=k, s=40.0 * k, length=length, kind=kind)
        for k, (length, kind) in enumerate(
            [
                (3.6, "car"),
                (4.4, "car"),
                (5.0, "car"),
                (12.0, "car"),
                (5.0, "truck"),
                (2.2, "motorcycle"),
            ],
            start=1,
        )
    ]
    found = read_commonroad(write(commonroad(movers)))
    assert found.tracks.kind.tolist() == [0, 1, 2, 2, 4, 5]
    assert found.tracks.is_kind_known.tolist() == [True, True, True, False, True, True]


ONCOMING = (
    Mover(number=21, s=900.0, speed=-28.0, lane=3),
    Mover(number=22, s=850.0, speed=-26.0, lane=3),
)


def test_oncoming_vehicles_are_no_egos_and_meetings_are_no_passes(write):
    alone = scenes(read_commonroad(write(commonroad())))
    both = scenes(read_commonroad(write(commonroad([*OVERTAKE, *ONCOMING]))))
    assert both.notes["oncoming_left_out"] == 2
    assert alone.notes["oncoming_left_out"] == 0
    assert both.counts == alone.counts
    assert both.recording.tracks.names.tolist() == ["3", "5", "7", "9"]
    assert both.notes["states_off_the_road"] == alone.notes["states_off_the_road"]


def test_who_backs_up_or_turns_for_a_moment_stays(write):
    text = commonroad([*OVERTAKE, Mover(number=4, s=400.0, speed=-1.0, lane=2)])
    turned = f"<exact>{np.pi:.6f}</exact></orientation>"
    found = read_commonroad(write(text.replace(turned, "<exact>0</exact></orientation>")))
    assert found.tracks.names.tolist() == ["3", "4", "5", "7", "9"]


def test_a_road_with_nothing_but_oncoming_vehicles_is_refused(write):
    with pytest.raises(ImportFormatError, match="expected vehicles that drive along it, got 2"):
        read_commonroad(write(commonroad([replace(one, lane=2) for one in ONCOMING])))


OTHER_WAY = Bend(curvature=1.0 / 300.0, lanes=1, length=800.0)


def two_way(movers) -> str:
    """A road with a lane in each direction, in a bend; who comes the other way is on lane 1."""

    def backwards(left: float) -> str:
        points = re.findall(r"<point>.*?</point>", OTHER_WAY.points(0.0, OTHER_WAY.length, left))
        return "".join(points[::-1])

    beside = '<adjacentLeft ref="99" drivingDir="opposite"/><laneletType>'
    more = (
        f'<lanelet id="99"><leftBound>{backwards(WIDTH)}</leftBound>'
        f"<rightBound>{backwards(2 * WIDTH)}</rightBound>"
        "</lanelet>"
    )
    text = commonroad(movers, OTHER_WAY, more=more)
    return text.replace("<laneletType>", beside, 1)


COMERS = tuple(Mover(number=21 + k, s=540.0 + 240.0 * k, speed=-15.0, lane=1) for k in (0, 1))


def test_an_overtake_on_the_other_side_is_one_and_who_comes_is_oncoming(write):
    movers = [replace(OVERTAKE[0], speed=20.0), replace(OVERTAKE[1], speed=14.0), *COMERS]
    text = two_way([replace(one, last=199) for one in movers])
    found = scenes(read_commonroad(write(text), lanelet_id=11), attempts_only=True)
    tracks = found.recording.tracks
    assert found.road.is_two_way
    assert found.road.is_curved
    assert tracks.names[tracks.is_oncoming].tolist() == ["21", "22"]
    assert (found.notes["oncoming"], found.notes["oncoming_left_out"]) == (2, 0)
    assert (found.counts["passes"], found.counts["candidate_overtakes"]) == (1, 1)
    (window,) = found.windows
    assert tracks.names[list(window.vehicles)].tolist() == ["7", "3", "21", "22"]
    run = found.trajectories(range(1))
    assert run.scenario.start_lane.tolist() == [[0, 0, 1, 1]]
    said = ot.label(run)
    assert said.events.target_slot.tolist() == [1]
    # Both ways are told along the right edge of the road; the gap lies half a lane beside it.
    time = 0.1 * float(said.events.return_end[0])
    apart = (540.0 - 15.0 * time) - (20.0 + 20.0 * time)
    gap = apart * (1.0 - 0.5 * WIDTH / 300.0) - 4.5
    law = said.findings.rule_codes.index("L24")
    assert said.findings.verdict[0, law] == Verdict.ILLEGAL
    assert said.findings.margin[0, law] == pytest.approx(gap - (20.0 + 15.0), abs=0.02)


def test_the_other_way_of_the_same_road_is_read_by_its_own_lanelet(write):
    movers = [*COMERS, Mover(number=1, s=100.0, speed=20.0)]
    found = read_commonroad(write(two_way([replace(one, last=199) for one in movers])))
    assert found.notes["lanelets_by_lane"] == [[99]]
    assert not found.road.is_two_way  # Lanelet 99 has no neighbour on the left that it names.
    assert found.tracks.names.tolist() == ["21", "22"]
    assert found.notes["oncoming_left_out"] == 1


# --- real recordings ---


def test_passes_are_those_of_a_plain_count(shared_data):
    tracks = read_commonroad(shared_data / "commonroad" / "USA_US101-5_1_T-1.xml").tracks
    position = {
        (int(tracks.names[v]), int(f)): float(tracks.s[row])
        for row, (v, f) in enumerate(zip(tracks.vehicle, tracks.frame, strict=True))
    }
    leads: dict[tuple[int, int], list[float]] = {}
    for (vehicle, frame), s in position.items():
        for neighbour in map(int, tracks.names):
            if neighbour != vehicle and (neighbour, frame) in position:
                lead = s - position[neighbour, frame]
                leads.setdefault((vehicle, neighbour), []).append(lead)
    assert sum(lead[0] < 0.0 < lead[-1] for lead in leads.values()) == 40


def test_an_oncoming_lane_lies_beside_the_road(shared_data):
    found = read_commonroad(shared_data / "commonroad" / "OSC_CutIn-1_2_T-1.xml")
    assert found.road.num_lanes == 1
    beside = found.road.overtaking_side_neighbour
    assert beside is not None
    assert beside.direction == -1
    # Vehicle 4 comes out of that lane.
    four = found.tracks.lane[found.tracks.start[1] : found.tracks.start[2]]
    assert four[0] == 1
    assert four[-1] == 0
