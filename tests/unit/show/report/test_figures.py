"""Errors of `overtaking.plot` name what can be drawn instead."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from overtaking.analysis.law_statistics import ToleranceCurve
from overtaking.core.errors import ConfigError
from overtaking.show.report.figures import draw


def test_a_result_without_figures_of_single_axes_proposes_none():
    curve = object.__new__(ToleranceCurve)  # Its values are not read.
    axes = Figure().add_subplot()
    with pytest.raises(ConfigError, match=r"law-curve has several axes, got axes; leave ax out$"):
        draw(curve, None, axes=axes, width="page", policy=None)


def test_the_error_for_another_source_names_every_function_in_full():
    with pytest.raises(
        ConfigError, match=r"evaluate, reproduce_study returned, got a str; "
    ) as caught:
        draw("a folder", None, axes=None, width="page", policy=None)
    assert "..." not in str(caught.value)
