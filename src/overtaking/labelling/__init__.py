"""From a recording to everything that is said of it."""

from overtaking.labelling.label import Labelled, label

__all__ = ["Labelled", "label"]
