"""Reasons of a verdict: broken rules, beliefs of the driver, and remedies.

- `explanation`: the explanation of one simulation;
- `breach`: one broken rule, and the changes that would have kept it;
- `remedies`, `german`: the remedies for each check;
- `margins`: margins frame by frame, for charts.
"""
