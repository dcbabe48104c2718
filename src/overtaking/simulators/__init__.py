"""The same scenarios on simulators that people use; see `sim` for the package's own."""
