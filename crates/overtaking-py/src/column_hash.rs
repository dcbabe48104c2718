//! Hashes of the columns of a table: the same values have the same hash, however Arrow stores them.
//!
//! `overtaking.data.tables.digest` passes the rows of a column piece by piece, as the buffers of Arrow (a format of
//! tables in memory). This module first brings values that differ only in storage to one form: slices, names in another
//! order, or the memory behind nulls (missing values). Then it hashes them with BLAKE3.

use std::ops::Range;

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::spread::{expect_memory, reserve};

/// Number of bytes that are collected before they are hashed: two times sixteen chunks of one KiB. BLAKE3 hashes
/// sixteen chunks together in the time of three single ones.
const HASHED_TOGETHER: usize = 32 << 10;

/// A BLAKE3 hash that collects short pieces of bytes.
#[derive(Default)]
struct BufferedHash {
    /// Hash of the earlier bytes.
    hasher: blake3::Hasher,
    /// Bytes that are collected and not hashed yet.
    unhashed: Vec<u8>,
}

impl BufferedHash {
    /// Hash the collected bytes if there are enough of them.
    fn hash_if_full(&mut self, py: Python<'_>) {
        if self.unhashed.len() >= HASHED_TOGETHER {
            py.detach(|| self.hasher.update(&self.unhashed));
            self.unhashed.clear();
        }
    }

    /// The hash of all bytes so far, 64 hexadecimal digits.
    fn hexdigest(&self) -> String {
        let mut hasher = self.hasher.clone();
        hasher
            .update(&self.unhashed)
            .finalize()
            .to_hex()
            .to_string()
    }
}

/// Rows of a column in the buffers of Arrow, which Python owns.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ArrowRows {
    /// Number of rows.
    count: usize,
    /// Index of the first row in the buffers.
    offset: usize,
    /// Bits, 1 for a row with a value; `None` if all rows have a value.
    validity: Option<PyBuffer<u8>>,
    /// Numbers, bits, indices of names, or the bytes of all texts; `None` if the column is empty.
    data: Option<PyBuffer<u8>>,
    /// For texts of any length, `count` + 1 positions in `data`: the start of each text, and the end of the last.
    ends: Option<PyBuffer<u8>>,
}

/// A copy of `ArrowRows`, because other Python threads may change the buffers while the rows are hashed.
struct OwnedRows {
    /// Number of rows.
    count: usize,
    /// Index of the first row in `data` and `ends`.
    offset: usize,
    /// As `ArrowRows::data`; empty if the column is empty.
    data: Vec<u8>,
    /// As `ArrowRows::ends`; empty if the column has no texts.
    ends: Vec<u8>,
    /// 1 for each row without a value, else 0.
    missing: Vec<u8>,
}

impl OwnedRows {
    fn new(py: Python<'_>, rows: &ArrowRows) -> PyResult<Self> {
        let copy = |buffer: &Option<PyBuffer<u8>>| match buffer {
            Some(buffer) => {
                expect_memory(buffer.len_bytes())?;
                buffer.to_vec(py)
            }
            None => Ok(Vec::new()),
        };
        let (count, offset) = (rows.count, rows.offset);
        let missing = match &rows.validity {
            Some(bits) => bits_to_bytes(&bits.to_vec(py)?, offset, count, u8::MAX)?,
            None => {
                let mut missing = reserve(count)?;
                missing.resize(count, 0);
                missing
            }
        };
        Ok(Self {
            count,
            offset,
            data: copy(&rows.data)?,
            ends: copy(&rows.ends)?,
            missing,
        })
    }
}

/// How the rows of a column lie in the buffer `data`.
enum Layout {
    /// Numbers of this many bytes: 1, 2, 4 or 8.
    Numbers(usize),
    /// One bit per row.
    Bits,
    /// Indices of names in a list, as 32-bit integers.
    Codes,
    /// Texts of any length.
    Texts,
    /// Texts of this many bytes.
    Fixed(usize),
}

/// BLAKE3 hashes of an Arrow column: over its values, and over its nulls.
#[pyclass]
pub struct ColumnHash {
    /// Layout of the rows.
    layout: Layout,
    /// Whether the column may hold nulls.
    nullable: bool,
    /// Hash over the values; a missing value counts as zero or as an empty text.
    values: BufferedHash,
    /// Hash over one byte for each row: 1 without a value, else 0.
    nulls: BufferedHash,
}

#[pymethods]
impl ColumnHash {
    /// Make the hash of a column without rows.
    ///
    /// Args:
    ///     layout: How the rows lie in their buffer: "numbers"; "bits" of Booleans; "codes",
    ///         indices of names as 32-bit integers; "texts" of any length; "fixed", texts of
    ///         `width` bytes.
    ///     width: Bytes of a number or of a fixed text; the other layouts ignore it.
    ///     nullable: Whether the column may hold nulls.
    ///
    /// Raises:
    ///     ValueError: The layout is unknown.
    #[new]
    #[pyo3(signature = (layout: "str", width: "int", *, nullable: "bool"))]
    fn new(layout: &str, width: usize, nullable: bool) -> PyResult<Self> {
        let layout = match layout {
            "numbers" => Layout::Numbers(width),
            "bits" => Layout::Bits,
            "codes" => Layout::Codes,
            "texts" => Layout::Texts,
            "fixed" => Layout::Fixed(width),
            unknown => return Err(PyValueError::new_err(format!("layout: {unknown}"))),
        };
        Ok(Self {
            layout,
            nullable,
            values: BufferedHash::default(),
            nulls: BufferedHash::default(),
        })
    }

    /// Add rows; returns whether any of these rows has a value.
    ///
    /// Args:
    ///     rows: `count`, the number of rows; `offset`, the index of the first row in the buffers;
    ///         and the buffers of Arrow: `validity` (None if all rows have a value), `data`, and
    ///         `ends` of texts.
    ///     meaning: For layout "codes", the code to hash for each index of a name.
    ///
    /// Raises:
    ///     ValueError: The buffers are too short, or the index of a name is beyond `meaning`.
    #[pyo3(signature = (
        rows: "Mapping[str, Any]",
        meaning: "Sequence[int] | None" = None,
    ) -> "bool")]
    fn update(
        &mut self,
        py: Python<'_>,
        rows: ArrowRows,
        meaning: Option<Vec<i8>>,
    ) -> PyResult<bool> {
        let rows = OwnedRows::new(py, &rows)?;
        let out = &mut self.values.unhashed;
        match self.layout {
            Layout::Numbers(width) => append_numbers(&rows, width, out)?,
            Layout::Bits => {
                let bits = bits_to_bytes(&rows.data, rows.offset, rows.count, 0)?;
                out.extend(
                    bits.iter()
                        .zip(&rows.missing)
                        .map(|(bit, is_missing)| bit & !is_missing),
                );
            }
            Layout::Codes => append_codes(&rows, &meaning.unwrap_or_default(), out)?,
            Layout::Texts => {
                let ends = text_ends(&rows)?;
                append_texts(&rows, |row| ends[row]..ends[row + 1], out)?;
            }
            Layout::Fixed(width) => {
                let begin = |row: usize| (rows.offset + row) * width;
                append_texts(&rows, |row| begin(row)..begin(row + 1), out)?;
            }
        }
        self.values.hash_if_full(py);
        if self.nullable {
            self.nulls.unhashed.extend_from_slice(&rows.missing);
            self.nulls.hash_if_full(py);
        }
        Ok(rows.missing.contains(&0))
    }

    /// The hashes over all values and over all nulls so far, 64 hexadecimal digits each.
    #[pyo3(signature = () -> "tuple[str, str]")]
    fn hexdigests(&self) -> (String, String) {
        (self.values.hexdigest(), self.nulls.hexdigest())
    }
}

/// The bytes of a range of a buffer; an error if the buffer is too short.
fn slice_buffer(buffer: &[u8], range: Range<usize>) -> PyResult<&[u8]> {
    let too_short = || PyValueError::new_err("rows: expected data of all of them");
    buffer.get(range).ok_or_else(too_short)
}

/// Expand `count` bits from bit `offset` on to bytes of 0 or 1. A `flip_mask` of 255 inverts all bits, 0 keeps them.
fn bits_to_bytes(bits: &[u8], offset: usize, count: usize, flip_mask: u8) -> PyResult<Vec<u8>> {
    const ONES: u64 = 0x0101_0101_0101_0101;
    let octets = slice_buffer(bits, offset / 8..(offset + count).div_ceil(8))?;
    let mut bytes = reserve(8 * octets.len())?;
    for octet in octets {
        // The octet is copied to all bytes, and byte `k` keeps bit `k`. Adding 0x7f carries any such bit to the
        // highest bit of its byte, from where the shift moves it to the lowest.
        let single_bits = (ONES * u64::from(octet ^ flip_mask)) & 0x8040_2010_0804_0201;
        let lowest = ((single_bits + 0x7f * ONES) >> 7) & ONES;
        bytes.extend_from_slice(&lowest.to_le_bytes());
    }
    bytes.drain(..offset % 8);
    bytes.truncate(count);
    Ok(bytes)
}

/// Append the bytes of each number in little-endian order, zeros for a missing number.
fn append_numbers(rows: &OwnedRows, width: usize, out: &mut Vec<u8>) -> PyResult<()> {
    let (begin, end) = (rows.offset * width, (rows.offset + rows.count) * width);
    let previous_length = out.len();
    out.extend_from_slice(slice_buffer(&rows.data, begin..end)?);
    if rows.missing.contains(&1) {
        match width {
            1 => clear_missing::<1>(&mut out[previous_length..], &rows.missing),
            2 => clear_missing::<2>(&mut out[previous_length..], &rows.missing),
            4 => clear_missing::<4>(&mut out[previous_length..], &rows.missing),
            8 => clear_missing::<8>(&mut out[previous_length..], &rows.missing),
            _ => return Err(PyValueError::new_err(format!("width: {width}"))),
        }
    }
    if cfg!(target_endian = "big") {
        let numbers = out[previous_length..].chunks_exact_mut(width.max(1));
        numbers.for_each(<[u8]>::reverse);
    }
    Ok(())
}

/// Set missing numbers to zero.
fn clear_missing<const WIDTH: usize>(buffer: &mut [u8], missing: &[u8]) {
    let (numbers, _) = buffer.as_chunks_mut::<WIDTH>();
    for (number, is_missing) in numbers.iter_mut().zip(missing) {
        // 255 for a number, 0 for a missing one.
        let mask = is_missing.wrapping_sub(1);
        number.iter_mut().for_each(|octet| *octet &= mask);
    }
}

/// Append the code of each row's name, -1 for a missing name.
fn append_codes(rows: &OwnedRows, meaning: &[i8], out: &mut Vec<u8>) -> PyResult<()> {
    let name_indices = read_integers(&rows.data, rows.offset, rows.count)?;
    let mut invalid_index = None;
    out.extend(name_indices.zip(&rows.missing).map(|(index, &is_missing)| {
        if is_missing != 0 {
            return -1_i8 as u8;
        }
        let code = usize::try_from(index).ok().and_then(|k| meaning.get(k));
        if code.is_none() {
            invalid_index = Some(index);
        }
        *code.unwrap_or(&-1) as u8
    }));
    match invalid_index {
        Some(index) => Err(PyValueError::new_err(format!("codes: no name {index}"))),
        None => Ok(()),
    }
}

/// Append each text after its length; a missing text is empty.
///
/// Without lengths, different columns such as ("ab", "c") and ("a", "bc") would have the same hash.
fn append_texts(
    rows: &OwnedRows,
    text_range: impl Fn(usize) -> Range<usize>,
    out: &mut Vec<u8>,
) -> PyResult<()> {
    for (row, &is_missing) in rows.missing.iter().enumerate() {
        let range = if is_missing == 0 {
            text_range(row)
        } else {
            0..0
        };
        let text = slice_buffer(&rows.data, range)?;
        out.extend((text.len() as u64).to_le_bytes());
        out.extend_from_slice(text);
    }
    Ok(())
}

/// The start of each text in the data, and the end of the last one.
fn text_ends(rows: &OwnedRows) -> PyResult<Vec<usize>> {
    if rows.count == 0 {
        return Ok(vec![0]);
    }
    let ends = read_integers(&rows.ends, rows.offset, rows.count + 1)?;
    Ok(ends.map(|end| end.max(0) as usize).collect())
}

/// Read `count` integers of 32 bits from a buffer, from integer number `offset` on.
fn read_integers(
    buffer: &[u8],
    offset: usize,
    count: usize,
) -> PyResult<impl Iterator<Item = i32>> {
    let octets = slice_buffer(buffer, offset * 4..(offset + count) * 4)?;
    let (integers, _) = octets.as_chunks::<4>();
    Ok(integers.iter().map(|bytes| i32::from_ne_bytes(*bytes)))
}
