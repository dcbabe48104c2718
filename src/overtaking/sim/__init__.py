"""The simulator: the readable reference, the engine, and branches of a simulation."""

from overtaking.sim.branch import Decision, branch

__all__ = ["Decision", "branch"]
