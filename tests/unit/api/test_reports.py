"""`film` and `write_report` take several kinds of sources, and name them in their errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

import overtaking as ot
from overtaking.analysis.law_statistics import ToleranceCurve
from overtaking.analysis.reproduction.run import Reproduction
from overtaking.analysis.whatif.twin import Twin
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from pathlib import Path


def empty(kind: type[Any]) -> Any:
    """An object of a class without its values, which are not read."""
    return object.__new__(kind)


def test_a_result_without_a_report_names_the_functions_whose_results_have_one():
    with pytest.raises(
        ConfigError,
        match="run_benchmark or reproduce_study returned, got an object of type ToleranceCurve",
    ):
        ot.write_report(empty(ToleranceCurve), "page")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"films": 3}, "films: expected no such option for a Reproduction, got 3"),
        ({"policy": "paper"}, "policy: expected no such option for a Reproduction, got paper"),
        ({"weighted": True}, "weighted: expected no such option for a Reproduction, got True"),
    ],
)
def test_an_option_for_other_sources_is_refused(options: dict[str, Any], message: str):
    with pytest.raises(ConfigError, match=message):
        empty(Reproduction).write_report("page", **options)


def test_the_report_on_a_result_needs_a_folder():
    with pytest.raises(ConfigError, match="out: expected a folder for the page on a Reproduction"):
        ot.write_report(empty(Reproduction), None)  # pyright: ignore[reportCallIssue, reportArgumentType]


def test_films_of_the_worst_scenes_are_not_for_data_sets(tmp_path: Path):
    with pytest.raises(ConfigError, match="films: expected no such option for a data set"):
        ot.write_report(tmp_path, films=3)  # pyright: ignore[reportCallIssue, reportArgumentType]
    with pytest.raises(ConfigError, match=r"films: .*got 0"):
        ot.write_report(tmp_path, films=0)  # pyright: ignore[reportCallIssue, reportArgumentType]


def test_a_source_that_cannot_be_filmed_is_refused():
    with pytest.raises(
        ConfigError, match="what label returned, or a Twin, got an object of type ToleranceCurve"
    ):
        ot.film(empty(ToleranceCurve), "film.mp4")


def test_the_film_of_a_twin_needs_a_file_and_takes_no_choice_of_simulations():
    twin = empty(Twin)
    with pytest.raises(ConfigError, match="out: expected an mp4 file for the film of a twin"):
        ot.film(twin, None)  # pyright: ignore[reportCallIssue, reportArgumentType]
    with pytest.raises(ConfigError, match="simulation_ids: expected no such option for a twin"):
        ot.film(twin, "twin.mp4", simulation_ids=[1])  # pyright: ignore[reportCallIssue, reportArgumentType]
    with pytest.raises(ConfigError, match="threads: expected no such option for a twin"):
        ot.film(twin, "twin.mp4", threads=2)  # pyright: ignore[reportCallIssue, reportArgumentType]


@pytest.mark.parametrize("branches", [{}, [], {"as it was": 3}, "twin"])
def test_branches_are_batches_by_title(branches: Any, tmp_path: Path):
    with pytest.raises(ConfigError, match="branches: expected a Twin, or batches of one simul"):
        ot.whatif.save_branches(tmp_path, branches, tmp_path / "branches")
