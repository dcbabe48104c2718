//! DELTA_BINARY_PACKED of the Parquet format: differences to the value before, less the smallest of
//! their block, in as many bits as the largest of 32 needs.
//!
//! Source: Apache Parquet, "Encodings", section "Delta Encoding".

/// Differences that share a smallest one.
const BLOCK: usize = 128;
/// Differences that share a number of bits.
const MINIBLOCK: usize = 32;
const MINIBLOCKS: usize = BLOCK / MINIBLOCK;

/// Appends some values, which Parquet has as INT32.
pub fn encode<T: Copy + Into<i32>>(values: &[T], out: &mut Vec<u8>) {
    header(
        values.len(),
        values.first().map_or(0, |&first| first.into().into()),
        out,
    );
    blocks(
        values,
        |before, value| value.into().wrapping_sub(before.into()),
        out,
    );
}

/// Appends some values, which Parquet has as INT64, if those that follow each other are less than 2^30 apart,
/// as sorted numbers of simulations are; whether they are.
pub fn encode_wide(values: &[i64], out: &mut Vec<u8>) -> bool {
    // Half the range, so that differences of differences fit as well.
    let is_near = |pair: &[i64]| pair[1].wrapping_sub(pair[0]).unsigned_abs() < 1 << 30;
    if !values.windows(2).all(is_near) {
        return false;
    }
    header(values.len(), values.first().copied().unwrap_or(0), out);
    blocks(
        values,
        |before, value| value.wrapping_sub(before) as i32,
        out,
    );
    true
}

/// Appends the blocks of some values after the first.
fn blocks<T: Copy>(values: &[T], step: impl Fn(T, T) -> i32, out: &mut Vec<u8>) {
    let mut differences = [0; BLOCK];
    let mut begin = 0;
    while begin + 1 < values.len() {
        let end = values.len().min(begin + BLOCK + 1);
        let (before, after) = (&values[begin..end - 1], &values[begin + 1..end]);
        for (difference, (&before, &after)) in differences.iter_mut().zip(before.iter().zip(after))
        {
            *difference = step(before, after);
        }
        write_block(&differences[..before.len()], out);
        begin = end - 1;
    }
}

fn header(count: usize, first: i64, out: &mut Vec<u8>) {
    varint(BLOCK as u64, out);
    varint(MINIBLOCKS as u64, out);
    varint(count as u64, out);
    varint(zigzag(first), out);
}

/// Appends a block of at most `BLOCK` differences.
fn write_block(differences: &[i32], out: &mut Vec<u8>) {
    let least = differences.iter().copied().min().unwrap_or(0);
    let mut above = [0; BLOCK];
    for (value, difference) in above.iter_mut().zip(differences) {
        // What wraps here wraps back when it is read.
        *value = difference.wrapping_sub(least) as u32;
    }
    varint(zigzag(least.into()), out);
    let widths = out.len();
    out.extend_from_slice(&[0; MINIBLOCKS]);
    // A miniblock that no value is left for has no bytes, and its width is not looked at.
    let filled = differences.len().div_ceil(MINIBLOCK);
    for (place, values) in above.as_chunks::<MINIBLOCK>().0[..filled]
        .iter()
        .enumerate()
    {
        let used = values.iter().fold(0, |bits, value| bits | value);
        let width = u32::BITS - used.leading_zeros();
        out[widths + place] = width as u8;
        pack(values, width, out);
    }
}

/// Appends 32 values of `width` bits each, least significant bits first.
fn pack(values: &[u32; MINIBLOCK], width: u32, out: &mut Vec<u8>) {
    macro_rules! by_width {
        ($($known:literal)*) => {
            match width {
                0 => {}
                $($known => pack_as::<$known>(values, out),)*
                _ => unreachable!("a value has at most 32 bits"),
            }
        };
    }
    by_width!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32);
}

/// As `pack`; the width is a constant, so that the compiler knows every shift.
fn pack_as<const WIDTH: usize>(values: &[u32; MINIBLOCK], out: &mut Vec<u8>) {
    let mut bytes = [[0; 4]; MINIBLOCK];
    for (word, bytes) in bytes[..WIDTH].iter_mut().enumerate() {
        *bytes = word_of::<WIDTH>(values, word).to_le_bytes();
    }
    out.extend_from_slice(bytes[..WIDTH].as_flattened());
}

/// Bits 32 `word` to 32 `word` + 31 of 32 values of `WIDTH` bits side by side.
#[inline(always)]
fn word_of<const WIDTH: usize>(values: &[u32; MINIBLOCK], word: usize) -> u32 {
    let begin = word * 32;
    let mut bits = 0;
    let mut place = begin / WIDTH;
    while place * WIDTH < begin + 32 {
        let at = place * WIDTH;
        bits |= if at >= begin {
            values[place] << (at - begin)
        } else {
            values[place] >> (begin - at)
        };
        place += 1;
    }
    bits
}

/// Appends a number, seven bits a byte, the last byte without its highest bit.
pub fn varint(mut number: u64, out: &mut Vec<u8>) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

/// Numbers of either sign as numbers without: small ones stay small.
fn zigzag(number: i64) -> u64 {
    ((number << 1) ^ (number >> 63)) as u64
}
