"""Data classes: road, vehicles, drivers, weather, scenario, trajectories, events, findings."""
