//! One column of a row group: its pages, what the footer says of it, and the hash over its values.

use bytes::Bytes;
use parquet::basic::{Compression, Encoding, Type};
use parquet::column::page::{CompressedPage, Page, PageWriter};
use parquet::column::writer::ColumnCloseResult;
use parquet::errors::Result;
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::statistics::Statistics;
use parquet::file::writer::{SerializedPageWriter, TrackedWrite};
use parquet::schema::types::ColumnDescPtr;

use crate::{delta, runs};

/// The values of a column, row by row.
#[derive(Clone, Copy)]
pub enum Values<'a> {
    /// INT64, as differences.
    Long(&'a [i64]),
    /// INT32, as differences.
    Int(&'a [i32]),
    /// INT32 of 16 bits, as differences.
    Short(&'a [i16]),
    /// INT32 of 16 bits with few values, as runs.
    FewShort(&'a [i16]),
    /// INT32 of 8 bits without sign, as runs.
    FewByte(&'a [u8]),
    /// Texts, given as places in a list of all texts that may occur, as runs.
    Name(&'a [i8], &'a [String]),
}

/// A column to write.
#[derive(Clone, Copy)]
pub struct Column<'a> {
    /// What it holds; where there is nothing, any value.
    pub values: Values<'a>,
    /// 1 where there is nothing, else 0; None if there may be no such row.
    pub missing: Option<&'a [u8]>,
    /// Whether the footer tells its smallest and largest value.
    pub is_key: bool,
}

/// An encoded column: the bytes of its pages, and what the footer says.
pub struct Chunk {
    pub bytes: Bytes,
    pub close: ColumnCloseResult,
}

impl Column<'_> {
    /// Number of rows.
    pub fn len(&self) -> usize {
        match self.values {
            Values::Long(values) => values.len(),
            Values::Int(values) => values.len(),
            Values::Short(values) | Values::FewShort(values) => values.len(),
            Values::FewByte(values) => values.len(),
            Values::Name(values, _) => values.len(),
        }
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What Parquet calls its type.
    pub fn physical_type(&self) -> Type {
        match self.values {
            Values::Long(_) => Type::INT64,
            Values::Name(..) => Type::BYTE_ARRAY,
            _ => Type::INT32,
        }
    }

    /// Adds the values to a hash, little-endian, with zero where there is nothing, and to another where
    /// that is.
    pub fn digest(&self, values: &mut blake3::Hasher, missing: &mut blake3::Hasher) {
        let Some(nothing) = self.missing else {
            return self.values.digest(values);
        };
        missing.update(nothing);
        match self.values {
            Values::FewShort(rows) => {
                let known: Vec<i16> = rows
                    .iter()
                    .zip(nothing)
                    .map(|(&value, &none)| if none == 0 { value } else { 0 })
                    .collect();
                Values::FewShort(&known).digest(values);
            }
            _ => unreachable!("a column of another kind has no nulls"),
        }
    }

    /// The column as pages of one row group.
    pub fn encode(&self, descr: ColumnDescPtr) -> Result<Chunk> {
        let (dictionary, data) = self.pages();
        let encoding = match dictionary {
            Some(_) => Encoding::RLE_DICTIONARY,
            None => Encoding::DELTA_BINARY_PACKED,
        };
        let mut sink = TrackedWrite::new(Vec::new());
        let mut writer = SerializedPageWriter::new(&mut sink);
        let mut dictionary_end = 0;
        if let Some((buf, count)) = dictionary {
            let size = buf.len();
            let page = Page::DictionaryPage {
                buf: buf.into(),
                num_values: count as u32,
                encoding: Encoding::PLAIN,
                is_sorted: false,
            };
            dictionary_end = writer
                .write_page(CompressedPage::new(page, size))?
                .bytes_written;
        }
        let size = data.len();
        let page = Page::DataPage {
            buf: data.into(),
            num_values: self.len() as u32,
            encoding,
            def_level_encoding: Encoding::RLE,
            rep_level_encoding: Encoding::RLE,
            statistics: None,
        };
        writer.write_page(CompressedPage::new(page, size))?;
        let bytes: Bytes = sink.into_inner()?.into();
        let mut metadata = ColumnChunkMetaData::builder(descr)
            .set_compression(Compression::UNCOMPRESSED)
            .set_encodings(vec![Encoding::RLE, encoding])
            .set_num_values(self.len() as i64)
            .set_total_compressed_size(bytes.len() as i64)
            .set_total_uncompressed_size(bytes.len() as i64)
            .set_data_page_offset(dictionary_end as i64);
        if dictionary_end > 0 {
            metadata = metadata
                .set_dictionary_page_offset(Some(0))
                .set_encodings(vec![Encoding::RLE, Encoding::PLAIN, encoding]);
        }
        if let Some(statistics) = self.is_key.then(|| self.values.range()).flatten() {
            metadata = metadata.set_statistics(statistics);
        }
        let close = ColumnCloseResult {
            bytes_written: bytes.len() as u64,
            rows_written: self.len() as u64,
            metadata: metadata.build()?,
            bloom_filter: None,
            column_index: None,
            offset_index: None,
        };
        Ok(Chunk { bytes, close })
    }

    /// The dictionary, if there is one, with the number of its values; and the page of data.
    fn pages(&self) -> (Option<(Vec<u8>, usize)>, Vec<u8>) {
        let mut data = Vec::with_capacity(self.len());
        if let Some(missing) = self.missing {
            self.levels(missing, &mut data);
        }
        let dictionary = match self.values {
            Values::Long(values) => {
                delta::encode_wide(values, &mut data);
                None
            }
            Values::Int(values) => {
                delta::encode(values, &mut data);
                None
            }
            Values::Short(values) => {
                delta::encode(values, &mut data);
                None
            }
            Values::FewShort(values) => Some(self.coded(values, &mut data, |value, out| {
                out.extend_from_slice(&i32::from(value).to_le_bytes());
            })),
            Values::FewByte(values) => Some(self.coded(values, &mut data, |value, out| {
                out.extend_from_slice(&i32::from(value).to_le_bytes());
            })),
            Values::Name(places, names) => Some(self.coded(places, &mut data, |place, out| {
                let name = &names[place as usize];
                out.extend_from_slice(&(name.len() as u32).to_le_bytes());
                out.extend_from_slice(name.as_bytes());
            })),
        };
        (dictionary, data)
    }

    /// Which rows have a value, after the number of bytes that say so.
    fn levels(&self, missing: &[u8], data: &mut Vec<u8>) {
        let there: Vec<u8> = missing.iter().map(|&none| 1 - none).collect();
        let start = data.len();
        data.extend_from_slice(&[0; 4]);
        runs::encode(&there, data);
        let length = (data.len() - start - 4) as u32;
        data[start..start + 4].copy_from_slice(&length.to_le_bytes());
    }

    /// Codes of the values that are there; the dictionary as bytes, and its length.
    fn coded<T: Copy + PartialEq>(
        &self,
        values: &[T],
        data: &mut Vec<u8>,
        write: impl Fn(T, &mut Vec<u8>),
    ) -> (Vec<u8>, usize) {
        let found = match self.missing {
            Some(missing) if missing.contains(&1) => {
                let rows = values.iter().zip(missing).filter(|(_, none)| **none == 0);
                let there: Vec<T> = rows.map(|(value, _)| *value).collect();
                runs::encode_coded(&there, data)
            }
            _ => runs::encode_coded(values, data),
        };
        let mut bytes = Vec::new();
        for &value in &found {
            write(value, &mut bytes);
        }
        (bytes, found.len())
    }
}

impl Values<'_> {
    fn digest(&self, hasher: &mut blake3::Hasher) {
        match self {
            Values::Long(values) => hash_words(values, hasher, i64::to_le_bytes),
            Values::Int(values) => hash_words(values, hasher, i32::to_le_bytes),
            Values::Short(values) | Values::FewShort(values) => {
                hash_words(values, hasher, i16::to_le_bytes);
            }
            Values::FewByte(values) => {
                hasher.update(values);
            }
            Values::Name(values, _) => hash_words(values, hasher, i8::to_le_bytes),
        }
    }

    /// The smallest and the largest value.
    fn range(&self) -> Option<Statistics> {
        let int = |least: Option<i32>, most| Statistics::int32(least, most, None, Some(0), false);
        match self {
            Values::Long(values) => {
                let (least, most) = (values.iter().min().copied(), values.iter().max().copied());
                Some(Statistics::int64(least, most, None, Some(0), false))
            }
            Values::Int(values) => Some(int(
                values.iter().min().copied(),
                values.iter().max().copied(),
            )),
            Values::FewByte(values) => Some(int(
                values.iter().min().copied().map(i32::from),
                values.iter().max().copied().map(i32::from),
            )),
            _ => None,
        }
    }
}

/// Adds numbers to a hash, the lowest byte first on every machine.
fn hash_words<T: bytemuck::NoUninit, const N: usize>(
    values: &[T],
    hasher: &mut blake3::Hasher,
    bytes: impl Fn(T) -> [u8; N],
) {
    if cfg!(target_endian = "little") {
        hasher.update(bytemuck::cast_slice(values));
    } else {
        let turned: Vec<[u8; N]> = values.iter().map(|&value| bytes(value)).collect();
        hasher.update(turned.as_flattened());
    }
}
