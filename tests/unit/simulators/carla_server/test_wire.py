"""MessagePack on the wire, against the library of its authors."""

from __future__ import annotations

import contextlib
import tracemalloc

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from overtaking.simulators.carla_server.wire import (
    MAX_FEW,
    MAX_MESSAGE_BYTES,
    MAX_VALUES_BYTES,
    Budget,
    Decoder,
    ProtocolError,
    encode,
)

SIMPLE = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats(allow_nan=False)
    | st.text(max_size=300)
    | st.binary(max_size=300)
)
VALUES = st.recursive(SIMPLE, lambda inner: st.lists(inner, max_size=20), max_leaves=40)


@pytest.mark.ci
@given(value=VALUES)
def test_what_is_encoded_is_what_the_library_encodes(value: object):
    assert encode(value) == msgpack.packb(value, use_bin_type=True)


@pytest.mark.ci
@given(messages=st.lists(VALUES, min_size=1, max_size=5), cuts=st.lists(st.integers(1, 40)))
def test_messages_come_out_whole_however_they_are_cut(messages: list[object], cuts: list[int]):
    data = b"".join(msgpack.packb(one, use_bin_type=True) for one in messages)
    decoder, found, at = Decoder(), [], 0
    for cut in [*cuts, len(data)]:
        found += decoder.feed(data[at : at + cut])
        at += cut
    assert found == messages


@given(value=st.floats(width=32, allow_nan=False))
def test_floats_of_32_bits_are_read(value: float):
    assert Decoder().feed(msgpack.packb(value, use_single_float=True)) == [value]


@given(data=st.binary(max_size=200))
def test_no_bytes_do_more_than_end_a_connection(data: bytes):
    with contextlib.suppress(ProtocolError):
        Decoder().feed(data)


@pytest.mark.parametrize(
    "data",
    [
        b"\x81\x01\x02",  # A map,
        b"\xd4\x01\x02",  # an extension,
        b"\xc1",  # what nobody may use,
        b"\xa2\xff\xfe",  # no UTF-8,
        b"\xdd\xff\xff\xff\xff",  # an array that would not fit,
        b"\xc6\x7f\xff\xff\xff",  # bytes that would not fit,
        b"\x91" * 2000,  # and nesting without end.
    ],
)
def test_what_the_protocol_does_not_have_is_refused(data: bytes):
    with pytest.raises(ProtocolError):
        Decoder().feed(data)


@pytest.mark.parametrize(
    "head",
    [
        b"\x91\xdd\xff\xff\xff\xff",  # An array that would not fit in another,
        b"\xdd\x00\x10\x00\x00" * 1000,  # many in each other,
        b"\x91\xc6\x7f\xff\xff\xff",  # and bytes that would not fit.
    ],
)
def test_what_is_declared_and_not_sent_takes_no_memory(head: bytes):
    tracemalloc.start()
    try:
        assert Decoder().feed(head) == []
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_nesting_as_deep_as_any_batch_is_read():
    data = b"\x91" * 24 + b"\x01"
    (value,) = Decoder().feed(data)
    for _ in range(24):
        (value,) = value
    assert value == 1


def test_a_long_message_has_few_values():
    long = "x" * MAX_VALUES_BYTES
    assert Decoder().feed(encode([long, [1] * MAX_FEW])) == [[long, [1] * MAX_FEW]]
    with pytest.raises(ProtocolError, match="max_array_len"):
        Decoder().feed(encode([long, [1] * (MAX_FEW + 1)]))


@pytest.mark.ci
def test_the_values_of_a_hostile_message_take_bounded_memory():
    # Arrays in each other, so that none is complete before the last, full of the values that grow
    # most: two bytes of text become an object of 51.
    level = b"\xdd" + (501).to_bytes(4, "big") + b"\xa2ab" * 500
    data = level * 1000 + b"\x01"
    assert len(data) <= MAX_VALUES_BYTES
    tracemalloc.start()
    try:
        Decoder().feed(data)
        assert tracemalloc.get_traced_memory()[1] < 64 * MAX_VALUES_BYTES
    finally:
        tracemalloc.stop()
    with pytest.raises(ProtocolError):
        Decoder().feed(level * 1020 + encode("x" * MAX_VALUES_BYTES))


def test_a_message_that_never_ends_is_refused():
    decoder = Decoder(Budget(4 * MAX_MESSAGE_BYTES))
    piece = b"\xc6" + (1 << 20).to_bytes(4, "big") + bytes(1 << 20)
    with pytest.raises(ProtocolError, match="bytes"):
        decoder.feed(b"\xdc\x01\x00" + piece * 20)


def test_connections_share_what_may_be_unfinished():
    budget = Budget(1000)
    first, second = Decoder(budget), Decoder(budget)
    first.feed(b"\xc5\x03\xe8" + bytes(600))
    with pytest.raises(ProtocolError, match="together"):
        second.feed(b"\xc5\x03\xe8" + bytes(600))
    first.close()
    second.close()
    Decoder(budget).feed(b"\xc5\x03\xe8" + bytes(900))


def test_finished_messages_give_back_what_they_took():
    budget = Budget(100)
    decoder = Decoder(budget)
    for _ in range(50):
        assert decoder.feed(msgpack.packb("x" * 60)) == ["x" * 60]
