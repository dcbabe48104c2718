"""Figures of numbers that `stats` has computed: one design for all, and nothing is counted here."""

from overtaking.core.errors import check_extra

check_extra("plots", "matplotlib", what="Matplotlib, which draws", where="figures")
