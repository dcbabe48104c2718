"""Figures of numbers that `stats` has computed: one design for all, and nothing is counted here."""

from importlib.util import find_spec

from overtaking.core.errors import MissingExtraError

if find_spec("matplotlib") is None:
    raise MissingExtraError.of(
        what="Matplotlib, which draws",
        where="figures",
        expected="the extra [plots]",
        got="no such package",
        next_step="run: pip install 'overtaking[plots]'",
    )
