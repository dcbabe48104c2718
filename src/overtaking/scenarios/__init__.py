"""From a profile, a seed and an index to a scenario."""
