"""Would it have happened anyway? The same scenes with a decision or the weather changed.

    python examples/what_if.py

Looks for egos that pulled out and then collided, and simulates those scenes again: with a driver
who stays in the lane, and with thick fog from two seconds before. Up to the change everything is as
it was, to the last bit.
"""

import numpy as np

import overtaking as ot
from overtaking.model.trajectories import NO_VEHICLE

FOG_LEAD = 40  # Frames between the fog and the decision, 2 s.


def crashes(trajectories: ot.Trajectories) -> np.ndarray:
    """Numbers of the simulations whose ego pulls out and hits somebody after that."""
    began = np.where(trajectories.percepts.valid[:, 0], trajectories.percepts.time[:, 0], np.inf)
    hit = trajectories.contacts.partner[:, 0] != NO_VEHICLE
    return np.flatnonzero(hit & (trajectories.contacts.time[:, 0] > began))


def describe_outcome(simulation: ot.Trajectories) -> str:
    """The outcome of a single simulation in words."""
    last = int(simulation.num_frames[0]) - 1
    partner = simulation.contacts.partner[0, 0]
    if partner == NO_VEHICLE:
        stage = ot.Stage(int(simulation.stage[0, last])).name.lower().replace("_", " ")
        return f"no collision; {stage} at {simulation.time_ms[last] / 1000:.1f} s"
    speed = simulation.contacts.closing_speed[0, 0] * 3.6e-3
    return f"vehicle {partner} at {simulation.contacts.time[0, 0] / 1000:.1f} s, {speed:.0f} km/h"


def main() -> None:
    """Print what happened, and what would have."""
    # Who stays is watched for as long as who pulls out.
    scenarios = ot.sample(
        "pinto2023-physical",
        num_simulations=1000,
        seed=1,
        overrides={"time.attempt_deadline_s": 20.0},
    )
    trajectories = ot.simulate(scenarios)
    rows = crashes(trajectories)
    print(f"{len(rows)} of {scenarios.num_simulations} egos pulled out and collided after that\n")
    print(f"{'':6}{'as it was':30}{'had it stayed':40}had fog come")
    avoided = 0
    for number in rows:
        only = slice(number, number + 1)
        scenario, simulation = scenarios.select(only), trajectories.select(only)
        pull_out = int(np.flatnonzero(simulation.stage[0] == ot.Stage.PULL_OUT)[0])
        stayed = ot.branch(scenario, pull_out, decision=ot.ForcedDecision.STAY)
        assert (stayed.states.s[:, :, :pull_out] == simulation.states.s[:, :, :pull_out]).all()

        fog = scenario.weather.replace(fog=np.full_like(scenario.weather.fog, 100.0))
        fogged = ot.branch(scenario, max(0, pull_out - FOG_LEAD), weather=fog)
        before, in_lane, in_fog = map(describe_outcome, (simulation, stayed, fogged))
        print(f"{number:<6}{before:30}{in_lane:40}{in_fog}")
        avoided += int(stayed.contacts.partner[0, 0] == NO_VEHICLE)
    print(f"\n{avoided} of them would not have collided in their lane")


if __name__ == "__main__":
    main()
