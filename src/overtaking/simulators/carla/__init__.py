"""Scenarios on CARLA."""
