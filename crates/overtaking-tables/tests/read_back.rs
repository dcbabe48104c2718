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
    OPTIONAL FLOAT gap;
    REQUIRED DOUBLE limit;
    REQUIRED BOOLEAN lit;
    OPTIONAL BYTE_ARRAY side (STRING);
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
        is_few: false,
    }
}

#[test]
fn values_of_any_size_and_gaps_come_back() {
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
    let gap: Vec<f32> = (0..count).map(|row| (row as f32).sqrt()).collect();
    let limit: Vec<f64> = (0..count)
        .map(|row| [25.0, 0.1][(row % 2) as usize])
        .collect();
    let lit: Vec<bool> = (0..count).map(|row| row * row % 3 == 0).collect();
    let names = ["off", "left", "right"].map(String::from);
    let side: Vec<i8> = (0..count).map(|row| (row % 3) as i8).collect();
    let missing: Vec<bool> = (0..count).map(|row| row % 311 < 40).collect();
    let other: Vec<bool> = (0..count).map(|row| row % 7 < 3).collect();

    for is_packed in [false, true] {
        let mut file = FileWriter::new(template(), &[0], is_packed).unwrap();
        let mut bytes = file
            .append(&[
                column(Values::Long(&simulation)),
                column(Values::Int(&x)),
                Column {
                    missing: Some(&missing),
                    is_few: true,
                    ..column(Values::Short(&lane))
                },
                Column {
                    missing: Some(&other),
                    ..column(Values::Float(&gap))
                },
                column(Values::Double(&limit)),
                column(Values::Flag(&lit)),
                column(Values::Name(&side, &names)),
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
            let expected = (!missing[number]).then(|| lane[number].into());
            assert_eq!(row.get_int(2).ok(), expected, "row {number}");
            assert_eq!(row.get_float(3).ok(), (!other[number]).then(|| gap[number]));
            assert_eq!(row.get_double(4).unwrap(), limit[number]);
            assert_eq!(row.get_bool(5).unwrap(), lit[number]);
            let name = &names[side[number] as usize];
            assert_eq!(row.get_string(6).unwrap(), name, "row {number}");
        }
    }
}
