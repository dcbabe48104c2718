"""Characters that a stream does not have are replaced by ones that mean the same."""

from __future__ import annotations

import io

import pytest

from overtaking.cli.streams import can_encode, plain_equivalent, prepare_streams, terminal_width


@pytest.mark.parametrize(
    ("character", "equivalent"),
    [
        *(("→", "->"), ("²", "2"), ("–", "-"), ("−", "-"), ("…", "..."), ("≥", ">=")),
        *(("×", "x"), ("▁", "_"), ("█", "#"), ("─", "-"), ("┼", "+"), ("χ", "chi"), ("Σ", "Sigma")),
        *(("é", "e"), ("Ü", "U"), ("ß", "ss"), ("½", "1/2"), ("ﬁ", "fi"), ("漢", "?")),
    ],
)
def test_a_character_has_a_plain_equivalent(character, equivalent):
    assert plain_equivalent(character) == equivalent


@pytest.mark.parametrize(
    ("encoding", "printed"),
    [
        ("ascii", b"5 m/s2 -> Evora - # \\xff"),
        ("latin-1", b"5 m/s\xb2 -> \xc9vora - # \\xff"),
        ("cp1252", b"5 m/s\xb2 -> \xc9vora \x96 # \\xff"),
        ("utf-8", "5 m/s² → Évora – █ ".encode() + rb"\xff"),
    ],
)
def test_a_stream_prints_every_text_in_its_encoding(monkeypatch, encoding, printed):
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr("sys.stdout", stream)
    prepare_streams()
    stream.write("5 m/s² → Évora – █ \udcff")  # The last: a byte of a file name that is not UTF-8.
    stream.flush()
    assert stream.buffer.getvalue() == printed  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("columns", "width"), [("40", 40), ("", None), ("0", None), ("wide", None), ("-4", None)]
)
def test_the_width_is_that_of_the_environment_or_unlimited(monkeypatch, capsys, columns, width):
    monkeypatch.setenv("COLUMNS", columns)
    assert terminal_width() == width


def test_only_characters_of_the_encoding_can_be_encoded():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="cp1252")
    assert can_encode("5 m/s²", stream)
    assert not can_encode("a → b", stream)
