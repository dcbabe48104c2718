"""The numbers that the source paper states about its data set."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

from overtaking.core.units import unit_converter
from overtaking.knowledge.quantities import Quantity
from overtaking.knowledge.toml_reader import read_record, read_records

_FILE = "paper.toml"

ALL = "all"
"""The scope of a statement about every simulation."""
# No printed number has more decimals; further digits are errors of the conversion to SI.
_DIGITS = 9


class StatementRole(StrEnum):
    """The role of a number of the paper in the model."""

    CALIBRATED = "calibrated"
    IMPLIED = "implied"
    PREDICTED = "predicted"
    PRESET = "preset"
    CONTRADICTION = "contradiction"
    DESIGN = "design"

    @property
    def meaning(self) -> str:
        """The same in words."""
        return _MEANINGS[self]

    @property
    def group(self) -> str:
        """The group of the score in which it counts."""
        return _GROUPS.get(self, str(self))


_MEANINGS = {
    StatementRole.CALIBRATED: "the profile was fitted to it",
    StatementRole.IMPLIED: "it follows from what was fitted",
    StatementRole.PREDICTED: "nothing was fitted to it",
    StatementRole.PRESET: "an artefact of CARLA's weather presets",
    StatementRole.CONTRADICTION: "the paper contradicts itself",
    StatementRole.DESIGN: "an input of its simulations, taken over",
}

_GROUPS = {
    StatementRole.DESIGN: "by design",
    StatementRole.PRESET: "by design",
    StatementRole.CALIBRATED: "fitted",
}


class Statistic(StrEnum):
    """A statistic of a set of simulations, compared with a number of the paper."""

    COUNT = "count"
    MEAN = "mean"
    SUM = "sum"
    WITHIN = "within"
    RATIO = "ratio"
    SPEARMAN = "spearman"
    P_VALUE = "p_value"
    DESIGN = "design"


COUNTS = (Statistic.COUNT, Statistic.SUM, Statistic.WITHIN)
"""The measures that count simulations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """One number of the paper.

    Attributes:
        about: The group that it belongs to.
        text: Its description.
        standing: Its role for the model, such as fitted.
        measure: The statistic to compare with it.
        stated: The number, in SI, with the unit in which the paper has it.
        feature: The feature, or for a design the input, that is measured.
        other_feature: The other feature of a ratio or a correlation.
        outcome_class: The class of the simulations, or `ALL`.
        low: Where a range begins, in SI; NaN without one.
        high: Where it ends.
        note: Remark for the reader.
        cause: Why our simulations have another number, if they have.
    """

    about: str
    text: str
    standing: StatementRole
    measure: Statistic
    stated: Quantity
    feature: str = ""
    other_feature: str = ""
    outcome_class: str = ALL
    low: float = math.nan
    high: float = math.nan
    note: str = ""
    cause: str = ""

    @property
    def unit(self) -> str:
        """The unit of the paper, empty for a plain number."""
        unit = self.stated.quoted_unit
        return {"1": "", "percent": "%"}.get(unit, unit)

    @property
    def factor(self) -> float:
        """One of the paper's unit, in SI."""
        return unit_converter(self.stated.quoted_unit, where=_FILE)(1.0)

    @property
    def quoted(self) -> float:
        """The number as the paper has it."""
        return round(self.stated.number / self.factor, _DIGITS)

    @property
    def resolution(self) -> float:
        """Half of the last decimal of `quoted`: how well it is known at best."""
        decimals = repr(self.quoted).partition(".")[2]
        return 0.5 * 10.0 ** -len(decimals)


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """The population that was fitted to the paper.

    Attributes:
        population: The drivers that were fitted.
        parameters_sha256: Hash over them and the profile, frozen when they were.
        seeds: Seeds that no reproduction may use.
    """

    population: str
    parameters_sha256: str
    seeds: tuple[float, ...]


@cache
def statements() -> Mapping[str, Statement]:
    """Every number by its name, in the order in which it is shown.

    Raises:
        KnowledgeError: A standing or a measure is unknown.
    """
    return read_records(Statement, _FILE, "statements")


@cache
def calibration() -> Calibration:
    """The fitted population and the seeds of its calibration."""
    return read_record(Calibration, _FILE, "calibration")
