"""The drivers `stay` and `rules`, and drivers in ONNX files.

`stay` and `rules` come with the package. They observe the traffic as the model driver, the
simulator's own driver of the ego, believes it to be (`observation="human"`). They choose moves
(`action="decision"`): they decide about lane changes, and the model driver accelerates, brakes and
steers. `model.driver_interface` describes the columns that they read. Left is the overtaking side,
also in left-hand traffic. The target is the vehicle that the ego overtakes; new leader and new
follower are the vehicles ahead and behind in the lane that a lane change would enter. UN R79 is the
regulation on steering equipment, with rules for automatic lane changes.
"""

import hashlib
import time
import weakref
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, Mask
from overtaking.core.errors import ConfigError, DriverError, OvertakingError, check_extra
from overtaking.core.worker_process import WORKER_ENDED, WorkerProcess
from overtaking.model.driver_interface import (
    OBSERVATION_SIZE,
    PASSING_COLUMNS,
    Move,
    NeighbourColumns,
)
from overtaking.model.trajectories import Stage
from overtaking.sim.ego_observation import Observation

Moves = NDArray[np.int64]
"""A `Move` for each simulation, shape (simulation,)."""


MIN_SPEED_GAIN = 3.0
"""Desired speed minus speed of the leader above which the ego overtakes [m/s]. Chosen."""


PULL_OUT_TIME_GAP = 4.0
"""Time gap to the leader below which the overtake may begin [s]. Chosen.

Also the shortest time in which the gap to a slower new leader may shrink to `MIN_TIME_GAP`: one
number for both rules is a choice.
"""


MIN_TIME_GAP = 1.2
"""Smallest time gap to the new leader, and of the new follower to the ego [s]. Chosen.

UN R79 asks that 1 s remains between the ego and the new follower (`time_gap` in `evaluation.toml`).
"""


INDICATOR_LEAD_TIME = 1.2
"""Time from the indicator to the lane change [s]. Chosen: UN R79 asks for at least 1 s."""


MAX_IMPOSED_DECEL = 3.0
"""Largest deceleration that a lane change imposes on the new follower [m/s^2].

As in UN R79, stated from memory, because the text was not available.
"""


CANCEL_IMPOSED_DECEL = 6.0
"""Deceleration of the new follower above which a lane change is cancelled [m/s^2]. Chosen."""


FOLLOWER_REACTION_TIME = 0.4
"""Time from the start of the lane change until the new follower brakes [s].

As in UN R79, stated from memory.
"""


MIN_GAP = 2.0
"""Smallest gap between the ego and its new follower at any speed [m]. Chosen."""


MIN_TIME_BETWEEN_CHANGES = 8.0
"""Smallest time from a lane change to the next pull-out; a return need not wait [s]. Chosen."""


ABORT_STATE_THRESHOLD = 0.5
"""`abort_state` above which the ego aborts [1].

The observed state is 0.5 or 1 if the ego would not be past the target in time: 1 if it now fits in
behind the target, 0.5 while it is still too fast or too near for that.
"""


ONCOMING_TIME_MARGIN = 3.0
"""Smallest time from the end of a pass until the ego meets an oncoming vehicle [s]. Chosen."""


def stay(observation: Observation) -> Moves:
    """Never change lanes."""
    return np.full(len(observation.is_running), int(Move.KEEP))


def rules(observation: Observation) -> Moves:
    """Change lanes by fixed rules: for a gain of speed, into gaps larger than UN R79 demands.

    The driver decides only while it checks the mirrors. Between two checks it keeps indicating to
    `wanted_side`, which is above 0 for the overtaking side and below 0 for the kerb side.
    """
    ego = observation.ego
    checks_mirrors = ego.checks_mirrors > 0
    may_pull_out = (ego.stage == Stage.FOLLOW) & (ego.can_pull_out > 0)
    may_pull_out &= ego.time_since_lane_change >= MIN_TIME_BETWEEN_CHANGES
    pulls_out = may_pull_out & np.where(
        checks_mirrors, _wants_to_overtake(observation), ego.wanted_side > 0
    )
    may_return = (ego.stage == Stage.PASS) & (ego.can_return > 0) & (ego.has_passed_target > 0)
    is_clear = _is_clear(observation, observation.right_leader, observation.right_follower)
    returns = may_return & np.where(checks_mirrors, is_clear, ego.wanted_side < 0)

    # The lane change begins at a check of the mirrors, when the indicator has been on long enough.
    # An ego that gives way to a vehicle indicating a change to the same gap only indicates.
    can_begin = (ego.time_indicating >= INDICATOR_LEAD_TIME) & checks_mirrors & (ego.gives_way == 0)
    pull_out_move = np.where(can_begin, Move.PULL_OUT, Move.INDICATE_PULL_OUT)
    return_move = np.where(can_begin, Move.RETURN, Move.INDICATE_RETURN)
    move = np.where(returns, return_move, np.where(pulls_out, pull_out_move, Move.KEEP))

    may_cancel = (ego.stage == Stage.PULL_OUT) & (ego.can_cancel_lane_change > 0) & checks_mirrors
    # A small time gap does not cancel a lane change that has begun: turning back can be more
    # dangerous. Only hard braking of the follower, or a gap below `MIN_GAP`, cancels it. A lane
    # change can be cancelled only in its first part, so the new follower is still on the left.
    cancels = may_cancel & ~_is_clear_behind(
        observation, observation.left_follower, max_decel=CANCEL_IMPOSED_DECEL, min_time_gap=0.0
    )
    # `abort_state` is above 0 only while the ego pulls out or passes, so the stage needs no test.
    # `Move.CANCEL` turns back during a lane change, and aborts during a pass.
    aborts = observation.passing.abort_state > ABORT_STATE_THRESHOLD
    return np.where(cancels | aborts, Move.CANCEL, move)


def _wants_to_overtake(observation: Observation) -> Mask:
    """Whether the leader is slow and near, and the gaps beside it suffice."""
    ego, leader, passing = observation.ego, observation.leader, observation.passing
    vehicle = observation.vehicle  # Parameters of the ego's vehicle.
    leader_speed = ego.speed - leader.closing_speed
    is_slow = vehicle.desired_speed - leader_speed > MIN_SPEED_GAIN
    is_near = (leader.is_detected > 0) & (leader.gap < PULL_OUT_TIME_GAP * ego.speed)
    is_clear = _is_clear(observation, observation.left_leader, observation.left_follower)
    is_two_way = passing.expected_closing_speed > 0  # On one-way roads `passing` is zero.
    # Ahead of the leader the ego needs its length and two time gaps: before it and behind it.
    min_return_gap = 2.0 * MIN_TIME_GAP * leader_speed + 2.0 * vehicle.half_length
    can_use_opposing_lane = (
        (passing.is_certain > 0)  # The driver has watched that lane for long enough.
        & (passing.line_is_solid == 0)
        & (passing.gap_ahead_of_leader > min_return_gap)
        & _is_back_in_time(observation)
    )
    return is_slow & is_near & is_clear & (can_use_opposing_lane | ~is_two_way)


def _is_back_in_time(observation: Observation) -> Mask:
    """Whether the ego is back in its lane `ONCOMING_TIME_MARGIN` before it meets oncoming traffic.

    The driver assumes an oncoming vehicle at the end of the sight distance, at the speed that it
    expects there. A detected vehicle replaces this gap if it is nearer, and this speed if it is
    faster.
    """
    ego, leader, vehicle = observation.ego, observation.leader, observation.vehicle
    oncoming, passing = observation.oncoming, observation.passing
    leader_speed = ego.speed - leader.closing_speed
    lengths = leader.length + 2.0 * vehicle.half_length
    distance = leader.gap + lengths + MIN_TIME_GAP * leader_speed
    # `_wants_to_overtake` rejects smaller gains; the limit only avoids a division by zero.
    speed_gain = np.maximum(vehicle.desired_speed - leader_speed, MIN_SPEED_GAIN)
    # As in `sim.reference.passing.accepts_oncoming_gap`, half a lane change passes before the ego
    # gains on the leader, and half of one at the end.
    duration = distance / speed_gain + vehicle.lane_change_duration
    is_detected = oncoming.is_detected > 0
    oncoming_gap = np.minimum(np.where(is_detected, oncoming.gap, np.inf), passing.sight_distance)
    # For an ego below its desired speed, the duration, at the desired speed from the start, and the
    # closing speed, at the present speed, are both too small. A choice in favour of the pass.
    closing_speed = np.where(is_detected, oncoming.closing_speed, 0.0)
    closing_speed = np.maximum(closing_speed, passing.expected_closing_speed)
    return oncoming_gap > (duration + ONCOMING_TIME_MARGIN) * closing_speed


def _is_clear(
    observation: Observation, new_leader: NeighbourColumns, new_follower: NeighbourColumns
) -> Mask:
    """Whether the gaps to both vehicles in the new lane suffice for a lane change."""
    return _is_clear_ahead(observation, new_leader) & _is_clear_behind(
        observation, new_follower, max_decel=MAX_IMPOSED_DECEL, min_time_gap=MIN_TIME_GAP
    )


def _is_clear_ahead(observation: Observation, new_leader: NeighbourColumns) -> Mask:
    """Whether the gap to the vehicle ahead in the new lane suffices."""
    closing_speed = np.maximum(new_leader.closing_speed, 0.0)
    # At this closing speed the gap falls to `MIN_TIME_GAP` after the time `PULL_OUT_TIME_GAP`.
    min_gap = MIN_TIME_GAP * observation.ego.speed + PULL_OUT_TIME_GAP * closing_speed
    return (new_leader.is_detected == 0) | (new_leader.gap > min_gap)


def _is_clear_behind(
    observation: Observation,
    new_follower: NeighbourColumns,
    *,
    max_decel: float,
    min_time_gap: float,
) -> Mask:
    """Whether the gap to the vehicle behind in the new lane suffices.

    Args:
        observation: Observations of the egos.
        new_follower: The vehicle behind in the new lane.
        max_decel: Largest deceleration of the vehicle until it is as slow as the ego [m/s^2].
        min_time_gap: Smallest time gap of the vehicle to the ego after that [s], at its speed
            before braking. A choice, stricter than at the lower speed after braking.
    """
    closing_speed: F32 = np.maximum(new_follower.closing_speed, 0.0)
    follower_speed = observation.ego.speed + new_follower.closing_speed
    braking_distance = closing_speed * closing_speed / (2.0 * max_decel)
    lost_distance = FOLLOWER_REACTION_TIME * closing_speed + braking_distance
    min_gap = lost_distance + np.maximum(min_time_gap * follower_speed, MIN_GAP)
    return (new_follower.is_detected == 0) | (new_follower.gap > min_gap)


MAX_BYTES = 1 << 28
"""Largest ONNX file that is read, 256 MiB. Chosen."""


MEMORY_MIB = 2048
"""Memory of the process beyond ONNX Runtime itself [MiB]. Only Linux enforces it. Chosen."""


TIMEOUT_S = 60.0
"""Longest time to load and check a network, and longest time of one decision [s]. Chosen."""


READY = "ready"
"""First answer of `sim.network_process`, when it has imported ONNX Runtime.

`TIMEOUT_S` limits each later answer, `_START_TIMEOUT_S` this one.
"""


_MODULE = "overtaking.sim.network_process"


_START_TIMEOUT_S = 120.0
"""Longest time to start Python and import ONNX Runtime, also on a busy machine [s]. Chosen."""


class OnnxDriver:
    """A driver in an ONNX file: a network from float32 observations to actions.

    The input is `Observation.table`, of shape (simulation, `OBSERVATION_SIZE`): the columns of the
    ego, of each neighbour, and of a pass. A network may have an input without the columns of a
    pass. The first output is the action, of shape (simulation, part), with the parts that
    `model.driver_interface.ACTION_KINDS` lists for the kind of action.

    A child process loads the network, checks it with zeros, and evaluates it at each decision. A
    network that passes the check may still crash or exhaust memory with other inputs, so this
    process never evaluates it. The child starts again at the next decision after a failure.

    Attributes:
        sha256: SHA-256 of the file.
        num_parts: Number of parts of an action; an output of shape (simulation,) has one.

    Args:
        path: The file.

    Raises:
        ConfigError: The file cannot be read, or is no network with this input and output.
        MissingExtraError: The extra `onnx` is not installed.
    """

    def __init__(self, path: Path) -> None:
        """Read the file, then load and check it in the child process."""
        check_extra("onnx", "onnxruntime", what="onnxruntime, which runs networks", where=str(path))
        self._path = path
        self._content = _read_file(path)
        self.sha256 = hashlib.sha256(self._content).hexdigest()
        self._lock = Lock()  # Without it a thread could receive the answer to another thread.
        self._worker: WorkerProcess | None = None
        self._width, self.num_parts = self._start(ConfigError)

    def __call__(self, observation: Observation) -> NDArray[np.floating]:
        """The action of each simulation.

        Raises:
            DriverError: The network fails, or exceeds its time or memory.
        """
        with self._lock:
            if self._worker is None:
                self._start(DriverError)
            return self._request(observation.table[:, : self._width], DriverError)

    def _start(self, error: type[OvertakingError]) -> tuple[int, int]:
        """Start the process; return the width of the input and the number of parts of an action.

        Args:
            error: Class of the error to raise: `ConfigError` at construction, `DriverError` later.
        """
        self._worker = WorkerProcess(_MODULE)
        # Ends the process when this object is deleted.
        weakref.finalize(self, self._worker.close)
        # `sim.network_process` describes the messages. `widths` are the allowed numbers of columns:
        # a network may leave out the columns of a pass.
        limits = {
            "memory_mib": MEMORY_MIB,
            "widths": (OBSERVATION_SIZE, OBSERVATION_SIZE - len(PASSING_COLUMNS)),
        }
        self._request(limits, error, timeout_s=_START_TIMEOUT_S)
        return self._request(self._content, error)

    def _request(
        self, message: object, error: type[OvertakingError], timeout_s: float | None = None
    ) -> Any:
        """Send a message to the process and return its answer.

        Args:
            message: The message, see `sim.network_process`.
            error: Class of the error to raise if the network or its process fails.
            timeout_s: Longest time of the answer [s]; None for `TIMEOUT_S`.
        """
        assert self._worker is not None
        limit = TIMEOUT_S if timeout_s is None else timeout_s
        try:
            self._worker.send(message)
            answer = _receive(self._worker, limit)
        except _NetworkError as failure:
            self._close()
            raise _driver_file_error(self._path, failure.expected, failure.got, error) from None
        except BaseException:
            # After Ctrl-C, the late answer must not be read as the answer to the next decision.
            self._close()
            raise
        return answer

    def _close(self) -> None:
        """End the process; the next decision starts a new one."""
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.close()


class _NetworkError(Exception):
    """The network or its process failed; holds the parts of the message for the user."""

    def __init__(self, expected: str, got: str) -> None:
        super().__init__(expected, got)
        self.expected, self.got = expected, got


def _receive(worker: WorkerProcess, timeout_s: float) -> Any:
    """The next answer of the process.

    Raises:
        _NetworkError: The process reports an error, ends, or exceeds its time.
    """
    start = time.monotonic()
    try:
        answer = worker.receive(timeout_s)
    except TimeoutError:
        elapsed = time.monotonic() - start
        raise _NetworkError(
            f"an answer within {timeout_s:g} s", f"none after {elapsed:.0f} s"
        ) from None
    if answer is WORKER_ENDED:
        raise _NetworkError(
            f"a process that evaluates it with {MEMORY_MIB} MiB of memory",
            f"one that ended {worker.describe_exit()}",
        )
    if isinstance(answer, dict):
        raise _NetworkError(answer["expected"], answer["got"])
    return answer


def _read_file(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise _driver_file_error(path, "a file that can be read", str(error)) from error
    if len(content) > MAX_BYTES:
        raise _driver_file_error(path, f"at most {MAX_BYTES} bytes", "more")
    return content


def _driver_file_error(
    path: Path, expected: str, got: str, error: type[OvertakingError] = ConfigError
) -> OvertakingError:
    """The error for a driver file that cannot be used, of the class `error`."""
    return error(
        what="driver",
        where=str(path),
        expected=expected,
        got=got,
        next_step="export the network anew; docs/how-to/evaluate-a-driver.md says how",
    )
