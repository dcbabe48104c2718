"""ONNX Runtime in a worker process, which the system holds to its memory.

Its messages are the limits, the content of an ONNX file, then observations. The answers are
`READY`, the width of the input with the number of parts, then actions. A dictionary reports an
error, with `expected` and `got`; the process ends after it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import onnxruntime

from overtaking.core.process_limits import limit_process
from overtaking.model.driver_interface import MAX_ACTION_PARTS
from overtaking.sim.built_in_drivers import READY

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from overtaking.core.worker_process import ParentConnection

_NUM_CHECKED_ROWS = 3
"""Simulations of the check. An output with another number of rows has another shape."""


_MEMORY_SIGNS = ("Failed to allocate memory", "bad_alloc", "bad allocation")
"""Texts in messages of ONNX Runtime about memory, for which it has no class of errors."""


class _UnusableError(Exception):
    """A network or an output that cannot be used; its arguments are `expected` and `got`."""


class _Network:
    """A network in the memory of this process.

    Raises:
        _UnusableError: It has another input, or its output for zeros is no action.
    """

    def __init__(self, content: bytes, widths: tuple[int, ...]) -> None:
        settings: Any = onnxruntime.SessionOptions()
        # One thread adds numbers in one order on every machine, and leaves the other cores to the
        # simulator.
        settings.intra_op_num_threads = settings.inter_op_num_threads = 1
        settings.log_severity_level = 3
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
        self._input, self.width = inputs[0].name, shapes[0][1]
        self.num_parts = self._check(shapes[0][0])

    def _check(self, length: object) -> int:
        """Run the network once; return the number of parts of its output."""
        num_rows = length if isinstance(length, int) else _NUM_CHECKED_ROWS
        action = self.run(np.zeros((num_rows, self.width), np.float32))
        if not np.isfinite(action).all():
            raise _UnusableError("finite numbers as the output for zeros", f"{action[0].tolist()}")
        return action.shape[1] if action.ndim == 2 else 1

    def run(self, observation: NDArray[np.float32]) -> NDArray[np.generic]:
        """The first output for an observation."""
        try:
            action = self._session.run(None, {self._input: observation})[0]
        except Exception as error:
            raise _runtime_error("an output", error) from None
        expected = f"numbers of shape (simulation, 1 to {MAX_ACTION_PARTS}) as the first output"
        if not isinstance(action, np.ndarray) or action.dtype.kind not in "fiub":
            value_type = getattr(action, "dtype", type(action).__name__)
            raise _UnusableError(expected, f"values of type {value_type}")
        num_rows, *num_parts = action.shape or (0,)
        is_action = not num_parts or (len(num_parts) == 1 and 1 <= num_parts[0] <= MAX_ACTION_PARTS)
        if num_rows != len(observation) or not is_action:
            raise _UnusableError(expected, f"{action.shape} for {len(observation)} simulations")
        return action


def main(parent: ParentConnection) -> None:
    """Load the network of the second message, then evaluate it for each further one."""
    messages = iter(parent)
    limits = next(messages)
    parent.send(READY)
    content = next(messages)
    # Standard input, output and error are open, and the pipes to the parent: a network cannot read
    # a file, such as one that it names as the place of its weights.
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
    """The error for one that ONNX Runtime raises."""
    lines = [line for line in str(error).splitlines() if line.strip()]
    text = lines[0] if lines else type(error).__name__
    # Without the code of the error, and the place in the source code of ONNX Runtime.
    text = re.sub(r"^\[ONNXRuntimeError\] : \d+ : ", "", text)
    cause = re.sub(r"^\S+:\d+ .*?\) (?=[A-Z])", "", text.rpartition("Status Message: ")[2])
    is_memory = isinstance(error, MemoryError) or any(sign in text for sign in _MEMORY_SIGNS)
    return MemoryError(cause) if is_memory else _UnusableError(expected, cause)
