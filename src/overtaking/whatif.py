"""Counterfactuals, futures and sufficient changes of a simulation, and branches as data sets."""

from overtaking.api.whatif import counterfactual as counterfactual
from overtaking.api.whatif import outcome_fan as outcome_fan
from overtaking.api.whatif import resimulate_branch as resimulate_branch
from overtaking.api.whatif import save_branches as save_branches
from overtaking.api.whatif import sufficient_changes as sufficient_changes
