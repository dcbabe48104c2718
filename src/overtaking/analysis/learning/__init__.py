"""Predicts the outcome of overtakes: rules for people, models for comparison, ranked factors."""
