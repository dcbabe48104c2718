//! The values of a column: how they are hashed, and how they become a page.

use std::borrow::Cow;

use parquet::basic::{Encoding, Type};
use parquet::data_type::ByteArray;
use parquet::errors::{ParquetError, Result};
use parquet::file::statistics::Statistics;

use crate::delta;
use crate::runs::{Bits, Coded, encode_among};

/// Bytes before each text that say how long it is, where texts are hashed.
const LENGTH_BYTES: usize = 8;
/// Different numbers that are worth a dictionary, where nobody has said that there are few.
const MOST_NUMBERS: usize = 256;

/// The values of a column, row by row.
#[derive(Clone, Copy)]
pub enum Values<'a> {
    /// INT64, as differences.
    Long(&'a [i64]),
    /// INT32, as differences.
    Int(&'a [i32]),
    /// INT32 of 16 bits, as differences.
    Short(&'a [i16]),
    /// INT32 of 8 bits without sign, as codes.
    Byte(&'a [u8]),
    /// FLOAT, as codes where there are few values.
    Float(&'a [f32]),
    /// DOUBLE, the same.
    Double(&'a [f64]),
    /// BOOLEAN, as bits.
    Flag(&'a [bool]),
    /// Texts out of a list that all pieces share, given as places in it; hashed as those places.
    Name(&'a [i8], &'a [String]),
    /// Any texts, given as places in a list; hashed as texts.
    Text(&'a [i32], &'a [String]),
    /// Texts of one length, one after the other, and that length.
    Fixed(&'a [u8], usize),
}

/// How the values on a page are encoded; and the dictionary, if there is one, with how many it holds.
pub struct Encoded {
    pub encoding: Encoding,
    pub dictionary: Option<(Vec<u8>, usize)>,
}

impl Encoded {
    fn plain(encoding: Encoding) -> Self {
        Self {
            encoding,
            dictionary: None,
        }
    }
}

impl Values<'_> {
    /// Number of rows.
    pub fn len(&self) -> usize {
        match self {
            Self::Long(values) => values.len(),
            Self::Int(values) => values.len(),
            Self::Short(values) => values.len(),
            Self::Byte(values) => values.len(),
            Self::Float(values) => values.len(),
            Self::Double(values) => values.len(),
            Self::Flag(values) => values.len(),
            Self::Name(places, _) => places.len(),
            Self::Text(places, _) => places.len(),
            Self::Fixed(octets, width) => octets.len() / width,
        }
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What Parquet calls its type.
    pub fn physical_type(&self) -> Type {
        match self {
            Self::Long(_) => Type::INT64,
            Self::Int(_) | Self::Short(_) | Self::Byte(_) => Type::INT32,
            Self::Float(_) => Type::FLOAT,
            Self::Double(_) => Type::DOUBLE,
            Self::Flag(_) => Type::BOOLEAN,
            Self::Name(..) | Self::Text(..) => Type::BYTE_ARRAY,
            Self::Fixed(..) => Type::FIXED_LEN_BYTE_ARRAY,
        }
    }

    /// Whether all places are those of a text.
    pub fn are_known(&self, missing: Option<&[bool]>) -> bool {
        let is_there = |row: usize| missing.is_none_or(|missing| !missing[row]);
        match self {
            Self::Name(places, names) => known(places, names, is_there),
            Self::Text(places, texts) => known(places, texts, is_there),
            _ => true,
        }
    }

    /// Adds the values to a hash, with zero where there is nothing.
    pub fn digest(&self, gaps: Option<&[bool]>, hasher: &mut blake3::Hasher) {
        match self {
            Self::Long(values) => words(values, gaps, 0, i64::to_le_bytes, hasher),
            Self::Int(values) => words(values, gaps, 0, i32::to_le_bytes, hasher),
            Self::Short(values) => words(values, gaps, 0, i16::to_le_bytes, hasher),
            Self::Byte(values) => words(values, gaps, 0, u8::to_le_bytes, hasher),
            Self::Float(values) => words(values, gaps, 0.0, f32::to_le_bytes, hasher),
            Self::Double(values) => words(values, gaps, 0.0, f64::to_le_bytes, hasher),
            Self::Flag(values) => words(values, gaps, false, |on| [u8::from(on)], hasher),
            Self::Name(places, _) => words(places, gaps, -1, i8::to_le_bytes, hasher),
            Self::Text(places, texts) => {
                texts_of(
                    places.iter().map(|&at| texts.get(at as usize)),
                    gaps,
                    hasher,
                );
            }
            Self::Fixed(octets, width) => {
                texts_of(octets.chunks_exact(*width).map(Some), gaps, hasher);
            }
        }
    }

    /// Appends the values that are there to a page.
    ///
    /// # Errors
    ///
    /// If a place is not that of a text.
    pub fn encode(
        &self,
        gaps: Option<&[bool]>,
        is_few: bool,
        out: &mut Vec<u8>,
    ) -> Result<Encoded> {
        match self {
            Self::Long(values) => {
                let there = present(values, gaps);
                if delta::encode_wide(&there, out) {
                    return Ok(Encoded::plain(Encoding::DELTA_BINARY_PACKED));
                }
                Ok(plain(&there, i64::to_le_bytes, out))
            }
            Self::Int(values) => Ok(integers(&present(values, gaps), is_few, out)),
            Self::Short(values) => Ok(integers(&present(values, gaps), is_few, out)),
            Self::Byte(values) => Ok(integers(&present(values, gaps), true, out)),
            Self::Float(values) => {
                let there = present(bytemuck::cast_slice::<f32, u32>(values), gaps);
                Ok(numbers(&there, u32::to_le_bytes, out))
            }
            Self::Double(values) => {
                let there = present(bytemuck::cast_slice::<f64, u64>(values), gaps);
                Ok(numbers(&there, u64::to_le_bytes, out))
            }
            Self::Flag(values) => Ok(flags(&present(values, gaps), out)),
            Self::Name(places, names) => named(&present(places, gaps), names, out),
            Self::Text(places, known) => texts(&present(places, gaps), known, out),
            Self::Fixed(octets, width) => {
                for (row, text) in octets.chunks_exact(*width).enumerate() {
                    if gaps.is_none_or(|gaps| !gaps[row]) {
                        out.extend_from_slice(text);
                    }
                }
                Ok(Encoded::plain(Encoding::PLAIN))
            }
        }
    }

    /// The smallest and the largest value, of a column without gaps.
    pub fn range(&self) -> Option<Statistics> {
        let int = |least: Option<i32>, most| Statistics::int32(least, most, None, Some(0), false);
        match self {
            Self::Long(values) => {
                let (least, most) = ends(values);
                Some(Statistics::int64(least, most, None, Some(0), false))
            }
            Self::Int(values) => {
                let (least, most) = ends(values);
                Some(int(least, most))
            }
            Self::Byte(values) => {
                let (least, most) = ends(values);
                Some(int(least.map(i32::from), most.map(i32::from)))
            }
            Self::Name(places, names) => {
                let seen = Coded::of(places, names.len())?.found;
                let texts = seen.iter().filter_map(|&place| names.get(place as usize));
                let (least, most) = (texts.clone().min()?, texts.max()?);
                let [least, most] = [least, most].map(|text| ByteArray::from(text.as_str()));
                let (least, most) = (Some(least), Some(most));
                Some(Statistics::byte_array(least, most, None, Some(0), false))
            }
            _ => None,
        }
    }
}

fn ends<T: Copy + Ord>(values: &[T]) -> (Option<T>, Option<T>) {
    (values.iter().min().copied(), values.iter().max().copied())
}

fn known<T: Copy + Into<i64>>(
    places: &[T],
    texts: &[String],
    is_there: impl Fn(usize) -> bool,
) -> bool {
    let count = texts.len() as i64;
    let is_known = |&place: &T| (0..count).contains(&place.into());
    // The first look takes many at a time, the second one only happens where there is nothing.
    places.iter().all(is_known)
        || (places.iter().enumerate()).all(|(row, place)| is_known(place) || !is_there(row))
}

/// The values that are there.
fn present<'a, T: Copy>(values: &'a [T], gaps: Option<&[bool]>) -> Cow<'a, [T]> {
    match gaps {
        None => values.into(),
        Some(gaps) => {
            // Every value is written and the next one over it if there was none: nothing to guess for the CPU.
            let mut there = values.to_vec();
            let mut count = 0;
            for (value, none) in values.iter().zip(gaps) {
                there[count] = *value;
                count += usize::from(!none);
            }
            there.truncate(count);
            there.into()
        }
    }
}

/// Adds numbers to a hash.
fn words<T: bytemuck::NoUninit, const N: usize>(
    values: &[T],
    gaps: Option<&[bool]>,
    nothing: T,
    bytes: impl Fn(T) -> [u8; N],
    hasher: &mut blake3::Hasher,
) {
    if let Some(gaps) = gaps {
        let rows = values.iter().zip(gaps);
        let filled: Vec<T> = rows
            .map(|(&value, &none)| if none { nothing } else { value })
            .collect();
        return words(&filled, None, nothing, bytes, hasher);
    }
    hasher.update(&octets(values, bytes));
}

/// The bytes of some numbers, the lowest byte first on every machine.
fn octets<T: bytemuck::NoUninit, const N: usize>(
    values: &[T],
    bytes: impl Fn(T) -> [u8; N],
) -> Cow<'_, [u8]> {
    if cfg!(target_endian = "little") {
        return bytemuck::cast_slice(values).into();
    }
    let turned: Vec<[u8; N]> = values.iter().map(|&value| bytes(value)).collect();
    turned.into_flattened().into()
}

/// Adds texts to a hash, each after its length; nothing is empty.
fn texts_of<T: AsRef<[u8]>>(
    texts: impl Iterator<Item = Option<T>>,
    gaps: Option<&[bool]>,
    hasher: &mut blake3::Hasher,
) {
    let mut bytes = Vec::new();
    for (row, text) in texts.enumerate() {
        let text = text.filter(|_| gaps.is_none_or(|gaps| !gaps[row]));
        let octets = text.as_ref().map_or(&[][..], AsRef::as_ref);
        let length: [u8; LENGTH_BYTES] = (octets.len() as u64).to_le_bytes();
        bytes.extend_from_slice(&length);
        bytes.extend_from_slice(octets);
    }
    hasher.update(&bytes);
}

/// Integers as codes if they are few, else as differences.
fn integers<T: Bits + Into<i32>>(values: &[T], is_few: bool, out: &mut Vec<u8>) -> Encoded {
    let coded = is_few.then(|| Coded::of(values, usize::MAX)).flatten();
    if let Some(coded) = coded {
        return with_dictionary(&coded, |value| value.into().to_le_bytes(), out);
    }
    delta::encode(values, out);
    Encoded::plain(Encoding::DELTA_BINARY_PACKED)
}

/// Numbers as codes if many of them are the same, else as they are.
fn numbers<T: Bits + bytemuck::NoUninit, const N: usize>(
    values: &[T],
    bytes: impl Fn(T) -> [u8; N],
    out: &mut Vec<u8>,
) -> Encoded {
    match Coded::of(values, MOST_NUMBERS.min(values.len() / 2)) {
        Some(coded) if !values.is_empty() => with_dictionary(&coded, bytes, out),
        _ => plain(values, bytes, out),
    }
}

fn with_dictionary<T: Bits, const N: usize>(
    coded: &Coded<T>,
    bytes: impl Fn(T) -> [u8; N],
    out: &mut Vec<u8>,
) -> Encoded {
    coded.encode(out);
    let octets: Vec<[u8; N]> = coded.found.iter().map(|&value| bytes(value)).collect();
    Encoded {
        encoding: Encoding::RLE_DICTIONARY,
        dictionary: Some((octets.as_flattened().to_vec(), coded.found.len())),
    }
}

fn plain<T: bytemuck::NoUninit, const N: usize>(
    values: &[T],
    bytes: impl Fn(T) -> [u8; N],
    out: &mut Vec<u8>,
) -> Encoded {
    out.extend_from_slice(&octets(values, bytes));
    Encoded::plain(Encoding::PLAIN)
}

fn flags(values: &[bool], out: &mut Vec<u8>) -> Encoded {
    for group in values.chunks(8) {
        let bits = group.iter().enumerate();
        out.push(bits.fold(0, |bits, (place, &on)| bits | u8::from(on) << place));
    }
    Encoded::plain(Encoding::PLAIN)
}

/// Names as their places in the list, all of which is the dictionary: then it is the same in every file, and
/// readers that compare dictionaries find one.
fn named(places: &[i8], names: &[String], out: &mut Vec<u8>) -> Result<Encoded> {
    let codes: &[u8] = bytemuck::cast_slice(places);
    if codes.iter().any(|&code| usize::from(code) >= names.len()) {
        return Err(unlisted());
    }
    encode_among(codes, names.len(), out);
    let mut octets = Vec::new();
    for name in names {
        write_text(name, &mut octets);
    }
    Ok(Encoded {
        encoding: Encoding::RLE_DICTIONARY,
        dictionary: Some((octets, names.len())),
    })
}

/// Texts as codes, or as they are where there are too many different ones.
fn texts(places: &[i32], known: &[String], out: &mut Vec<u8>) -> Result<Encoded> {
    let text = |place: i32| {
        let found = usize::try_from(place).ok().and_then(|at| known.get(at));
        found.ok_or_else(unlisted)
    };
    let Some(coded) = Coded::of(places, usize::MAX) else {
        for &place in places {
            write_text(text(place)?, out);
        }
        return Ok(Encoded::plain(Encoding::PLAIN));
    };
    coded.encode(out);
    let mut octets = Vec::new();
    for &place in &coded.found {
        write_text(text(place)?, &mut octets);
    }
    Ok(Encoded {
        encoding: Encoding::RLE_DICTIONARY,
        dictionary: Some((octets, coded.found.len())),
    })
}

/// Appends a text after its length.
fn write_text(text: &str, out: &mut Vec<u8>) {
    out.extend_from_slice(&(text.len() as u32).to_le_bytes());
    out.extend_from_slice(text.as_bytes());
}

fn unlisted() -> ParquetError {
    ParquetError::General("a text that is not in the list".into())
}
