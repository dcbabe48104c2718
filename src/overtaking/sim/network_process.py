"""A worker process that evaluates the network of an `OnnxDriver` under a memory limit.

The parent sends the limits, the content of an ONNX file, then one table of observations for each
decision. The process answers `READY`, then the width of the input and the number of parts of an
action (`model.driver_interface.ActionPart`), then actions. An error is answered as a dictionary
with `expected` and `got`; the process then ends.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import onnxruntime

from overtaking.core.process_limits import limit_process
from overtaking.sim.action_spaces import MAX_ANSWER_PARTS
from overtaking.sim.built_in_drivers import READY

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.worker_process import ParentConnection

_NUM_CHECKED_ROWS = 3
"""Number of rows of the input in the check, for a network that takes any number of rows.

Chosen: any number above 1 shows whether the output has a row for each simulation.
"""


_MEMORY_SIGNS = ("Failed to allocate memory", "bad_alloc", "bad allocation")
"""Texts by which messages about memory are recognised; ONNX Runtime has no error class for them."""


class _UnusableError(Exception):
    """The network or its output cannot be used; the arguments are `expected` and `got`."""


class _Network:
    """A network in the memory of this process.

    Args:
        content: Content of an ONNX file.
        widths: Allowed numbers of columns of the input.

    Raises:
        _UnusableError: The network has a different input, or its output for zeros is no action.
        MemoryError: The memory limit is too small for ONNX Runtime.
    """

    def __init__(self, content: bytes, widths: tuple[int, ...]) -> None:
        settings: Any = onnxruntime.SessionOptions()
        # A single thread adds numbers in a fixed order, whatever the number of cores, and leaves
        # the other cores to the simulator.
        settings.intra_op_num_threads = settings.inter_op_num_threads = 1
        settings.log_severity_level = 3  # Errors, no warnings.
        try:
            self._session: Any = onnxruntime.InferenceSession(
                content, settings, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            raise _runtime_error("an ONNX model", error) from None
        inputs = self._session.get_inputs()
        shapes = [list(node.shape) for node in inputs]
        if len(inputs) != 1 or len(shapes[0]) != 2 or shapes[0][1] not in widths:
            shape = " or ".join(f"(simulation, {width})" for width in widths)
            raise _UnusableError(f"one input of shape {shape}", f"{shapes}")
        if inputs[0].type != "tensor(float)":
            raise _UnusableError("an input of float32 numbers", inputs[0].type)
        num_input_rows, self.width = shapes[0]
        self._input_name = inputs[0].name
        self.num_parts = self._check_output(num_input_rows)

    def _check_output(self, num_input_rows: object) -> int:
        """Run the network once with zeros; return the number of parts of an action.

        Args:
            num_input_rows: Number of rows of the input if it is fixed; a name or None if not.
        """
        num_rows = num_input_rows if isinstance(num_input_rows, int) else _NUM_CHECKED_ROWS
        action = self.run(np.zeros((num_rows, self.width), np.float32))
        if not np.isfinite(action).all():
            raise _UnusableError("finite numbers as the output for zeros", f"{action[0].tolist()}")
        return action.shape[1] if action.ndim == 2 else 1

    def run(self, observation: NDArray[np.float32]) -> NDArray[np.generic]:
        """The first output of the network, an action for each simulation.

        Args:
            observation: Observations, shape (simulation, width).

        Raises:
            _UnusableError: The network fails, or its output is no action.
            MemoryError: The memory limit is too small for ONNX Runtime.
        """
        try:
            action = self._session.run(None, {self._input_name: observation})[0]
        except Exception as error:
            raise _runtime_error("an output", error) from None
        expected = f"numbers of shape (simulation, 1 to {MAX_ANSWER_PARTS}) as the first output"
        if not isinstance(action, np.ndarray) or action.dtype.kind not in "fiub":
            value_type = getattr(action, "dtype", type(action).__name__)
            raise _UnusableError(expected, f"values of type {value_type}")
        num_parts = action.shape[1] if action.ndim == 2 else 1
        has_parts = action.ndim in {1, 2} and 1 <= num_parts <= MAX_ANSWER_PARTS
        if not has_parts or len(action) != len(observation):
            raise _UnusableError(expected, f"{action.shape} for {len(observation)} simulations")
        return action


def main(parent: ParentConnection) -> None:
    """Load the network in the second message, then evaluate it for each later message."""
    messages = iter(parent)
    limits = next(messages)
    # This module has imported ONNX Runtime by now, and the parent's time limit begins.
    parent.send(READY)
    content = next(messages)
    # New files must have descriptors 0 to 2, which standard input, output and error occupy. Files
    # that are open stay open. So ONNX Runtime cannot open a file of weights that the network names.
    limit_process(limits["memory_mib"], open_files=3)
    try:
        network = _Network(content, limits["widths"])
        del content
        parent.send((network.width, network.num_parts))
        for observation in messages:
            parent.send(network.run(np.ascontiguousarray(observation)))
    except _UnusableError as error:
        expected, obtained = error.args
        parent.send({"expected": expected, "got": obtained})
    except MemoryError as error:
        expected = f"at most {limits['memory_mib']} MiB of memory"
        parent.send({"expected": expected, "got": str(error) or "more"})


def _runtime_error(expected: str, error: Exception) -> Exception:
    """Our error for an exception of ONNX Runtime, with a shortened message."""
    lines = [line for line in str(error).splitlines() if line.strip()]
    text = lines[0] if lines else type(error).__name__
    # A message is "[ONNXRuntimeError] : 2 : INVALID_ARGUMENT : Non-zero status code ... Status
    # Message: /a/file.cc:38 onnxruntime::f(int) Reason". Keep the reason: remove code and place.
    text = re.sub(r"^\[ONNXRuntimeError\] : \d+ : ", "", text)
    cause = re.sub(r"^\S+:\d+ .*?\) (?=[A-Z])", "", text.rpartition("Status Message: ")[2])
    is_memory = isinstance(error, MemoryError) or any(sign in text for sign in _MEMORY_SIGNS)
    return MemoryError(cause) if is_memory else _UnusableError(expected, cause)
