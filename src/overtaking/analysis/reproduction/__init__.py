"""Compares simulations with every number that the source paper states."""
