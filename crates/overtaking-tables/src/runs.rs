//! Columns that take few values: a dictionary of the values, and runs and packed groups of their codes.
//!
//! Source: Apache Parquet, "Encodings", sections "Dictionary Encoding" and "Run Length Encoding /
//! Bit-Packing Hybrid".

use crate::delta::varint;

/// Values that are compared at a time, once a run has begun.
const STRIDE: usize = 32;
/// Codes of a packed group.
const GROUP: usize = 8;
/// Values that a dictionary holds at most, so that a code is a byte.
const MOST: usize = 256;
/// Bits of a code that a run is worth leaving a packed stretch for: two bytes, and one for the next stretch.
const RUN_BITS: usize = 24;
/// Places of the table of values that are known, far more than there are values.
const PLACES_BITS: u32 = 11;

/// What tells values apart.
pub trait Bits: Copy + PartialEq {
    /// Its bits.
    fn bits(self) -> u64;
}

macro_rules! bits_of {
    ($($kind:ty => $as:ty),*) => {
        $(impl Bits for $kind {
            fn bits(self) -> u64 {
                self as $as as u64
            }
        })*
    };
}
bits_of!(i8 => u8, u8 => u8, i16 => u16, i32 => u32, i64 => u64, u32 => u32, u64 => u64);

/// A dictionary, and the place of every value in it.
pub struct Coded<T> {
    pub found: Vec<T>,
    pub codes: Vec<u8>,
}

impl<T: Bits> Coded<T> {
    /// The codes of some values, or None if there are too many different ones.
    pub fn of(values: &[T], most: usize) -> Option<Self> {
        let most = most.min(MOST);
        let mut known = [u16::MAX; 1 << PLACES_BITS];
        let mut coded = Self {
            found: Vec::new(),
            codes: Vec::with_capacity(values.len()),
        };
        let mut rest = values;
        while let Some(&value) = rest.first() {
            let length = run_length(rest);
            let code = code_of(value, &mut known, &mut coded.found);
            if coded.found.len() > most {
                return None;
            }
            coded.codes.resize(coded.codes.len() + length, code);
            rest = &rest[length..];
        }
        Some(coded)
    }

    /// Appends the codes, after the number of bits of each.
    pub fn encode(&self, out: &mut Vec<u8>) {
        encode_among(&self.codes, self.found.len(), out);
    }
}

/// Appends codes of a dictionary that holds so many, after the number of bits of each.
pub fn encode_among(codes: &[u8], count: usize, out: &mut Vec<u8>) {
    let width = bits_for(count);
    out.push(width);
    encode(codes, width, out);
}

/// The code of a value, a new one if it has none. Where the 257th value would need one it is 0.
fn code_of<T: Bits>(value: T, known: &mut [u16], found: &mut Vec<T>) -> u8 {
    let mixed = value.bits().wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mut place = (mixed >> (u64::BITS - PLACES_BITS)) as usize;
    loop {
        match known[place] {
            u16::MAX => break,
            code if found[code as usize].bits() == value.bits() => return code as u8,
            _ => place = (place + 1) % known.len(),
        }
    }
    known[place] = found.len() as u16;
    found.push(value);
    (found.len() - 1) as u8
}

/// Appends codes of `width` bits, at most 8: long runs as such, the others packed.
pub fn encode(codes: &[u8], width: u8, out: &mut Vec<u8>) {
    let shortest = RUN_BITS.div_ceil(width.into()).max(GROUP);
    let (mut packed, mut begin) = (0, 0);
    while let Some(next) = next_run(codes, begin) {
        begin = next;
        let length = long_run(&codes[begin..]);
        // What the groups before it lack belongs to them.
        let lacking = (packed..begin).len().next_multiple_of(GROUP) - (begin - packed);
        if length >= lacking + shortest {
            pack(&codes[packed..begin + lacking], width, out);
            repeat(codes[begin], length - lacking, out);
            packed = begin + length;
        }
        begin += length;
    }
    pack(&codes[packed..], width, out);
}

/// Where the next run of a group or more begins, from the beginning of a run on.
fn next_run(codes: &[u8], mut begin: usize) -> Option<usize> {
    while let Some(group) = codes.get(begin..begin + GROUP) {
        // From behind, so that of codes that differ most are never looked at.
        match group.windows(2).rposition(|pair| pair[0] != pair[1]) {
            None => return Some(begin),
            Some(last) => begin += last + 1,
        }
    }
    None
}

/// Appends one code, a number of times.
pub fn repeat(code: u8, count: usize, out: &mut Vec<u8>) {
    varint((count as u64) << 1, out);
    out.push(code);
}

/// Appends packed groups of codes, the last one filled with zeros.
fn pack(codes: &[u8], width: u8, out: &mut Vec<u8>) {
    if codes.is_empty() {
        return;
    }
    varint((codes.len().div_ceil(GROUP) as u64) << 1 | 1, out);
    for group in codes.chunks(GROUP) {
        let mut bits = 0;
        for (place, &code) in group.iter().enumerate() {
            bits |= u64::from(code) << (place * usize::from(width));
        }
        out.extend_from_slice(&bits.to_le_bytes()[..width.into()]);
    }
}

/// How often the first of some values comes in a row.
#[inline]
fn run_length<T: Copy + PartialEq>(values: &[T]) -> usize {
    match values {
        [value, next, ..] if value == next => long_run(values),
        _ => 1,
    }
}

/// As `run_length`, faster where they come more often.
fn long_run<T: Copy + PartialEq>(values: &[T]) -> usize {
    let value = values[0];
    let near = &values[1..values.len().min(GROUP)];
    if let Some(place) = near.iter().position(|other| *other != value) {
        return place + 1;
    }
    let strides = values.chunks_exact(STRIDE);
    let whole = strides.take_while(|stride| stride.iter().all(|other| *other == value));
    let certain = whole.count() * STRIDE;
    let more = values[certain..]
        .iter()
        .take_while(|other| **other == value);
    certain + more.count()
}

/// Bits that codes below `count` need, at least one.
fn bits_for(count: usize) -> u8 {
    (usize::BITS - count.saturating_sub(1).leading_zeros()).max(1) as u8
}
