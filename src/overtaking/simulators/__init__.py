"""The same scenarios on SUMO and CARLA; see `sim` for the package's own simulator."""
