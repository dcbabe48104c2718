"""The parameters of the fitted profiles are those whose figures are written down."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import pytest

from overtaking import scenarios
from overtaking.analysis.reproduction.run import parameter_hash
from overtaking.knowledge.paper import calibration as fitted_to_the_study
from overtaking.knowledge.paper import statements

FOLDER = Path(__file__).resolve().parents[2] / "calibration"


def calibration(profile: str = "motorway"):
    name = f"{profile}_calibration"
    found = importlib.util.spec_from_file_location(name, FOLDER / f"{profile}.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    sys.modules[name] = module
    found.loader.exec_module(module)
    return module


def test_the_frozen_figures_belong_to_the_parameters_in_use():
    module = calibration()
    frozen = json.loads(module.FROZEN.read_text(encoding="utf-8"))
    advice = "after a change on purpose: python calibration/motorway.py --freeze, and review"
    assert frozen["parameters_sha256"] == module.parameter_hash(), advice


def test_the_frozen_parameters_meet_every_target():
    frozen = json.loads((FOLDER / "motorway.json").read_text(encoding="utf-8"))
    missed = [one["name"] for one in frozen["validation"]["figures"] if one["met"] is False]
    assert missed == []


def test_the_drivers_of_the_study_are_those_that_were_frozen():
    now = parameter_hash(scenarios.spec("pinto2023"))
    frozen = json.loads((FOLDER / "pinto2023.json").read_text(encoding="utf-8"))
    advice = "after a change on purpose: calibration/README.md says how to freeze, and review"
    assert fitted_to_the_study().parameters_sha256 == now, advice
    assert frozen["parameters_sha256"] == now, advice


def test_the_frozen_numbers_of_the_study_are_what_its_drivers_give():
    module = calibration("pinto2023")
    frozen = json.loads(module.FROZEN.read_text(encoding="utf-8"))
    found = module.run(2, module.CHECK_SEED)
    assert set(found) == set(frozen["numbers"]) == set(module.fitted())
    for name, one in frozen["numbers"].items():
        assert one["study"] == statements()[name].quoted
        kind = "count" if name.startswith("count") else name.split("_")[0].upper()
        # Two sets of 276 against twenty: within a few standard deviations of two.
        assert found[name] == pytest.approx(one["ours"], abs=5.0 * module.TOLERANCE[kind])


def test_the_parameters_of_the_study_lie_where_they_can_be_defended():
    module = calibration("pinto2023")
    for one, value in zip(module.SEARCHED, module.now(), strict=True):
        assert one.low <= value <= one.high, one.name


def test_the_search_notices_who_cannot_overtake_any_more():
    module = calibration("pinto2023")
    place = [one.name for one in module.SEARCHED].index("pull_out_time")
    never = tuple(
        1.6 if number in (place, place + 1) else value for number, value in enumerate(module.now())
    )
    found = module.run(1, module.SEARCH_SEED, never)
    assert found["count_no_attempt"] > module.run(1, module.SEARCH_SEED)["count_no_attempt"]
    assert module.distance(found) > module.distance(module.run(1, module.SEARCH_SEED))
