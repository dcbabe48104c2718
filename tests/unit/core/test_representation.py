"""Objects as JSON values, in one line, and as tables in notebooks; counts in words."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import date
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest

import overtaking as ot
from overtaking.core.representation import format_count, json_values
from overtaking.data.views import Verdict


@dataclass
class Point:
    x: float
    tags: tuple[str, ...]


def test_values_of_every_supported_type_become_json_values() -> None:
    value = {
        1: Point(x=np.float32(0.5), tags=("a", "b")),
        "array": np.array([1.0, np.nan, np.inf]),
        "counts": np.array([[1, 2]]),
        "bytes": b"\x01\xff",
        "day": date(2024, 2, 29),
        "plain": [None, True, 3, "text"],
    }
    plain = json_values(value)
    assert plain == {
        "1": {"x": 0.5, "tags": ["a", "b"]},
        "array": [1.0, None, None],
        "counts": [[1, 2]],
        "bytes": "01ff",
        "day": "2024-02-29",
        "plain": [None, True, 3, "text"],
    }
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0, "0 simulations"),
        (1, "1 simulation"),
        (2, "2 simulations"),
        (1_000_000, "1,000,000 simulations"),
    ],
)
def test_only_a_count_of_one_has_a_singular_noun(number: int, text: str) -> None:
    assert format_count(number, "simulation") == text


SHORT = {"time.horizon_s": 2.0, "time.attempt_deadline_s": 1.0}
SAMPLED = "profile='pinto2023-physical', road='town06', seed=1, simulations=3, vehicles=6"


@pytest.fixture(scope="module")
def labelled() -> ot.LabelledTrajectories:
    return ot.label(
        ot.simulate(ot.sample("pinto2023-physical", num_simulations=3, seed=1, overrides=SHORT))
    )


def test_batches_say_what_they_are_in_a_line(labelled):
    runs = labelled.trajectories
    assert repr(runs.scenario) == f"Scenario({SAMPLED})"
    assert repr(runs) == f"Trajectories({SAMPLED}, frames=41, ms=50)"
    assert repr(labelled) == f"LabelledTrajectories({SAMPLED}, frames=41, ms=50)"
    assert repr(runs.scenario.drivers) == "DriverTraits(simulations=3)"
    assert repr(labelled.paper_features) == "PaperFeatures(reading='paper', simulations=3)"


def test_nothing_is_worked_out_to_be_shown(labelled):
    assert repr(labelled.signals) == "EgoSignals(frame_interval_ms=50, simulations=3)"
    with pytest.raises(AttributeError):
        object.__getattribute__(labelled.signals, "gap")


def test_a_notebook_gets_a_table_with_headers_and_a_caption(labelled):
    scenario = labelled.trajectories.scenario.replace(profile="<b>&")
    table = ET.fromstring(scenario._repr_html_())
    assert table.findtext("caption") == "Scenario"
    rows = {row.findtext("th"): row.findtext("td") for row in table.iter("tr")}
    assert rows["profile"] == "<b>&"
    assert rows["simulations"] == "3"
    assert {cell.get("scope") for cell in table.iter("th")} == {"row"}


def test_a_verdict_is_a_line_in_a_terminal_and_a_table_in_a_notebook():
    rules = pd.DataFrame({"verdict": ["illegal", "legal", "illegal"]}, index=["L3", "L4", "L12"])
    verdict = Verdict(
        simulation=3,
        outcome="completed",
        detail="returned",
        classes={"paper": "Success_I"},
        phases={"t_a": 1.8},
        rules=rules,
    )
    assert repr(verdict) == (
        "Verdict(simulation=3, outcome='completed', detail='returned', "
        "class_paper='Success_I', broken='L3, L12')"
    )
    page = verdict._repr_html_()
    assert page.startswith("<table><caption>Verdict</caption>")
    assert '<th scope="row">broken</th><td>L3, L12</td>' in page
