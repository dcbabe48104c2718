"""Reasons of a verdict: broken rules, beliefs of the driver, and what would have been lawful."""

from overtaking.labels.explain.breach import Breach, Change, Quantity, Remedy
from overtaking.labels.explain.explanation import Doubt, Explanation, explain
from overtaking.labels.explain.thoughts import Thought

__all__ = ["Breach", "Change", "Doubt", "Explanation", "Quantity", "Remedy", "Thought", "explain"]
