"""Labels of a data set: with it from the start, and made anew."""

from __future__ import annotations

import pytest
from tests.support.page_inputs import WRITERS
from tests.support.sumo import needs_sumo

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError, DatasetError
from overtaking.data import relabel
from overtaking.data.tables.schemas import LABEL_TABLES
from overtaking.labels.law.portugal import PORTUGAL

SIZE = 12


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=SIZE,
        seed=5,
        out=tmp_path_factory.mktemp("label") / "data",
    )


@pytest.mark.parametrize("table", LABEL_TABLES)
def test_labels_from_memory_and_from_files_are_the_same(data, table):
    before = data.table(table)
    assert ot.relabel_dataset(data.path).table(table).equals(before)


def test_labelling_again_changes_nothing(data):
    again = ot.relabel_dataset(data.path)
    assert again.content_hash == data.content_hash
    again.verify()


@pytest.mark.parametrize(
    ("file_format", "name"),
    [
        ("commonroad", "scene.xml"),
        ("ngsim", "trajectories.csv"),
        # This format states no kinds of vehicles; friction depends on them.
        ("pinto2023", "table.csv"),
    ],
)
def test_labelling_a_recording_again_changes_nothing(tmp_path, file_format: str, name: str):
    WRITERS[name](tmp_path / name)
    data = ot.import_recording(file_format, tmp_path / name, tmp_path / "data")
    again = ot.relabel_dataset(data.path)
    assert again.content_hash == data.content_hash
    again.verify()


@needs_sumo
@pytest.mark.parametrize("keep", ["features", "frames"])
def test_a_data_set_of_another_simulator_is_labelled_again_only_from_its_frames(tmp_path, keep):
    short = {"time.horizon_s": 2.0, "time.attempt_deadline_s": 2.0}
    data = ot.generate_dataset(
        "pinto2023-physical",
        num_simulations=1,
        seed=5,
        out=tmp_path / "data",
        keep=keep,
        simulator="sumo",
        overrides=short,
    )
    if keep == "frames":
        assert ot.relabel_dataset(data.path).content_hash == data.content_hash
        return
    before = {path: path.read_bytes() for path in data.path.rglob("*") if path.is_file()}
    with pytest.raises(ConfigError, match=r"expected one that keeps frames.*got one of sumo"):
        ot.relabel_dataset(data.path)
    assert {path: path.read_bytes() for path in before} == before


def test_labels_agree_with_those_of_a_run_in_memory(data):
    runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=SIZE, seed=5))
    found = ot.label(runs)
    rows = data.labels()
    paper = rows[rows["policy"] == "paper"]
    assert paper["num_broken"].tolist() == found.labels.num_broken[:, 0].tolist()
    # Rules of two-way roads have no rows on a road of one direction.
    stored = [one.code for one in PORTUGAL.rules if not one.only_two_way_roads]
    assert data.findings()["rule"].tolist() == stored * SIZE
    assert set(stored) < set(found.findings.rule_codes)


def test_features_have_the_papers_names_and_units(data):
    frame = data.features()
    assert list(frame.columns) == [
        *("DN", "HL", "TE", "TP", "WT", "OT", "NV", "SE", "SP", "DSEP"),
        *("D", "OLR", "PREC", "WIND", "FOG", "CLASS", "weight"),
    ]
    assert len(frame) == SIZE
    # 50 to 120 km/h at the start; drivers may have slowed down since.
    assert frame["SE"].between(0.0, 130.0).all()
    assert frame["SE"].max() > 50.0


def test_encoded_features_are_numbers_without_gaps(data):
    frame = data.features(encoded=True).drop(columns="CLASS")
    assert frame.notna().all().all()
    assert set(frame["DN"]) <= {0.0, 1.0}
    assert frame["TE"].between(0, 4).all()


def test_a_verdict_tells_phases_and_rules(data):
    done = data.labels().query("outcome == 'completed'")["simulation"]
    verdict = data.verdict(int(done.iloc[0]))
    assert verdict.outcome == "completed"
    assert verdict.phases["attempt"] < verdict.phases["return_end"]
    assert set(verdict.classes) == {"paper", "default", "strict"}
    assert (verdict.broken["margin"] < 0).all()


def test_an_unknown_policy_is_one_line(data):
    with pytest.raises(ValueError, match="policy: expected paper or default or strict"):
        data.features("lenient")


def test_ending_the_work_leaves_the_data_set_as_it_was(data, monkeypatch):
    before = {path: path.read_bytes() for path in data.path.rglob("*") if path.is_file()}

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(relabel, "encode_labels", full)
    with pytest.raises(DatasetError, match="No space left on device"):
        ot.relabel_dataset(data.path)
    after = {path: path.read_bytes() for path in data.path.rglob("*") if path.is_file()}
    assert after == before


def test_the_command_counts_classes(data, capsys):
    assert main(["label", str(data.path)]) == 0
    assert "No_attempt" in capsys.readouterr().out
