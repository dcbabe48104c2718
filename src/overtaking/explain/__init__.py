"""Why a simulation is judged as it is: what was broken, believed, and would have been lawful."""

from overtaking.explain.breach import Breach
from overtaking.explain.change import Change, Quantity, Remedy
from overtaking.explain.explanation import Doubt, Explanation, explain
from overtaking.explain.thoughts import Thought

__all__ = ["Breach", "Change", "Doubt", "Explanation", "Quantity", "Remedy", "Thought", "explain"]
