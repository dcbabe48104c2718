"""What `show` tells and draws of real simulations."""

from __future__ import annotations

import io
import itertools
import json
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from rich.console import Console, Group

import overtaking as ot
from overtaking.cli.drawing import Glyphs
from overtaking.cli.law import law_lines
from overtaking.cli.show import MAX_INSTANTS, render
from overtaking.cli.timeline import event_lines
from overtaking.core.units import kmh_from_mps
from overtaking.knowledge.glossary import terms
from overtaking.model.trajectories import (
    NO_VEHICLE,
    UNKNOWNS,
    PerceivedVehicle,
    Stage,
    Trajectories,
)
from overtaking.show.description import describe, lane_name
from overtaking.show.judgement import EVENTS, Values
from overtaking.show.wording import SYMBOLS, margin_words, symbol

if TYPE_CHECKING:
    from overtaking.labels.labelling import LabelledTrajectories

NUM_SIMULATIONS = 48


@pytest.fixture(scope="module")
def labelled() -> LabelledTrajectories:
    """Enough simulations for every kind of ending to be among them."""
    return ot.label(
        ot.simulate(ot.sample("pinto2023-physical", num_simulations=NUM_SIMULATIONS, seed=1))
    )


@pytest.fixture(scope="module")
def runs(labelled) -> Trajectories:
    return labelled.trajectories


@pytest.fixture(scope="module")
def stories(labelled) -> list[Values]:
    """What is told of each simulation."""
    return [describe(one(labelled, number), number) for number in range(NUM_SIMULATIONS)]


def test_classes_and_policies_are_explained(runs, stories):
    text = printed(lambda console: render(runs.select(slice(0, 1)), stories[0], console), width=110)
    flat = " ".join(text.split())
    for name, policy in stories[0]["policies"].items():
        assert terms("classes")[policy["class"]].meaning in flat
        assert terms("policies")[name].meaning in flat
    assert "overtaking glossary" in flat


def one(labelled: LabelledTrajectories, number: int) -> LabelledTrajectories:
    return labelled.select(np.array([number]))


def printed(part, *, width: int = 80, encoding: str = "utf-8", **settings) -> str:
    """What `part` of a console gives, as a terminal of a width and encoding shows it."""
    file = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    console = Console(file=file, width=width, highlight=False, **settings)
    console.print(part(console))
    file.flush()
    return file.buffer.getvalue().decode(encoding)


def drawn(labelled: LabelledTrajectories, **settings) -> str:
    values = describe(labelled, 17)
    return printed(lambda console: render(labelled.trajectories, values, console), **settings)


def without(labelled: LabelledTrajectories, *unknown: str) -> LabelledTrajectories:
    """The same recording, some of it unknown."""
    return ot.label(labelled.trajectories.replace(unknown=frozenset(unknown)))


def test_there_is_something_to_see(runs):
    stages = {Stage(int(code)) for code in np.unique(runs.stage[runs.frame_mask])}
    assert {Stage.FOLLOW, Stage.PULL_OUT, Stage.PASS, Stage.RETURN, Stage.DONE} <= stages
    assert (runs.contacts.partner != NO_VEHICLE).any()


@pytest.mark.ci
@pytest.mark.parametrize(("width", "encoding"), [(80, "utf-8"), (80, "ascii"), (120, "utf-8")])
def test_every_simulation_fits_the_terminal(labelled, stories, width, encoding):
    for number, values in list(enumerate(stories))[::3]:
        run = one(labelled, number).trajectories
        text = printed(lambda c, r=run, v=values: render(r, v, c), width=width, encoding=encoding)
        assert max(len(line) for line in text.splitlines()) <= width


def test_without_colour_nothing_but_colour_is_lost(labelled):
    plain = drawn(one(labelled, 0))
    coloured = drawn(one(labelled, 0), force_terminal=True, color_system="truecolor")
    assert "\x1b[" not in plain
    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured) == plain
    assert len(coloured) > len(plain)


def test_description_is_json_and_its_numbers_are_those_recorded(runs, stories):
    for number, values in enumerate(stories):
        assert json.loads(json.dumps(values, allow_nan=False)) == values
        assert values["num_frames"] == runs.num_frames[number]
        assert len(values["vehicles"]) == runs.scenario.num_vehicles[number]
        assert values["duration_s"] == pytest.approx((runs.num_frames[number] - 1) * 0.05)
        assert (
            bytes.fromhex(values["trace_hash"]) == runs.trace_hash[number].astype("<u4").tobytes()
        )


def test_stages_follow_each_other_without_a_hole(runs, stories):
    for number, values in enumerate(stories):
        stages = values["stages"]
        assert stages[0]["from_s"] == 0.0
        assert stages[-1]["to_s"] == values["duration_s"]
        for before, after in itertools.pairwise(stages):
            assert before["to_s"] == after["from_s"]
            assert before["stage"] != after["stage"]
        frames = sum((one["stage"] == "PULL_OUT") for one in stages)
        recorded = runs.stage[number, : runs.num_frames[number]]
        assert (frames > 0) == bool((recorded == Stage.PULL_OUT).any())


def test_every_collision_is_told_once_with_partner_instant_and_impulse(labelled, stories):
    seen = 0
    for number, values in enumerate(stories):
        if number % 8 and not values["collisions"]:
            continue
        run, collisions = one(labelled, number).trajectories, values["collisions"]
        text = printed(lambda c, r=run, v=values: render(r, v, c))
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


def test_beliefs_are_told_beside_the_truth_and_the_law(labelled, runs, stories):
    number = next(
        n
        for n in range(NUM_SIMULATIONS)
        if runs.percepts.valid[n].any() and runs.percepts.is_detected[n, 0, PerceivedVehicle.LEADER]
    )
    decision = stories[number]["decisions"][0]
    assert decision["kind"] == "PULL_OUT"
    leader = decision["neighbours"]["leader"]
    assert leader["gap_m"] == runs.percepts.gap[number, 0, PerceivedVehicle.LEADER] / 1000
    assert leader["true_gap_m"] == runs.percepts.true_gap[number, 0, PerceivedVehicle.LEADER] / 1000
    assert leader["law"]["rule"] == "L3"
    text = drawn(one(labelled, number))
    assert f"{leader['gap_m']:.1f} ({leader['true_gap_m']:.1f})" in text
    assert f"L3 {leader['law']['belief'].replace('_', ' ')}" in text


def test_the_strip_shows_lane_and_speed_of_the_ego(labelled, runs):
    lines = [line for line in drawn(one(labelled, 0), width=120).splitlines() if " s │" in line]
    assert 2 <= len(lines) <= MAX_INSTANTS + 1
    first = lines[0].rsplit("│", 1)[1].split()
    speed_kmh = kmh_from_mps(runs.states.speed[0, 0, 0] / 1000.0)
    assert first == [
        lane_name(runs.road, int(runs.states.lane[0, 0, 0])),
        f"{speed_kmh:.0f}",
        "follow",
    ]
    assert all("E" in line for line in lines)


@pytest.mark.parametrize("code", [5, 255])
def test_a_vehicle_off_the_lanes_is_said_to_be_off(labelled, runs, code):
    first = one(labelled, 0)
    run, values = first.trajectories, describe(first, 0)
    assert lane_name(run.road, 4) == str(run.road.lanes[4].lane_id)
    off = run.replace(states=run.states.replace(lane=np.full_like(run.states.lane, code)))
    lines = printed(lambda console: render(off, values, console)).splitlines()
    lines = [line for line in lines if " s │" in line]
    assert all(line.rsplit("│", 1)[1].split()[0] == "off" for line in lines)
    assert max(len(line) for line in lines) <= 80


def test_events_are_told_in_the_order_of_time_and_marked_below_the_stages(labelled, stories):
    seen = set()
    for number, values in enumerate(stories):
        times = [each["time_s"] for each in values["events"]]
        assert times == sorted(times)
        for each in values["events"]:
            assert getattr(labelled.events, each["event"])[number] == each["frame"]
            assert each["time_s"] == each["frame"] * 50 / 1000
        happened = {each["event"] for each in values["events"]}
        assert happened == {name for name in EVENTS if getattr(labelled.events, name)[number] >= 0}
        seen |= happened
    assert {"following_begin", "attempt", "line_crossed", "overlap_end", "return_end"} <= seen
    number = next(n for n, v in enumerate(stories) if v["outcome"] == "completed")
    lines = drawn(one(labelled, number)).splitlines()
    begin = lines.index("What the ego did")
    end = next(n for n in range(begin, len(lines)) if lines[n].strip().startswith("0 s"))
    marks = "".join(lines[begin + 2 : end])
    for each in stories[number]["events"]:
        assert EVENTS[each["event"]].letter in marks


@pytest.mark.parametrize(("struck", "words"), [(True, "is struck by 2"), (False, "runs into 2")])
def test_every_event_has_its_words_and_a_collision_tells_who_ran_into_whom(struck, words):
    events = [
        {"event": name, "symbol": EVENTS[name].symbol, "frame": n, "time_s": n / 20}
        for n, name in enumerate(EVENTS)
    ]
    values = {
        "events": events,
        "target": 1,
        "collision_partner": 2,
        "struck_by_partner": struck,
    }
    lines = [str(line) for line in event_lines(values)]
    assert len(lines) == len(EVENTS)
    assert all(
        line.startswith(one.letter) for line, one in zip(lines, EVENTS.values(), strict=True)
    )
    (collision,) = (line for line in lines if line.startswith("C"))
    assert collision.endswith(words)
    assert lines[0].endswith("0.00 s  t_follow   follows 1")


def test_no_mark_of_an_event_is_the_letter_of_a_vehicle():
    letters = {one.letter for one in EVENTS.values()}
    assert len(letters) == len(EVENTS)
    assert not letters & set(SYMBOLS)


def test_every_broken_rule_is_told_with_article_margin_frames_and_what_it_needed(stories):
    codes = set()
    for values in stories:
        text = re.sub(r"\s+", " ", law_of(values))
        for each in values["broken"]:
            assert f"{each['rule']} {each['title']}, {each['law']}: " in text
            assert f"margin {margin_words(each['margin'], each['unit'])}" in text
            if each["first_frame"] != each["last_frame"]:
                assert f"frames {each['first_frame']}–{each['last_frame']}" in text
            codes.add(each["rule"])
        assert text.count(" needs ") == len(values["broken"])
        for name, policy in values["policies"].items():
            assert f"{name} {policy['class']}" in text
        assert ("Broken nothing" in text) == (not values["broken"])
    assert {"L3", "L12", "L14s", "L21"} <= codes


def law_of(values: Values, width: int = 80) -> str:
    glyphs = Glyphs.for_terminal(ascii_only=False)
    return printed(lambda _: Group(*law_lines(values, width, glyphs)), width=width)


def test_a_speed_is_told_in_both_units(stories):
    values = next(v for v in stories if any(each["rule"] == "L12" for each in v["broken"]))
    ((change,),) = next(each for each in values["broken"] if each["rule"] == "L12")["remedies"]
    by = -change["by"]
    assert f"needs {by:.1f} m/s ({by * 3.6:.0f} km/h) slower at {change['time_s']:.2f} s" in law_of(
        values
    )


def test_in_left_hand_traffic_the_slow_side_is_on_the_left(stories):
    values = next(v for v in stories if any(each["rule"] == "L21" for each in v["broken"]))
    assert "1 lane farther to the right" in law_of(values)
    mirrored = values | {"road": values["road"] | {"driving_side": "left"}}
    assert "1 lane farther to the left" in law_of(mirrored)


def test_what_was_not_recorded_is_not_told(labelled, stories):
    number = next(n for n in range(NUM_SIMULATIONS) if stories[n]["decisions"])
    blind = without(one(labelled, number), *UNKNOWNS)
    values = describe(blind, 3)
    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert values["not_recorded"] == sorted(UNKNOWNS)
    assert values["weather"] is values["road"]["speed_limit_mps"] is None
    assert values["stages"] == values["decisions"] == []
    assert {one["mass_kg"] for one in values["vehicles"]} == {None}
    text = drawn(blind)
    assert "Weather  unknown" in text
    assert "limit unknown" in text
    assert "follow 0.00" not in text
    assert "L3 Safe distance (not recorded: weather)" in text
    assert "What the driver believed" not in text
    assert max(len(line) for line in text.splitlines()) <= 80


def test_a_collision_whose_force_was_not_recorded_has_no_speed_of_approach(labelled, stories):
    number = next(n for n, v in enumerate(stories) if v["collisions"])
    blind = without(one(labelled, number), "impulse")
    (collision, *_) = describe(blind, 0)["collisions"]
    assert collision["impulse_newton_s"] is collision["closing_speed_mps"] is None
    text = drawn(blind)
    assert "Collision of" in text
    assert "closing at" not in text


def test_a_vehicle_that_leaves_the_recording_is_drawn_until_then(labelled, stories):
    number = next(n for n, v in enumerate(stories) if len(v["vehicles"]) >= 2)
    run = one(labelled, number).trajectories
    present = np.repeat(run.scenario.vehicles.valid[:, :, None], run.stage.shape[1], axis=2)
    last = int(run.num_frames[0]) // 2
    present[0, 1, last + 1 :] = False
    speed = run.states.speed.copy()
    speed[0, 1, last + 1 :] = 0
    gone = run.replace(is_recorded=present, states=run.states.replace(speed=speed))
    values = describe(ot.label(gone), 0)
    assert values["vehicles"][1]["to_s"] == last * 50 / 1000
    lines = printed(lambda console: render(gone, values, console)).splitlines()
    (line,) = (each for each in lines if re.match(r"1 .* km/h, ", each))
    assert f"→ {kmh_from_mps(run.states.speed[0, 1, last] / 1000.0):3.0f} km/h" in line
