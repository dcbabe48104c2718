"""Profiles and samplers: from a specification, a seed and a number to a scenario."""

from __future__ import annotations

from overtaking.scenarios.reading import profile_names, spec
from overtaking.scenarios.sampling import long_enough, sample
from overtaking.scenarios.schema import Spec

__all__ = ["Spec", "long_enough", "profile_names", "sample", "spec"]
