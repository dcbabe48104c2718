"""Rules and factors that are learned from a data set."""

from overtaking.api.learning import learn_factors as learn_factors
from overtaking.api.learning import learn_rules as learn_rules
