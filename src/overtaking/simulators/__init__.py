"""Runs the same scenarios on SUMO and CARLA; `sim` is the package's own simulator."""
