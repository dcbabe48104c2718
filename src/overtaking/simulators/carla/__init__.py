"""Runs scenarios on CARLA 0.9.16, by our drivers or by its Traffic Managers."""
