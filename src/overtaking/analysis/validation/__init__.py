"""Holds the traffic of a profile against what is known of real traffic."""
