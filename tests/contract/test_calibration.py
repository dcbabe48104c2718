"""The parameters of the fitted profiles are those whose figures are written down."""

from __future__ import annotations

import importlib.util
import json
import sys
import tomllib
from pathlib import Path

import pytest

from overtaking.analysis.reproduction.run import parameter_hash
from overtaking.analysis.reproduction.statements import calibration as fitted_to_the_study
from overtaking.analysis.reproduction.statements import statements
from overtaking.analysis.validation.figures import DEFINITIONS, HEAD_ON, PASSES, RATE
from overtaking.analysis.validation.targets import targets
from overtaking.scenarios import profiles

FOLDER = Path(__file__).resolve().parents[2] / "calibration"
PLAN = tomllib.loads((FOLDER / "plan.toml").read_text(encoding="utf-8"))


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


def test_the_frozen_figures_are_judged_by_the_limits_in_use():
    frozen = json.loads((FOLDER / "motorway.json").read_text(encoding="utf-8"))
    figures = frozen["validation"]["figures"]
    assert [one["name"] for one in figures] == list(targets())
    for one in figures:
        target = targets()[one["name"]]
        limits = [one[side] for side in ("target_low", "target_high") if one[side] is not None]
        assert limits == pytest.approx([target.scale * limit.number for limit in target.limits])
        assert one["standing"] == target.standing


def test_the_frozen_parameters_miss_only_what_the_plan_says():
    frozen = json.loads((FOLDER / "motorway.json").read_text(encoding="utf-8"))
    missed = [one["name"] for one in frozen["validation"]["figures"] if one["met"] is False]
    assert missed == PLAN["missed"]


def test_every_figure_has_one_declaration_and_a_standing():
    assert list(targets()) == [one.name for one in (RATE, *DEFINITIONS)]
    assert list(targets("passes")) == [one.name for one in (*PASSES, HEAD_ON)]


def test_rural_is_judged_with_a_seed_that_nothing_was_fitted_with():
    assert PLAN["rural"]["judged_with"] not in PLAN["rural"]["fitted_with"]


def test_the_drivers_are_searched_on_the_fitted_figures_and_judged_with_another_seed():
    module = calibration()
    fitted = {name for name, one in targets().items() if one.standing == "fitted"}
    assert fitted == module.FITTED_ON
    assert {"lane_change_duration", "gap_time"} <= fitted
    assert module.SEARCH_SEED != module.CHECK_SEED


def test_the_drivers_of_the_study_are_those_that_were_frozen():
    now = parameter_hash(profiles.load_specification("pinto2023"))
    frozen = json.loads((FOLDER / "pinto2023.json").read_text(encoding="utf-8"))
    advice = "after a change on purpose: calibration/README.md says how to freeze, and review"
    assert fitted_to_the_study().parameters_sha256 == now, advice
    assert frozen["parameters_sha256"] == now, advice


@pytest.mark.ci
def test_the_frozen_numbers_of_the_study_are_what_its_drivers_give():
    module = calibration("pinto2023")
    frozen = json.loads(module.FROZEN.read_text(encoding="utf-8"))
    found = module.run(6, module.CHECK_SEED)
    assert set(found) == set(frozen["numbers"]) == set(module.fitted())
    for name, one in frozen["numbers"].items():
        assert one["study"] == statements()[name].quoted
        kind = "count" if name.startswith("count") else name.split("_")[0].upper()
        # Six sets of 276 against twenty: within a few standard deviations of six.
        assert found[name] == pytest.approx(one["ours"], abs=5.0 * module.TOLERANCE[kind])


def test_the_parameters_of_the_study_lie_where_they_can_be_defended():
    module = calibration("pinto2023")
    for one, value in zip(module.SEARCHED, module.now(), strict=True):
        assert one.low <= value <= one.high, one.name


def test_the_search_notices_egos_that_are_blind():
    module = calibration("pinto2023")
    place = [one.name for one in module.SEARCHED].index("weather.pushes.sight_m")
    blind = tuple(2.0 if number == place else value for number, value in enumerate(module.now()))
    found = module.run(1, module.SEARCH_SEED, blind)
    assert found["count_no_attempt"] > module.run(1, module.SEARCH_SEED)["count_no_attempt"]
    assert module.distance(found) > module.distance(module.run(1, module.SEARCH_SEED))


def test_the_search_writes_into_the_profile_what_it_finds():
    module = calibration("pinto2023")
    text = module.TARGET.read_text(encoding="utf-8")
    for one in module.SEARCHED:
        assert module.with_value(text, one.name, module._value(one)).count("\n") == text.count("\n")
        changed = tomllib.loads(module.with_value(text, one.name, 7.25))
        before = tomllib.loads(text)
        *sections, key = one.name.split(".")
        for section in sections:
            changed, before = changed[section], before[section]
        assert changed.pop(key) == 7.25
        assert before.pop(key) == module._value(one)
        assert changed == before
