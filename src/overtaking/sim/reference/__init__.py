"""The model as a person reads it: batched float32 NumPy, each formula with its source.

The engine in `crates/overtaking-core` is the same model, fast; both record the same bits. Nothing
in this package, nor anything that it imports, loads compiled code of ours.
"""

from overtaking.sim.reference.run import run, simulate

__all__ = ["run", "simulate"]
