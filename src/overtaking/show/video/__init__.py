"""Simulations seen from above, as films: recorded states in, frames and mp4 files out."""
