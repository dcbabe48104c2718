"""Numbers and names in sentences."""

import re

_SURROGATE = re.compile("[\ud800-\udfff]")


def counted(number: int, noun: str) -> str:
    """A number with its noun.

    Args:
        number: How many.
        noun: What, in the singular, with a plural in s.

    Examples:
        >>> counted(1, "simulation"), counted(1000, "simulation")
        ('1 simulation', '1,000 simulations')
    """
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def as_utf8(text: str) -> str:
    r"""A text that UTF-8 can hold: bytes of a file name that are not UTF-8 become `\xe9`.

    Python keeps such bytes of a name as surrogates, which no file in UTF-8 can hold.
    """
    return _SURROGATE.sub(_escape, text)


def _escape(surrogate: re.Match[str]) -> str:
    code = ord(surrogate.group())
    # Python adds 0xDC00 to the byte (PEP 383).
    return f"\\x{code - 0xDC00:02x}" if 0xDC80 <= code <= 0xDCFF else f"\\u{code:04x}"
