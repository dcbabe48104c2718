"""What decides an overtake: rules for people, models for comparison, and the factors in order."""
