"""The columns of the table `safety`."""

from overtaking.data.tables.columns import Enumeration
from overtaking.data.tables.measured import Measured, encounter, measured
from overtaking.model.safety import MOMENTS

MOMENT_NAMES = Enumeration(names=MOMENTS)

_FRONT = "front.valid"

SAFETY_COLUMNS: tuple[Measured, ...] = (
    *encounter("front", "front", "the ego behind the vehicle ahead"),
    measured(
        "front_headway",
        "headway",
        "s",
        "From front bumper to front bumper; null if the ego stands",
        present=_FRONT,
    ),
    measured("front_picud", "picud", "m", "Gap left after sudden braking of both", present=_FRONT),
    measured(
        "front_rss_margin",
        "rss_margin",
        "m",
        "Gap minus the safe one of responsibility-sensitive safety",
        present=_FRONT,
    ),
    measured(
        "front_lawful_margin",
        "lawful_margin",
        "m",
        "Gap minus the safe distance of L3",
        present=_FRONT,
        needs=["weather"],
    ),
    *encounter("rear", "rear", "the vehicle behind, behind the ego"),
    *encounter("entered_front", "entered_front", "the vehicle ahead in the lane entered"),
    *encounter("entered_rear", "entered_rear", "the vehicle behind in the lane entered"),
    measured(
        "stop_margin_lit",
        "stop_margin_lit",
        "m",
        "Sight of the lit minus stopping distance",
        needs=["weather"],
    ),
    measured(
        "stop_margin_unlit",
        "stop_margin_unlit",
        "m",
        "Sight of the unlit minus stopping distance",
        needs=["weather", "lamps"],
    ),
)
"""What is measured at every moment."""

MANOEUVRE_COLUMNS: tuple[Measured, ...] = (
    measured(
        "close_share",
        "close_share",
        "1",
        "Share of the manoeuvre closer than the safe distance of L3",
        needs=["weather"],
    ),
    measured("time_exposed", "time_exposed", "s", "Time at a critical time to collision, TET"),
    measured("time_integrated", "time_integrated", "s^2", "What it lacks, integrated, TIT"),
    measured(
        "entry_encroachment",
        "entry_encroachment",
        "s",
        "Until the vehicle behind on the left was where the ego entered; null if never",
    ),
    measured(
        "return_encroachment",
        "return_encroachment",
        "s",
        "Until the overtaken vehicle was where the ego returned; null if never",
    ),
)
"""What is measured once, in the row of the manoeuvre; null in the others."""
