"""The parameters of `motorway` are those whose figures are written down."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "calibration"


def calibration():
    found = importlib.util.spec_from_file_location("motorway_calibration", FOLDER / "motorway.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
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
