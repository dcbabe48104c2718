"""A hostile ONNX file ends its own process, and the caller gets one line that names the file."""

from __future__ import annotations

import gc
import os
import signal
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.processes import eventually, is_running

import overtaking as ot
from overtaking.api import evaluation
from overtaking.core.errors import ConfigError, DriverError
from overtaking.model.driver_interface import OBSERVATION_SIZE
from overtaking.sim import built_in_drivers

if TYPE_CHECKING:
    from pathlib import Path

onnx: Any = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

pytestmark = pytest.mark.ci

SHORT = {"time.horizon_s": 12.0, "time.attempt_deadline_s": 12.0}
HUGE = 50_000_000_000
"""Bytes of an array that no laptop has."""

helper, FLOAT = onnx.helper, onnx.TensorProto.FLOAT
linux_only = pytest.mark.skipif(sys.platform != "linux", reason="only Linux bounds the memory")


def constant(name: str, values: Any, kind: type = np.int64) -> Any:
    """An array that a network holds."""
    return onnx.numpy_helper.from_array(np.array(values, kind), name)


def write_network(
    path: Path,
    nodes: list[Any],
    constants: list[Any],
    *,
    action: tuple[int, list[str | int]] = (FLOAT, ["n", 2]),
    observation: tuple[int, list[str | int]] = (FLOAT, ["n", OBSERVATION_SIZE]),
) -> Path:
    """Write a network from `observation` to `action`, with their types and shapes."""
    inputs, outputs = (
        [helper.make_tensor_value_info(name, *spec)]
        for name, spec in (("seen", observation), ("action", action))
    )
    graph = helper.make_graph(nodes, "test", inputs, outputs, constants)
    opset = [helper.make_opsetid("", 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=9), path)
    return path


def linear(path: Path, *, num_parts: int = 2, factor: float = 0.0) -> Path:
    """A network of one layer, which answers `factor` times the sum of its inputs."""
    weights = constant("weights", np.full((OBSERVATION_SIZE, num_parts), factor), np.float32)
    layer = helper.make_node("MatMul", ["seen", "weights"], ["action"])
    return write_network(path, [layer], [weights], action=(FLOAT, ["n", num_parts]))


def allocating(path: Path, num_bytes: int) -> Path:
    """A network that computes the mean of an array of float32."""
    nodes = [
        helper.make_node("ReduceSum", ["seen"], ["sum"], keepdims=0),
        helper.make_node("Expand", ["sum", "shape"], ["ones"]),
        helper.make_node("ReduceMean", ["ones"], ["mean"], keepdims=0),
        helper.make_node("MatMul", ["seen", "weights"], ["zeros"]),
        helper.make_node("Add", ["zeros", "mean"], ["action"]),
    ]
    constants = [
        constant("shape", [num_bytes // 4]),
        constant("weights", np.zeros((OBSERVATION_SIZE, 2)), np.float32),
    ]
    return write_network(path, nodes, constants)


def looping(path: Path, *, if_nonzero: bool = False) -> Path:
    """A network with a loop of 2^62 rounds; `if_nonzero` skips the loop for zeros."""
    body = helper.make_graph(
        [
            helper.make_node("Identity", ["running"], ["still_running"]),
            helper.make_node("Add", ["total", "step"], ["next_total"]),
        ],
        "body",
        [
            helper.make_tensor_value_info("round", onnx.TensorProto.INT64, []),
            helper.make_tensor_value_info("running", onnx.TensorProto.BOOL, []),
            helper.make_tensor_value_info("total", FLOAT, ["n", 2]),
        ],
        [
            helper.make_tensor_value_info("still_running", onnx.TensorProto.BOOL, []),
            helper.make_tensor_value_info("next_total", FLOAT, ["n", 2]),
        ],
        [constant("step", 1.0, np.float32)],
    )
    nodes = [
        helper.make_node("MatMul", ["seen", "weights"], ["zeros"]),
        helper.make_node("ReduceMax", ["seen"], ["largest"], keepdims=0),
        helper.make_node("Greater", ["largest", "zero"], ["is_nonzero"]),
        helper.make_node("Cast", ["is_nonzero"], ["factor"], to=onnx.TensorProto.INT64),
        helper.make_node("Mul", ["factor", "many"], ["conditional_rounds"]),
        helper.make_node(
            "Loop",
            ["conditional_rounds" if if_nonzero else "many", "", "zeros"],
            ["action"],
            body=body,
        ),
    ]
    constants = [
        constant("weights", np.zeros((OBSERVATION_SIZE, 2)), np.float32),
        constant("zero", 0.0, np.float32),
        constant("many", 1 << 62),
    ]
    return write_network(path, nodes, constants)


def of_shape(path: Path, shape: list[int]) -> Path:
    """A network whose output has a fixed shape."""
    node = helper.make_node("ConstantOfShape", ["shape"], ["action"])
    return write_network(path, [node], [constant("shape", shape)], action=(FLOAT, [*shape]))


def load_error(path: Path) -> str:
    """The message with which a file is refused."""
    with pytest.raises(ConfigError) as caught:
        evaluation.load_driver(str(path), "truth", action="accel_lane", action_repeat=1)
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


def drive_error(path: Path) -> str:
    """The message with which a drive ends."""
    driver = evaluation.load_driver(str(path), "truth", action="accel_lane", action_repeat=1)
    scenes = ot.sample("pinto2023-physical", num_simulations=2, seed=1, overrides=SHORT)
    with pytest.raises(DriverError) as caught:
        ot.drive(scenes, driver.function, observation="truth")
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_a_truncated_file_is_refused(tmp_path: Path, repository: Path, share: float):
    content = (repository / "examples" / "rl" / "learned.onnx").read_bytes()
    path = tmp_path / "truncated.onnx"
    path.write_bytes(content[: int(share * len(content))])
    assert "expected an ONNX model" in load_error(path)


@linux_only
@pytest.mark.parametrize("num_bytes", [2049 * 2**20, HUGE])
def test_a_network_that_allocates_more_than_2_gib_is_refused(tmp_path: Path, num_bytes: int):
    path = allocating(tmp_path / "large.onnx", num_bytes)
    assert "expected at most 2048 MiB of memory" in load_error(path)


@linux_only
def test_a_constant_of_50_gb_is_refused(tmp_path: Path):
    path = of_shape(tmp_path / "constant.onnx", [3, HUGE // 12])
    assert "expected at most 2048 MiB of memory" in load_error(path)


def test_a_network_that_does_not_end_is_stopped_at_the_time_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = looping(tmp_path / "loop.onnx")
    monkeypatch.setattr(built_in_drivers, "TIMEOUT_S", 1.0)
    assert "an answer within 1 s" in load_error(path)


def test_a_network_that_ends_for_zeros_only_is_stopped_in_the_drive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = looping(tmp_path / "loop.onnx", if_nonzero=True)
    driver = evaluation.load_driver(str(path), "truth", action="accel_lane", action_repeat=1)
    monkeypatch.setattr(built_in_drivers, "TIMEOUT_S", 1.0)
    scenes = ot.sample("pinto2023-physical", num_simulations=2, seed=1, overrides=SHORT)
    with pytest.raises(DriverError, match=r"loop\.onnx.*within 1 s"):
        ot.drive(scenes, driver.function, observation="truth")


@pytest.mark.parametrize("shape", [[], [3, 0], [3, 50], [2, 2], [3, 2, 1], [2]])
def test_an_output_that_is_no_action_is_refused(tmp_path: Path, shape: list[int]):
    message = load_error(of_shape(tmp_path / "shape.onnx", shape))
    assert "of shape (simulation, " in message


def test_an_output_with_another_number_of_parts_than_the_action_is_refused(tmp_path: Path):
    message = load_error(linear(tmp_path / "parts.onnx", num_parts=3))
    assert "expected 2 parts (accel, lane_change), got 3" in message


def test_a_network_may_answer_with_the_eight_parts_of_a_trajectory(tmp_path: Path):
    path = linear(tmp_path / "trajectory.onnx", num_parts=8)
    driver = evaluation.load_driver(str(path), "truth", action="trajectory", action_repeat=1)
    scenes = ot.sample("pinto2023-physical", num_simulations=2, seed=1, overrides=SHORT)
    trajectories = ot.drive(scenes, driver.function, observation="truth", action="trajectory")
    # All points of the answers are at the vehicle itself, so the ego brakes.
    last_frame = trajectories.num_frames - 1
    speed = trajectories.states.speed[[0, 1], 0, last_frame]
    assert (speed < trajectories.states.speed[:, 0, 0]).all()


def test_a_fixed_number_of_rows_that_fits_the_check_is_refused_in_the_drive(tmp_path: Path):
    assert "(3, 2) for 2 simulations" in drive_error(of_shape(tmp_path / "fixed.onnx", [3, 2]))


def test_an_output_that_is_not_finite_is_refused(tmp_path: Path):
    node = helper.make_node("MatMul", ["seen", "weights"], ["action"])
    weights = constant("weights", np.full((OBSERVATION_SIZE, 2), np.nan), np.float32)
    path = write_network(tmp_path / "nan.onnx", [node], [weights])
    assert "expected finite numbers" in load_error(path)


def test_text_as_output_is_refused(tmp_path: Path):
    node = helper.make_node("Cast", ["seen"], ["action"], to=onnx.TensorProto.STRING)
    path = write_network(
        tmp_path / "text.onnx",
        [node],
        [],
        action=(onnx.TensorProto.STRING, ["n", OBSERVATION_SIZE]),
    )
    assert "values of type object" in load_error(path)


def test_an_input_of_float64_is_refused(tmp_path: Path):
    node = helper.make_node("Identity", ["seen"], ["action"])
    spec = (onnx.TensorProto.DOUBLE, ["n", OBSERVATION_SIZE])
    path = write_network(tmp_path / "double.onnx", [node], [], action=spec, observation=spec)
    assert "expected an input of float32 numbers" in load_error(path)


def test_weights_in_another_file_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = linear(tmp_path / "outside.onnx")
    model = onnx.load(path)
    onnx.save(
        model,
        path,
        save_as_external_data=True,
        location="weights.bin",
        size_threshold=0,
        convert_attribute=False,
    )
    assert (tmp_path / "weights.bin").stat().st_size
    monkeypatch.chdir(tmp_path)
    assert "expected an ONNX model" in load_error(path)


@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
def test_a_process_that_is_killed_ends_one_drive_and_starts_again_for_the_next(tmp_path: Path):
    path = linear(tmp_path / "linear.onnx")
    driver = built_in_drivers.OnnxDriver(path)
    scenes = ot.sample("pinto2023-physical", num_simulations=2, seed=1, overrides=SHORT)
    actions = ot.drive(scenes, driver, observation="truth").actions
    os.kill(process_id(driver), signal.SIGKILL)
    with pytest.raises(DriverError, match=r"linear\.onnx.*SIGKILL"):
        ot.drive(scenes, driver, observation="truth")
    again = ot.drive(scenes, driver, observation="truth").actions
    assert actions is not None
    assert again is not None
    assert np.array_equal(actions.values, again.values)


def test_an_interrupted_decision_leaves_no_answer_for_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    driver = built_in_drivers.OnnxDriver(linear(tmp_path / "linear.onnx", factor=1.0))
    receive = built_in_drivers._receive

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(built_in_drivers, "_receive", interrupt)
    with pytest.raises(KeyboardInterrupt):
        driver._request(np.ones((2, OBSERVATION_SIZE), np.float32), DriverError)
    monkeypatch.setattr(built_in_drivers, "_receive", receive)
    driver._start(DriverError)
    answer = driver._request(np.zeros((2, OBSERVATION_SIZE), np.float32), DriverError)
    assert np.array_equal(answer, np.zeros((2, 2)))


def test_a_driver_that_is_no_longer_used_ends_its_process(tmp_path: Path):
    driver = built_in_drivers.OnnxDriver(linear(tmp_path / "linear.onnx"))
    process = process_id(driver)
    del driver
    gc.collect()
    assert eventually(lambda: not is_running(process))


def process_id(driver: built_in_drivers.OnnxDriver) -> int:
    """Process in which a network runs."""
    assert driver._worker is not None
    return driver._worker.pid
