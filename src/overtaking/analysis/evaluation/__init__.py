"""Drivers beside each other in the same scenes: rates, differences, conflicts, lane changes."""
