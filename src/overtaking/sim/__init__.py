"""The simulator: two implementations of one model, and external drivers of the ego.

Modules:
    engine: The compiled simulator, for whole batches.
    reference: The readable simulator in NumPy; records the same bits as the engine.
    stepping: A batch that waits at every decision for actions, on either simulator.
    branching: Branches: the same simulations with weather, drivers or vehicles changed from a frame
        on.
    external_driver: Lets an external driver drive the ego of every simulation of a batch.
    action_spaces: The actions that a driver may answer, and their conversion to recorded actions.
    ego_observation: The observations that a driver gets at a decision.
    sensors: Sensors of an automated vehicle, which limit and disturb what a driver observes.
    built_in_drivers: The drivers `stay` and `rules`, and drivers from ONNX files.
    network_process: The process in which a driver from an ONNX file is evaluated.
    external_motion: Drivers of the model in a simulation whose vehicles another simulator moves.
    pedal_driving: Vehicles that a program drives by pedals and wheel angles, as in a CARLA server.

This package imports none of its modules, so that the reference can be used without compiled code.
"""

MODEL_VERSION = "2"
"""Changes whenever any recorded bit of any simulation may change."""
