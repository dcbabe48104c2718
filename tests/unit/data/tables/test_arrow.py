"""Our conversions give what pyarrow's own give, which load pandas."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as nps

from overtaking.data.tables.arrow import (
    column_to_numpy,
    missing_in,
    to_arrow,
    to_names,
    to_numpy,
    to_texts,
)

KINDS = ["i1", "u1", "i2", "i4", "i8", "u8", "f4", "f8", "?"]
LENGTH = st.integers(0, 40)


@st.composite
def columns(draw):
    """Values, where they are missing, and a slice."""
    length = draw(LENGTH)
    finite = {"allow_nan": False} if (kind := draw(st.sampled_from(KINDS)))[0] == "f" else None
    values = draw(nps.arrays(np.dtype(kind), length, elements=finite))
    missing = draw(nps.arrays(np.bool_, length))
    first = draw(st.integers(0, length))
    return values, missing, slice(first, draw(st.integers(first, length)))


@given(column=columns())
def test_numbers_are_those_of_pyarrow(column):
    values, missing, _ = column
    ours, theirs = to_arrow(values, missing), pa.array(values, mask=missing)
    ours.validate(full=True)
    assert ours.equals(theirs)
    assert to_arrow(values).equals(pa.array(values))


@pytest.mark.ci
@given(column=columns())
def test_any_part_of_an_array_comes_back(column):
    values, missing, part = column
    chunk = pa.array(values, mask=missing)[part.start : part.stop]
    there = ~missing[part]
    assert np.array_equal(missing_in(chunk), missing[part])
    assert to_numpy(chunk).dtype == values.dtype
    assert np.array_equal(to_numpy(chunk)[there], values[part][there])


@pytest.mark.ci
@given(texts=st.lists(st.none() | st.text()))
def test_texts_are_those_of_pyarrow(texts):
    ours = to_texts(texts)
    ours.validate(full=True)
    assert ours.equals(pa.array(texts, pa.string()))


@given(codes=st.lists(st.none() | st.sampled_from([0, 1, 2])))
def test_names_are_those_of_their_codes(codes):
    missing = np.array([code is None for code in codes], dtype=bool)
    given_codes = np.array([code or 0 for code in codes], dtype=np.uint8)
    ours = to_names(given_codes, ("off", "left", "right"), missing)
    expected = [None if code is None else ("off", "left", "right")[code] for code in codes]
    assert ours.to_pylist() == expected
    assert ours.type == pa.dictionary(pa.int32(), pa.string())


def test_numbers_are_not_copied():
    values = np.arange(10, dtype=np.int32)
    assert to_arrow(values).buffers()[1].address == values.ctypes.data
    assert to_numpy(to_arrow(values)).ctypes.data == values.ctypes.data


@pytest.mark.ci
@pytest.mark.parametrize("module", ["overtaking.data.generate", "overtaking.data.tables.encode"])
def test_writing_a_data_set_does_not_load_pandas(module: str):
    code = (
        f"import sys, {module}, numpy as np\n"
        "from overtaking.data.tables import arrow, digest, columns\n"
        "import pyarrow as pa\n"
        "table = pa.table({'a': arrow.to_arrow(np.arange(3, dtype=np.int32))})\n"
        "field = columns.computed_column('a', pa.int32(), columns.FieldSpec('A')).arrow_field\n"
        "digest.content_of(table.cast(pa.schema([field])))\n"
        "print('pandas' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_a_column_in_pieces_is_one_array_with_a_value_for_its_nulls():
    pieces = [pa.array([1, None, 3], pa.uint8()), pa.array([None, 5], pa.uint8()).slice(1)]
    values = column_to_numpy(pa.chunked_array(pieces), 255)
    assert values.dtype == np.uint8
    assert values.tolist() == [1, 255, 3, 5]
    assert column_to_numpy(pa.chunked_array([], pa.bool_())).dtype == np.bool_
    assert column_to_numpy(pa.chunked_array([[True, None]]), missing=True).tolist() == [True, True]
    # A recording may tell nothing of a column that holds yes or no.
    absent = column_to_numpy(pa.chunked_array([pa.nulls(2, pa.bool_())]))
    assert (absent.dtype, absent.tolist()) == (np.bool_, [False, False])
