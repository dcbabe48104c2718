//! One column of a row group: its pages, what the footer says of it, and the hash over its values.

use bytes::Bytes;
use parquet::basic::{Compression, Encoding, Type, ZstdLevel};
use parquet::column::page::{CompressedPage, Page, PageWriter};
use parquet::column::writer::ColumnCloseResult;
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::writer::{SerializedPageWriter, TrackedWrite};
use parquet::schema::types::ColumnDescPtr;

use crate::values::{Encoded, Values};
use crate::{packing, runs};

/// A column to write.
#[derive(Clone, Copy)]
pub struct Column<'a> {
    /// What it holds; where there is nothing, any value.
    pub values: Values<'a>,
    /// Where there is nothing; None if there is no such row.
    pub missing: Option<&'a [bool]>,
    /// Whether the footer tells its smallest and largest value.
    pub is_key: bool,
    /// Whether integers take few values and rarely change, so that runs beat differences.
    pub is_few: bool,
}

/// The hashes over the values of a column and over where it has none.
#[derive(Clone, Default)]
pub struct Hashes {
    pub values: blake3::Hasher,
    pub missing: blake3::Hasher,
}

/// An encoded column: the bytes of its pages, and what the footer says.
pub struct Chunk {
    pub bytes: Bytes,
    pub close: ColumnCloseResult,
}

/// The bytes of one page as they are stored, and how many they are without compression.
struct Squeezed {
    stored: Bytes,
    length: usize,
    is_small: bool,
}

impl Column<'_> {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What Parquet calls its type.
    pub fn physical_type(&self) -> Type {
        self.values.physical_type()
    }

    /// Adds the values to a hash, little-endian, with zero where there is nothing, and to another where
    /// that is.
    pub fn digest(&self, is_nullable: bool, hashes: &mut Hashes) {
        if is_nullable {
            match self.missing {
                Some(missing) => hashes.missing.update(bytemuck::cast_slice(missing)),
                None => hashes.missing.update(&vec![0; self.len()]),
            };
        }
        self.values.digest(self.gaps(), &mut hashes.values);
    }

    /// Where there is nothing, if that is anywhere.
    fn gaps(&self) -> Option<&[bool]> {
        self.missing.filter(|missing| missing.contains(&true))
    }

    /// The column as pages of one row group.
    ///
    /// # Errors
    ///
    /// If the pages cannot be assembled.
    pub fn encode(&self, descr: ColumnDescPtr, is_packed: bool) -> Result<Chunk> {
        let mut data = Vec::with_capacity(self.len());
        if descr.max_def_level() > 0 {
            self.levels(&mut data);
        }
        let Encoded {
            encoding,
            dictionary,
        } = self.values.encode(self.gaps(), self.is_few, &mut data)?;
        let mut pages = vec![Squeezed::of(data, is_packed)?];
        let is_small = pages[0].is_small;
        let codec = match is_small {
            true => Compression::ZSTD(ZstdLevel::default()),
            false => Compression::UNCOMPRESSED,
        };
        let mut count = 0;
        if let Some((bytes, values)) = dictionary {
            count = values;
            pages.insert(0, Squeezed::like(bytes, is_small)?);
        }
        let mut sink = TrackedWrite::new(Vec::new());
        let dictionary_end = self.write_pages(&mut sink, &pages, count, encoding)?;
        let bytes: Bytes = sink.into_inner()?.into();
        let saved: i64 = pages.iter().map(Squeezed::saved).sum();
        let mut metadata = ColumnChunkMetaData::builder(descr)
            .set_compression(codec)
            .set_encodings(vec![Encoding::RLE, encoding])
            .set_num_values(self.len() as i64)
            .set_total_compressed_size(bytes.len() as i64)
            .set_total_uncompressed_size(bytes.len() as i64 + saved)
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

    /// Writes the dictionary, if there is one of some values, and the page of data; the end of the former.
    fn write_pages(
        &self,
        sink: &mut TrackedWrite<Vec<u8>>,
        pages: &[Squeezed],
        count: usize,
        encoding: Encoding,
    ) -> Result<u64> {
        let mut writer = SerializedPageWriter::new(sink);
        let mut dictionary_end = 0;
        if let [dictionary, _] = pages {
            let page = Page::DictionaryPage {
                buf: dictionary.stored.clone(),
                num_values: count as u32,
                encoding: Encoding::PLAIN,
                is_sorted: false,
            };
            let page = CompressedPage::new(page, dictionary.length);
            dictionary_end = writer.write_page(page)?.bytes_written;
        }
        let data = &pages[pages.len() - 1];
        let page = Page::DataPage {
            buf: data.stored.clone(),
            num_values: self.len() as u32,
            encoding,
            def_level_encoding: Encoding::RLE,
            rep_level_encoding: Encoding::RLE,
            statistics: None,
        };
        writer.write_page(CompressedPage::new(page, data.length))?;
        Ok(dictionary_end)
    }

    /// Which rows have a value, after the number of bytes that say so.
    fn levels(&self, data: &mut Vec<u8>) {
        let start = data.len();
        data.extend_from_slice(&[0; 4]);
        match self.gaps() {
            Some(missing) => {
                let there: Vec<u8> = missing.iter().map(|&none| u8::from(!none)).collect();
                runs::encode(&there, 1, data);
            }
            None => runs::repeat(1, self.len(), data),
        }
        let length = (data.len() - start - 4) as u32;
        data[start..start + 4].copy_from_slice(&length.to_le_bytes());
    }
}

impl Squeezed {
    /// A page, compressed where that makes it clearly smaller.
    fn of(whole: Vec<u8>, is_packed: bool) -> Result<Self> {
        let small = match is_packed {
            true => packing::worthwhile(&whole).map_err(no_compression)?,
            false => None,
        };
        Ok(Self::with(whole, small))
    }

    /// A page, compressed if another one of its column is.
    fn like(whole: Vec<u8>, is_small: bool) -> Result<Self> {
        let small = match is_small {
            true => Some(packing::compressed(&whole).map_err(no_compression)?),
            false => None,
        };
        Ok(Self::with(whole, small))
    }

    fn with(whole: Vec<u8>, small: Option<Vec<u8>>) -> Self {
        Self {
            length: whole.len(),
            is_small: small.is_some(),
            stored: small.unwrap_or(whole).into(),
        }
    }

    /// By how much the file is shorter for the compression.
    fn saved(&self) -> i64 {
        self.length as i64 - self.stored.len() as i64
    }
}

fn no_compression(error: std::io::Error) -> ParquetError {
    ParquetError::General(format!("cannot compress: {error}"))
}
