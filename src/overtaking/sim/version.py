"""The version of the simulated model."""

MODEL_VERSION = "2"
"""Changes whenever any recorded bit of any simulation may change."""
