"""From words on the command line to arguments."""

from __future__ import annotations

from pathlib import Path

import pytest

from overtaking.cli import arguments
from overtaking.cli.options import RoadChoice
from overtaking.core.errors import ConfigError


def test_only_what_was_asked_for_is_given():
    assert arguments.given(seed=0, simulations=None, overrides={}, keep="frames") == {
        "seed": 0,
        "keep": "frames",
    }


def test_changes_are_keys_and_values_and_the_last_one_counts():
    changes = ["traffic.vehicles=2..4", " weather.mode = free ", "traffic.vehicles=3", "a.b=c=d"]
    assert arguments.overrides(changes, 100) == {
        "traffic.vehicles": "3",
        "weather.mode": "free",
        "a.b": "c=d",
        "profile.frame_interval_ms": 100,
    }


@pytest.mark.parametrize("change", ["traffic.vehicles", "=3", "traffic.vehicles=", "", " = "])
def test_a_change_without_key_or_value_is_refused(change):
    with pytest.raises(ConfigError, match=r"--set: .*expected KEY=VALUE"):
        arguments.overrides([change], None)


def test_a_road_is_the_profiles_unless_one_is_named():
    assert arguments.road(RoadChoice()) is None
    named = arguments.road(RoadChoice(road="town06"))
    assert named is not None
    assert named.name == "town06"


@pytest.mark.parametrize(
    ("out", "is_csv", "target"),
    [
        ("table", None, "table.csv"),
        ("table", True, "table.csv"),
        ("table", False, "table.parquet"),
        ("table.csv", None, "table.csv"),
        ("table.parquet", None, "table.parquet"),
        ("table.parquet", False, "table.parquet"),
        ("table.v2", None, "table.v2.csv"),
    ],
)
def test_the_kind_of_a_table_is_in_its_name(tmp_path, out, is_csv, target):
    assert arguments.table_file(tmp_path / out, is_csv=is_csv) == tmp_path / target


def test_a_name_that_contradicts_the_option_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="leave the option out"):
        arguments.table_file(tmp_path / "table.csv", is_csv=False)


@pytest.mark.parametrize("folder", [".", "/"])
def test_a_folder_is_no_table(folder):
    with pytest.raises(ConfigError, match="expected a file, got a folder"):
        arguments.table_file(Path(folder), is_csv=None)


def test_threads_are_told_to_the_engine(monkeypatch):
    monkeypatch.setenv(arguments.THREADS_VARIABLE, "7")
    arguments.limit_threads(None)
    assert arguments.os.environ[arguments.THREADS_VARIABLE] == "7"
    arguments.limit_threads(2)
    assert arguments.os.environ[arguments.THREADS_VARIABLE] == "2"
