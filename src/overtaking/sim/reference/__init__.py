"""The model as a person reads it: batched float32 NumPy, each formula with its source.

The engine in `crates/overtaking-core` is the same model, fast: its files and functions have the
same names, and both record the same bits. No module here, nor any that it imports, loads compiled
code of ours.

Arguments that most functions share:
    state: The state of the batch. Functions that change it say so.
    params: Parameters of the batch: `vehicles`, `simulations`, `constants`, `road`.
    context: Perception of the drivers at this decision.
    slots: Slots to compute. An int gives shape (simulation,), a slice (vehicle, simulation).

Left is the overtaking side. Left-hand traffic is mirrored when parameters are prepared and again
when a frame is recorded, so that no formula depends on the side on which traffic drives.

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
