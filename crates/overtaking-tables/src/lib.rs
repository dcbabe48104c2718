//! Tables of recorded integers as Parquet files, written as fast as two cores can.
//!
//! Recorded values change little from frame to frame, so columns are differences of as many bits as they
//! need (`delta`), and what takes few values is runs of codes (`runs`). Both are encodings of the Parquet
//! format, which every reader knows; the `parquet` crate assembles the file around them.

mod column;
mod delta;
mod file;
mod runs;

pub use column::{Column, Values};
pub use file::FileWriter;
