"""Groups of related examples, leaking features, targets, and refused data sets."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from overtaking.analysis.learning.attributes import ATTRIBUTES, FACTORS, time_to_safe_gap
from overtaking.analysis.learning.examples import groups_of, refuse_too_few
from overtaking.analysis.learning.leakage import LEAKS, chosen_factors
from overtaking.analysis.learning.targets import TARGETS, is_asked, target_of
from overtaking.core.errors import ConfigError, DatasetError


def simulation_table(*rows: tuple[int | None, int | None, str | None]) -> pd.DataFrame:
    frame = pd.DataFrame(rows, columns=["seed", "scenario_index", "source_recording"])
    return frame.astype({"seed": "UInt64", "scenario_index": "UInt64"})


def test_twins_and_branches_of_a_scenario_are_in_one_group():
    groups = groups_of(simulation_table((1, 4, None), (1, 5, None), (1, 4, None), (2, 4, None)))
    assert groups[0] == groups[2]
    assert len({*groups}) == 3


def test_all_egos_of_a_recording_are_in_one_group():
    groups = groups_of(
        simulation_table(
            (None, None, "USA_US101-1 frames 3 to 90 vehicles 12 14 15"),
            (None, None, "USA_US101-1 frames 90 to 200 vehicles 7 12"),
            (None, None, "USA_US101-2 frames 3 to 90 vehicles 12 14 15"),
            (None, None, "table.csv simulation 3 vehicles 1 2"),
            (None, None, "table.csv simulation 4 vehicles 1 2"),
        )
    )
    assert groups[0] == groups[1]
    assert len({*groups}) == 4


@pytest.mark.parametrize(
    "name",
    ["OT", "ot", "C", "collision", "OV", "max|a|", "max_a", "mean_SE", "mean D", "mean_olr"],
)
def test_a_feature_known_only_after_the_overtake_is_refused_with_the_reason(name: str):
    with pytest.raises(ConfigError, match=r"known when the overtake begins.*--show-leakage"):
        chosen_factors(("waiting time", name))


def test_an_unknown_feature_is_refused():
    with pytest.raises(ConfigError, match="no such name"):
        chosen_factors(("colour",))


def test_factors_and_attributes_can_be_chosen():
    assert chosen_factors(()) == FACTORS
    assert chosen_factors(("waiting time", "friction")) == {
        "waiting time": ("waiting_time_s",),
        "friction": ("friction",),
    }


def test_no_attribute_is_a_leaking_feature():
    refused = {name.lower() for leak in LEAKS for name in (leak.name, *leak.others)}
    assert refused.isdisjoint(attribute.name.lower() for attribute in ATTRIBUTES)
    assert refused.isdisjoint(name.lower() for name in FACTORS)


def test_a_target_applies_only_to_simulations_that_can_answer_it():
    classes = pd.Series(["No_attempt", "Success_L", "censored", "Unsuccess_col", "Success_L"])
    attempted = np.array([False, True, True, True, True])
    has_leader = np.array([True, True, True, True, False])
    assert is_asked(classes, attempted, has_leader, TARGETS["legal"]).tolist() == [
        False, True, False, True, False
    ]  # fmt: skip
    assert is_asked(classes, attempted, has_leader, TARGETS["start"]).tolist() == [
        True, True, False, True, False
    ]  # fmt: skip
    with pytest.raises(ConfigError, match="legal or collision or start"):
        target_of("weather")


def test_the_time_to_the_safe_gap_is_the_margin_over_the_closing_speed():
    columns = {
        "law_leader_m": np.array([20.0, -1.0, 20.0, np.nan]),
        "leader_closing_speed_mps": np.array([5.0, 5.0, -5.0, 5.0]),
    }
    times = time_to_safe_gap(columns.__getitem__)
    assert times[:2].tolist() == [4.0, 0.0]
    assert np.isnan(times[2:]).all()


def test_too_few_examples_are_refused():
    positive = np.arange(100) < 5
    with pytest.raises(DatasetError, match="5, 95 and 100; make a larger data set"):
        refuse_too_few(positive, np.arange(100), where="x", what="y", least=20)
    with pytest.raises(DatasetError, match="50, 50 and 1;"):
        refuse_too_few(np.arange(100) < 50, np.zeros(100, np.int64), where="x", what="y", least=20)
