"""The colours and marks that figures and pages share.

Source:
    M. Okabe and K. Ito, Color universal design, 2002 (revised 2008): colours that people with any
    kind of colour vision can tell apart.
"""

from overtaking.model.verdicts import OvertakeClass

CLASS_COLOURS = {
    OvertakeClass.NO_ATTEMPT.title: "#5b626b",
    OvertakeClass.SUCCESS_I.title: "#e69f00",
    OvertakeClass.SUCCESS_L.title: "#009e73",
    OvertakeClass.UNSUCCESS_COL.title: "#d55e00",
    OvertakeClass.UNSUCCESS_NCOL.title: "#0072b2",
    OvertakeClass.SUCCESS_U.title: "#cc79a7",
    OvertakeClass.CENSORED.title: "#c4c8cf",
    OvertakeClass.UNSUCCESS_DEP.title: "#56b4e9",
}
"""Colour of each class, the same in every figure."""

CLASS_MARKERS = dict(zip(CLASS_COLOURS, "osDX^Pv<", strict=True))
"""Marker of each class."""

INK, QUIET, LINE, GRID = "#1d2126", "#5b626b", "#9aa1aa", "#e3e6ea"
ACCENT = "#0072b2"
