"""Tables of other tools: dates, units in headers, Arrow's interface, comments, thousands, sides."""

from __future__ import annotations

import unicodedata
import zipfile
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from tests.support.recordings import OVERTAKE, Mover, highd, states

from overtaking.core.errors import ImportFormatError
from overtaking.data.collection import ENDINGS
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.column_map import column_map
from overtaking.recordings.findings import Check, Consequence, Finding
from overtaking.recordings.highd import read_highd
from overtaking.recordings.tables import read_table, recording_of
from overtaking.recordings.track_table import read_track_rows, track_rows_from_table

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.recordings.recording import Recording

COLUMNS = {
    "vehicle": "id",
    "time": "t [s]",
    "x": "x [m]",
    "y": "y [m]",
    "length": "length [m]",
    "width": "width [m]",
    "type": "kind",
}
MAP: dict[str, Any] = {
    "columns": COLUMNS,
    "types": {"car": ["car"], "truck": ["truck"], "left_out": ["pedestrian"]},
    "road": {"kind": "motorway", "borders_m": [0, 3.5, 7, 10.5], "heading_deg": 0},
}
USED = ["id", "t", "x", "y", "length", "width", "kind"]
START = pd.Timestamp("2024-05-01 08:30:00")


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    """Vehicle 7 overtakes vehicle 3."""
    movers = [replace(mover, s=mover.s + 100.0) for mover in OVERTAKE]
    table = pd.DataFrame(states(movers))[USED]
    table.loc[table.id == 9, "kind"] = "truck"
    return table


def read(table: Any, **sections: Any) -> Recording:
    """A table in memory; sections replace those of the map of columns."""
    columns = column_map({**MAP, **sections})
    return recording_of(track_rows_from_table(table, columns), columns, "t")


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def findings(recording: Recording, check: Check) -> list[Finding]:
    return [finding for finding in recording.findings if finding.check is check]


def is_same(recording: Recording, other: Recording) -> bool:
    """Whether two recordings have equal vehicles, apart from rounding."""
    tracks, others = recording.tracks, other.tracks
    return (
        tracks.names.tolist() == others.names.tolist()
        and np.array_equal(tracks.start, others.start)
        and np.allclose(tracks.s, others.s, atol=1e-6)
        and np.allclose(tracks.d, others.d, atol=1e-6)
        and np.array_equal(tracks.kind, others.kind)
    )


# Times


def with_times(frame: pd.DataFrame, form: str) -> pd.DataFrame:
    """The table with times in another form."""
    elapsed = pd.to_timedelta(frame.t, unit="s")
    date = START + elapsed
    text = date.dt.strftime("%Y-%m-%dT%H:%M:%S.%f")
    forms: dict[str, Any] = {
        "date in ns": date.astype("datetime64[ns]"),
        "date in ms": date.astype("datetime64[ms]"),
        "date in a zone": date.dt.tz_localize("Europe/Berlin"),
        "duration": elapsed,
        "ISO": text,
        "ISO in UTC": text + "Z",
        "ISO with an offset": text + "+02:00",
        "ISO with a blank": text.str.replace("T", " "),
        "ISO without separators": date.dt.strftime("%Y%m%dT%H%M%S.%f"),
        "time of the day": date.dt.strftime("%H:%M:%S.%f"),
        "duration of pandas": elapsed.map(str),
    }
    return frame.assign(t=forms[form])


FORMS = (
    *("date in ns", "date in ms", "date in a zone", "duration", "ISO", "ISO in UTC"),
    *("ISO with an offset", "ISO with a blank", "ISO without separators", "time of the day"),
    "duration of pandas",
)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("unit", [" [s]", " [ms]", ""])
def test_times_may_be_dates_durations_or_texts(frame, form, unit):
    other = read(with_times(frame, form), columns={**COLUMNS, "time": f"t{unit}"})
    assert is_same(other, read(frame))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_files_may_have_dates_durations_or_texts(tmp_path, frame, form, ending):
    path = tmp_path / f"t.{ending}"
    table = with_times(frame, form)
    table.to_csv(path, index=False) if ending == "csv" else table.to_parquet(path)
    assert is_same(read_table(path, MAP), read(frame))


def test_offsets_of_dates_count(frame):
    text = with_times(frame, "ISO").t
    is_later = frame.t > 10.0  # The clock is set forward by an hour, and so is the offset.
    later = (START + pd.to_timedelta(frame.t + 3600.0, unit="s")).map(lambda time: time.isoformat())
    table = frame.assign(t=(text + "+01:00").where(~is_later, later + "+02:00"))
    assert is_same(read(table), read(frame))


def test_texts_of_which_some_have_an_offset_are_refused_with_the_row(frame):
    table = with_times(frame, "ISO")
    table.loc[table.index[6], "t"] += "Z"
    with pytest.raises(ImportFormatError, match=r"row 7, column t: .* all with an offset"):
        read(table)


def test_numbers_need_a_unit(frame):
    with pytest.raises(ImportFormatError, match=r'time = "t \[s\]"'):
        read(frame, columns={**COLUMNS, "time": "t"})


@pytest.mark.parametrize("period", [86_400.0, 3_600.0])
@pytest.mark.parametrize("before", [0.05, 5.0, 29.0])
@pytest.mark.parametrize("order", ["vehicle", "time", "none"])
def test_a_clock_that_starts_again_goes_on(frame, period, before, order):
    frame = frame.assign(elapsed=frame.t, t=((frame.t + period - before) % period).round(3))
    table = {
        "vehicle": frame,
        "time": frame.sort_values(["elapsed", "id"]),
        "none": frame.sample(frac=1.0, random_state=1),
    }[order]
    recording = read(table)
    assert recording.notes["tracks_torn"] == 0
    (finding,) = findings(recording, Check.TIME)
    assert finding.consequence is Consequence.CORRECTED
    assert finding.rows == (frame.elapsed >= before - 1e-9).sum()
    assert finding.first_time_s == pytest.approx(0.0, abs=0.1)


def test_a_recording_of_a_whole_hour_has_no_wrap(frame):
    later = frame.assign(id=frame.id + 100, t=frame.t + 3600.0 - frame.t.max())
    recording = read(pd.concat([frame, later]))
    assert not findings(recording, Check.TIME)
    assert recording.tracks.num_vehicles == 8


def test_a_row_that_goes_back_in_time_is_reported(frame):
    order = np.arange(len(frame))
    order[[350, 351]] = order[[351, 350]]
    table = frame.iloc[order]
    recording = read(table)
    (finding,) = findings(recording, Check.TIME)
    assert finding.consequence is Consequence.REPORTED
    assert finding.vehicle == str(frame.id.iloc[350])
    assert finding.first_time_s == pytest.approx(frame.t.iloc[350])
    assert is_same(recording, read(frame))


@pytest.mark.parametrize("order", ["reversed", "mixed", "time"])
def test_tables_in_another_order_are_read_without_a_finding(frame, order):
    table = {
        "reversed": frame.iloc[::-1],
        "mixed": frame.sample(frac=1.0, random_state=3),
        "time": frame.sort_values(["t", "id"]),
    }[order]
    recording = read(table)
    assert not recording.findings
    assert is_same(recording, read(frame))


# Names of vehicles and of columns


def renamed(frame: pd.DataFrame, names: dict[int, str]) -> pd.DataFrame:
    return frame.assign(id=[names.get(number, str(number)) for number in frame.id])


@pytest.mark.parametrize(
    ("first", "second"),
    [("7", "07"), ("12", "1_2"), ("1", " 1"), ("1", "+1"), ("a" * 60 + "1", "a" * 60 + "2")],
)
def test_ids_that_look_alike_are_different_vehicles(frame, first, second):
    recording = read(renamed(frame, {9: first, 7: second}))
    assert {first, second} <= set(recording.tracks.names)
    assert recording.tracks.num_vehicles == 4
    lengths = dict(zip(recording.tracks.names, recording.tracks.length, strict=True))
    assert (lengths[first], lengths[second]) == (12.0, 4.5)


@pytest.mark.parametrize("form", ["{}", "{}.0", "{}.", " {} "])
def test_whole_numbers_are_names_without_decimals_and_in_order(frame, form):
    recording = read(renamed(frame, {number: form.format(number * 5) for number in (3, 5, 7, 9)}))
    assert recording.tracks.names.tolist() == ["15", "25", "35", "45"]
    assert not recording.findings


def test_composed_and_decomposed_letters_are_equal(frame):
    composed, decomposed = "é", unicodedata.normalize("NFD", "é")
    table = frame.rename(columns={"kind": f"typ{composed}"})
    table["id"] = [composed if k % 2 else decomposed for k in range(len(frame))]
    table["id"] = frame.id.map(str) + table.id
    table[f"typ{composed}"] = frame.kind.replace("truck", f"{composed}norme")
    types = {"car": ["car"], "truck": [f"{decomposed}norme"]}
    recording = read(table, columns={**COLUMNS, "type": f"typ{decomposed}"}, types=types)
    assert recording.tracks.names.tolist() == [f"{number}{composed}" for number in (3, 5, 7, 9)]
    assert (recording.tracks.kind == VehicleKind.TRUCK).any()


@pytest.mark.parametrize("header", ["x [m]", "x (m)", "X [ m ]", "x[metres]", " x "])
def test_headers_may_have_the_unit_of_the_map(frame, header):
    assert is_same(read(frame.rename(columns={"x": header})), read(frame))


def test_a_unit_that_contradicts_the_map_is_refused(frame):
    table = frame.rename(columns={"x": "x [ft]"})
    with pytest.raises(ImportFormatError, match=r"column x \[ft\]: .* map of columns, m, got ft"):
        read(table)
    named_whole = read(table, columns={**COLUMNS, "x": "x [ft] [m]"})
    assert is_same(named_whole, read(frame))


def test_of_two_headers_the_one_with_the_unit_of_the_map_is_read(frame):
    table = frame.rename(columns={"x": "x [m]"}).assign(**{"x [ft]": frame.x / 0.3048})
    assert is_same(read(table), read(frame))
    in_feet = read(table, columns={**COLUMNS, "x": "x [ft]"})
    assert np.allclose(in_feet.tracks.s, read(frame).tracks.s)


def test_a_missing_column_is_named_with_those_that_exist(frame):
    table = frame.rename(columns={"id": "track_id"})
    with pytest.raises(ImportFormatError) as caught:
        read(table)
    message = str(caught.value)
    assert "expected a column id, got none among track_id, t, x, y, length, width" in message
    assert "the nearest column is track_id" in message
    with pytest.raises(ImportFormatError, match=r"id is in the index: call reset_index\(\)"):
        read(frame.set_index("id"))


# Tables in memory


class ArrowStream:
    """A table of a library that has Arrow's C interface."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self.table = pa.table(frame)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.table.__arrow_c_stream__(requested_schema)


class ArrowArray:
    """A batch of rows of a library that has Arrow's C interface."""

    def __init__(self, frame: pd.DataFrame) -> None:
        (self.batch,) = pa.table(frame).combine_chunks().to_batches()

    def __arrow_c_array__(self, requested_schema: object = None) -> object:
        return self.batch.__arrow_c_array__(requested_schema)


def views(frame: pd.DataFrame) -> pa.Table:
    """Texts as polars has them."""
    table = pa.table(frame)
    return table.set_column(6, "kind", table["kind"].cast(pa.string_view()))


@pytest.mark.parametrize(
    "make",
    [
        ArrowStream,
        ArrowArray,
        views,
        lambda frame: ArrowArray(frame).batch,
        lambda frame: pa.table(frame).to_reader(),
        lambda frame: {name: frame[name].to_numpy() for name in frame},
        lambda frame: {name: frame[name].tolist() for name in frame},
        lambda frame: frame.astype({"kind": "category", "id": "category"}),
        lambda frame: frame.assign(id=[str(k) if k > 4 else k for k in frame.id]),
    ],
)
def test_tables_of_other_libraries_are_read(frame, make):
    assert is_same(read(make(frame)), read(frame))


def dictionary(texts: list[str], index: pa.DataType, text: pa.DataType) -> pa.Array:
    encoded = pa.array(texts).dictionary_encode()
    return pa.DictionaryArray.from_arrays(
        encoded.indices.cast(index), encoded.dictionary.cast(text)
    )


@pytest.mark.parametrize(
    "make",
    [
        lambda kinds: dictionary(kinds, pa.uint32(), pa.string_view()),
        lambda kinds: dictionary(kinds, pa.uint8(), pa.large_string()),
        lambda kinds: pa.array(kinds, pa.large_binary()),
        lambda kinds: pc.run_end_encode(pa.array(kinds)),
    ],
)
def test_texts_may_have_any_type_of_arrow(frame, make):
    table = pa.table(frame)
    typed = table.set_column(6, "kind", make(frame.kind.tolist()))
    assert is_same(read(typed), read(frame))


def test_columns_without_values(frame):
    table = pa.table(frame)
    tracks = read(table.set_column(6, "kind", pa.nulls(len(frame)))).tracks
    assert not tracks.is_kind_known.any()
    with pytest.raises(ImportFormatError, match=r"column x: .* an empty cell here and in"):
        read(table.set_column(2, "x", pa.nulls(len(frame))))
    with pytest.raises(ImportFormatError, match=r"column id: .* an empty cell here and in"):
        read(table.set_column(0, "id", pa.nulls(len(frame))))
    with pytest.raises(ImportFormatError, match="column kind: expected texts"):
        read(table.set_column(6, "kind", pa.array([["car"]] * len(frame))))


@pytest.mark.parametrize("table", [None, 3, [1, 2], "t.csv"])
def test_what_is_no_table_is_refused(table):
    with pytest.raises(ImportFormatError, match="expected a data frame of pandas"):
        read(table)


def test_missing_cells_of_data_frames_are_left_out(frame):
    nullable = frame.astype({"id": "Int64"})
    nullable.loc[frame.index[5], "id"] = pd.NA
    floats = frame.astype({"id": float})
    floats.loc[frame.index[5], "id"] = np.nan
    texts = floats.assign(id=floats.id.map(str))
    plain = {name: floats[name].to_numpy() for name in floats}
    for table in (nullable, floats, texts, plain):
        recording = read(table)
        (finding,) = findings(recording, Check.MISSING_CELLS)
        assert (finding.rows, finding.vehicle) == (1, None)
        assert finding.first_time_s == pytest.approx(frame.t.iloc[5])
        assert set(recording.tracks.names) <= {"3", "5", "7", "7 (2)", "9"}


# Kinds and values


def test_one_row_does_not_change_a_kind(frame):
    table = frame.copy()
    rows = table.index[table.id == 9]
    table.loc[rows[0], "kind"] = "car"
    recording = read(table)
    assert is_same(recording, read(frame))
    (finding,) = findings(recording, Check.KINDS)
    assert (finding.vehicle, finding.rows) == ("9", 1)
    assert finding.consequence is Consequence.CORRECTED
    assert finding.first_time_s == pytest.approx(table.t[rows[0]])


def test_of_two_equally_frequent_kinds_none_is_known(frame):
    table = frame.copy()
    rows = table.index[table.id == 9]
    table.loc[rows[: len(rows) // 2], "kind"] = "car"
    table = table.drop(index=rows[-1]) if len(rows) % 2 else table
    recording = read(table)
    is_known = dict(zip(recording.tracks.names, recording.tracks.is_kind_known, strict=True))
    assert not is_known["9"]
    assert findings(recording, Check.KINDS)


@pytest.mark.parametrize(("kind", "num_vehicles"), [("car", 4), ("pedestrian", 3)])
def test_most_rows_decide_whether_a_vehicle_is_read(frame, kind, num_vehicles):
    table = frame.copy()
    rows = table.index[table.id == 5]
    other = "car" if kind == "pedestrian" else "pedestrian"
    table.loc[rows, "kind"] = kind
    table.loc[rows[10:13], "kind"] = other
    assert read(table).tracks.num_vehicles == num_vehicles


def test_missing_optional_values_lie_between_their_neighbours(frame):
    table = frame.assign(v=30.0, h=359.0)
    rows = table.index[table.id == 5]
    table.loc[rows, "h"] = np.where(np.arange(len(rows)) % 2, 359.0, 1.0)
    table.loc[rows[[20, 21]], "v"] = np.nan
    table.loc[rows[40], "h"] = np.nan
    columns = {**COLUMNS, "speed": "v [m/s]", "heading": "h [deg]"}
    recording = read(table, columns=columns)
    assert np.allclose(recording.tracks.speed, 30.0)
    assert np.abs(np.degrees(recording.tracks.heading)).max() < 1.01
    assert {finding.vehicle for finding in findings(recording, Check.MISSING_CELLS)} == {"5"}


def test_a_vehicle_without_speeds_has_those_of_its_positions(frame):
    movers = [*(replace(one, s=one.s + 100.0) for one in OVERTAKE), Mover(number=11, last=3)]
    table = pd.DataFrame(states(movers))[USED].assign(v=25.0)
    table.loc[table.id == 11, "v"] = np.nan
    columns = {**COLUMNS, "speed": "v [m/s]"}
    tracks = read(table, columns=columns).tracks
    vehicle = tracks.names.tolist().index("11")
    speed = tracks.speed[tracks.start[vehicle] : tracks.start[vehicle + 1]]
    assert np.allclose(speed, movers[-1].speed)


# Text files


def lines_of(frame: pd.DataFrame) -> list[str]:
    return frame.to_csv(index=False).splitlines()


LAYOUTS = {
    "blank lines at the end": lambda lines: [*lines, "", "  ", "\t", ""],
    "empty rows at the end": lambda lines: [*lines, ",,,,,,", ",,,,,,"],
    "comments": lambda lines: ["# a", "#b", *lines[:9], "# c", "#7,1,2,3,4,5,6", *lines[9:], "# d"],
    "comments after blanks": lambda lines: ["  # a", *lines[:9], "\t# b", *lines[9:]],
    "blank lines between": lambda lines: ["", *lines[:9], "", *lines[9:]],
    "names in a comment": lambda lines: [f"# {lines[0]}", *lines[1:]],
    "blanks": lambda lines: [line.replace(",", "  ") for line in lines],
    "blanks and names in a comment": lambda lines: [
        f"# {lines[0].replace(',', ' ')}",
        *(f"  {line.replace(',', ' ')}" for line in lines[1:]),
    ],
    "separator of Excel": lambda lines: ["sep=;", *(line.replace(",", ";") for line in lines)],
    "blanks after separators": lambda lines: [line.replace(",", ", ") for line in lines],
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_layouts_of_text_files(tmp_path, frame, layout, end):
    text = end.join(LAYOUTS[layout](lines_of(frame))) + end
    path = tmp_path / "t.csv"
    path.write_bytes(text.encode())
    recording = read_table(path, MAP)
    assert is_same(recording, read(frame))
    assert not recording.findings


def test_ids_may_begin_like_comments(tmp_path, frame):
    path = tmp_path / "t.csv"
    renamed(frame, {number: f"#{number}" for number in (3, 5, 7, 9)}).to_csv(path, index=False)
    assert read_table(path, MAP).tracks.names.tolist() == ["#3", "#5", "#7", "#9"]


@pytest.mark.parametrize(
    ("cell", "message"), [("0", "length, 0.1 to 50 m, got 0"), ("zz", "invalid value 'zz'")]
)
def test_lines_are_counted_as_in_the_file(tmp_path, frame, cell, message):
    head, *rows = lines_of(frame)
    rows[20] = ",".join([*rows[20].split(",")[:4], cell, "1.8", "car"])
    lines = ["# a", "", head, *rows[:10], "# b", "", *rows[10:]]
    path = write(tmp_path / "t.csv", "\n".join(lines) + "\n")
    line = lines.index(rows[20]) + 1
    with pytest.raises(ImportFormatError, match=f"line {line}[:,].*{message}"):
        read_table(path, MAP)
    without_names = [line for line in lines if line != head]
    path.write_text("\n".join(without_names) + "\n", encoding="utf-8")
    content = {**MAP, "recording": {"names": head.split(",")}}
    if cell == "0":
        with pytest.raises(ImportFormatError, match=f"line {line - 1}, .*{message}"):
            read_table(path, content)


def test_two_decimal_marks_are_refused(tmp_path, frame):
    text = frame.to_csv(index=False, sep=";", decimal=",")
    path = write(tmp_path / "t.csv", text.replace("5,25", "5.25", 1))
    with pytest.raises(ImportFormatError, match="expected one decimal mark, a point or a comma"):
        read_table(path, MAP)


def test_texts_in_memory_may_have_decimal_commas(frame):
    texts = {name: frame[name].map(lambda value: f"{value}".replace(".", ",")) for name in "xyt"}
    assert is_same(read(frame.assign(**texts)), read(frame))


def test_other_files_are_named_with_the_way_out(tmp_path, frame):
    path = tmp_path / "t.csv"
    text = frame.to_csv(index=False)
    for encoding, message in (("utf-16", "UTF-16; save it as UTF-8"), ("utf-16-le", "UTF-16")):
        path.write_bytes(text.encode(encoding))
        with pytest.raises(ImportFormatError, match=message):
            read_table(path, MAP)
    path.write_bytes(text.replace("kind", "kínd").encode("latin-1"))
    with pytest.raises(ImportFormatError, match="no UTF-8; save it as UTF-8"):
        read_table(path, MAP)
    frame.to_parquet(path)
    with pytest.raises(ImportFormatError, match=r"a Parquet file; end its name in \.parquet"):
        read_table(path, MAP)
    with zipfile.ZipFile(tmp_path / "t.xlsx", "w") as archive:
        archive.writestr("docProps/app.xml", "<a/>")
        archive.writestr("xl/workbook.xml", "<a/>")
    with pytest.raises(ImportFormatError, match=r"Excel workbook \(.xlsx\); save the sheet as"):
        read_table(tmp_path / "t.xlsx", MAP)


@pytest.mark.parametrize("name", ["T.CSV", "t.tsv", "t.pq", "T.PARQUET", "t.Feather", "T.CSV.GZ"])
def test_endings_of_names_are_known(tmp_path, frame, name):
    path = tmp_path / name
    if "csv" in name.lower():
        compression = "gzip" if name.endswith("GZ") else None
        frame.to_csv(path, index=False, compression=compression)
    elif "tsv" in name:
        frame.to_csv(path, index=False, sep="\t")
    elif "Feather" in name:
        frame.to_feather(path)
    else:
        frame.to_parquet(path)
    assert is_same(read_table(path, MAP), read(frame))
    assert name.lower().removesuffix(".gz").endswith(ENDINGS["table"])


def test_files_of_highd_may_have_names_in_capital_letters(tmp_path):
    path = highd(tmp_path)
    num_vehicles = read_highd(path).tracks.num_vehicles
    for file in list(tmp_path.iterdir()):
        file.rename(file.with_name(file.name.upper()))
    assert read_highd(tmp_path / path.name.upper()).tracks.num_vehicles == num_vehicles


# Separators of thousands


def in_millimetres(frame: pd.DataFrame, mark: str) -> pd.DataFrame:
    """The table with x in whole millimetres of less than 1 km, and separators of thousands."""
    x = ((frame.x % 900.0) * 1000.0).round().astype(int)
    return frame.assign(x=x.map(lambda value: f"{value:,}".replace(",", mark)))


MILLIMETRES = {**COLUMNS, "x": "x [mm]"}


@pytest.mark.parametrize("in_file", [True, False])
def test_numbers_that_may_have_separators_of_thousands_are_reported(tmp_path, frame, in_file):
    near = frame[frame.x < 900.0]
    table = in_millimetres(near, ".")
    columns = {**MAP, "columns": MILLIMETRES}
    path = tmp_path / "t.csv"
    table.to_csv(path, index=False)
    source: Any = path if in_file else table

    def rows(**recording: str):
        declared = column_map({**columns, "recording": recording})
        reader = read_track_rows if in_file else track_rows_from_table
        return reader(source, declared)

    (finding,) = rows().findings
    assert finding.check is Check.NUMBER_FORMAT
    assert finding.consequence is Consequence.REPORTED
    assert "column x" in finding.detail
    assert not rows(thousands="none").findings
    assert not rows(thousands=".").findings
    expected = np.sort(near.x.to_numpy())
    assert np.allclose(np.sort(rows(thousands=".").values["x"]), expected, atol=1e-3)
    assert rows(thousands="none").values["x"].max() < 1.0


@pytest.mark.parametrize("cell", ["1.75", "1.7500", "0.750", "1750", "1750.250"])
def test_numbers_that_show_their_decimals_are_not_reported(frame, cell):
    table = in_millimetres(frame[frame.x < 900.0], ".")
    table.loc[table.index[-1], "x"] = cell
    rows = track_rows_from_table(table, column_map({**MAP, "columns": MILLIMETRES}))
    assert not [finding for finding in rows.findings if finding.check is Check.NUMBER_FORMAT]


def test_whole_groups_of_thousands_name_the_key(tmp_path, frame):
    path = tmp_path / "t.csv"
    frame.assign(x=[f"1.{k % 900 + 100}.000" for k in range(len(frame))]).to_csv(path, index=False)
    with pytest.raises(ImportFormatError, match=r'state recording\.thousands = "\."'):
        read_table(path, MAP)


# Axes and sides


TWO_WAYS = [
    *(replace(one, s=one.s + 100.0) for one in OVERTAKE),
    Mover(number=21, s=900.0, speed=-25.0),
    Mover(number=22, s=1000.0, speed=-27.0),
]


def turned(frame: pd.DataFrame, degrees: float) -> pd.DataFrame:
    """The table after a turn from its x axis towards its y axis."""
    angle = np.radians(degrees)
    x, y = frame.x * np.cos(angle) - frame.y * np.sin(angle), frame.x * np.sin(angle)
    return frame.assign(x=x, y=y + frame.y * np.cos(angle))


@pytest.mark.parametrize("degrees", [0.0, 90.0, -30.0, 180.0])
@pytest.mark.parametrize("y_axis", ["left", "right"])
def test_angles_turn_from_x_towards_y_and_borders_grow_to_the_left(frame, degrees, y_axis):
    sign = 1.0 if y_axis == "left" else -1.0
    table = turned(frame.assign(y=frame.y * sign), degrees).assign(h=degrees)
    recording = read(
        table,
        columns={**COLUMNS, "heading": "h [deg]"},
        recording={"y_axis": y_axis},
        road={**MAP["road"], "heading_deg": degrees},
    )
    expected = read(frame)
    assert np.allclose(recording.tracks.d, expected.tracks.d, atol=1e-6)
    assert np.allclose(recording.tracks.s, expected.tracks.s, atol=1e-6)


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("is_right", [True, False])
def test_oncoming_traffic_shows_the_side(side, is_right):
    table = pd.DataFrame(states(TWO_WAYS))[USED]
    offset = 12.0 if (side == "right") == is_right else -12.0
    table.loc[table.id > 20, "y"] += offset
    road = {"kind": "motorway", "driving_side": side, "heading_deg": 0}
    if is_right:
        assert read(table, road=road).tracks.num_vehicles == 4
        return
    with pytest.raises(ImportFormatError, match=f"oncoming traffic: .*{side}"):
        read(table, road=road)


@pytest.mark.parametrize("side", ["right", "left"])
def test_lanes_in_the_wrong_order_are_refused(frame, side):
    table = frame.assign(lane=np.floor(frame.y / 3.5).astype(int))
    columns = {**COLUMNS, "lane": "lane"}
    used = sorted(table.lane.unique().tolist(), reverse=side == "left")
    road = {"kind": "motorway", "driving_side": side, "heading_deg": 0, "lanes": used}
    read(table, columns=columns, road=road)
    with pytest.raises(ImportFormatError, match=r"order of lanes: expected road\.lanes from"):
        read(table, columns=columns, road={**road, "lanes": used[::-1]})


def test_velocities_with_other_axes_than_positions_are_refused(frame):
    table = frame.assign(vx=30.0, vy=0.0)
    for rows in table.groupby("id").groups.values():
        table.loc[rows, "vy"] = -np.gradient(table.y[rows], 0.1)
        table.loc[rows, "vx"] = np.gradient(table.x[rows], 0.1)
    columns = {**COLUMNS, "vx": "vx [m/s]", "vy": "vy [m/s]"}
    with pytest.raises(ImportFormatError, match=r"axes: .*opposite directions"):
        read(table, columns=columns)
    assert read(table.assign(vy=-table.vy), columns=columns).tracks.num_vehicles == 4
