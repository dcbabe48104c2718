"""From trajectories to events, verdicts of law and features."""
