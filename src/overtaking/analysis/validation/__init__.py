"""Compares the traffic of a profile with published measurements."""
