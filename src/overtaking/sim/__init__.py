"""The simulator: the readable reference, the engine, and branches of a simulation.

Import the parts by name: `sim.engine`, `sim.reference`, `sim.branch`. Nothing is imported here, so
that the reference can be used where no compiled code is wanted.
"""
