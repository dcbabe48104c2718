"""Figures of numbers that `stats` has computed: one design for all, and nothing is counted here."""
