"""Compares drivers in the same scenes: rates, differences, conflicts, lane changes."""
