"""What happened: the events of an overtake, how it ended, and its class under a policy."""

from overtaking.labels.events.classify import Judgement, classify
from overtaking.labels.events.engine import find_events

__all__ = ["Judgement", "classify", "find_events"]
