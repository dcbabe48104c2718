"""Runs scenarios on SUMO, with its drivers and its motion."""
