"""The stage of the ego, derived from its movement: SUMO's drivers have no stages of an overtake."""

from dataclasses import dataclass

from overtaking.model.trajectories import LANE_CHANGE_SPEED, Stage


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """The ego and its leader at one instant, lateral axis towards the fast side.

    Attributes:
        lane: Lane index of the ego.
        offset: Distance of its centre from the middle of that lane [m].
        drift: Its lateral speed [m/s].
        leader: Slot of the nearest vehicle ahead in its lane, or None.
        passed: Slots of the vehicles whose front is behind the ego's rear.
    """

    lane: int
    offset: float
    drift: float
    leader: int | None
    passed: frozenset[int]


@dataclass(slots=True, kw_only=True)
class Watch:
    """Follows the stage of the ego from instant to instant.

    Attributes:
        settled: Distance from the middle of a lane at which a lane change is over [m].
        stage: The stage now.
        attempted: Whether it ever pulled out.
        target: Slot of the vehicle that it overtakes, None before.
    """

    settled: float
    stage: Stage = Stage.FOLLOW
    attempted: bool = False
    target: int | None = None

    def look(self, sight: Sight) -> Stage:
        """The stage after one more instant."""
        self.stage = self._next(sight)
        return self.stage

    def crash(self) -> None:
        """The ego has hit something, for good."""
        self.stage = Stage.CRASHED

    def _next(self, sight: Sight) -> Stage:
        # In SUMO no vehicle drifts within its lane, so its lateral speed alone shows a lane change.
        outwards, back = sight.drift > LANE_CHANGE_SPEED, sight.drift < -LANE_CHANGE_SPEED
        settled = abs(sight.offset) < self.settled and not (outwards or back)
        if self.stage is Stage.FOLLOW and outwards and sight.leader is not None:
            self.attempted, self.target = True, sight.leader
            return Stage.PULL_OUT
        if self.stage is Stage.PULL_OUT:
            return Stage.ABORT if back else Stage.PASS if settled else self.stage
        returns = self.stage in (Stage.RETURN, Stage.ABORT) or (self.stage is Stage.PASS and back)
        if not returns:
            return self.stage
        # In SUMO the target may fall back, and the ego return before it is past.
        if self.target in sight.passed:
            return Stage.DONE if settled else Stage.RETURN
        return Stage.FOLLOW if settled else Stage.ABORT
