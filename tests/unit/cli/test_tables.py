"""Tables fit the width of the terminal, without breaking words."""

from __future__ import annotations

import io

import pytest
from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from overtaking.cli.streams import fold_command
from overtaking.cli.tables import CommandLine, drawn_rows, facts, open_table, wrap_words

HASH = "21ed4b9283119036c259e72be2701f3cba50dc50db5cd69779d2bfc3f5368539"


def lines_of(drawing: object, width: int) -> list[str]:
    console = Console(file=io.StringIO(), width=width, force_terminal=False)
    with console.capture() as captured:
        console.print(drawing, crop=False)
    return [line.rstrip() for line in captured.get().splitlines()]


def vehicles():
    table = open_table("", "vehicle", "mass kg>", "starts")
    table.add_row("E", "yellow car", "1400", "behind the target")
    table.add_row("1", "white truck", "14246", "")
    return table


def test_a_table_that_fits_has_its_natural_width():
    assert lines_of(vehicles(), 80) == [
        "   vehicle      mass kg  starts",
        "E  yellow car      1400  behind the target",
        "1  white truck    14246",
    ]


def test_texts_are_folded_between_words_where_that_is_enough():
    assert lines_of(vehicles(), 41) == [
        "   vehicle      mass kg  starts",
        "E  yellow car      1400  behind the",
        "                         target",
        "1  white truck    14246",
    ]


def test_a_table_of_too_many_columns_becomes_records():
    assert lines_of(vehicles(), 30) == [
        "E",
        "  vehicle  yellow car",
        "  mass kg  1400",
        "  starts   behind the target",
        "",
        "1",
        "  vehicle  white truck",
        "  mass kg  14246",
    ]


def test_columns_of_numbers_go_on_in_further_blocks():
    rows = [("SE", *("117.25",) * 4), ("OT", *("12.00",) * 4)]
    table = drawn_rows(("feature", *(f"class_{number}>" for number in range(4))), rows)
    assert lines_of(table, 30) == [
        "feature  class_0  class_1",
        "───────  ───────  ───────",
        "SE        117.25   117.25",
        "OT         12.00    12.00",
        "",
        "feature  class_2  class_3",
        "───────  ───────  ───────",
        "SE        117.25   117.25",
        "OT         12.00    12.00",
    ]


def test_labels_that_repeat_are_left_out_in_a_table_and_stay_in_records():
    table = drawn_rows(
        ("feature", "statistic", "all classes together>"),
        [("SE", "mean", "1"), ("SE", "max", "2")],
        num_labels=2,
    )
    assert lines_of(table, 80)[2:] == [
        f"SE       mean       {'1':>20}",
        f"         max        {'2':>20}",
    ]
    assert lines_of(table, 22) == [
        *("SE mean", "  all classes together", "    1", ""),
        *("SE max", "  all classes together", "    2"),
    ]


def test_a_word_that_is_longer_than_the_line_stays_whole_on_a_line_of_its_own():
    rows = [("profile", "motorway"), ("content", HASH), ("made", "on a machine with 2 cores")]
    assert lines_of(facts(rows), 24) == [
        "profile  motorway",
        *("content", HASH),
        *("made     on a machine", "         with 2 cores"),
    ]
    assert [str(line) for line in wrap_words(Text(f"a table in {HASH}: 2 MB"), 20)] == [
        *("a table in", f"{HASH}:", "2 MB")
    ]


def test_lines_that_begin_with_blanks_go_on_farther_in():
    lines = wrap_words(Text("  fact: the ego is behind the target"), 20)
    assert [str(line) for line in lines] == ["  fact: the ego is", "    behind the", "    target"]


@pytest.mark.parametrize("width", [20, 40, 60, 80, 120])
def test_no_line_is_wider_than_the_terminal(width):
    header = ("figure", "value>", "95 % interval>", "target>", "standing>", "verdict")
    rows = [("head-on collisions per million km", "0.1", "0.0 .. 0.2", ">= 3", "held out", "met")]
    assert max(map(cell_len, lines_of(drawn_rows(header, rows, title="t " * 60), width))) <= width


def test_a_command_goes_on_as_a_shell_reads_it():
    words = ("overtaking", "show", "'/data/a folder/set'", "0")
    assert lines_of(CommandLine(words, "next: "), 80) == [
        "next: overtaking show '/data/a folder/set' 0"
    ]
    assert lines_of(CommandLine(words, "next: "), 26) == [
        *("next: overtaking show \\", "  '/data/a folder/set' 0")
    ]
    assert fold_command(words, 10) == [
        *("overtaking \\", "  show \\", "  '/data/a folder/set' \\", "  0")
    ]
