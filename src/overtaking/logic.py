"""Questions to a data set in logic, and proofs of breaches."""

from overtaking.api.logic import ask as ask
from overtaking.api.logic import prove as prove
