"""Tolerances and two laws, on overtakes whose verdicts are counted by hand."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

import overtaking as ot
from overtaking.analysis.law_statistics import STEPS, compared, curve, tolerances
from overtaking.cli import main
from overtaking.core.errors import ConfigError
from overtaking.labels.labelling import label
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import policies_of_law
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.overtake_events import Outcome
from overtaking.model.verdicts import OvertakeClass, Verdict

pytestmark = pytest.mark.ci

COUNT = 150
POLICY = {one.name: one for one in policies_of_law("pt")}


@pytest.fixture(scope="module")
def run():
    return ot.simulate(ot.sample("motorway", num_simulations=COUNT, seed=1))


def said_by(run, pack, chosen):
    return label(run, pack=pack, policies=chosen)


def test_without_tolerance_the_curve_counts_the_classes_of_the_policy(run):
    for name in ("paper", "default", "enforced"):
        chosen = POLICY[name]
        said = said_by(run, PORTUGAL, [chosen])
        found = curve([(said, said.case())], PORTUGAL, chosen)
        assert found.overtakes == (said.labels.outcome == Outcome.COMPLETED).sum() > 0
        legal = (said.labels.classes[:, 0] == OvertakeClass.SUCCESS_L).sum()
        assert found.legal == legal
        for counts in found.relaxed.values():
            assert counts[0] == legal
            assert counts == sorted(counts)


def test_a_relaxed_distance_is_a_margin_counted_by_hand(run):
    chosen = POLICY["paper"]
    said = said_by(run, PORTUGAL, [chosen])
    found = curve([(said, said.case())], PORTUGAL, chosen)
    done = said.labels.outcome == Outcome.COMPLETED
    for k, metres in enumerate(tolerances("distance")):
        broken = np.zeros(done.sum(), bool)
        for code in chosen.required:
            place = said.findings.rule_codes.index(code)
            allowed = metres if PORTUGAL.rule(code).unit == "m" else 0.0
            illegal = said.findings.verdict[done, place] == Verdict.ILLEGAL
            broken |= illegal & (said.findings.margin[done, place] < -allowed)
        assert found.relaxed["distance"][k] == (~broken).sum()


def test_the_rule_that_alone_decides_is_the_only_one_that_is_broken(run):
    chosen = POLICY["paper"]
    said = said_by(run, PORTUGAL, [chosen])
    found = curve([(said, said.case())], PORTUGAL, chosen)
    done = said.labels.outcome == Outcome.COMPLETED
    assert sum(found.alone.values()) == (said.labels.num_broken[done, 0] == 1).sum() > 0
    assert sum(found.broken.values()) == said.labels.num_broken[done, 0].sum()


def test_batches_add_up(run):
    chosen = POLICY["paper"]
    parts = [run.select(np.arange(0, 60)), run.select(np.arange(60, COUNT))]
    said = [said_by(one, PORTUGAL, [chosen]) for one in (run, *parts)]
    whole = curve([(said[0], said[0].case())], PORTUGAL, chosen)
    sum_of = curve([(one, one.case()) for one in said[1:]], PORTUGAL, chosen)
    assert whole == sum_of


def test_two_laws_part_where_their_classes_do(run):
    packs, chosen = (PORTUGAL, GERMANY), [policies_of_law(name) for name in ("pt", "de")]
    said = [said_by(run, pack, of) for pack, of in zip(packs, chosen, strict=True)]
    values = compared([(np.arange(COUNT), said[0].case(), said)], packs, chosen)
    for one in values["parted"]:
        place = [each.name for each in chosen[0]].index(one["policy"])
        pt, de = (each.labels.classes[:, place] for each in said)
        a, b = (pt, de) if one["legal_under"] == "pt" else (de, pt)
        parts = (a == OvertakeClass.SUCCESS_L) & (b == OvertakeClass.SUCCESS_I)
        assert one["overtakes"] == parts.sum()
        assert {each["simulation"] for each in one["examples"]} <= {*np.flatnonzero(parts)}
        assert all(each["margin"] < 0 for each in one["examples"])
    assert sum(one["overtakes"] for one in values["parted"]) > 0
    for one in values["laws"]:
        assert sum(one["conduct"].values()) == sum(one["classes"].values()) == COUNT


def test_the_commands_write_nothing_and_draw_a_figure(tmp_path, capsys):
    data = ot.generate_dataset("motorway", num_simulations=40, seed=1, out=tmp_path / "data")
    before, picture = data.content_hash, tmp_path / "law.png"
    line = ["law", "curve", str(data.path), "--law", "de", "--plot", str(picture), "--json"]
    assert main(line) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["rule_set"] == GERMANY.version
    assert [one["tolerance"] for one in told["tolerances"]] == list(STEPS)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["law", "compare", str(data.path)]) == 0
    assert "de-2@2013" in capsys.readouterr().out
    assert ot.load_dataset(data.path).content_hash == before


def test_verdicts_of_another_law_are_written_beside_the_data_set(tmp_path, capsys):
    data, out = (
        ot.generate_dataset("motorway", num_simulations=30, seed=1, out=tmp_path / "data"),
        tmp_path / "de.parquet",
    )
    before = data.content_hash
    line = ["label", str(data.path), "--law", "de", "--policies", "serious,enforced"]
    assert main([*line, "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    rows = pd.read_parquet(out)
    assert len(rows) == 60
    assert {*rows["rule_set"]} == {GERMANY.version}
    assert {*rows["law"]} == {"de"}
    for name, classes in told["classes"].items():
        assert rows[rows["policy"] == name]["class"].value_counts().to_dict() == classes
    assert ot.load_dataset(data.path).content_hash == before
    assert [path.name for path in tmp_path.glob("*.parquet")] == ["de.parquet"]


def test_a_policy_that_a_law_lacks_is_refused(tmp_path):
    data = ot.generate_dataset("motorway", num_simulations=2, seed=1, out=tmp_path / "data")
    with pytest.raises(ConfigError, match="expected paper or default or strict"):
        ot.law.tolerance_curve(data.path, policy="lenient")
