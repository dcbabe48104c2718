"""Simulations that begin and end independently of each other, each in a row of a batch."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F32, F64, Mask
from overtaking.gym.supply import Place, Supply, given_of, scenario_of
from overtaking.labels.label import label
from overtaking.model.actions import KINDS, MOST_PARTS, Actions
from overtaking.model.observation import OWN, parted
from overtaking.model.trajectory import Stage
from overtaking.sim import engine
from overtaking.sim.controls import CONTROLS
from overtaking.sim.driving import rounded
from overtaking.sim.observation import Seen
from overtaking.sim.stepping import Renewable
from overtaking.world.clock import DECISIONS_PER_SECOND, SUBSTEPS
from overtaking.world.parameters import SIMULATION_FIELDS, VehicleParameters

_LAST_STEP = SIMULATION_FIELDS.index("last_step")
_STAGE = list(OWN).index("stage")


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdicts:
    """How simulations ended.

    Attributes:
        outcome: `Outcome`, shape (simulation,).
        legal: Whether they are legal under the policy `default`, shape (simulation,).
        broken: Rules of it that they break, shape (simulation,).
        trace_hash: Of their states, shape (simulation, 4).
    """

    outcome: NDArray[np.uint8]
    legal: Mask
    broken: NDArray[np.uint8]
    trace_hash: NDArray[np.uint32]


class Rows:
    """A batch in which each simulation is followed by the next one of its row.

    Attributes:
        table: What the egos observe, shape (simulation, `WIDTH`); of those that have ended just now
            for the last time.
        runs: Which simulations run, shape (simulation,).
        index: Their numbers, shape (simulation,).
        decision: Decisions so far, shape (simulation,).
        clipped: Answers that were beyond the limits so far, shape (simulation,); counted outside.

    Args:
        supply: Where scenarios come from.
        count: Rows.
        action: What is answered, a name in `CONTROLS`.
        hold: Decisions for which an answer holds.
        is_true: Whether the truth is observed, not what the ego believes.
        logs: Whether what is answered is kept, for `judge`.
    """

    def __init__(
        self, supply: Supply, *, count: int, action: str, hold: int, is_true: bool, logs: bool
    ) -> None:
        """Begin the first simulation of each row."""
        self._supply, self._hold, self._control = supply, hold, CONTROLS[action]
        self._places = supply.take(np.arange(count))
        given = given_of(self._places)
        self._steps = Renewable(given, self._control.kind, is_true=is_true)
        self._driver = np.array([row[0] for row in given.of_vehicles])
        self.index = given.index
        self.decision = np.zeros(count, np.int64)
        self.clipped = np.zeros(count, np.int64)
        last = int(given.simulation[_LAST_STEP].max()) // SUBSTEPS + 1 if logs else 0
        self._log = np.zeros((count, last, MOST_PARTS), np.int32)
        self._tell(*self._steps.begin())

    @property
    def seen(self) -> Seen:
        """What the egos observe, by name."""
        own, around, meeting = parted(self.table)
        return Seen(
            time=0.0,
            active=self.runs,
            own=own,
            around=around,
            meeting=meeting,
            driver=VehicleParameters._make(self._driver),
        )

    @property
    def stage(self) -> F32:
        """The `Stage` of each ego."""
        return self.table[:, _STAGE]

    @property
    def crashed(self) -> Mask:
        """Whether each ego has hit another, or left the road."""
        return self.stage == Stage.CRASHED

    def go_on(self, answer: F64) -> None:
        """Carry out answers of shape (simulation, part), for as long as they hold."""
        control, parts = self._control, KINDS[self._control.kind]
        if control.plan is None:
            self._step(rounded(answer, self.runs, parts), self._hold)
            return
        begin = self.seen
        track = control.plan(answer, begin)
        running = begin
        for k in range(self._hold):
            values = rounded(track(running), self.runs, parts)
            self._step(values, 1)
            running = _at(self.seen, (k + 1) / float(DECISIONS_PER_SECOND))

    def _step(self, values: NDArray[np.int32], decisions: int) -> None:
        rows = np.flatnonzero(self.runs)
        for k in range(decisions if self._log.size else 0):
            at = np.minimum(self.decision[rows] + k, self._log.shape[1] - 1)
            self._log[rows, at] = values[rows]
        self.decision[rows] += decisions
        self._tell(*self._steps.step(values, decisions))

    def renew(self, rows: NDArray[np.int64]) -> None:
        """Begin the next simulations of some rows."""
        places = self._supply.take(rows)
        for row, place in zip(rows, places, strict=True):
            self._places[row] = place
        given = given_of(places)
        table, runs = self._steps.renew(rows, given)
        self.table[rows], self.runs[rows] = table, runs
        self._driver[:, rows] = [row[0] for row in given.of_vehicles]
        self.index[rows] = given.index
        self.decision[rows] = self.clipped[rows] = 0

    def judge(self, rows: NDArray[np.int64]) -> Verdicts:
        """How the simulations of some rows end: simulated again from what was answered."""
        places: list[Place] = [self._places[row] for row in rows]
        asked = np.minimum(self.decision[rows], self._log.shape[1])
        log = self._log[rows, : int(asked.max())]
        for one, count in zip(log, asked, strict=True):
            one[count:] = one[count - 1]
        actions = Actions(values=log, kind=self._control.kind)
        run = engine.run(scenario_of(places), given_of(places), actions=actions)
        labels = label(run).labels
        policy = labels.policies.index("default")
        return Verdicts(
            outcome=labels.outcome,
            legal=labels.is_legal[:, policy],
            broken=labels.num_broken[:, policy],
            trace_hash=run.trace_hash,
        )

    def _tell(self, table: F32, runs: Mask) -> None:
        self.table, self.runs = table, runs


def _at(seen: Seen, time: float) -> Seen:
    """The same at another time."""
    return replace(seen, time=time)
