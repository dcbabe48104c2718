"""The colours and marks of the classes, for figures and pages."""

from overtaking.model.labels import OvertakeClass

CLASS_COLOURS = {
    OvertakeClass.NO_ATTEMPT.title: "#5b626b",
    OvertakeClass.SUCCESS_I.title: "#e69f00",
    OvertakeClass.SUCCESS_L.title: "#009e73",
    OvertakeClass.UNSUCCESS_COL.title: "#d55e00",
    OvertakeClass.UNSUCCESS_NCOL.title: "#0072b2",
    OvertakeClass.SUCCESS_U.title: "#cc79a7",
    OvertakeClass.CENSORED.title: "#c4c8cf",
}
"""Colour of each class, the same in every figure."""

CLASS_MARKERS = dict(zip(CLASS_COLOURS, "osDX^Pv", strict=True))
"""Marker of each class."""
