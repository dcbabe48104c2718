//! Films: frames are drawn from lists of what is on them.
//!
//! Everything is reckoned in integers with one rounding, so a film is the same on every machine. What a
//! picture looks like and where it lies is decided by who calls: nothing here knows of roads or vehicles.

mod frame;
mod grid;
mod light;
mod sheet;
mod show;
mod sprite;
mod texture;

pub use frame::{Frame, Plane, Rows};
pub use grid::Ends;
pub use light::{Light, Night, Streaks, Veil};
pub use sheet::{Colour, Sheet};
pub use show::{ITEM_LENGTH, KINDS, Pictures, Show};
pub use sprite::{OPAQUE, Raster, Sprite, Tile};
pub use texture::{ONE, Place, Texture};
