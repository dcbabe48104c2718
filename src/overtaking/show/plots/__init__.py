"""Figures of numbers that `stats` has computed: one design for all, and nothing is counted here."""

from importlib.util import find_spec

from overtaking.core.errors import MissingExtraError

if find_spec("matplotlib") is None:
    raise MissingExtraError.for_extra("plots", what="Matplotlib, which draws", where="figures")
