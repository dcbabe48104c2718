"""Tables as text, CSV, JSON and LaTeX."""

from __future__ import annotations

import io
import json
import math
import re

import pandas as pd
import pytest
from tests.support.features import synthetic_features

from overtaking.analysis.stats.formats import (
    latex,
    page_parts,
    table_to_csv,
    table_to_latex,
    to_csv,
    to_latex,
)
from overtaking.analysis.stats.results import Statistics, statistics
from overtaking.analysis.stats.table import Style, write
from overtaking.cli.output import page_text
from overtaking.knowledge.glossary import terms


@pytest.fixture(scope="module")
def result() -> Statistics:
    return statistics(synthetic_features(), policy="paper")


def test_json_is_strict_and_contains_exact_numbers(result: Statistics):
    values = json.loads(json.dumps(result.values(), allow_nan=False))
    assert values["simulations"] == 276
    assert values["policy"] == "paper"
    mean = next(
        row
        for row in values["dynamic_features"]
        if (row["feature"], row["statistic"]) == ("SE", "mean")
    )
    assert (
        mean["Success_L"] == result.sample.values("SE")[result.sample.members("Success_L")].mean()
    )


def test_json_has_null_for_a_missing_number():
    values = statistics(synthetic_features(1), policy="paper").values()
    text = json.dumps(values, allow_nan=False)
    sigma = [row for row in values["dynamic_features"] if row["statistic"] == "σ"]
    assert sigma[0]["All"] is None
    assert "NaN" not in text


def test_text_explains_its_classes_and_features(result: Statistics):
    text = page_text(page_parts(result))
    for name in result.sample.classes:
        assert terms("classes")[name].meaning in text
    for name, term in terms("features").items():
        assert re.search(rf"^{name} +{term.meaning}$", text, re.M)


def test_csv_is_one_tidy_table_with_exact_values(result: Statistics):
    rows = pd.read_csv(io.StringIO(to_csv(result)), keep_default_na=False)
    assert list(rows.columns) == ["table", "feature", "unit", "statistic", "class", "value"]
    assert rows["table"].unique().tolist() == [
        "classes",
        "static-features",
        "dynamic-features",
        "waiting-time",
    ]
    standard_deviation = rows.query("feature == 'SE' and statistic == 'σ' and `class` == 'All'")[
        "value"
    ]
    assert float(standard_deviation.item()) == result.sample.frame["SE"].std()


def test_a_table_written_as_csv_can_be_read_unchanged(result: Statistics):
    read_back = pd.read_csv(io.StringIO(table_to_csv(result.classes)))
    pd.testing.assert_frame_equal(read_back, result.classes.rows)


def test_latex_escapes_special_characters(result: Statistics):
    text = to_latex(result)
    assert r"No\_attempt" in text
    assert r"$\sigma$" in text
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == 3
    for line in text.splitlines():
        assert "%" not in line.replace(r"\%", "")
    assert latex("50 % of a_b & {c}\\") == r"50 \% of a\_b \& \{c\}\textbackslash{}"


def test_every_latex_row_has_as_many_cells_as_columns(result: Statistics):
    for table in result.tables:
        rows = [line for line in table_to_latex(table).splitlines() if line.endswith(r"\\")]
        assert len(rows) == len(table.rows) + 1
        assert {line.replace(r"\&", "").count("&") for line in rows} == {len(table.header) - 1}


def test_text_has_aligned_columns_and_warnings(result: Statistics):
    text = page_text(page_parts(result))
    lines = text[text.index("Statistics of dynamic") :].splitlines()
    header = lines[2]
    body = lines[4:8]
    assert all(line[: header.index("All") + 3].rstrip() == line for line in body)
    assert "Waiting time (Kaplan-Meier)" in text
    assert "warning: No Success_L" in text


@pytest.mark.parametrize(
    ("value", "style", "written"),
    [
        (1234.0, Style.COUNT, "1,234"),
        (1234.5, Style.COUNT, "1,234.5"),
        (math.nan, Style.COUNT, "–"),
        (0.1234, Style.SHARE, "12.3 %"),
        (3.14159, Style.NUMBER, "3.14"),
        (-3.14159, Style.NUMBER, "−3.14"),
        (-0.001, Style.NUMBER, "0.00"),
        (1e-9, Style.P_VALUE, "< 0.001"),
        (0.0494, Style.P_VALUE, "0.049"),
    ],
)
def test_a_value_is_written_in_its_style(value: float, style: Style, written: str):
    assert write(value, style) == written
