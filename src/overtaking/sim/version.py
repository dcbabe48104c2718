"""The version of the simulated model."""

MODEL_VERSION = "1"
"""Changes whenever any recorded bit of any simulation may change."""
