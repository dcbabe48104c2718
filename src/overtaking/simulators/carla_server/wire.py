"""MessagePack as CARLA's client speaks it: read in pieces and in bounded memory.

Messages follow each other without a length in front. So a message is first skipped, which finds its
end and builds no objects, and decoded when it is complete. What is declared and never sent takes no
memory.
"""

from typing import Any, Final

import msgpack

MAX_MESSAGE_BYTES: Final = 16 << 20
"""Longest message; an OpenDRIVE file of a whole city has a few million bytes."""

MAX_VALUES_BYTES: Final = 2 << 20
"""Longest message with many values. Decoded, a byte may take 64 bytes of memory.

A batch that spawns a thousand vehicles has about 30,000 values in 116 kB.
"""

MAX_FEW: Final = 64
"""Most values in an array of a longer message: the arguments of a call with a long text."""

MAX_BUFFERED_BYTES: Final = 64 << 20
"""Most bytes of unfinished messages on all connections together."""


_LONG = b"\xc6\xdb\xdd"  # Heads of bytes, text and arrays with a length of 32 bits.


class ProtocolError(Exception):
    """Bytes that no CARLA client sends; the server closes their connection."""


class Budget:
    """Bytes of unfinished messages, shared by all connections of a server."""

    def __init__(self, limit: int = MAX_BUFFERED_BYTES) -> None:
        """Start with all bytes free."""
        self._free = limit

    def take(self, count: int) -> None:
        """Reserve `count` bytes; a negative number releases them.

        Raises:
            ProtocolError: Fewer bytes are free.
        """
        if count > self._free:
            raise ProtocolError("the connections together hold more unfinished messages than fit")
        self._free -= count


class Decoder:
    """Turns the bytes of one connection into messages, each a nest of lists.

    Args:
        budget: Shared with the other connections.
    """

    def __init__(self, budget: Budget | None = None) -> None:
        """Wait for the first message."""
        self._budget = budget or Budget()
        self._buffer = bytearray()
        self._scanner = msgpack.Unpacker(read_size=1 << 14, max_buffer_size=2 * MAX_MESSAGE_BYTES)
        self._num_decoded = 0

    @property
    def is_empty(self) -> bool:
        """Whether all data so far belongs to complete messages."""
        return not self._buffer

    def feed(self, data: bytes) -> list[Any]:
        """All messages that `data` completes, in order.

        Raises:
            ProtocolError: No CARLA client sends these bytes.
        """
        self._budget.take(len(data))
        self._buffer += data
        self._scanner.feed(data)
        messages: list[Any] = []
        while self._skips_message():
            length = self._scanner.tell() - self._num_decoded
            messages.append(_decoded(self._buffer[:length]))
            self._num_decoded += length
            self._release(length)
        if max(len(self._buffer), _declared(self._buffer)) > MAX_MESSAGE_BYTES:
            raise ProtocolError(f"a message of more than {MAX_MESSAGE_BYTES} bytes")
        return messages

    def close(self) -> None:
        """Release the bytes of an unfinished message."""
        self._release(len(self._buffer))

    def _release(self, count: int) -> None:
        del self._buffer[:count]
        self._budget.take(-count)

    def _skips_message(self) -> bool:
        """Go to the end of the next message; False where it is not complete."""
        try:
            self._scanner.skip()
        except msgpack.OutOfData:
            return False
        except ValueError as error:  # A reserved type, or nesting beyond 1,024 levels.
            raise ProtocolError(f"no MessagePack: {str(error) or type(error).__name__}") from None
        return True


def _declared(message: bytearray) -> int:
    """Length that the head of an unfinished message states in 32 bits; it is a lower bound."""
    has_length = len(message) >= 5 and message[0] in _LONG
    return int.from_bytes(message[1:5], "big") if has_length else 0


def _decoded(message: bytearray) -> Any:
    """The values of a complete message; maps and extensions do not occur in the protocol."""
    longest = len(message) if len(message) <= MAX_VALUES_BYTES else MAX_FEW
    try:
        return msgpack.unpackb(message, max_array_len=longest, max_map_len=0, max_ext_len=0)
    except ValueError as error:  # A limit, or text that is not UTF-8.
        raise ProtocolError(f"a value that the protocol does not have: {error}") from None


encode = msgpack.Packer().pack
"""A value as MessagePack: tuples are arrays, bytes are binary, floats have 64 bits."""
