"""A driver beside others in the same scenes: from Python, the command line, and a file."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import overtaking as ot
from overtaking.analysis.evaluation.endpoints import EVERY, PRIMARY
from overtaking.analysis.evaluation.words import warnings
from overtaking.api import evaluation
from overtaking.cli import main
from overtaking.core.errors import ConfigError, DriverError
from overtaking.model.driver_interface import OBSERVATION_SIZE, PASSING_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Callable

pytestmark = pytest.mark.ci

SHORT = {"time.horizon_s": 12.0, "time.attempt_deadline_s": 12.0}
EXAMPLES = Path(__file__).parents[2] / "examples"
ARGUMENTS = ["--set", "time.horizon_s=12.0", "--set", "time.attempt_deadline_s=12.0"]


def test_the_built_in_ego_as_a_policy_does_not_differ_from_it():
    name = f"{EXAMPLES / 'human_ego.py'}:HumanEgo"
    ego = evaluation.resolve_driver(name, "human", action="decision", action_repeat=1)
    found = ot.evaluate(
        ego, "pinto2023-physical", num_simulations=24, seed=3, references=["human"], overrides=SHORT
    )
    assert found.drivers == ("HumanEgo", "human")
    assert {one.pairs for one in found.contrasts} == {0}
    assert {one.verdict for one in found.contrasts} == {"too few"}
    for one in EVERY:
        values = [found.rate(driver, one.name).value for driver in found.drivers]
        np.testing.assert_array_equal(*values)


def test_rates_are_those_of_the_labels():
    found = ot.evaluate("rules", "pinto2023-physical", num_simulations=40, seed=3, overrides=SHORT)
    scenes = ot.sample("pinto2023-physical", num_simulations=40, seed=3, overrides=SHORT)
    labelled = ot.label(ot.simulate(scenes))
    assert found.counts["human"]["collision"] == (labelled.events.collision >= 0).sum()
    assert found.counts["human"]["attempted"] == labelled.events.has_attempt.sum()
    legal = labelled.labels.is_legal[:, labelled.labels.policies.index("default")]
    assert found.rate("human", "legal").value == pytest.approx(legal.mean())
    assert found.rate("stay", "gained").value == 0.0
    primary = [one for one in found.contrasts if one.is_primary]
    assert len(primary) == len(PRIMARY) * len(found.references)
    assert all(one.adjusted != one.adjusted for one in primary)  # Not corrected.


def test_a_profile_of_the_package_stands_for_its_risky_one():
    road = {**SHORT, "traffic.vehicles": [2, 12], "traffic.sight_m": [5.0, 10.0]}
    risky = ot.evaluate(
        "stay", "motorway", num_simulations=4, seed=1, references=["human"], overrides=road
    )
    met = ot.evaluate(
        "stay",
        "motorway",
        num_simulations=4,
        seed=1,
        references=["human"],
        overrides=road,
        natural=True,
    )
    assert (risky.profile, met.profile) == ("motorway-risk", "motorway")
    assert met.effective == pytest.approx(4.0)


def test_weighted_rates_are_those_that_brute_force_finds():
    """Dense nights and pressing egos are drawn more often; what happens is as frequent as ever."""
    bent = [
        {
            "name": "dense nights",
            "share": 0.5,
            "powers": {"density": 0.3, "ego_driving_style": 0.3},
            "parts": {"sun": [0.0, 0.5]},
        }
    ]
    short = {"time.horizon_s": 40.0, "time.attempt_deadline_s": 30.0}
    options = {"references": ["human"], "natural": True}
    risky = {**short, "proposal": bent}
    some = ot.evaluate("stay", "motorway", num_simulations=250, seed=11, overrides=risky, **options)
    many = ot.evaluate("stay", "motorway", num_simulations=250, seed=12, overrides=short, **options)
    assert many.effective == pytest.approx(250.0)
    assert some.effective < 230.0
    for name in ("attempted_per_scenes", "lateral", "legal"):
        here, there = (one.rate("human", name) for one in (some, many))
        error = np.hypot(here.high - here.low, there.high - there.low) / (2.0 * 1.96)
        assert abs(here.value - there.value) < 3.5 * error, name


def test_clipped_answers_are_counted_and_told():
    def hasty(observation: ot.Observation) -> np.ndarray:
        return np.tile([300.0, 0.0], (len(observation.is_running), 1))

    driver = ot.Driver(function=hasty, observation="truth", action="speed_lane", action_repeat=20)
    found = ot.evaluate(
        driver,
        "pinto2023-physical",
        num_simulations=6,
        seed=1,
        references=["stay"],
        overrides=SHORT,
    )
    counts = found.values()["counts"]
    assert counts[found.policy]["clipped"] > 6
    assert counts["stay"]["clipped"] == 0
    assert any("and clipped" in one for one in warnings(found))


def test_the_page_and_what_the_command_prints(tmp_path, capsys):
    words = ["evaluate", "pinto2023-physical", "--driver", "rules", "-n", "30", *ARGUMENTS]
    assert main([*words, "--out", str(tmp_path), "--films", "1", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["policy"] == "rules"
    assert values["against"] == ["human", "stay"]
    assert values["claims_conformity"] is False
    assert {one["endpoint"] for one in values["contrasts"] if one["primary"]} == {
        one.name for one in PRIMARY
    }
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "No conformity with any regulation or standard is claimed" in page
    assert page.count("<img") == 3
    assert not re.search(r"(src|href)=\"(https?:)?//", page)
    films = sorted(one.name for one in (tmp_path / "films").glob("*.mp4"))
    assert [f"films/{name}" in page for name in films] == [True]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "Differences of the primary endpoints" in told
    assert "too few" in told


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--driver", "nobody.py:f"], "--driver: driver"),
        (["--driver", "json:dumps"], "--observation"),
        (
            ["--driver", "rules", "--references", "humn,stay"],
            "--references: driver: expected human, ",
        ),
        (["--driver", "rules", "--references", "human,sty"], "expected stay, "),
        (["--driver", "rule", "--observation", "human"], "--driver: driver: expected rules, "),
        (["--driver", "rules", "--references", "no_module:f"], "--references: driver: "),
        (["--driver", "json:dmps", "--observation", "human"], "expected json:dumps, "),
        (["--driver", "json:", "--observation", "human"], "--driver: driver: "),
        (["--driver", "nobody.py:f", "--observation", "human"], "driver"),
        (["--driver", "human"], "each once"),
        (["--driver", "rules", "--benchmark", "nothing"], "overtake"),
        (["--driver", "rules", "--benchmark", "overtake", "-n", "5"], "fixes them"),
    ],
)
def test_what_cannot_be_evaluated_is_one_line(words, said, capsys):
    assert main(["evaluate", *words]) == 2
    told = capsys.readouterr()
    assert not told.out
    assert said in told.err
    assert len(told.err.strip().splitlines()) == 1


def test_a_policy_that_fails_is_told_with_scene_and_time():
    def breaks(observation: ot.Observation) -> np.ndarray:
        raise RuntimeError("no idea" * (observation.decision_index > 10))

    with pytest.raises(DriverError, match="simulation 0"):
        ot.evaluate(
            ot.Driver(function=breaks, observation="human"),
            "pinto2023-physical",
            num_simulations=4,
            seed=1,
        )


def network(path: Path, width: int = OBSERVATION_SIZE) -> Callable[[ot.Observation], np.ndarray]:
    """Write a network of one layer, and return the same as a function."""
    onnx = pytest.importorskip("onnx")
    helper, numeric = onnx.helper, onnx.TensorProto.FLOAT
    weights = np.zeros((width, 2), np.float32)
    weights[:2, 0] = -0.05, 0.25  # Speed and acceleration.
    weights[2:4, 1] = 1e-4, 0.1  # Position and lateral position.
    shapes = {"seen": ["n", width], "action": ["n", 2]}
    inputs, outputs = (
        [helper.make_tensor_value_info(name, numeric, shapes[name])] for name in ("seen", "action")
    )
    layer = helper.make_node("MatMul", ["seen", "weights"], ["action"])
    graph = helper.make_graph(
        [layer], "linear", inputs, outputs, [onnx.numpy_helper.from_array(weights, "weights")]
    )
    opset = [helper.make_opsetid("", 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=9), path)

    def same(observation: ot.Observation) -> np.ndarray:
        return observation.table[:, :width] @ weights

    return same


@pytest.mark.parametrize("width", [OBSERVATION_SIZE, OBSERVATION_SIZE - len(PASSING_COLUMNS)])
def test_a_network_in_a_file_drives_as_the_same_function(tmp_path, width):
    pytest.importorskip("onnxruntime")
    path = tmp_path / "linear.onnx"
    same = network(path, width)
    driver = evaluation.load_driver(str(path), "truth", action="accel_lane", action_repeat=4)
    assert driver.sha256
    scenes = ot.sample("pinto2023-physical", num_simulations=8, seed=1, overrides=SHORT)
    options = {"observation": "truth", "action_repeat": 4}
    runs = [ot.drive(scenes, one, **options) for one in (driver.function, same)]
    first, second = (one.actions for one in runs)
    assert first is not None
    assert second is not None
    difference = first.values.astype(int) - second.values
    assert np.abs(difference).max() <= 1  # A step of rounding.
    found = ot.evaluate(
        driver,
        "pinto2023-physical",
        num_simulations=8,
        seed=1,
        references=["stay"],
        overrides=SHORT,
    )
    assert found.policy == "linear.onnx"
    assert found.digest == driver.sha256


def test_the_network_of_the_examples_overtakes_and_signals_before(repository: Path):
    pytest.importorskip("onnxruntime")
    path = repository / "examples" / "rl" / "learned.onnx"
    assert path.stat().st_size < 100_000
    driver = evaluation.load_driver(str(path), "truth", action="decision", action_repeat=20)
    scenes = ot.sample("pinto2023-physical", num_simulations=60, seed=11)
    runs = ot.drive(
        scenes, driver.function, observation="truth", action="decision", action_repeat=20
    )
    events = ot.label(runs).events
    assert events.has_attempt.sum() > 30
    assert events.is_completed.sum() > 10
    assert runs.actions
    moves = runs.actions.values[:, :, 0]
    for one, first in zip(*np.nonzero(moves == ot.Move.PULL_OUT), strict=True):
        assert (moves[one, max(first - 40, 0) : first] != ot.Move.KEEP).any()


def test_the_table_of_the_benchmark_names_the_network_that_is_shipped(repository: Path):
    """A row of another file would be of another driver."""
    network = (repository / "examples" / "rl" / "learned.onnx").read_bytes()
    page = (repository / "docs" / "how-to" / "evaluate-a-driver.md").read_text("utf-8")
    assert f"SHA-256 `{hashlib.sha256(network).hexdigest()[:16]}`" in page


def test_a_file_that_is_no_network_of_that_shape_is_refused(tmp_path):
    pytest.importorskip("onnxruntime")
    wide, text = tmp_path / "wide.onnx", tmp_path / "text.onnx"
    network(wide, OBSERVATION_SIZE + 1)
    text.write_bytes(b"no network")
    for path, said in (
        (wide, "one input of shape"),
        (text, "an ONNX model"),
        (tmp_path / "none.onnx", "a file that can be read"),
    ):
        with pytest.raises(ConfigError, match=said):
            evaluation.load_driver(str(path), "human", action="accel_lane", action_repeat=1)


def test_an_unknown_reference_in_python_names_the_argument():
    with pytest.raises(ConfigError, match=r"references: expected human or .*, got humn"):
        ot.evaluate("rules", "pinto2023-physical", num_simulations=4, references=["humn"])


@pytest.mark.parametrize(
    ("words", "drawn", "has_note"),
    [
        (["rural"], "rural-risk", True),
        (["rural", "--natural"], "rural", False),
        (["rural-risk"], "rural-risk", False),
        (["pinto2023-physical"], "pinto2023-physical", False),
    ],
)
def test_output_and_page_name_the_profile_of_the_drawn_scenes(
    words, drawn, has_note, tmp_path, capsys
):
    command = [
        "evaluate",
        *words,
        "--driver",
        "stay",
        "--references",
        "human",
        "-n",
        "8",
        *ARGUMENTS,
    ]
    assert main([*command, "--json", "--out", str(tmp_path / "page"), "--films", "0"]) == 0
    output = capsys.readouterr()
    values = json.loads(output.out)
    assert (values["profile"], values["asked_profile"]) == (drawn, words[0])
    assert values["law_policy"] == "default"
    note = f"drawn from {drawn}, in which dangerous scenes are more frequent"
    assert (note in output.err and "--natural" in output.err) == has_note
    page = next((tmp_path / "page").glob("*.html")).read_text()
    assert f"8 scenes of {drawn}" in page
    assert (note in page) == has_note
