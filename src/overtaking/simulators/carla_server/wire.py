"""MessagePack as CARLA's client speaks it: strict, incremental and bounded on the way in.

Messages follow each other without a length in front, so the decoder keeps its place between two
pieces of a message and looks at each byte once. Maps and extensions do not occur in the protocol
and are refused, as is whatever would take more memory or nesting than a client needs.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, Final

MAX_MESSAGE_BYTES = 16 << 20
"""Largest message; an OpenDRIVE file of a whole city has a few million bytes."""
MAX_ITEMS = 200_000
"""Most values in one message; a batch that spawns a thousand vehicles has about 30,000."""
MAX_DEPTH = 24
"""Deepest nesting; a batch whose commands spawn and then command has 9 levels."""
MAX_BUFFERED_BYTES = 64 << 20
"""Most bytes of unfinished messages on all connections together."""


class ProtocolError(Exception):
    """Bytes that no CARLA client sends; the connection they came on cannot go on."""


@dataclass(frozen=True, slots=True)
class Encoded:
    """A value that is MessagePack already, such as the list of blueprints."""

    data: bytes


class Budget:
    """Bytes of unfinished messages, shared by all connections of a server."""

    def __init__(self, limit: int = MAX_BUFFERED_BYTES) -> None:
        """Start with nothing taken."""
        self._left = limit

    def take(self, count: int) -> None:
        """Set `count` bytes aside; a negative number gives them back.

        Raises:
            ProtocolError: There are not so many left.
        """
        if count > self._left:
            raise ProtocolError("the connections together hold more unfinished messages than fit")
        self._left -= count


_NUMBERS: Final[dict[int, struct.Struct]] = {
    code: struct.Struct(f">{letter}")
    for code, letter in zip(
        (0xCA, 0xCB, 0xCC, 0xCD, 0xCE, 0xCF, 0xD0, 0xD1, 0xD2, 0xD3), "fdBHIQbhiq", strict=True
    )
}
_LENGTHS: Final[dict[int, struct.Struct]] = {
    code: struct.Struct(f">{letter}")
    for code, letter in zip(
        (0xC4, 0xC5, 0xC6, 0xD9, 0xDA, 0xDB, 0xDC, 0xDD), "BHIBHIHI", strict=True
    )
}
_SIMPLE: Final[dict[int, Any]] = {0xC0: None, 0xC2: False, 0xC3: True}
_TEXTS = frozenset((0xD9, 0xDA, 0xDB))
_ARRAYS = frozenset((0xDC, 0xDD))
_NOTHING = object()


class Decoder:
    """Turns the bytes of one connection into messages, each a nest of lists.

    Args:
        budget: Shared with the other connections.
    """

    def __init__(self, budget: Budget | None = None) -> None:
        """Wait for the first message."""
        self._budget = budget or Budget()
        self._buffer = bytearray()
        self._at = 0
        self._open: list[tuple[list[Any], int]] = []
        self._items = 0
        self._taken = 0
        self._done: Any = _NOTHING

    def feed(self, data: bytes) -> list[Any]:
        """Every message that `data` completes, in order.

        Raises:
            ProtocolError: The bytes are none that a client sends.
        """
        self._budget.take(len(data))
        self._taken += len(data)
        self._buffer += data
        messages: list[Any] = []
        while (value := self._next()) is not _NOTHING:
            if self._place(value):
                continue
            messages.append(self._finished(value))
        if len(self._buffer) > MAX_MESSAGE_BYTES:
            raise ProtocolError(f"a message of more than {MAX_MESSAGE_BYTES} bytes")
        return messages

    def close(self) -> None:
        """Give back what was set aside."""
        self._budget.take(-self._taken)
        self._taken = 0
        self._buffer.clear()

    def _finished(self, value: Any) -> Any:
        """The message that `value` is or has completed; its bytes are let go."""
        message = self._done if self._done is not _NOTHING else value
        del self._buffer[: self._at]
        self._budget.take(-self._at)
        self._taken -= self._at
        self._at = 0
        self._items = 0
        self._done = _NOTHING
        return message

    def _place(self, value: Any) -> bool:
        """Put a value where it belongs; whether the message goes on."""
        self._items += 1
        if self._items > MAX_ITEMS:
            raise ProtocolError(f"a message of more than {MAX_ITEMS} values")
        if type(value) is _Array:
            if len(self._open) >= MAX_DEPTH:
                raise ProtocolError(f"a message nested deeper than {MAX_DEPTH}")
            if value.length:
                self._open.append(([], value.length))
                return True
            value = []
        while self._open:
            items, length = self._open[-1]
            items.append(value)
            if len(items) < length:
                return True
            self._open.pop()
            value = items
        self._done = value
        return False

    def _next(self) -> Any:
        """The next value or head of an array, `_NOTHING` if its bytes are not all here."""
        if self._at >= len(self._buffer):
            return _NOTHING
        code = self._buffer[self._at]
        if code < 0x80 or code >= 0xE0:
            self._at += 1
            return code if code < 0x80 else code - 0x100
        if code in _SIMPLE:
            self._at += 1
            return _SIMPLE[code]
        if 0x90 <= code < 0xA0:
            self._at += 1
            return _Array(code & 0x0F)
        if 0xA0 <= code < 0xC0:
            return self._bytes(self._at + 1, code & 0x1F, is_text=True)
        if code in _NUMBERS:
            return self._number(_NUMBERS[code])
        return self._long(code)

    def _number(self, kind: struct.Struct) -> Any:
        end = self._at + 1 + kind.size
        if end > len(self._buffer):
            return _NOTHING
        (value,) = kind.unpack_from(self._buffer, self._at + 1)
        self._at = end
        return value

    def _long(self, code: int) -> Any:
        """A value that states its length."""
        kind = _LENGTHS.get(code)
        if kind is None:
            raise ProtocolError(f"the type 0x{code:02x}, which the protocol does not have")
        start = self._at + 1 + kind.size
        if start > len(self._buffer):
            return _NOTHING
        (length,) = kind.unpack_from(self._buffer, self._at + 1)
        if code not in _ARRAYS:
            return self._bytes(start, length, is_text=code in _TEXTS)
        if length > MAX_ITEMS:
            raise ProtocolError(f"an array of {length} values")
        self._at = start
        return _Array(length)

    def _bytes(self, start: int, length: int, *, is_text: bool) -> Any:
        end = start + length
        if length > MAX_MESSAGE_BYTES:
            raise ProtocolError(f"a text of {length} bytes")
        if end > len(self._buffer):
            return _NOTHING
        content = bytes(self._buffer[start:end])
        self._at = end
        if not is_text:
            return content
        try:
            return content.decode("utf-8")
        except UnicodeDecodeError:
            raise ProtocolError("a text that is not UTF-8") from None


@dataclass(frozen=True, slots=True)
class _Array:
    """The head of an array."""

    length: int


def encode(value: Any) -> bytes:
    """A value as MessagePack; tuples are arrays, bytes are binary, floats have 64 bits."""
    parts: list[bytes] = []
    _append(value, parts)
    return b"".join(parts)


_DOUBLE = struct.Struct(">Bd")
_ARRAY_HEADS = ((0xDC, "H"), (0xDD, "I"))


def _append(value: Any, parts: list[bytes]) -> None:
    """Append the bytes of a value, the common types first."""
    kind = type(value)
    if kind is float:
        parts.append(_DOUBLE.pack(0xCB, value))
    elif kind is int:
        parts.append(_INTEGERS[value] if 0 <= value < len(_INTEGERS) else _integer(value))
    elif kind is bool or value is None:
        parts.append(b"\xc0" if value is None else b"\xc3" if value else b"\xc2")
    elif isinstance(value, list | tuple):
        parts.append(_head(len(value), 0x90, 16, _ARRAY_HEADS))
        for item in value:
            _append(item, parts)
    elif isinstance(value, int | float):  # An enumeration, or a number of a library.
        _append(int(value) if isinstance(value, int) else float(value), parts)
    else:
        parts.extend(_whole(value))


def _whole(value: Any) -> tuple[bytes, ...]:
    """The bytes of what is written in one piece."""
    if isinstance(value, str):
        text = value.encode("utf-8")
        return _head(len(text), 0xA0, 32, ((0xD9, "B"), (0xDA, "H"), (0xDB, "I"))), text
    if isinstance(value, bytes):
        return _head(len(value), 0, 0, ((0xC4, "B"), (0xC5, "H"), (0xC6, "I"))), value
    if isinstance(value, Encoded):
        return (value.data,)
    raise TypeError(f"cannot encode {type(value).__name__}")


def _head(length: int, short: int, below: int, longer: tuple[tuple[int, str], ...]) -> bytes:
    """Type and length of an array, a text or bytes, in the fewest bytes."""
    if length < below:
        return bytes((short + length,))
    for code, letter in longer:
        if length < 1 << (8 * struct.calcsize(letter)):
            return struct.pack(f">B{letter}", code, length)
    raise ValueError(f"cannot encode a value of length {length}")


def _integer(value: int) -> bytes:
    if 0 <= value < 0x80 or -0x20 <= value < 0:
        return struct.pack(">b", value)
    if value >= 0:
        kinds = ((0xCC, "B"), (0xCD, "H"), (0xCE, "I"), (0xCF, "Q"))
        fits = next(kind for kind in kinds if value < 1 << (8 * struct.calcsize(kind[1])))
    else:
        kinds = ((0xD0, "b"), (0xD1, "h"), (0xD2, "i"), (0xD3, "q"))
        fits = next(kind for kind in kinds if value >= -(1 << (8 * struct.calcsize(kind[1]) - 1)))
    return struct.pack(f">B{fits[1]}", fits[0], value)


_INTEGERS = tuple(_integer(value) for value in range(1 << 10))
"""Numbers of actors and the like, which are written all the time."""
