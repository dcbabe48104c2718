"""What is said of simulations comes back from its tables as it was said."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.overtakes import meeting, rural

from overtaking.data.tables.decode import decode
from overtaking.data.tables.encode_labels import encode_labels
from overtaking.data.tables.names import EVENTS
from overtaking.data.tables.schemas import KEYS, LABEL_TABLES, SCHEMAS
from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.overtake_events import NEVER, Outcome, OutcomeDetail
from overtaking.model.verdicts import OvertakeClass, Severity, Verdict
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

SIZE, FIRST = 60, 1000


@pytest.fixture(scope="module")
def labelled() -> LabelledTrajectories:
    given = load_specification("pinto2023-physical")
    index = np.arange(SIZE, dtype=np.uint64)
    return label(engine.simulate(ScenarioSource(given, load_road(given.road), 4).sample(index)))


@pytest.fixture(scope="module")
def tables(labelled):
    return encode_labels(labelled, np.arange(FIRST, FIRST + SIZE))


@pytest.fixture(scope="module")
def frames(tables):
    return {name: decode(table) for name, table in tables.items()}


@pytest.mark.parametrize("name", LABEL_TABLES)
def test_a_table_is_sorted_by_its_key_and_has_its_schema(name, tables, frames):
    assert tables[name].schema.equals(SCHEMAS[name], check_metadata=True)
    key = list(KEYS[name])
    assert not frames[name].duplicated(key).any()
    assert frames[name].equals(frames[name].sort_values(key, kind="stable"))


def test_every_event_that_happened_has_a_row_and_no_other(labelled, frames):
    rows = frames["events"].set_index(["simulation", "event"])["frame"]
    for name in EVENTS:
        happened = getattr(labelled.events, name)
        for k in range(SIZE):
            key = (FIRST + k, name)
            assert (key in rows.index) == (happened[k] != NEVER)
            assert happened[k] == NEVER or rows[key] == happened[k]


def test_times_of_events_are_those_of_their_frames(frames):
    rows = frames["events"]
    assert np.allclose(rows["time_s"], rows["frame"] * 0.05)


def test_a_collision_names_the_partner_and_the_change_of_speed(labelled, frames):
    hits = frames["events"].query("event == 'collision'").set_index("simulation")
    assert len(hits)
    for simulation, row in hits.iterrows():
        assert row["vehicle"] == labelled.events.collision_slot[simulation - FIRST]
        assert row["speed_change_mps"] >= 0.0
    others = frames["events"].query("event != 'collision'")
    assert others["speed_change_mps"].isna().all()


def test_classes_and_outcomes_have_the_names_of_the_model(labelled, frames):
    rows = frames["labels"]
    said = labelled.labels
    names = [OvertakeClass(code).title for code in said.classes.reshape(-1)]
    assert rows["class"].tolist() == names
    first = rows.drop_duplicates("simulation")
    assert first["outcome"].tolist() == [Outcome(code).name.lower() for code in said.outcome]
    assert first["detail"].tolist() == [OutcomeDetail(code).name.lower() for code in said.detail]


def test_findings_are_those_of_the_rules(labelled, frames):
    rows, found = frames["findings"], labelled.findings
    # The road has no oncoming traffic.
    kept = [place for place, rule in enumerate(PORTUGAL.rules) if not rule.only_two_way_roads]
    assert rows["rule"].tolist() == [found.rule_codes[place] for place in kept] * SIZE
    assert (np.delete(found.verdict, kept, axis=1) == Verdict.NOT_APPLICABLE).all()
    verdict = [Verdict(code).name.lower() for code in found.verdict[:, kept].reshape(-1)]
    assert rows["verdict"].tolist() == verdict
    judged = rows["verdict"].isin(["legal", "illegal"])
    assert (rows["margin"].notna() == judged).all()
    broken = rows["verdict"] == "illegal"
    assert (rows["first_frame"].notna() == broken).all()
    severity = [Severity(code).name.lower() for code in found.severity[:, kept].reshape(-1)]
    assert rows["severity"].tolist() == severity
    assert set(rows.loc[broken, "severity"]) <= {"light", "serious", "very_serious"}


def test_features_of_both_readings_alternate(labelled, frames):
    rows = frames["features"]
    assert rows["reading"].tolist() == ["paper", "matched"] * SIZE
    for reading in (labelled.paper_features, labelled.matched_features):
        mine = rows[rows["reading"] == reading.reading]
        assert np.array_equal(mine["WT_s"].to_numpy(), reading.waiting_time)
        assert np.array_equal(mine["SE_mps"].to_numpy(), reading.ego_speed)
        assert (mine["TP"].notna().to_numpy() == reading.has_target).all()
        occupancy = mine["OLR_percent"].to_numpy()
        assert np.allclose(occupancy, reading.left_occupancy * 100.0)


def test_weather_that_nobody_knows_is_null(labelled):
    run = labelled.trajectories.replace(unknown=frozenset({"weather"}))
    rows = decode(encode_labels(label(run), np.arange(SIZE))["features"])
    weather = ["DN", "HL", "PREC_percent", "WIND_percent", "FOG_percent"]
    assert rows[weather].isna().all().all()
    assert rows[["TE", "SE_mps", "NV"]].notna().all().all()


def test_on_a_two_way_road_the_rules_about_oncoming_traffic_are_kept():
    case = rural(meeting(60.0))
    rows = decode(encode_labels(label(case.trajectories), np.arange(1))["findings"])
    assert rows["rule"].tolist() == list(PORTUGAL.codes)
    assert dict(zip(rows["rule"], rows["verdict"], strict=True))["L25"] == "legal"
