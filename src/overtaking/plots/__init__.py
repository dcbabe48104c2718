"""Figures of numbers that `stats` has computed: one design for all of them, nothing is counted here."""
