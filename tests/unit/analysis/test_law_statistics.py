"""Tolerance curves and comparisons of two laws equal counts of verdicts by hand."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

import overtaking as ot
from overtaking.analysis.law_statistics import (
    TOLERANCE_SCALES,
    compare_laws,
    tolerance_curve,
)
from overtaking.cli import main
from overtaking.core.errors import ConfigError
from overtaking.labels.labelling import JudgedBatch, label
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.judging import policies_of_law
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.model.overtake_events import Outcome
from overtaking.model.verdicts import OvertakeClass, Verdict

pytestmark = pytest.mark.ci

NUM_SIMULATIONS = 150
POLICIES = {policy.name: policy for policy in policies_of_law("pt")}


@pytest.fixture(scope="module")
def trajectories():
    return ot.simulate(ot.sample("motorway", num_simulations=NUM_SIMULATIONS, seed=1))


def judge(trajectories, *laws):
    """One batch, labelled by each law, which is a pack with its policies."""
    labelled = tuple(label(trajectories, pack=pack, policies=policies) for pack, policies in laws)
    return JudgedBatch(np.arange(labelled[0].labels.outcome.size), labelled)


def portuguese_curve(trajectories, policy):
    """The labels under one policy, and their curve."""
    batch = judge(trajectories, (PORTUGAL, [policy]))
    return batch.labelled[0], tolerance_curve([batch], PORTUGAL, policy)


@pytest.mark.parametrize("name", ["paper", "default", "enforced"])
def test_without_tolerance_the_curve_counts_the_classes_of_the_policy(trajectories, name):
    labelled, curve = portuguese_curve(trajectories, POLICIES[name])
    assert curve.overtakes == (labelled.labels.outcome == Outcome.COMPLETED).sum() > 0
    num_legal = (labelled.labels.classes[:, 0] == OvertakeClass.SUCCESS_L).sum()
    assert curve.legal == num_legal
    for counts in curve.legal_by_tolerance.values():
        assert counts[0] == num_legal
        assert counts == sorted(counts)


def test_a_distance_tolerance_forgives_breaches_with_a_smaller_negative_margin(trajectories):
    policy = POLICIES["paper"]
    labelled, curve = portuguese_curve(trajectories, policy)
    is_completed = labelled.labels.outcome == Outcome.COMPLETED
    for k, metres in enumerate(TOLERANCE_SCALES["distance"].values_si):
        is_broken = np.zeros(is_completed.sum(), bool)
        for code in policy.required:
            column = labelled.findings.rule_codes.index(code)
            tolerated = metres if PORTUGAL.rule(code).unit == "m" else 0.0
            is_illegal = labelled.findings.verdict[is_completed, column] == Verdict.ILLEGAL
            margin = labelled.findings.margin[is_completed, column]
            is_broken |= is_illegal & (margin < -tolerated)
        assert curve.legal_by_tolerance["distance"][k] == (~is_broken).sum()


def test_speed_tolerances_are_in_kilometres_per_hour():
    scale = TOLERANCE_SCALES["speed"]
    assert scale.values_si == pytest.approx([value / 3.6 for value in scale.values])


def test_overtakes_with_one_broken_rule_are_counted_under_that_rule(trajectories):
    labelled, curve = portuguese_curve(trajectories, POLICIES["paper"])
    is_completed = labelled.labels.outcome == Outcome.COMPLETED
    num_broken = labelled.labels.num_broken[is_completed, 0]
    assert sum(curve.broken_alone.values()) == (num_broken == 1).sum() > 0
    assert sum(curve.broken.values()) == num_broken.sum()


def test_the_curve_of_two_batches_equals_the_curve_of_all_simulations(trajectories):
    policy = POLICIES["paper"]
    parts = [
        trajectories.select(np.arange(60)),
        trajectories.select(np.arange(60, NUM_SIMULATIONS)),
    ]
    batches = [judge(part, (PORTUGAL, [policy])) for part in parts]
    _, whole_curve = portuguese_curve(trajectories, policy)
    assert tolerance_curve(batches, PORTUGAL, policy) == whole_curve


def test_two_laws_disagree_where_their_classes_differ(trajectories):
    packs, policies = (PORTUGAL, GERMANY), [policies_of_law(name) for name in ("pt", "de")]
    batch = judge(trajectories, *zip(packs, policies, strict=True))
    values = compare_laws([batch], packs, policies)
    for disagreement in values["disagreements"]:
        column = [policy.name for policy in policies[0]].index(disagreement["policy"])
        portuguese, german = (labelled.labels.classes[:, column] for labelled in batch.labelled)
        is_legal_in_portugal = disagreement["legal_under"] == "pt"
        legal, illegal = (portuguese, german) if is_legal_in_portugal else (german, portuguese)
        differs = (legal == OvertakeClass.SUCCESS_L) & (illegal == OvertakeClass.SUCCESS_I)
        assert disagreement["overtakes"] == differs.sum()
        examples = disagreement["examples"]
        assert {example["simulation"] for example in examples} <= {*np.flatnonzero(differs)}
        assert all(example["margin"] < 0 for example in examples)
    assert sum(disagreement["overtakes"] for disagreement in values["disagreements"]) > 0
    for law in values["laws"]:
        assert sum(law["conduct"].values()) == sum(law["classes"].values()) == NUM_SIMULATIONS


def test_law_curve_draws_a_figure_and_leaves_the_data_set_unchanged(tmp_path, capsys):
    data = ot.generate_dataset("motorway", num_simulations=40, seed=1, out=tmp_path / "data")
    content_hash, picture = data.content_hash, tmp_path / "law.png"
    line = ["law", "curve", str(data.path), "--law", "de", "--plot", str(picture), "--json"]
    assert main(line) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["rule_set"] == GERMANY.version
    assert [entry["tolerance"] for entry in result["legal_by_tolerance"]] == list(TOLERANCE_SCALES)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["law", "compare", str(data.path)]) == 0
    assert "de-2@2013" in capsys.readouterr().out
    assert ot.load_dataset(data.path).content_hash == content_hash


def test_verdicts_under_german_law_go_to_a_separate_file(tmp_path, capsys):
    data, out = (
        ot.generate_dataset("motorway", num_simulations=30, seed=1, out=tmp_path / "data"),
        tmp_path / "de.parquet",
    )
    content_hash = data.content_hash
    line = ["label", str(data.path), "--law", "de", "--policies", "serious,enforced"]
    assert main([*line, "--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    rows = pd.read_parquet(out)
    assert len(rows) == 60
    assert {*rows["rule_set"]} == {GERMANY.version}
    assert {*rows["law"]} == {"de"}
    for name, classes in result["classes"].items():
        assert rows[rows["policy"] == name]["class"].value_counts().to_dict() == classes
    assert ot.load_dataset(data.path).content_hash == content_hash
    assert [path.name for path in tmp_path.glob("*.parquet")] == ["de.parquet"]


def test_a_policy_that_the_law_does_not_define_is_refused(tmp_path):
    data = ot.generate_dataset("motorway", num_simulations=2, seed=1, out=tmp_path / "data")
    with pytest.raises(ConfigError, match="expected paper or default or strict"):
        ot.law.tolerance_curve(data.path, policy="lenient")
