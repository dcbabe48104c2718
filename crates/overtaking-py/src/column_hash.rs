//! The hash of what a column of a table holds.

use std::ops::Range;

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::spread::{expect_room, reserved};

/// Bytes that wait for each other: BLAKE3 hashes sixteen of its chunks of a KiB in the time that three take one by one.
const WAITING: usize = 32 << 10;

/// A hash over bytes that come in pieces: BLAKE3.
#[derive(Default)]
struct BufferedHash {
    hasher: blake3::Hasher,
    waiting: Vec<u8>,
}

impl BufferedHash {
    /// Hash what waits, if it is enough.
    fn settle(&mut self, py: Python<'_>) {
        if self.waiting.len() >= WAITING {
            py.detach(|| self.hasher.update(&self.waiting));
            self.waiting.clear();
        }
    }

    fn hexdigest(&self) -> String {
        let mut hasher = self.hasher.clone();
        hasher.update(&self.waiting).finalize().to_hex().to_string()
    }
}

/// OwnedRows of a column as Arrow has them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ArrowRows {
    count: usize,
    offset: usize,
    /// A bit for each row that has a value; all have one if it is left out.
    validity: Option<PyBuffer<u8>>,
    /// What rows hold: numbers, bits, or the bytes of all texts.
    data: Option<PyBuffer<u8>>,
    /// Where texts of any length begin and end in these.
    ends: Option<PyBuffer<u8>>,
}

/// The same, copied, as others may change what they have given.
struct OwnedRows {
    count: usize,
    offset: usize,
    data: Vec<u8>,
    ends: Vec<u8>,
    /// 1 for each row without a value, else 0.
    missing: Vec<u8>,
}

impl OwnedRows {
    fn new(py: Python<'_>, given: &ArrowRows) -> PyResult<Self> {
        let copied = |buffer: &Option<PyBuffer<u8>>| match buffer {
            Some(buffer) => {
                expect_room(buffer.len_bytes())?;
                buffer.to_vec(py)
            }
            None => Ok(Vec::new()),
        };
        let (count, offset) = (given.count, given.offset);
        let missing = match &given.validity {
            Some(bits) => bits_to_bytes(&bits.to_vec(py)?, offset, count, u8::MAX)?,
            None => {
                let mut missing = reserved(count)?;
                missing.resize(count, 0);
                missing
            }
        };
        Ok(Self {
            count,
            offset,
            data: copied(&given.data)?,
            ends: copied(&given.ends)?,
            missing,
        })
    }
}

/// How the rows of a column lie in its data.
enum Layout {
    /// As numbers of so many bytes.
    Numbers(usize),
    /// As bits.
    Bits,
    /// As places in a list of names, four bytes each.
    Codes,
    /// As texts of any length.
    Texts,
    /// As texts of so many bytes.
    Fixed(usize),
}

/// BLAKE3 hashes of an Arrow column: over its values, and over its nulls.
#[pyclass]
pub struct ColumnHash {
    layout: Layout,
    nullable: bool,
    values: BufferedHash,
    nulls: BufferedHash,
}

#[pymethods]
impl ColumnHash {
    /// Begin without rows.
    ///
    /// Args:
    ///     layout: "numbers", "bits", "codes" of names, "texts" of any length, or "fixed".
    ///     width: Bytes of a number, or of a text of fixed length.
    ///     nullable: Whether the column may hold nulls.
    ///
    /// Raises:
    ///     ValueError: There is no such layout.
    #[new]
    #[pyo3(signature = (layout: "str", width: "int", *, nullable: "bool"))]
    fn new(layout: &str, width: usize, nullable: bool) -> PyResult<Self> {
        let layout = match layout {
            "numbers" => Layout::Numbers(width),
            "bits" => Layout::Bits,
            "codes" => Layout::Codes,
            "texts" => Layout::Texts,
            "fixed" => Layout::Fixed(width),
            other => return Err(PyValueError::new_err(format!("layout: {other}"))),
        };
        Ok(Self {
            layout,
            nullable,
            values: BufferedHash::default(),
            nulls: BufferedHash::default(),
        })
    }

    /// Add rows; returns whether any of them has a value.
    ///
    /// Args:
    ///     rows: `count` of the rows, their `offset` in the buffers, and the buffers `validity` (or
    ///         None), `data`, and `ends` of texts.
    ///     meaning: The code of each name in the dictionary of the column.
    ///
    /// Raises:
    ///     ValueError: The buffers are too short, or a name is not in the dictionary.
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
        let out = &mut self.values.waiting;
        match self.layout {
            Layout::Numbers(width) => numbers(&rows, width, out)?,
            Layout::Bits => {
                let bits = bits_to_bytes(&rows.data, rows.offset, rows.count, 0)?;
                out.extend(
                    bits.iter()
                        .zip(&rows.missing)
                        .map(|(bit, null)| bit & !null),
                );
            }
            Layout::Codes => codes(&rows, &meaning.unwrap_or_default(), out)?,
            Layout::Texts => {
                let ends = text_ends(&rows)?;
                texts(&rows, |row| ends[row]..ends[row + 1], out)?;
            }
            Layout::Fixed(width) => {
                let begin = |row: usize| (rows.offset + row) * width;
                texts(&rows, |row| begin(row)..begin(row + 1), out)?;
            }
        }
        self.values.settle(py);
        if self.nullable {
            self.nulls.waiting.extend_from_slice(&rows.missing);
            self.nulls.settle(py);
        }
        Ok(rows.missing.contains(&0))
    }

    /// The hashes over all values and over all nulls so far, 64 hexadecimal digits each.
    #[pyo3(signature = () -> "tuple[str, str]")]
    fn hexdigests(&self) -> (String, String) {
        (self.values.hexdigest(), self.nulls.hexdigest())
    }
}

/// A part of a buffer.
fn part(whole: &[u8], place: Range<usize>) -> PyResult<&[u8]> {
    let short = || PyValueError::new_err("rows: expected data of all of them");
    whole.get(place).ok_or_else(short)
}

/// A byte for each of some bits, those of `flipped` turned round.
fn bits_to_bytes(whole: &[u8], offset: usize, count: usize, flipped: u8) -> PyResult<Vec<u8>> {
    const ONES: u64 = 0x0101_0101_0101_0101;
    let octets = part(whole, offset / 8..(offset + count).div_ceil(8))?;
    let mut found = reserved(8 * octets.len())?;
    for octet in octets {
        // One bit of the octet in each byte, which is then moved to where the lowest is.
        let each = (ONES * u64::from(octet ^ flipped)) & 0x8040_2010_0804_0201;
        let lowest = ((each + 0x7f * ONES) >> 7) & ONES;
        found.extend_from_slice(&lowest.to_le_bytes());
    }
    found.drain(..offset % 8);
    found.truncate(count);
    Ok(found)
}

/// The bytes of each number in the order of small machines, zero where there is none.
fn numbers(rows: &OwnedRows, width: usize, out: &mut Vec<u8>) -> PyResult<()> {
    let (begin, end) = (rows.offset * width, (rows.offset + rows.count) * width);
    let written = out.len();
    out.extend_from_slice(part(&rows.data, begin..end)?);
    if rows.missing.contains(&1) {
        match width {
            1 => without_nulls::<1>(&mut out[written..], &rows.missing),
            2 => without_nulls::<2>(&mut out[written..], &rows.missing),
            4 => without_nulls::<4>(&mut out[written..], &rows.missing),
            8 => without_nulls::<8>(&mut out[written..], &rows.missing),
            _ => return Err(PyValueError::new_err(format!("width: {width}"))),
        }
    }
    if cfg!(target_endian = "big") {
        let each = out[written..].chunks_exact_mut(width.max(1));
        each.for_each(<[u8]>::reverse);
    }
    Ok(())
}

/// Put zero where there is no number.
fn without_nulls<const WIDTH: usize>(numbers: &mut [u8], missing: &[u8]) {
    let (each, _) = numbers.as_chunks_mut::<WIDTH>();
    for (number, null) in each.iter_mut().zip(missing) {
        let kept = null.wrapping_sub(1);
        number.iter_mut().for_each(|octet| *octet &= kept);
    }
}

/// The code that each place in a list of names stands for, -1 where there is none.
fn codes(rows: &OwnedRows, meaning: &[i8], out: &mut Vec<u8>) -> PyResult<()> {
    let (places, mut strange) = (integers(&rows.data, rows.offset, rows.count)?, None);
    out.extend(places.zip(&rows.missing).map(|(place, &null)| {
        let known = usize::try_from(place).ok().and_then(|at| meaning.get(at));
        if known.is_none() && null == 0 {
            strange = Some(place);
        }
        let code = if null == 0 { *known.unwrap_or(&-1) } else { -1 };
        code as u8
    }));
    match strange {
        Some(place) => Err(PyValueError::new_err(format!("codes: no name {place}"))),
        None => Ok(()),
    }
}

/// Each text after its length, so that no two columns of texts look alike; null is empty.
fn texts(
    rows: &OwnedRows,
    place: impl Fn(usize) -> Range<usize>,
    out: &mut Vec<u8>,
) -> PyResult<()> {
    for (row, &null) in rows.missing.iter().enumerate() {
        let text = part(&rows.data, if null == 0 { place(row) } else { 0..0 })?;
        out.extend((text.len() as u64).to_le_bytes());
        out.extend_from_slice(text);
    }
    Ok(())
}

/// Where each text begins, and where the last one ends.
fn text_ends(rows: &OwnedRows) -> PyResult<Vec<usize>> {
    if rows.count == 0 {
        return Ok(vec![0]);
    }
    let found = integers(&rows.ends, rows.offset, rows.count + 1)?;
    Ok(found.map(|end| end.max(0) as usize).collect())
}

/// Some integers of a buffer, of four bytes each.
fn integers(whole: &[u8], offset: usize, count: usize) -> PyResult<impl Iterator<Item = i32>> {
    let octets = part(whole, offset * 4..(offset + count) * 4)?;
    let (each, _) = octets.as_chunks::<4>();
    Ok(each.iter().map(|one| i32::from_ne_bytes(*one)))
}
