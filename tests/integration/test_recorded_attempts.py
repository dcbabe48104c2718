"""Attempts in recordings of others, held against the positions in the files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from overtaking.core.errors import OvertakingError
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.labelling import label
from overtaking.model.overtake_events import NEVER
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.formats import read_recording

pytestmark = pytest.mark.ci

FILES = sorted((Path(__file__).parents[3] / "shared/data/commonroad").glob("*.xml"))
ROUNDING = 0.003
"""Positions are rounded to millimetres before they are judged [m]."""


def judged(path: Path):
    try:
        found = read_recording("commonroad", path, {}).scenes
    except OvertakingError as error:
        pytest.skip(str(error))
    return found, label(found.trajectories(range(len(found))))


def raw(found, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position of an ego to the left, of its left-most corner, and the cosine of its heading."""
    tracks, road, window = found.recording.tracks, found.road, found.windows[number]
    rows = np.arange(tracks.row(window.ego, window.first), tracks.row(window.ego, window.last) + 1)
    angle = tracks.heading[rows] - road.heading_at(tracks.s[rows])
    across = road.overtaking_sign * tracks.d[rows]
    half_length, half_width = tracks.length[window.ego] / 2, tracks.width[window.ego] / 2
    reach = half_length * np.abs(np.sin(angle)) + half_width * np.abs(np.cos(angle))
    return across, across + reach, np.cos(angle)


@pytest.mark.skipif(not FILES, reason="no recordings beside the checkout")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_attempt_is_a_crossing_or_a_swing_that_comes_back(path):
    found, labelled = judged(path)
    events, road = labelled.events, found.road
    second = round(1000 / labelled.signals.frame_interval_ms)
    beyond = road.overtaking_side_neighbour
    lanes = road.num_lanes - (0 if beyond is not None and beyond.kind == "driving" else 1)
    kinds = {"crossing": 0, "return": 0}
    for number in np.flatnonzero(events.has_attempt):
        across, corner, cosine = raw(found, int(number))
        begin, back = int(events.attempt[number]), int(events.abort_end[number])
        lane = int(events.original_lane[number])
        stop = len(across) if back == NEVER else back + 1
        assert lane < lanes, number
        assert (cosine > 0).all(), number
        line = road.overtaking_sign * road.lane_boundaries[lane + 1] + float(
            constant("event_detection.attempt.over_line")
        )
        assert begin == 0 or corner[begin - 1] <= line + ROUNDING, number
        way = across[begin:stop]
        kind = VehicleKind(found.recording.tracks.kind[found.windows[int(number)].ego])
        least = float(constant(f"event_detection.attempt.advance.{kind.code}"))
        if corner[begin:stop].max() > line - ROUNDING:
            kinds["crossing"] += 1
            continue
        kinds["return"] += 1
        assert (way[second:] - way[:-second]).max() >= least - ROUNDING, number
        assert way[-1] - way[0] <= constant("event_detection.motion.settled_shift") + ROUNDING, (
            number
        )
    drifts = int((events.drift != NEVER).sum())
    begun_before = int((events.began_before_recording != NEVER).sum())
    print(f"\n{path.stem}: {len(found)} simulations, {kinds}, {drifts=}, {begun_before=}")
