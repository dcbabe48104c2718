"""Features of simulations: the paper's in two readings, of decisions, and of safety."""

from overtaking.labels.features.decision import attempt_features
from overtaking.labels.features.safety import safety_measures
from overtaking.labels.features.study import matched_features, paper_features

__all__ = ["attempt_features", "matched_features", "paper_features", "safety_measures"]
