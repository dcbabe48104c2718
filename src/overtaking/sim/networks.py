"""Policies in ONNX files."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError, MissingExtraError
from overtaking.model.observation import MEETING, WIDTH
from overtaking.sim.observation import Observation

MOST_BYTES = 1 << 28
"""Largest file that is read."""


class Network:
    """A policy in an ONNX file: from float32 numbers to an action.

    Its input has shape (simulation, `WIDTH`): `Observation.own`, then `Observation.around` row by
    row, then `Observation.meeting`; or it ends before the last. Its first output has shape
    (simulation, part).

    Attributes:
        digest: SHA-256 of the file.

    Args:
        path: The file.

    Raises:
        ConfigError: It cannot be read, or takes something else.
        MissingExtraError: The extra `onnx` is not installed.
    """

    def __init__(self, path: Path) -> None:
        """Read the file."""
        try:
            import onnxruntime
        except ImportError as error:
            what = "onnxruntime, which runs networks"
            raise MissingExtraError.lacking("onnx", what=what, where=str(path)) from error
        content = _content(path)
        self.digest = hashlib.sha256(content).hexdigest()
        settings: Any = onnxruntime.SessionOptions()
        # Sums in one order, whatever the machine; and the simulator has the other cores.
        settings.intra_op_num_threads = settings.inter_op_num_threads = 1
        settings.log_severity_level = 3
        try:
            self._session: Any = onnxruntime.InferenceSession(
                content, settings, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            raise _refused(path, "an ONNX model", error) from error
        inputs = self._session.get_inputs()
        shapes = [list(one.shape) for one in inputs]
        widths = (WIDTH, WIDTH - len(MEETING))
        if len(inputs) != 1 or len(shapes[0]) != 2 or shapes[0][1] not in widths:
            wanted = " or ".join(f"(simulation, {width})" for width in widths)
            raise _refused(path, f"one input of shape {wanted}", f"{shapes}")
        self._input, self._width = inputs[0].name, shapes[0][1]

    def __call__(self, seen: Observation) -> NDArray[np.floating]:
        """The action of each simulation."""
        numbers = np.ascontiguousarray(seen.table[:, : self._width])
        return self._session.run(None, {self._input: numbers})[0]


def _content(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise _refused(path, "a file that can be read", error) from error
    if len(content) > MOST_BYTES:
        raise _refused(path, f"at most {MOST_BYTES} bytes", "more")
    return content


def _refused(path: Path, expected: str, got: object) -> ConfigError:
    return ConfigError.of(
        what="policy",
        where=str(path),
        expected=expected,
        got=str(got),
        next_step="export the network anew; docs/how-to/evaluate-a-driver.md says how",
    )
