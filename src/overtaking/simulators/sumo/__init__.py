"""Scenarios on SUMO."""
