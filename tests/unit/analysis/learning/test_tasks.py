"""The split by scene, the tasks, and their baselines."""

from __future__ import annotations

import hashlib

import numpy as np
import pandas as pd
import pytest

from overtaking.analysis.learning.attributes import ATTRIBUTES, BY_NAME
from overtaking.analysis.learning.baselines import baselines
from overtaking.analysis.learning.examples import Examples, roots_of
from overtaking.analysis.learning.tasks import PARTS, TASKS, parts_of

NAMES = [one.name for one in ATTRIBUTES]


def examples(count: int, classes: list[str] | None = None) -> Examples:
    values = np.tile([one.scale.absent for one in ATTRIBUTES], (count, 1))
    values[:, NAMES.index("leader_gap_m")] = 40.0
    values[:, NAMES.index("over_limit")] = np.where(np.arange(count) % 2, 3.0, -3.0)
    return Examples(
        simulations=np.arange(count),
        attributes=ATTRIBUTES,
        values=values,
        classes=pd.Series(classes or ["Success_L"] * count),
        attempted=np.ones(count, np.bool_),
        groups=np.arange(count),
        policy="paper",
    )


def rows(seeds: list[int], indices: list[int]) -> pd.DataFrame:
    none = [None] * len(seeds)
    return pd.DataFrame({"seed": seeds, "scenario_index": indices, "source_recording": none})


def test_the_part_of_a_scene_follows_from_its_hash():
    for root in ("1:0", "7:12345", "2023:99999"):
        uniform = int(hashlib.sha256(root.encode()).hexdigest()[:16], 16) / 2**64
        part = "train" if uniform < 0.7 else "validation" if uniform < 0.85 else "test"
        assert parts_of([root]).tolist() == [part]


def test_twins_and_branches_stay_together_at_every_size():
    roots = roots_of(rows([7, 7, 8], [3, 3, 3]))
    assert roots[0] == roots[1] != roots[2]
    many = parts_of([f"7:{n}" for n in range(2000)])
    assert many[:500].tolist() == parts_of([f"7:{n}" for n in range(500)]).tolist()
    for name, share in PARTS.items():
        assert (many == name).mean() == pytest.approx(share, abs=4 * (0.25 / 2000) ** 0.5)


def test_tasks_ask_whom_they_should():
    given = examples(4, ["Success_L", "No_attempt", "censored", "Unsuccess_col"])
    given.attempted[1] = False
    given.values[3, NAMES.index("leader_gap_m")] = BY_NAME["leader_gap_m"].scale.absent
    asked = {task.name: task.is_asked(given).tolist() for task in TASKS}
    assert asked["outcome"] == asked["legal"] == [True, False, False, False]
    assert asked["go"] == [True, True, False, False]
    answers = {task.name: task.answers(given)[:2].tolist() for task in TASKS}
    assert answers == {
        "outcome": ["Success_L", "No_attempt"],
        "legal": ["legal", "not legal"],
        "go": ["go", "stay"],
    }


def test_baselines_reach_what_they_can():
    rng = np.random.default_rng(1)
    known, kept = examples(400), examples(300)
    # One in four of those over the limit says "b", and an attribute tells them apart.
    answers = []
    for one in (known, kept):
        is_b = (np.arange(len(one)) % 2 == 1) & (rng.uniform(size=len(one)) < 0.25)
        one.values[:, NAMES.index("waiting_time_s")] = np.where(is_b, 9.0, 1.0)
        answers.append(np.where(is_b, "b", "a"))
    found = {one.name: one for one in baselines(known, answers[0], kept, answers[1])}
    share = float((answers[1] == "a").mean())
    for name in ("majority", "speed over the limit alone"):
        assert found[name].accuracy[0] == pytest.approx(share)
        assert found[name].balanced[0] == pytest.approx(0.5)
        assert found[name].accuracy[1] < share < found[name].accuracy[2]
    for name in ("logistic regression", "gradient boosting", "rules"):
        assert found[name].balanced == (1.0, 1.0, 1.0)


def test_the_limit_alone_says_what_is_commonest_on_either_side():
    known, kept = examples(100), examples(50)
    answers = [np.where(np.arange(len(one)) % 2, "b", "a") for one in (known, kept)]
    found = {one.name: one for one in baselines(known, answers[0], kept, answers[1])}
    assert found["speed over the limit alone"].accuracy[0] == 1.0
    assert found["majority"].accuracy[0] == 0.5


def test_one_answer_leaves_nothing_to_learn():
    known, kept = examples(10), examples(5)
    assert baselines(known, np.full(10, "a"), kept, np.full(5, "a")) == []
