"""Ego-centred signals of any recording: who is around, how far, how fast, how far one sees."""

from overtaking.signals.engine import signals
from overtaking.signals.target import alongside, signals_of, target_signals

__all__ = ["alongside", "signals", "signals_of", "target_signals"]
