//! What is written comes back through the reader of the `parquet` crate, which we did not write.

use std::sync::Arc;

use bytes::Bytes;
use overtaking_tables::{Column, FileWriter, Values};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::record::RowAccessor;
use parquet::schema::parser::parse_message_type;

const SCHEMA: &str = "message rows {
    REQUIRED INT64 simulation;
    REQUIRED INT32 x;
    OPTIONAL INT32 lane;
}";

fn template() -> Bytes {
    let schema = Arc::new(parse_message_type(SCHEMA).unwrap());
    let writer = SerializedFileWriter::new(Vec::new(), schema, Default::default()).unwrap();
    writer.into_inner().unwrap().into()
}

fn column(values: Values<'_>) -> Column<'_> {
    Column {
        values,
        missing: None,
        is_key: false,
    }
}

#[test]
fn numbers_of_any_size_and_gaps_come_back() {
    let count = 1000;
    let simulation: Vec<i64> = (0..count).map(|row| row / 70).collect();
    let x: Vec<i32> = (0..count)
        .map(|row| match row % 5 {
            0 => i32::MAX,
            1 => i32::MIN,
            _ => (row * row * 7919 % 1_000_003) as i32,
        })
        .collect();
    let lane: Vec<i16> = (0..count).map(|row| -(row as i16 / 90)).collect();
    let missing: Vec<u8> = (0..count).map(|row| u8::from(row % 311 < 40)).collect();

    let mut file = FileWriter::new(template(), &[0]).unwrap();
    let mut bytes = file
        .append(&[
            column(Values::Long(&simulation)),
            column(Values::Int(&x)),
            Column {
                values: Values::FewShort(&lane),
                missing: Some(&missing),
                is_key: false,
            },
        ])
        .unwrap();
    bytes.extend(file.finish(vec![]).unwrap());

    let reader = SerializedFileReader::new(Bytes::from(bytes)).unwrap();
    let rows: Vec<_> = reader
        .get_row_iter(None)
        .unwrap()
        .map(Result::unwrap)
        .collect();
    assert_eq!(rows.len(), count as usize);
    for (number, row) in rows.iter().enumerate() {
        assert_eq!(row.get_long(0).unwrap(), simulation[number]);
        assert_eq!(row.get_int(1).unwrap(), x[number]);
        let expected = (missing[number] == 0).then(|| lane[number].into());
        assert_eq!(row.get_int(2).ok(), expected, "row {number}");
    }
}
