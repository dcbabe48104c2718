"""The learning tasks, their split by scene, and their baselines."""

from __future__ import annotations

import hashlib

import numpy as np
import pandas as pd
import pytest

from overtaking.analysis.learning.attributes import ATTRIBUTES, BY_NAME
from overtaking.analysis.learning.baselines import baselines
from overtaking.analysis.learning.examples import Examples, roots_of
from overtaking.analysis.learning.tasks import PARTS, TASKS, parts_of

ATTRIBUTE_NAMES = [attribute.name for attribute in ATTRIBUTES]


def alternating_examples(count: int, classes: list[str] | None = None) -> Examples:
    """Examples in which every second ego is faster than its limit."""
    values = np.tile([attribute.scale.absent for attribute in ATTRIBUTES], (count, 1))
    values[:, ATTRIBUTE_NAMES.index("leader_gap_m")] = 40.0
    values[:, ATTRIBUTE_NAMES.index("over_limit")] = np.where(np.arange(count) % 2, 3.0, -3.0)
    return Examples(
        simulations=np.arange(count),
        attributes=ATTRIBUTES,
        values=values,
        classes=pd.Series(classes or ["Success_L"] * count),
        attempted=np.ones(count, np.bool_),
        groups=np.arange(count),
        policy="paper",
    )


def scenario_table(seeds: list[int], indices: list[int]) -> pd.DataFrame:
    no_recordings = [None] * len(seeds)
    return pd.DataFrame(
        {"seed": seeds, "scenario_index": indices, "source_recording": no_recordings}
    )


def test_the_part_of_a_scene_follows_from_its_hash():
    for root in ("1:0", "7:12345", "2023:99999"):
        hash_share = int(hashlib.sha256(root.encode()).hexdigest()[:16], 16) / 2**64
        part = "train" if hash_share < 0.7 else "validation" if hash_share < 0.85 else "test"
        assert parts_of([root]).tolist() == [part]


def test_twins_and_branches_of_a_scene_are_in_the_same_part_at_every_size():
    roots = roots_of(scenario_table([7, 7, 8], [3, 3, 3]))
    assert roots[0] == roots[1] != roots[2]
    parts = parts_of([f"7:{n}" for n in range(2000)])
    assert parts[:500].tolist() == parts_of([f"7:{n}" for n in range(500)]).tolist()
    # Four standard errors of a share of 2,000 scenes.
    for name, share in PARTS.items():
        assert (parts == name).mean() == pytest.approx(share, abs=4 * (0.25 / 2000) ** 0.5)


def test_a_task_includes_only_simulations_that_can_answer_it():
    four_examples = alternating_examples(
        4, ["Success_L", "No_attempt", "censored", "Unsuccess_col"]
    )
    four_examples.attempted[1] = False
    four_examples.values[3, ATTRIBUTE_NAMES.index("leader_gap_m")] = BY_NAME[
        "leader_gap_m"
    ].scale.absent
    included = {task.name: task.is_asked(four_examples).tolist() for task in TASKS}
    assert included["outcome"] == included["legal"] == [True, False, False, False]
    assert included["go"] == [True, True, False, False]
    answers = {task.name: task.answers(four_examples)[:2].tolist() for task in TASKS}
    assert answers == {
        "outcome": ["Success_L", "No_attempt"],
        "legal": ["legal", "not legal"],
        "go": ["go", "stay"],
    }


def test_only_models_of_all_attributes_learn_a_hidden_attribute():
    rng = np.random.default_rng(1)
    training, test = alternating_examples(400), alternating_examples(300)
    # One in four of the egos over the limit has answer b; the waiting time shows which.
    answers = []
    for part in (training, test):
        is_b = (np.arange(len(part)) % 2 == 1) & (rng.uniform(size=len(part)) < 0.25)
        part.values[:, ATTRIBUTE_NAMES.index("waiting_time_s")] = np.where(is_b, 9.0, 1.0)
        answers.append(np.where(is_b, "b", "a"))
    baseline_by_name = {
        baseline.name: baseline for baseline in baselines(training, answers[0], test, answers[1])
    }
    share_of_a = float((answers[1] == "a").mean())
    for name in ("majority", "speed over the limit alone"):
        assert baseline_by_name[name].accuracy[0] == pytest.approx(share_of_a)
        assert baseline_by_name[name].balanced[0] == pytest.approx(0.5)
        assert baseline_by_name[name].accuracy[1] < share_of_a < baseline_by_name[name].accuracy[2]
    for name in ("logistic regression", "gradient boosting", "rules"):
        assert baseline_by_name[name].balanced == (1.0, 1.0, 1.0)


def test_the_limit_baseline_predicts_the_most_frequent_answer_above_and_below_the_limit():
    training, test = alternating_examples(100), alternating_examples(50)
    answers = [np.where(np.arange(len(part)) % 2, "b", "a") for part in (training, test)]
    baseline_by_name = {
        baseline.name: baseline for baseline in baselines(training, answers[0], test, answers[1])
    }
    assert baseline_by_name["speed over the limit alone"].accuracy[0] == 1.0
    assert baseline_by_name["majority"].accuracy[0] == 0.5


def test_a_task_with_a_single_answer_has_no_baselines():
    training, test = alternating_examples(10), alternating_examples(5)
    assert baselines(training, np.full(10, "a"), test, np.full(5, "a")) == []
