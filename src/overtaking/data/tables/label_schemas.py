"""The columns of the tables that say what happened, whether it was lawful, and how it is described.

They follow from the other tables and can be made from them anew.
"""

import pyarrow as pa

from overtaking.data.tables.columns import Enumeration, column
from overtaking.data.tables.decision_columns import DECISION_COLUMNS, KINDS
from overtaking.data.tables.safety_columns import MANOEUVRE_COLUMNS, MOMENT_NAMES, SAFETY_COLUMNS
from overtaking.knowledge import terms
from overtaking.labels.law import POLICIES, PORTUGAL
from overtaking.model.events import Detail, Outcome
from overtaking.model.labels import Belief, OvertakeClass, Severity, Verdict

EVENTS_IN_ORDER = (
    "follow",
    "attempt",
    "line_crossed",
    "overlap_begin",
    "overlap_end",
    "return_begin",
    "return_end",
    "abort",
    "back",
    "collision",
    "road_departure",
    "drift",
    "under_way",
)
"""The attributes of `model.events.Events` that have rows of their own, if they happened."""

EVENTS = Enumeration(names=EVENTS_IN_ORDER)
RULES = Enumeration(names=PORTUGAL.codes)
ARTICLES = Enumeration(names=tuple(dict.fromkeys(rule.law for rule in PORTUGAL.rules)))
POLICY_NAMES = Enumeration(names=tuple(policy.name for policy in POLICIES))
READINGS = Enumeration(names=("paper", "matched"))
VERDICTS = Enumeration(names=tuple(one.name.lower() for one in Verdict))
BELIEFS = Enumeration(names=tuple(one.name.lower() for one in Belief))
SEVERITIES = Enumeration(names=tuple(one.name.lower() for one in Severity))
OUTCOMES = Enumeration(names=tuple(one.name.lower() for one in Outcome))
DETAILS = Enumeration(names=tuple(one.name.lower() for one in Detail))
CLASSES = Enumeration(names=tuple(one.title for one in OvertakeClass))
DAY_NIGHT = Enumeration(names=("Day", "Night"))
NO_YES = Enumeration(names=("No", "Yes"))

_SIMULATION = column("simulation", pa.int64(), "1", "Number of the simulation in its data set")
_FEATURES = terms("features")
_VERSION = column("rule_set", pa.string(), "1", "Version of the rules")

LABEL_FIELDS: dict[str, list[pa.Field]] = {
    "events": [
        _SIMULATION,
        column("event", EVENTS, "1", "What happened, see the page on events"),
        column("frame", pa.int32(), "1", "First frame in which it is so"),
        column("time_ms", pa.int32(), "ms", "Time of that frame"),
        column("vehicle", pa.uint8(), "1", "Slot of the vehicle that it is about", nullable=True),
        column(
            "speed_change_mps",
            pa.float32(),
            "m/s",
            "Change of the ego's speed by the first contact",
            nullable=True,
        ),
    ],
    "labels": [
        _SIMULATION,
        column("policy", POLICY_NAMES, "1", "Which rules decide, and what is done in doubt"),
        column("class", CLASSES, "1", "Class of the simulation under that policy"),
        column("outcome", OUTCOMES, "1", "How it ended, legality aside"),
        column("detail", DETAILS, "1", "How it came to that"),
        column(
            "legal_as_far_as_decidable",
            pa.bool_(),
            "1",
            "Whether no required rule is known to be broken",
        ),
        column("num_broken", pa.uint8(), "1", "Required rules that are broken"),
        column("num_undecidable", pa.uint8(), "1", "Required rules that apply and are undecidable"),
        _VERSION,
        column("class_weight", pa.float64(), "1", "Weight that gives back the natural rates"),
    ],
    "findings": [
        _SIMULATION,
        column("rule", RULES, "1", "Code of the rule"),
        column("verdict", VERDICTS, "1", "What it says"),
        column(
            "margin",
            pa.float32(),
            "1",
            "Distance from the border of the law in the unit of the rule, negative in a breach",
            nullable=True,
        ),
        column("first_frame", pa.int32(), "1", "First frame of the breach", nullable=True),
        column("last_frame", pa.int32(), "1", "Last frame of the breach", nullable=True),
        column("article", ARTICLES, "1", "Article of the Highway Code"),
        column("severity", SEVERITIES, "1", "Severity of the breach"),
        column("belief", BELIEFS, "1", "The same judged on what the driver believed"),
    ],
    "features": [
        _SIMULATION,
        column("policy", READINGS, "1", "The paper's way of measuring, or alike in every class"),
        column("DN", DAY_NIGHT, "1", _FEATURES["DN"].meaning, nullable=True),
        column("HL", NO_YES, "1", _FEATURES["HL"].meaning, nullable=True),
        column("TE", KINDS, "1", _FEATURES["TE"].meaning),
        column("TP", KINDS, "1", _FEATURES["TP"].meaning, nullable=True),
        column("WT_s", pa.float32(), "s", _FEATURES["WT"].meaning, nullable=True),
        column("OT_s", pa.float32(), "s", _FEATURES["OT"].meaning, nullable=True),
        column("NV", pa.uint8(), "1", _FEATURES["NV"].meaning),
        column("SE_mps", pa.float32(), "m/s", _FEATURES["SE"].meaning),
        column("SP_mps", pa.float32(), "m/s", _FEATURES["SP"].meaning, nullable=True),
        column("DSEP_mps", pa.float32(), "m/s", _FEATURES["DSEP"].meaning, nullable=True),
        column("D_m", pa.float32(), "m", _FEATURES["D"].meaning, nullable=True),
        column("OLR_percent", pa.float32(), "%", _FEATURES["OLR"].meaning),
        column("PREC_percent", pa.float32(), "%", _FEATURES["PREC"].meaning, nullable=True),
        column("WIND_percent", pa.float32(), "%", _FEATURES["WIND"].meaning, nullable=True),
        column("FOG_percent", pa.float32(), "%", _FEATURES["FOG"].meaning, nullable=True),
        column("frame", pa.int32(), "1", "Measured in this frame, null for means", nullable=True),
    ],
    "decisions": [
        _SIMULATION,
        column("frame", pa.int32(), "1", "Frame of the attempt, or of what stands for it"),
        *(one.field for one in DECISION_COLUMNS),
    ],
    "safety": [
        _SIMULATION,
        column("moment", MOMENT_NAMES, "1", "The worst of the manoeuvre, or at an event"),
        column("frame", pa.int32(), "1", "Frame of the event, or the first of the manoeuvre"),
        *(one.field for one in (*SAFETY_COLUMNS, *MANOEUVRE_COLUMNS)),
    ],
}
"""The fields of each table of labels."""

LABEL_KEYS: dict[str, tuple[str, ...]] = {
    "events": ("simulation", "event"),
    "labels": ("simulation", "policy"),
    "findings": ("simulation", "rule"),
    "features": ("simulation", "policy"),
    "decisions": ("simulation",),
    "safety": ("simulation", "moment"),
}

LABEL_TABLES = tuple(LABEL_FIELDS)
