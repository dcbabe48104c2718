r"""The ego of this package as a policy: the driver to begin with when you write your own.

    overtaking drive motorway --policy examples/human_ego.py:HumanEgo \
        --observe human --action decision -n 100 --out data/human

It decides when to signal, pull out, give up and return, from what the driver of the scenario
believes. So it drives like the built-in ego, bit for bit. Change a line, and it does not.
"""

import numpy as np
from numpy.typing import NDArray

import overtaking as ot
from overtaking.core.arrays import Mask
from overtaking.core.float32_math import exp, maximum, minimum
from overtaking.model.driver_interface import NEIGHBOUR_ROLES
from overtaking.model.vehicles import EGO_SLOT
from overtaking.sim.reference.gaps import (
    View,
    has_room_behind,
    may_pull_out,
    may_return,
    may_squeeze,
    must_abort,
    wants_to_pass,
)
from overtaking.sim.reference.passing import Outlook, may_meet, seen_ahead
from overtaking.sim.reference.state import FAST_LEAD, FAST_REAR, LEAD, SLOW_LEAD, SLOW_REAR
from overtaking.world.step_parameters import Parameters, parameters

FITTING = 0.5  # Above it there is room behind the leader; below it a driver brakes for that [1].
PRESSED = 0.5  # Above it a small gap is taken; below it a driver only wants to be back soon [1].
LEAST_DEMAND = np.float32(1e-6)  # Keeps what is imposed finite for who demands nothing [1].


class HumanEgo:
    """The built-in ego, from percepts to decisions; asks for `human` and answers `decision`."""

    given: Parameters

    def reset(self, scenario: ot.Scenario) -> None:
        """Take the constants of the model for a new batch."""
        self.given = parameters(scenario)

    def __call__(self, seen: ot.Observation) -> NDArray[np.int64]:
        """A move for each simulation."""
        view, looks = self.view(seen), seen.of("looks") > 0
        start, back = self.starts(seen, view, looks), self.returns(seen, view, looks)
        signalled = seen.of("signalled") + self.given.constants.decision
        sure = (looks & (seen.of("contested") == 0)) | view.told
        shown = signalled > seen.driver.signal_time
        now = (shown | ((seen.of("hurries") > 0) & back)) & sure
        out = np.where(now, ot.Move.PULL_OUT, ot.Move.SHOW_OUT)
        home = np.where(now, ot.Move.RETURN, ot.Move.SHOW_BACK)
        move = np.where(start, out, np.where(back, home, ot.Move.KEEP))
        return np.where(self.aborts(seen, view, looks), ot.Move.ABORT, move)

    def view(self, seen: ot.Observation) -> View:
        """What the decisions are made from; who has waited for long demands less."""
        c, driver = self.given.constants, seen.driver
        impatience = maximum(exp(-(seen.of("waited") * driver.inverse_patience)), c.patience_floor)
        demand = driver.gap_acceptance * impatience
        around = np.moveaxis(seen.around, 0, -1)[: len(NEIGHBOUR_ROLES) - 2]
        told = driver.gap_acceptance <= 0  # Told to change lanes, as in the study: looks at no gap.
        return View(
            who=EGO_SLOT,
            own=driver,
            speed=seen.of("speed"),
            gap=around[:, 1],
            closing=around[:, 2],
            detected=around[:, 0] > 0,
            leader_speed=seen.of("speed") - around[LEAD, 2],
            demand=demand,
            imposes=minimum(
                minimum(driver.safe_decel / maximum(demand, LEAST_DEMAND), c.most_imposed),
                driver.hardest_decel,
            ),
            impatience=impatience,
            room_left=seen.of("room_left") if self.given.road.two_way else np.float32(1.0),
            told=told,
            ordered=told & (around[LEAD, 0] > 0) & (around[LEAD, 2] > driver.passing_gain),
            command=np.zeros_like(demand),
        )

    def starts(self, seen: ot.Observation, view: View, looks: Mask) -> Mask:
        """Whether to signal to pull out: decided at looks into the mirrors, held between them."""
        free = (seen.of("stage") == ot.Stage.FOLLOW) & (seen.of("can_go_out") > 0)
        rested = seen.of("since_change") >= self.given.constants.abort_cooldown
        wants = wants_to_pass(self.given, view) & may_pull_out(self.given, view)
        if self.given.road.two_way:
            wants &= self.may_meet(seen, view)
        wants = np.where(view.told, view.ordered, wants)
        return free & rested & np.where(looks | view.told, wants, seen.of("wanted") > 0)

    def may_meet(self, seen: ot.Observation, view: View) -> Mask:
        """Whether the lane of oncoming traffic is believed to be free for long enough."""
        comes = seen.of("detected", "oncoming") > 0
        c = self.given.constants
        gap = np.where(comes, seen.of("gap", "oncoming"), c.oncoming_range)
        ahead = Outlook(
            gap=view.gap[LEAD],
            leader=view.leader_speed,
            length=seen.of("length", "lead"),
            room=seen.of("room"),
            seen=seen_ahead(view.own, gap, seen.of("sight")),
            closing=np.where(comes, seen.of("closing", "oncoming"), seen.of("expected")),
            sure=seen.of("sure") > 0,
            solid=seen.of("solid") > 0,
            room_left=seen.of("room_left"),
        )
        may = may_meet(self.given, view.own, view.speed, view.impatience, ahead)
        return may & ~(seen.of("indicator", "lead") > 0)  # One overtakes at a time.

    def returns(self, seen: ot.Observation, view: View, looks: Mask) -> Mask:
        """Whether to signal to return: past the other, or stuck beside it for too long."""
        c = self.given.constants
        passes = (seen.of("stage") == ot.Stage.PASS) & (seen.of("can_go_back") > 0)
        stuck = (seen.of("stage_time") > c.give_up_after) & (seen.of("behind_target") > 0)
        rested = seen.of("since_change") >= c.abort_cooldown
        passed = seen.of("passed") > 0
        may = may_return(self.given, view, view.room_left) & (passed | stuck)
        if self.given.road.two_way:
            room = may_squeeze(self.given, self.given.of_simulations, view)
            squeezes = (seen.of("hurries") > PRESSED) & room & passed
            may, rested = may | squeezes, rested | squeezes
        wants = np.where(view.told, passed, may)
        return passes & np.where(looks | view.told, wants & rested, seen.of("wanted") < 0)

    def aborts(self, seen: ot.Observation, view: View, looks: Mask) -> Mask:
        """Whether to give up: the lane being entered has turned dangerous, or somebody comes."""
        falls_in = (seen.of("yields") > FITTING) & has_room_behind(self.given, view)
        out = must_abort(self.given, view, SLOW_LEAD, SLOW_REAR)
        home = must_abort(self.given, view, FAST_LEAD, FAST_REAR)
        home &= not self.given.road.two_way  # The lane of others is no place to stay.
        danger = np.where(seen.of("stage") == ot.Stage.PULL_OUT, out, home)
        return falls_in | (looks & ~view.told & danger & (seen.of("can_abort") > 0))


def main() -> None:
    """Compare it with the built-in ego."""
    scenes = ot.sample("pinto2023-physical", num_simulations=100, seed=1)
    ours = ot.simulate(scenes)
    runs = ot.drive(scenes, HumanEgo(), observe="human", action="decision")
    same = (runs.trace_hash == ours.trace_hash).all(axis=1)
    print("100 scenes of pinto2023-physical, percepts to decisions")
    print(f"  same trace as the built-in ego: {same.sum()}")
    print(f"  overtakes begun: {(runs.stage == ot.Stage.PULL_OUT).any(axis=1).sum()}")
    assert runs.actions is not None
    print(f"  changes of what it does: {runs.actions.is_change.sum()}")


if __name__ == "__main__":
    main()
