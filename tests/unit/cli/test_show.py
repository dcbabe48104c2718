"""What `show` tells and draws of real simulations."""

from __future__ import annotations

import io
import itertools
import json
import re

import numpy as np
import pytest
from rich.console import Console

from overtaking import api
from overtaking.cli.description import describe, lane_name
from overtaking.cli.drawing import symbol
from overtaking.cli.show import MAX_INSTANTS, render
from overtaking.core.units import kmh_from_mps
from overtaking.model.trajectory import NO_VEHICLE, Stage, Trajectories

NUM_SIMULATIONS = 48


@pytest.fixture(scope="module")
def runs() -> Trajectories:
    """Enough simulations for every kind of ending to be among them."""
    return api.simulate(api.sample("pinto2023", NUM_SIMULATIONS, 1))


def one(runs: Trajectories, number: int) -> Trajectories:
    return runs.select(np.array([number]))


def drawn(run: Trajectories, *, width: int = 80, encoding: str = "utf-8", **settings) -> str:
    file = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    console = Console(file=file, width=width, highlight=False, **settings)
    console.print(render(run, describe(run, 17), console))
    file.flush()
    return file.buffer.getvalue().decode(encoding)


def test_there_is_something_to_see(runs):
    stages = {Stage(int(code)) for code in np.unique(runs.stage[runs.frame_valid])}
    assert {Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE} <= stages
    assert (runs.contacts.partner != NO_VEHICLE).any()


@pytest.mark.parametrize("width", [80, 120])
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_every_simulation_fits_the_terminal(runs, width, encoding):
    for number in range(NUM_SIMULATIONS):
        text = drawn(one(runs, number), width=width, encoding=encoding)
        assert max(len(line) for line in text.splitlines()) <= width
        assert len(text.splitlines()) <= MAX_INSTANTS + 50


def test_without_colour_nothing_but_colour_is_lost(runs):
    plain = drawn(one(runs, 0))
    coloured = drawn(one(runs, 0), force_terminal=True, color_system="truecolor")
    assert "\x1b[" not in plain
    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured) == plain
    assert len(coloured) > len(plain)


def test_description_is_json_and_its_numbers_are_those_recorded(runs):
    for number in range(NUM_SIMULATIONS):
        run = one(runs, number)
        values = describe(run, number)
        assert json.loads(json.dumps(values, allow_nan=False)) == values
        assert values["num_frames"] == run.num_frames[0]
        assert len(values["vehicles"]) == run.scenario.num_vehicles[0]
        assert values["duration_s"] == pytest.approx((run.num_frames[0] - 1) * 0.05)
        assert bytes.fromhex(values["trace_hash"]) == run.trace_hash[0].astype("<u4").tobytes()


def test_stages_follow_each_other_without_a_hole(runs):
    for number in range(NUM_SIMULATIONS):
        run = one(runs, number)
        stages = describe(run, number)["stages"]
        assert stages[0]["from_s"] == 0.0
        assert stages[-1]["to_s"] == describe(run, number)["duration_s"]
        for before, after in itertools.pairwise(stages):
            assert before["to_s"] == after["from_s"]
            assert before["stage"] != after["stage"]
        frames = sum((one["stage"] == "PULL_OUT") for one in stages)
        assert (frames > 0) == bool((run.stage[0, : run.num_frames[0]] == Stage.PULL_OUT).any())


def test_every_collision_is_told_once_with_partner_instant_and_impulse(runs):
    seen = 0
    for number in range(NUM_SIMULATIONS):
        run = one(runs, number)
        text = drawn(run)
        collisions = describe(run, number)["collisions"]
        crashed = {slot for one in collisions for slot in one["vehicles"]}
        assert crashed == set(np.flatnonzero(run.contacts.partner[0] != NO_VEHICLE).tolist())
        for one_collision in collisions:
            first, second = one_collision["vehicles"]
            assert run.contacts.impulse[0, [first, second]].max() > 0
            line = f"Collision of {symbol(first)} and {symbol(second)} at "
            assert text.count(line) == 1
            assert f"{one_collision['time_s']:.2f} s" in text
            seen += 1
        assert ("No collision" in text) == (not collisions)
    assert seen > 0


def test_beliefs_are_told_beside_the_truth(runs):
    number = next(n for n in range(NUM_SIMULATIONS) if runs.percepts.valid[n].any())
    run = one(runs, number)
    decision = describe(run, number)["decisions"][0]
    assert decision["kind"] == "PULL_OUT"
    leader = decision["neighbours"]["leader"]
    assert leader["gap_m"] == run.percepts.gap[0, 0, 0] / 1000
    assert leader["true_gap_m"] == run.percepts.true_gap[0, 0, 0] / 1000
    text = drawn(run, width=120)
    assert f"{leader['gap_m']:.0f} ({leader['true_gap_m']:.0f}) m," in text


def test_the_strip_shows_lane_and_speed_of_the_ego(runs):
    run = one(runs, 0)
    lines = [line for line in drawn(run, width=120).splitlines() if " s │" in line]
    assert 2 <= len(lines) <= MAX_INSTANTS + 1
    first = lines[0].rsplit("│", 1)[1].split()
    speed_kmh = kmh_from_mps(run.states.speed[0, 0, 0] / 1000.0)
    assert first == [
        lane_name(run.road, int(run.states.lane[0, 0, 0])),
        f"{speed_kmh:.0f}",
        "follow",
    ]
    assert all("E" in line for line in lines)


@pytest.mark.parametrize("code", [5, 255])
def test_a_vehicle_off_the_lanes_is_said_to_be_off(runs, code):
    run = one(runs, 0)
    assert lane_name(run.road, 4) == str(run.road.lanes[4].lane_id)
    states = run.states.replace(lane=np.full_like(run.states.lane, code))
    lines = [line for line in drawn(run.replace(states=states)).splitlines() if " s │" in line]
    assert all(line.rsplit("│", 1)[1].split()[0] == "off" for line in lines)
    assert max(len(line) for line in lines) <= 80
