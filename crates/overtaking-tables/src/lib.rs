//! Tables as Parquet files, written as fast as two cores can.
//!
//! Recorded values change little from frame to frame, so columns of integers are differences of as many bits
//! as they need (`delta`), and what takes few values is codes (`runs`); other numbers are as they are. All of
//! them are encodings of the Parquet format, which every reader knows; the `parquet` crate assembles the file
//! around them.

mod column;
mod delta;
mod file;
mod packing;
mod runs;
mod values;

pub use column::Column;
pub use file::FileWriter;
pub use values::Values;
