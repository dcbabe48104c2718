"""Pictures made of characters tell the numbers that they were made of."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from overtaking.cli.drawing import (
    Glyphs,
    Strip,
    bar_lengths,
    centred,
    nice_reach,
    placed,
    sparkline,
    symbol,
)
from overtaking.model.scenario import MAX_VEHICLES

UNICODE = Glyphs.for_terminal(ascii_only=False)
ASCII = Glyphs.for_terminal(ascii_only=True)


def test_ascii_glyphs_are_ascii_and_as_many_as_the_others():
    for name in ASCII.__slots__:
        assert getattr(ASCII, name).isascii()
    assert len(ASCII.levels) == len(UNICODE.levels)


def test_every_vehicle_has_a_letter_of_its_own():
    letters = [symbol(slot) for slot in range(32)]
    assert letters[0] == "E"
    assert len(set(letters)) == 32 >= MAX_VEHICLES


def test_sparkline_rises_with_its_values():
    line = sparkline(np.linspace(0.0, 7.9, 8), width=8, low=0.0, high=8.0, glyphs=UNICODE)
    assert line == "▁▂▃▄▅▆▇█"


def test_sparkline_of_a_constant_speed_is_flat_and_of_the_width_asked_for():
    line = sparkline(np.full(200, 25.0), width=40, low=25.0, high=25.0, glyphs=ASCII)
    assert line == "_" * 40


@pytest.mark.ci
@given(
    values=st.lists(st.floats(0.0, 60.0), min_size=1, max_size=300),
    width=st.integers(1, 120),
)
def test_sparkline_has_one_character_for_each_column_it_can_fill(values, width):
    line = sparkline(np.array(values), width=width, low=0.0, high=60.0, glyphs=UNICODE)
    assert len(line) == min(width, len(values))
    assert set(line) <= set(UNICODE.levels)


@example(durations=[0.0, 5.960464477539063e-08], width=30)
@given(durations=st.lists(st.floats(0.0, 120.0), min_size=1, max_size=8), width=st.integers(1, 110))
def test_a_bar_is_as_wide_as_asked_for_and_shows_every_stage(durations, width):
    lengths = bar_lengths(durations, width)
    assert sum(lengths) == max(width, len(durations))
    assert min(lengths) >= 1


def test_a_bar_is_in_proportion():
    assert bar_lengths([1.0, 2.0, 1.0], 40) == [10, 20, 10]


@pytest.mark.parametrize(
    ("width", "line"),
    [(10, "─ pass ───"), (6, " pass "), (5, "pass─"), (2, "pa"), (0, "")],
)
def test_a_word_is_centred_or_cut(width, line):
    assert len(line) == width
    assert sorted(centred("pass", width, "─")) == sorted(line)
    assert centred("pass", width, "─").strip("─ ") == line.strip("─ ")


def strip(position, lane, slots) -> Strip:
    return Strip(
        position=np.array(position, dtype=float)[:, None],
        lane=np.array(lane)[:, None],
        slots=np.array(slots),
        reach=50.0,
    )


def test_strip_puts_the_ego_in_the_middle_and_others_where_they_are():
    (line,) = strip([0.0, 25.0, -25.0], [0, 1, -1], [0, 1, 2]).lines(42, UNICODE)
    assert len(line) == 42
    assert line.index("E") == 20
    assert line[30:32] == "1'"
    assert line[10:12] == "2,"


def test_strip_leaves_out_what_is_beyond_its_reach():
    (line,) = strip([0.0, 51.5, -80.0], [0, 0, 0], [0, 1, 2]).lines(42, UNICODE)
    assert line.strip() == "E"


def test_strip_never_hides_the_ego():
    (line,) = strip([0.0, 0.1], [0, -1], [0, 1]).lines(42, UNICODE)
    assert line.strip() == "E,"


@given(
    position=st.lists(st.floats(-500.0, 500.0), min_size=1, max_size=12),
    width=st.integers(10, 100),
)
def test_every_line_of_a_strip_is_as_wide_as_asked_for(position, width):
    slots = range(1, len(position) + 1)
    lanes = [slot % 3 - 1 for slot in slots]
    for line in strip([0.0, *position], [0, *lanes], [0, *slots]).lines(width, ASCII):
        assert len(line) == width
        assert "E" in line


def test_reach_is_round_and_shows_most_of_all_and_nearly_all_of_the_nearest():
    near, far = np.linspace(0.0, 25.0, 50), np.full(50, 400.0)
    assert nice_reach(near[None]) == 30.0
    assert nice_reach(np.linspace(0.0, 80.0, 50)[None]) == 100.0
    assert nice_reach(np.stack([near, near, near + 1.0, far])) == 30.0
    assert nice_reach(far[None]) == 150.0
    assert nice_reach(np.empty((0, 50))) == 30.0


def test_marks_stand_at_their_columns_and_none_hides_another():
    assert placed([(0, "F"), (3, "A"), (3, "X"), (4, "O")], 6) == ["F  AO ", "   X  "]
    assert placed([], 6) == []
