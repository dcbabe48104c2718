//! A Parquet file, piece by piece, as bytes for the caller to write.

use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use bytes::Bytes;
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::{KeyValue, ParquetMetaDataReader, SortingColumn};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::SchemaDescriptor;
use rayon::prelude::*;

use crate::column::{Chunk, Column, Hashes};

/// Bytes that were written and not yet fetched.
#[derive(Clone, Default)]
struct Pending(Arc<Mutex<Vec<u8>>>);

impl Pending {
    fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.0.lock().expect("no writer panics"))
    }
}

impl Write for Pending {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0
            .lock()
            .expect("no writer panics")
            .extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes one file; what it writes is returned, so that the caller decides where it goes.
pub struct FileWriter {
    writer: SerializedFileWriter<Pending>,
    pending: Pending,
    hashes: Vec<Hashes>,
    is_packed: bool,
}

impl FileWriter {
    /// Starts a file.
    ///
    /// # Arguments
    ///
    /// * `template`: an empty Parquet file; its schema and metadata become those of this one.
    /// * `keys`: places of the columns that the rows are sorted by.
    /// * `is_packed`: whether pages are compressed where that makes them smaller.
    ///
    /// # Errors
    ///
    /// If the template is no Parquet file.
    pub fn new(template: Bytes, keys: &[usize], is_packed: bool) -> Result<Self> {
        let given = ParquetMetaDataReader::new().parse_and_finish(&template)?;
        let about = given.file_metadata();
        let sorting = keys.iter().map(|&key| SortingColumn {
            column_idx: key as i32,
            descending: false,
            nulls_first: false,
        });
        let properties = WriterProperties::builder()
            .set_created_by(format!("overtaking-tables {}", env!("CARGO_PKG_VERSION")))
            .set_key_value_metadata(about.key_value_metadata().cloned())
            .set_sorting_columns(Some(sorting.collect()))
            .build();
        let schema = about.schema_descr().root_schema_ptr();
        let pending = Pending::default();
        Ok(Self {
            writer: SerializedFileWriter::new(pending.clone(), schema, Arc::new(properties))?,
            pending,
            hashes: vec![Default::default(); about.schema_descr().num_columns()],
            is_packed,
        })
    }

    /// Appends rows as one row group; the bytes that the file grows by.
    ///
    /// # Errors
    ///
    /// If columns are missing or of another kind than the schema says, or of different lengths.
    pub fn append(&mut self, columns: &[Column<'_>]) -> Result<Vec<u8>> {
        let schema = self.writer.schema_descr();
        check(columns, schema)?;
        let chunks = (columns, self.hashes.as_mut_slice(), schema.columns())
            .into_par_iter()
            .map(|(column, hashes, descr)| {
                column.digest(descr.max_def_level() > 0, hashes);
                column.encode(descr.clone(), self.is_packed)
            })
            .collect::<Result<Vec<Chunk>>>()?;
        let mut group = self.writer.next_row_group()?;
        for chunk in chunks {
            group.append_column(&chunk.bytes, chunk.close)?;
        }
        group.close()?;
        self.writer.flush()?;
        Ok(self.pending.take())
    }

    /// Hashes over values and gaps of each column so far, 64 hexadecimal digits each.
    pub fn digests(&self) -> Vec<(String, String)> {
        let text = |hash: &blake3::Hasher| hash.finalize().to_hex().to_string();
        self.hashes
            .iter()
            .map(|both| (text(&both.values), text(&both.missing)))
            .collect()
    }

    /// The bytes that end the file.
    ///
    /// # Errors
    ///
    /// If the file was ended before.
    pub fn finish(&mut self, notes: Vec<(String, String)>) -> Result<Vec<u8>> {
        for (key, value) in notes {
            self.writer
                .append_key_value_metadata(KeyValue::new(key, value));
        }
        self.writer.finish()?;
        self.writer.flush()?;
        Ok(self.pending.take())
    }
}

/// Whether columns are those of a schema, and equally long.
fn check(columns: &[Column<'_>], schema: &SchemaDescriptor) -> Result<()> {
    let (expected, got) = (schema.num_columns(), columns.len());
    if got != expected {
        return Err(ParquetError::General(format!(
            "{got} columns instead of {expected}"
        )));
    }
    for (column, descr) in columns.iter().zip(schema.columns()) {
        let fits = column.physical_type() == descr.physical_type()
            && column.len() == columns[0].len()
            && column
                .missing
                .is_none_or(|missing| missing.len() == column.len() && descr.max_def_level() > 0)
            && column.values.are_known(column.missing);
        if !fits {
            let name = descr.name();
            return Err(ParquetError::General(format!(
                "column {name} is not as in the schema"
            )));
        }
    }
    Ok(())
}
