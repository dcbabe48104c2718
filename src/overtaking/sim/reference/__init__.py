"""The model as a person reads it: batched float32 NumPy, each formula with its source.

The engine in `crates/overtaking-core` is the same model, fast: its files and functions have the
same names, and both record the same bits. No module here, nor any that it imports, loads compiled
code of ours.

Left is the overtaking side. Left-hand traffic is mirrored when parameters are prepared and again
when a frame is recorded (docs/adr/0006).

Data:
    state, decision_context
Perception:
    neighbour_search, perception, oncoming
Decisions:
    car_following, acceleration, lane_change, gap_acceptance, passing, pass_continuation, overtake
External drivers of the ego:
    observation_table, ego_action
Motion:
    road_conditions, steering, vehicle_dynamics, collisions, pedal_driving
The run:
    simulation, recorder
"""

from overtaking.sim.reference.simulation import run, simulate

__all__ = ["run", "simulate"]
