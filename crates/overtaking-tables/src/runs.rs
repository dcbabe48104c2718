//! Columns that take few values and rarely change: a dictionary of the values, and runs of their codes.
//!
//! Source: Apache Parquet, "Encodings", sections "Dictionary Encoding" and "Run Length Encoding".

use crate::delta::varint;

/// Values that are compared at a time.
const STRIDE: usize = 32;

/// Appends runs of numbers of at most 8 bits each.
pub fn encode(numbers: &[u8], out: &mut Vec<u8>) {
    each(numbers, |number, length| run(number, length, out));
}

/// Appends runs of the codes of some values; the values in the order of their codes.
///
/// # Panics
///
/// If there are more than 256 different values.
pub fn encode_coded<T: Copy + PartialEq>(values: &[T], out: &mut Vec<u8>) -> Vec<T> {
    let mut found = Vec::new();
    let width = out.len();
    out.push(0);
    each(values, |value, length| {
        run(code_of(value, &mut found), length, out)
    });
    out[width] = bits_for(found.len());
    found
}

/// Calls back with each run: its value and its length.
fn each<T: Copy + PartialEq>(values: &[T], mut found: impl FnMut(T, u64)) {
    let mut rest = values;
    while let Some(&value) = rest.first() {
        let strides = rest.chunks_exact(STRIDE);
        let whole = strides.take_while(|stride| stride.iter().all(|other| *other == value));
        let certain = whole.count() * STRIDE;
        let more = rest[certain..]
            .iter()
            .take_while(|other| **other == value)
            .count();
        found(value, (certain + more) as u64);
        rest = &rest[certain + more..];
    }
}

fn run(code: u8, length: u64, out: &mut Vec<u8>) {
    varint(length << 1, out);
    out.push(code);
}

/// Bits that codes below `count` need, at least one.
fn bits_for(count: usize) -> u8 {
    (usize::BITS - count.saturating_sub(1).leading_zeros()).max(1) as u8
}

fn code_of<T: Copy + PartialEq>(value: T, found: &mut Vec<T>) -> u8 {
    let place = found
        .iter()
        .position(|known| *known == value)
        .unwrap_or_else(|| {
            found.push(value);
            found.len() - 1
        });
    u8::try_from(place).expect("at most 256 different values")
}
