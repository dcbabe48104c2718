"""The simulator: two implementations of one model, and drivers that replace the ego's.

Modules:
    engine: The compiled simulator, for whole batches.
    reference: The readable simulator in NumPy; records the same bits as the engine.
    stepping: A batch that waits at every decision, on either simulator.
    branching: What would have happened: a simulation with something changed from a frame on.
    external_driver: Lets an external driver drive the ego of every simulation of a batch.
    action_spaces: What a driver may answer, and how it becomes the recorded action.
    ego_observation: What a driver observes at a decision.
    sensors: Sensors of an automated vehicle between the truth and the driver.
    built_in_drivers: The drivers `stay` and `rules`, and drivers from ONNX files.
    network_process: The process in which a driver from an ONNX file is evaluated.
    pedal_driving: One tick of vehicles that pedals and wheel control, on either simulator.

Nothing is imported here, so that the reference can be used where no compiled code is wanted.
"""

MODEL_VERSION = "2"
"""Changes whenever any recorded bit of any simulation may change."""
