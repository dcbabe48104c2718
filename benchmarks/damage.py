"""Damages sound input: texts by their words and lines, and any bytes."""

import random
import re

VALUE = re.compile(r'"[^"\n]*"|[\w.+-]+')
MARK = re.compile(r"[\[\]{}<>=,:]")
HOSTILE = (
    *(
        "0",
        "-1",
        "1",
        "2.5",
        "1e308",
        "-1e308",
        "1e-320",
        "1e999",
        "nan",
        "NaN",
        "inf",
        "-Infinity",
    ),
    *("9" * 30, "9" * 5000, "true", "false", "null", "None", '""', '"a"', '"\\ud800"', '"\\u0000"'),
    *("[]", "{}", "[[]]", "[1, 2]", "[" * 100_000, '{"a":' * 100_000, '"' + "a" * 1_000_000 + '"'),
    *("1970-01-01", "0x10", "1_000", "..", "/dev/zero", "../..", "\x00", "\u2028", "<", "&a;", "'"),
)


def damaged_text(text: str, chance: random.Random) -> bytes:
    """A text with one to four things wrong: words, lines or bytes."""
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        text = chance.choice(_OF_TEXT)(text, chance)
    data = text.encode()
    return data if chance.random() < 0.9 else damaged_bytes(data, chance)


def damaged_bytes(data: bytes, chance: random.Random) -> bytes:
    """Bytes of which some are changed, missing, new, or all that follow."""
    at = chance.randrange(len(data) + 1)
    length = chance.choice((1, 2, 8, 64))
    match chance.randrange(4):
        case 0:
            return data[:at] + chance.randbytes(length) + data[at + length :]
        case 1:
            return data[:at] + data[at + length :]
        case 2:
            return data[:at] + chance.randbytes(length) + data[at:]
        case _:
            return data[:at]


def _other_value(text: str, chance: random.Random) -> str:
    """A value becomes a hostile one, or one from elsewhere in the text."""
    return _other(text, VALUE, chance)


def _other_mark(text: str, chance: random.Random) -> str:
    """The same for a mark between values."""
    return _other(text, MARK, chance)


def _other(text: str, pattern: re.Pattern[str], chance: random.Random) -> str:
    places = [found.span() for found in pattern.finditer(text)]
    if not places:
        return chance.choice(HOSTILE)
    start, stop = chance.choice(places)
    from_here = text[slice(*chance.choice(places))]
    return text[:start] + chance.choice((*HOSTILE, *[from_here] * 20)) + text[stop:]


def _moved_line(text: str, chance: random.Random) -> str:
    """A line is gone, twice there, or elsewhere."""
    lines = text.splitlines(keepends=True) or [""]
    line = chance.choice(lines)
    if chance.random() < 0.7:
        lines.remove(line)
    if chance.random() < 0.7:
        lines.insert(chance.randrange(len(lines) + 1), line)
    return "".join(lines)


_OF_TEXT = (_other_value, _other_value, _other_value, _other_value, _other_mark, _moved_line)
