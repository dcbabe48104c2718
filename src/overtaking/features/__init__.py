"""Features of simulations: the paper's, under its own reading and under one that is fair."""

from overtaking.features.matched import matched_features
from overtaking.features.paper import paper_features

__all__ = ["matched_features", "paper_features"]
