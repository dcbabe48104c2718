"""Ego-centred signals of any recording: who is around, how far, how fast, how far one sees."""

from overtaking.signals.engine import signals
from overtaking.signals.target import signals_of, target_signals

__all__ = ["signals", "signals_of", "target_signals"]
