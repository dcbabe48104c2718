"""Questions in logic: answered as pandas answers them, and unable to do anything else."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

import overtaking
import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking import Dataset

pytestmark = pytest.mark.ci

SIMULATIONS = 24


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set whose name is an attempt of its own."""
    path = tmp_path_factory.mktemp("data") / '"). #script(python). x'
    ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=SIMULATIONS,
        seed=5,
        out=path,
        shard_size=SIMULATIONS // 2,
    )
    return path


@pytest.fixture(scope="module")
def data(folder: Path) -> Dataset:
    return overtaking.load_dataset(folder)


@pytest.fixture(scope="module")
def states(data: Dataset) -> pd.DataFrame:
    """The states of all simulations, with lane indices; none beyond the lanes."""
    index = {lane.lane_id: place for place, lane in enumerate(data.road.lanes)}
    parts = [data.states(number) for number in range(len(data))]
    lengths = data.vehicles().set_index(["simulation", "vehicle"])["length_m"]
    found = pd.concat(parts, ignore_index=True).join(lengths, on=["simulation", "vehicle"])
    return found.assign(lane_index=found["lane_id"].map(index))


def rows_of(data: Dataset, query: str, **bounds: Any) -> set[tuple[int | str, ...]]:
    found = overtaking.logic.ask(data, query, **bounds)
    assert found.num_simulations == len(data)
    return set(found.rows)


def changes(states: pd.DataFrame) -> pd.DataFrame:
    """Every frame in which somebody is in another lane than before."""
    ordered = states.sort_values(["simulation", "vehicle", "frame"])
    before = ordered.groupby(["simulation", "vehicle"])["lane_index"].shift()
    moved = ordered.assign(before=before).dropna(subset=["before", "lane_index"])
    moved = moved[moved["before"] != moved["lane_index"]]
    return moved.astype({"before": int, "lane_index": int})


def test_whose_class_is_asked_for_is_whose_label_it_is(data: Dataset):
    labels = data.labels()
    of_paper = labels[(labels["policy"] == "paper") & (labels["class"] == "Success_I")]
    expected = {(int(n),) for n in of_paper["simulation"]}
    assert rows_of(data, "class(S,paper,success_i)") == expected
    assert expected


def test_simulations_are_joined_with_their_weather_and_counted(data: Dataset):
    simulations = data.simulations().merge(data.weather(), on="weather")
    at_night = simulations[simulations["night"] & (simulations["num_vehicles"] >= 4)]
    expected = {
        (int(n), int(count)) for n, count in at_night[["simulation", "num_vehicles"]].values
    }
    query = "night(S), N = #count{ V : vehicle(S,V,_,_,_) }, N >= 4"
    assert rows_of(data, query) == expected


def test_lane_changes_are_those_of_the_states(data: Dataset, states: pd.DataFrame):
    columns = ["simulation", "vehicle", "before", "lane_index", "frame"]
    expected = {tuple(row) for row in changes(states)[columns].to_numpy().tolist()}
    within = "K >= 0, L >= 0, lanes(N), K < N, L < N"
    found = rows_of(data, f"changes_lane(S,V,K,L,F), {within}")
    assert {row[:5] for row in found} == expected
    assert expected


def test_who_passes_whom_is_seen_in_the_positions(data: Dataset, states: pd.DataFrame):
    """Within 200 m of the ego, in pairs, frame by frame."""
    columns = ["simulation", "frame", "vehicle", "s_m", "length_m"]
    ego = states[states["vehicle"] == 0].set_index(["simulation", "frame"])["s_m"].rename("ego_s")
    near = states[columns].join(ego, on=["simulation", "frame"])
    near = near[(near["s_m"] - near["ego_s"]).abs() <= 200.0]
    pairs = near.merge(near, on=["simulation", "frame"], suffixes=("", "_b"))
    pairs = pairs[pairs["vehicle"] != pairs["vehicle_b"]]
    half = (pairs["length_m"] + pairs["length_m_b"]) / 2
    # Lengths are rounded up to the millimetre in the facts, each.
    pairs = pairs.assign(ahead=pairs["s_m"] - pairs["s_m_b"] >= half + 0.0005)
    pairs = pairs.sort_values(["simulation", "vehicle", "vehicle_b", "frame"])
    grouped = pairs.groupby(["simulation", "vehicle", "vehicle_b"])
    was, last = grouped["ahead"].shift(), grouped["frame"].shift()
    passed = pairs[pairs["ahead"] & (was == False) & (last == pairs["frame"] - 1)]  # noqa: E712
    expected = passed[["simulation", "vehicle", "vehicle_b", "frame"]].to_numpy().tolist()
    found = rows_of(data, "passes(S,A,B,F)")
    assert {row[:3] for row in found} == {tuple(row[:3]) for row in expected}
    exact = found & {tuple(row) for row in expected}
    assert len(exact) >= 0.95 * len(found)  # A millimetre of rounding may be a frame.


def test_overtakes_are_those_that_the_events_call_completed(data: Dataset, states: pd.DataFrame):
    """Where the target is still in the ego's lane when the ego leaves it."""
    events = data.events().pivot_table(index="simulation", columns="event", values="frame")
    targets = data.events().query("event == 'attempt'").set_index("simulation")["vehicle"]
    lane = states.set_index(["simulation", "vehicle", "frame"])["lane_index"]
    collided = {*data.events().query("event == 'collision'")["simulation"]}
    expected: set[tuple[int, int]] = set()
    for number in events.dropna(subset="return_end").index:
        if number in collided:
            continue
        mine = changes(states).query(f"simulation == {number} and vehicle == 0")
        left = mine[(mine["lane_index"] > mine["before"])]
        left = left[left["frame"] >= events["attempt"][number]].iloc[0]
        target = int(targets[number])
        if lane[number, target, left["frame"]] == left["before"]:
            expected.add((int(number), target))
    assert expected
    assert expected <= {row[:2] for row in rows_of(data, "overtakes(S,ego,B,F)")}


def test_what_the_law_says_is_what_the_findings_say(data: Dataset):
    findings = data.findings()
    broken = findings[(findings["rule"] == "L12") & (findings["verdict"] == "illegal")]
    assert rows_of(data, "illegal(S,l12)") == {(int(n),) for n in broken["simulation"]}
    query = "overtakes(S,ego,P,F), illegal(S,l3), not night(S)"
    assert {row[0] for row in rows_of(data, query)} <= {
        int(n)
        for n in findings[(findings["rule"] == "L3") & (findings["verdict"] == "illegal")][
            "simulation"
        ]
    }


def test_the_same_is_found_however_few_frames_are_looked_at(data: Dataset):
    query = "overtakes(S,A,B,F)"
    assert rows_of(data, query, frame_step=1) == rows_of(data, query, frame_step=500)


def test_only_simulations_that_are_chosen_are_asked(data: Dataset):
    found = overtaking.logic.ask(data, "simulation(S)", simulation_ids=[3, 7])
    assert (found.rows, found.num_simulations) == ([(3,), (7,)], 2)
    with pytest.raises(ConfigError, match=f"expected 0 to {SIMULATIONS - 1}, got 99"):
        overtaking.logic.ask(data, "simulation(S)", simulation_ids=[99])


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ('#include "/etc/passwd"', "no directive and no script, got #include at column 1"),
        ("#script(python) import os #end", "no directive and no script"),
        ('simulation(S). #include "x"', "no directive"),
        ("simulation(S). evil(1)", "one condition, got 2 statements"),
        ("simulation(S). {evil}", "got 2 statements"),
        ("X = @open(1), simulation(X)", "an external function at column 5"),
        ("simulation(S) % comment", "a comment at column 15"),
        ("&diff{a-b} <= 3", "a theory atom"),
        ("simulation(S", "at its end"),
        ("simulation(S), )", "unexpected ) at column 16"),
        ("simulations(S)", "expected simulation(S) or"),
        ("lane(S,V,F,L)", "lane(S, V, Lane, First, Last), got lane with 4 arguments at column 1"),
        ("event(S,start,F)", "got start"),
        ("vehicle(S,fast,_,_,_)", "V in vehicle(S, V, Kind, Length, Width) to be a number"),
        ("event(S,attempt,F), target(S,F)", "each variable to be one kind of thing"),
        ("simulation(S), X > 3", "got X, to which no atom gives a value"),
        ("not night(S)", "got S, to which no atom gives a value"),
        ("(" * 500 + "1" + ")" * 500 + " = X", "at most 40 brackets"),
        ("simulation(S), " * 500, "at most 2000 characters"),
        ("", "expected a condition"),
    ],
)
def test_what_is_no_question_is_refused_in_one_line(data: Dataset, query: str, message: str):
    with pytest.raises(ConfigError) as refused:
        overtaking.logic.ask(data, query, simulation_ids=[0])
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_question_without_end_is_stopped(data: Dataset):
    endless = "X = 1..9000, Y = 1..9000, Z = 1..9000, (X+Y+Z)\\7 = 8"
    with pytest.raises(ConfigError, match="an answer within 1 s"):
        overtaking.logic.ask(data, endless, simulation_ids=[0], timeout_s=1.0)
    with pytest.raises(ConfigError, match="at most 64 MiB of memory"):
        overtaking.logic.ask(data, "X = 1..100000000", simulation_ids=[0], memory_mib=64)
    with pytest.raises(ConfigError, match="an answer of at most 16 MiB"):
        overtaking.logic.ask(
            data, "X = 1..200000", simulation_ids=[0], memory_mib=128, max_rows=10**9
        )


def test_nothing_beside_the_data_set_is_written(data: Dataset, workdir: Path):
    before = sorted(path.name for path in data.path.rglob("*"))
    overtaking.logic.ask(data, "overtakes(S,A,B,F)")
    assert sorted(path.name for path in data.path.rglob("*")) == before
    assert list(workdir.iterdir()) == []


def test_the_command_prints_answers_with_times(data: Dataset, capsys: pytest.CaptureFixture[str]):
    assert main(["ask", str(data.path), "event(S,attempt,F)", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["columns"] == [
        {"name": "S", "type": "simulation"},
        {"name": "F", "type": "frame"},
    ]
    events = data.events()
    frames = events[events["event"] == "attempt"][["simulation", "frame"]].to_numpy().tolist()
    assert values["rows"] == frames
    assert main(["ask", str(data.path), "event(S,attempt,F)", "--rows", "1"]) == 0
    shown = capsys.readouterr()
    assert f"{frames[0][1]} ({frames[0][1] * 0.05:.2f} s)" in shown.out
    assert "there are more answers than these 1" in shown.err


def test_a_proof_names_article_frames_and_facts(data: Dataset, capsys: pytest.CaptureFixture[str]):
    findings = data.findings()
    broken = findings[(findings["rule"] == "L12") & (findings["verdict"] == "illegal")].iloc[0]
    number, first = int(broken["simulation"]), int(broken["first_frame"])
    assert main(["ask", str(data.path), "--why", str(number)]) == 0
    page = capsys.readouterr().out
    speed = data.states(number).query(f"vehicle == 0 and frame == {first}")["speed_mps"].iloc[0]
    fact = f"ego_speed({number},{first},{round(speed * 1000)})"
    assert "L12, Speed limit (Article 27): broken in frame" in page
    assert f"fact: {fact}" in page
    (proof,) = (proof for proof in overtaking.logic.prove(data, number) if proof.rule == "l12")
    assert (proof.first_frame, proof.last_frame) == (first, int(broken["last_frame"]))


def test_the_predicates_are_listed(data: Dataset, capsys: pytest.CaptureFixture[str]):
    assert main(["ask", str(data.path), "--predicates", "--json"]) == 0
    entries = json.loads(capsys.readouterr().out)["predicates"]
    names = {entry["predicate"] for entry in entries}
    assert {"overtakes(S, A, B, F)", "illegal(S, Rule)"} <= names
    assert main(["ask", str(data.path)]) == 2
    assert "expected a query, --why N or --predicates, got none" in capsys.readouterr().err


def test_progress_counts_the_chosen_simulations_alone(data: Dataset, tmp_path: Path):
    """Simulations 3 and 20 are in two files, so each is a report of its own."""
    reports: list[tuple[int, int]] = []
    options: dict[str, Any] = {
        "simulation_ids": [3, 20],
        "progress": lambda num_done, num_all: reports.append((num_done, num_all)),
    }
    ot.logic.ask(data, "simulation(S)", **options)
    assert reports == [(1, 2), (2, 2)]
    reports.clear()
    ot.export_dataset(data, tmp_path / "facts", file_format="asp", **options)
    assert reports == [(1, 2), (2, 2)]


def test_an_export_holds_the_chosen_simulations(data: Dataset, tmp_path: Path):
    out = tmp_path / "facts"
    options = ["--simulations", "3,7", "--format", "asp", "--with-law", "--out", str(out)]
    assert main(["export", str(data.path), *options, "--quiet"]) == 0
    assert {path.name for path in out.iterdir()} == {"facts-00000.lp", "theory.lp", "law.lp"}
    text = (out / "facts-00000.lp").read_text(encoding="utf-8")
    assert {"simulation(3).", "simulation(7)."} <= {*text.splitlines()}
    states = data.states(3)
    place = states[(states["vehicle"] == 0) & (states["frame"] == 0)].iloc[0]
    assert f"position(3,0,0,{np.rint(place['s_m'] * 1000):.0f})." in text
    refused = ["export", str(data.path), "--frame-step", "5", "--out", str(tmp_path / "t.csv")]
    assert main(refused) == 2
