"""Labels of trajectories: events, verdicts of law, classes, features and explanations."""
