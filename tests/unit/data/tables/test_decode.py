"""People get SI numbers and names."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from overtaking.data.tables.columns import codes
from overtaking.data.tables.decode import decode
from overtaking.data.tables.encode import encode
from overtaking.data.tables.schemas import RECORDED_TABLES, SCHEMAS


@pytest.fixture(scope="module")
def recorded(recorder):
    return recorder(seed=2)


@pytest.fixture(scope="module")
def frames(recorded):
    return {name: decode(table) for name, table in encode(recorded, np.arange(5)).items()}


def test_lengths_come_back_in_metres_as_the_nearest_double(frames):
    assert decode(one_state(x_mm=123))["x_m"].tolist() == [0.123]
    assert decode(one_state(x_mm=-350_070))["x_m"].tolist() == [-350.07]
    assert frames["states"]["x_m"].dtype == np.float64


def test_angles_come_back_in_radians():
    assert decode(one_state(heading_100urad=-31_416))["heading_rad"].tolist() == [-3.1416]


def test_lights_come_back_one_by_one():
    found = decode(one_state(lights=0b1001))
    assert found[["brake", "low_beam", "high_beam", "rear_fog"]].to_numpy().tolist() == [
        [True, False, False, True]
    ]


def test_names_come_back_as_categories_that_know_all_names(frames):
    assert list(frames["vehicles"]["kind"].cat.categories) == ["S", "M", "L", "V", "T", "MC", "B"]
    assert frames["vehicles"]["role"].iloc[0] == "ego"


def test_what_is_null_comes_back_as_missing(frames):
    vehicles = frames["vehicles"]
    assert vehicles["contact_vehicle"].dtype == pd.UInt8Dtype()
    missing = vehicles["contact_vehicle"].isna()
    assert missing.any()
    assert vehicles.loc[missing, "contact_time_s"].isna().all()
    assert vehicles.loc[~missing, "contact_time_s"].notna().all()


def test_hashes_come_back_as_text(recorded, frames):
    text = frames["simulations"]["trace_hash"].iloc[0]
    assert bytes.fromhex(text) == recorded.trace_hash[0].astype("<u4").tobytes()


@pytest.mark.parametrize("name", RECORDED_TABLES)
def test_no_column_is_an_object_and_no_row_is_lost(name: str, frames, recorded):
    table = encode(recorded, np.arange(5))[name]
    assert len(frames[name]) == table.num_rows
    kinds = [kind for kind in frames[name].dtypes if isinstance(kind, np.dtype)]
    assert not any(kind.hasobject for kind in kinds)


def test_codes_do_not_depend_on_the_order_in_a_dictionary():
    names = ("off", "left", "right")
    one = pa.DictionaryArray.from_arrays(pa.array([1, 0, None]), pa.array(["right", "off"]))
    other = pa.DictionaryArray.from_arrays(pa.array([0, 0]), pa.array(["left"]))
    column = pa.chunked_array([one, other])
    assert codes(column, names).tolist() == [0, 2, -1, 1, 1]


def one_state(**values: int) -> pa.Table:
    """A row of the states table: zeros but for the values given."""
    row = {field.name: values.get(field.name, 0) for field in SCHEMAS["states"]}
    row["indicator"] = "off"
    return pa.Table.from_pylist([row], schema=SCHEMAS["states"])
