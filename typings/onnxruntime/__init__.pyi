# What `overtaking.sim.built_in_drivers` uses of it.
from typing import Any

class SessionOptions:
    intra_op_num_threads: int
    inter_op_num_threads: int
    log_severity_level: int

class InferenceSession:
    def __init__(self, content: bytes, settings: SessionOptions, providers: list[str]) -> None: ...
    def get_inputs(self) -> list[Any]: ...
    def run(self, outputs: None, inputs: dict[str, Any]) -> list[Any]: ...
