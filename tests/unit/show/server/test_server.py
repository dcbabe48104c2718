"""What the server of `overtaking view` tells, and whom."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.recordings import commonroad
from tests.support.serving import Client, branches, get, serving

import overtaking as ot
from overtaking.cli import main
from overtaking.model.import_report import ImportFinding
from overtaking.model.scenario import ForcedDecision
from overtaking.model.trajectories import PerceivedVehicle
from overtaking.show.description import describe
from overtaking.show.server.index import ordering
from overtaking.show.server.whatif import DECISIONS
from overtaking.show.view.pack import pack

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.data.load import Dataset
    from overtaking.model.trajectories import Trajectories

NUM_SIMULATIONS = 60


def packed(runs: Trajectories, number: int) -> Any:
    """What an exported page would hold, after a way through JSON."""
    return json.loads(json.dumps(pack(ot.label(runs), number)))


def test_rows_are_those_of_the_tables(client: Client, data: Dataset):
    rows = client.rows(count=NUM_SIMULATIONS)["rows"]
    labels = data.labels().set_index(["simulation", "policy"])["class"]
    findings = data.findings()
    broken = findings[findings["verdict"] == "illegal"].groupby("simulation")["rule"].apply(set)
    weather = data.weather().set_index("weather")
    assert [one["number"] for one in rows] == list(range(NUM_SIMULATIONS))
    for one in rows:
        number = one["number"]
        assert one["classes"] == {name: labels[number, name] for name in one["classes"]}
        assert set(one["broken"]) == broken.get(number, set())
        assert one["weather"] == weather["preset"][number]
        assert one["night"] == weather["night"][number]


def expected(data: Dataset, **asked: Any) -> set[int]:
    """The simulations that a filter leaves, found by pandas."""
    labels, findings, attempts = data.labels(), data.findings(), data.attempts()
    weather = data.simulations().merge(data.weather(), on="weather").set_index("simulation")
    left = set(range(len(data)))
    if "classes" in asked:
        mine = labels[labels["policy"] == asked["policy"]]
        left &= set(mine[mine["class"].isin(asked["classes"])]["simulation"])
    for rule in asked.get("rules", ()):
        of = findings[(findings["rule"] == rule) & (findings["verdict"] == "illegal")]
        left &= set(of["simulation"])
    if "weather" in asked:
        left &= set(weather.index[weather["preset"].isin(asked["weather"])])
    if "light" in asked:
        left &= set(weather.index[weather["night"] == (asked["light"] == ["night"])])
    for name, column in (("ego", "ego_kind"), ("overtaken", "leader_kind")):
        if name in asked:
            left &= set(attempts[attempts[column].isin(asked[name])]["simulation"])
    if bounds := asked.get("margin"):
        of = findings[findings["rule"] == bounds["rule"]].set_index("simulation")["margin"]
        left &= set(of.index[(of >= bounds["least"]) & (of <= bounds["most"])])
    return left


FILTERS: list[dict[str, Any]] = [
    {"policy": "strict", "classes": ["Success_I", "No_attempt"]},
    {"policy": "paper", "classes": ["Success_I"], "rules": ["L3", "L18"]},
    {"light": ["night"], "ego": ["S", "M"], "weather": ["HardRainNight", "ClearNight"]},
    {"margin": {"rule": "L3", "least": -20.0, "most": -1.0}, "overtaken": ["S", "M", "L"]},
]


@pytest.mark.ci
@pytest.mark.parametrize("asked", FILTERS)
def test_filters_leave_what_pandas_leaves(client: Client, data: Dataset, asked: dict[str, Any]):
    told = client.rows(**asked, count=NUM_SIMULATIONS)
    left = expected(data, **asked)
    assert {one["number"] for one in told["rows"]} == left
    assert told["found"] == len(left) > 0
    for name, counts in told["counts"].items():
        for value, many in counts.items():
            wanted = [*asked.get("rules", ()), value] if name == "rules" else [value]
            policy = asked.get("policy", "paper")
            assert many == len(expected(data, **{"policy": policy, **asked, name: wanted}))


def test_lists_are_in_order_and_in_parts(client: Client):
    of = client.rows(order="duration", descending=True, count=NUM_SIMULATIONS)["rows"]
    lengths = [one["duration_s"] for one in of]
    assert lengths == sorted(lengths, reverse=True)
    part = client.rows(count=7, around=40)
    assert (part["first"], part["rows"][5]["number"]) == (35, 40)
    falling = client.rows(descending=True, first=50, count=20)["rows"]
    assert [one["number"] for one in falling] == list(range(9, -1, -1))


def test_the_page_is_given_the_import_report(client: Client, data: Dataset, monkeypatch):
    assert get(client, "/api/start")["import_report"] == {"rows": [], "num_rows": 0}
    finding = ImportFinding(
        recording="a.csv",
        check="sizes",
        vehicle=None,
        first_time_s=None,
        rows=9,
        consequence="reported",
        detail="swapped",
    )
    monkeypatch.setattr(data, "import_findings", (finding,))
    assert get(client, "/api/start")["import_report"] == {
        "rows": [finding.to_dict()],
        "num_rows": 1,
    }


def test_a_run_is_what_an_exported_page_holds(client: Client, data: Dataset):
    for number in (0, 17):
        told = get(client, f"/api/runs/{number}")
        assert told == packed(data.trajectory(number), number)


@pytest.mark.ci
def test_beliefs_at_every_decision_agree_with_those_that_were_recorded(
    client: Client, data: Dataset
):
    checked = 0
    for number in range(12):
        percepts = data.trajectory(number).percepts
        told = get(client, f"/api/runs/{number}/beliefs")
        lead = next((one for one in told["roles"] if one["role"] == "leader"), None)
        for row in np.flatnonzero(percepts.valid[0]):
            at = round(percepts.time[0, row] / told["interval_ms"])
            place = (0, row, PerceivedVehicle.LEADER)
            if percepts.slot[place] == 255:
                continue
            assert lead is not None
            assert lead["slot"][at] == percepts.slot[place]
            assert (lead["seen"][at] == 1) == percepts.is_detected[place]
            assert abs(lead["true_gap_mm"][at] - percepts.true_gap[place]) <= 1
            if percepts.is_detected[place]:
                assert abs(lead["gap_mm"][at] - percepts.gap[place]) <= 1
                checked += 1
    assert checked > 5


@pytest.mark.parametrize("decision", [ForcedDecision[name] for name in DECISIONS])
def test_a_branch_is_that_of_the_library(client: Client, data: Dataset, decision: ForcedDecision):
    status, told, _ = client.ask(
        "POST", "/api/runs/3/branches", branches({"frame": 30, "decision": decision.name})
    )
    assert status == 200, told
    runs = ot.branch(data.scenario(3), 30, decision=decision)
    assert told["run"] == packed(runs, 3)
    changes = (runs.trace_hash != data.trajectory(3).trace_hash).any()
    assert (told["said"] == ["Nothing changes."]) == (not changes)


def test_a_branch_says_what_has_changed(client: Client, data: Dataset):
    asked = branches({"frame": 0, "decision": "STAY"})
    _, told, _ = client.ask("POST", "/api/runs/3/branches", asked)
    before = describe(ot.label(data.trajectory(3)), 3)
    after = told["run"]["values"]
    assert told["said"][0] == "Outcome: no attempt, instead of completed."
    for one in before["broken"]:
        is_left = one["rule"] in [other["rule"] for other in after["broken"]]
        lead = "Still broken" if is_left else "No longer broken"
        assert any(text.startswith(f"{lead}: {one['rule']} ") for text in told["said"])


def test_other_weather_is_that_of_the_preset(client: Client):
    _, told, _ = client.ask(
        "POST", "/api/runs/3/branches", branches({"frame": 5, "weather": "HardRainNight"})
    )
    assert told["run"]["values"]["weather"]["preset"] == "HardRainNight"
    assert told["run"]["values"]["weather"]["night"]
    assert told["parts"] >= 5


@pytest.mark.parametrize(
    "asked",
    [
        {"frame": 10**6, "decision": "STAY"},
        {"frame": 1, "decision": "FLY"},
        {"frame": 1, "weather": "<b>"},
        {"frame": 1},
        {"frame": 1, "decision": "STAY", "weather": "ClearNoon"},
        {"frame": -1, "decision": "STAY"},
        {"frame": "1; DROP", "decision": "STAY"},
    ],
)
def test_a_branch_that_cannot_be_is_one_clear_error(client: Client, asked: dict[str, Any]):
    status, told, _ = client.ask("POST", "/api/runs/3/branches", branches(asked))
    assert status == 400
    assert told["error"].startswith("view: ")
    assert "\n" not in told["error"]


def test_a_branch_of_a_branch_has_both_changes(client: Client, data: Dataset):
    asked = branches({"frame": 10, "decision": "STAY"}, {"frame": 70, "decision": "PULL_OUT"})
    status, told, _ = client.ask("POST", "/api/runs/3/branches", asked)
    assert status == 200, told
    first = ot.branch(data.scenario(3), 10, decision=ForcedDecision.STAY)
    runs = ot.branch(first, 70, decision=ForcedDecision.PULL_OUT)
    assert told["run"] == packed(runs, 3)
    assert told["run"] != packed(first, 3)
    assert told["title"] == "stay at 0.50 s, then pull out at 3.50 s"
    assert told["frame"] == 10


@pytest.mark.parametrize(
    "body", [{}, {"changes": []}, branches(*[{"frame": 1, "decision": "STAY"}] * 5)]
)
def test_a_branch_has_one_to_four_changes(client: Client, body: dict[str, Any]):
    status, told, _ = client.ask("POST", "/api/runs/3/branches", body)
    assert (status, set(told)) == (400, {"error"})


@pytest.mark.ci
def test_what_several_pages_ask_for_at_once_is_answered_in_turn(client: Client):
    def ask(frame: int) -> int:
        asked = branches({"frame": frame, "decision": "STAY"})
        return client.ask("POST", "/api/runs/5/branches", asked)[0]

    with ThreadPoolExecutor(12) as many:
        assert set(many.map(ask, range(12))) == {200}


@pytest.mark.ci
@pytest.mark.parametrize("condition", ["truth", "belief"])
def test_a_fan_is_that_of_the_command(
    client: Client, data: Dataset, condition: str, capsys: pytest.CaptureFixture[str]
):
    asked = {"condition_on": condition, "policy": "strict"}
    status, told, _ = client.ask("POST", "/api/runs/3/fan", asked)
    assert status == 200, told
    command = ["fan", data.where, "3", "--condition-on", condition, "--policy", "strict", "--json"]
    assert main(command) == 0
    values = json.loads(capsys.readouterr().out)
    assert {name: told[name] for name in values} == values
    assert ("hindsight" in told["title"]) == (condition == "truth")
    assert ("decision" in told["about"]) == (condition == "belief")


@pytest.mark.parametrize(
    "asked",
    [
        {"condition_on": "all"},
        {"policy": "<b>"},
        {"futures": 100_000},
        {"condition_on": "truth", "every": 0.05},
        [],
    ],
)
def test_a_fan_has_its_bounds(client: Client, asked: Any):
    status, told, _ = client.ask("POST", "/api/runs/3/fan", asked)
    assert (status, set(told)) == (400, {"error"})


@pytest.mark.ci
def test_lists_by_margin_are_in_order_and_keep_it_when_filtered(client: Client, data: Dataset):
    findings = data.findings()
    margin = findings[findings["rule"] == "L3"].set_index("simulation")["margin"]
    bounds = {"rule": "L3", "least": None, "most": None}
    for descending in (False, True):
        asked = {"margin": bounds, "order": "margin", "descending": descending}
        whole = [one["number"] for one in client.rows(**asked, count=NUM_SIMULATIONS)["rows"]]
        wanted = margin.dropna().sort_values(ascending=not descending, kind="stable")
        assert whole == wanted.index.tolist()
        night = client.rows(**asked, light=["night"], count=NUM_SIMULATIONS)["rows"]
        assert [one["number"] for one in night] == [
            one for one in whole if one in expected(data, light=["night"])
        ]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_order_is_that_of_a_stable_sort(sign: float):
    values = np.random.default_rng(1).integers(-9, 9, 5000).astype(np.float32)
    values[::7], values[1::7], values[2::7] = np.nan, 0.0, -0.0
    values[3::70], values[4::70], values[5::70] = np.inf, -np.inf, 1e-40
    assert (ordering(sign * values) == np.argsort(sign * values, kind="stable")).all()


@pytest.mark.ci
def test_sql_filters_the_list_and_cannot_write(client: Client, data: Dataset):
    text = "SELECT simulation FROM labels WHERE policy = 'strict' AND class = 'Success_I'"
    _, told, _ = client.ask("POST", "/api/sql", {"sql": text})
    assert told["filters"]
    wanted = expected(data, policy="strict", classes=["Success_I"])
    assert client.rows(sql=text)["found"] == told["num_rows"] == len(wanted)
    for bad in (
        "DROP TABLE labels",
        "COPY labels TO 'x.csv'",
        "SELECT * FROM read_csv('/etc/passwd')",
    ):
        status, told, _ = client.ask("POST", "/api/sql", {"sql": bad})
        assert (status, set(told)) == (400, {"error"})


@pytest.mark.ci
def test_a_recording_is_listed_and_shown_without_what_it_does_not_tell(tmp_path: Path):
    scene, out = tmp_path / "scene.xml", tmp_path / "data"
    scene.write_text(commonroad(), encoding="utf-8")
    assert main(["import", "commonroad", str(scene), "--out", str(out), "-q"]) == 0
    with serving(ot.load_dataset(out)) as url:
        client = Client(url).enter()
        told = client.rows()
        assert told["rows"][0]["weather"] == "unknown"
        assert (told["counts"]["weather"], told["counts"]["light"]) == ({}, {})
        assert get(client, "/api/runs/0")["told"]["weather"] == "unknown"
        assert get(client, "/api/runs/0/thumbnail")["lines"]
        assert client.ask("GET", "/api/runs/0/beliefs")[0] == 400
        asked = branches({"frame": 1, "decision": "STAY"})
        status, told, _ = client.ask("POST", "/api/runs/0/branches", asked)
        assert (status, "recording" in told["error"]) == (400, True)
        status, told, _ = client.ask("POST", "/api/runs/0/fan", {})
        assert (status, set(told)) == (400, {"error"})
