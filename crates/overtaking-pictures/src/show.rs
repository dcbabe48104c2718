//! Lists of what is on the frames of a film, and how a frame is drawn from its part of the list.

use std::sync::Arc;

use crate::frame::{Frame, Rows};
use crate::light::{Light, Night, Streaks, Veil};
use crate::sprite::{Sprite, Tile};
use crate::texture::{Place, Texture};

/// Numbers to an item of the list: kind, picture, x, y, two more, and the rows that may be drawn on.
pub const ITEM_LENGTH: usize = 8;

/// What an item may be, in the order of their numbers.
pub const KINDS: [&str; 7] = [
    "tile", "sprite", "texture", "veil", "light", "night", "streaks",
];

/// No picture, where an item may do without.
const NONE: i32 = -1;

/// Something to be drawn.
#[derive(Debug, Clone, Copy)]
enum Item {
    Tile {
        picture: usize,
        at: (usize, usize),
        columns: (usize, usize),
    },
    Sprite {
        picture: usize,
        at: (i32, i32),
    },
    Texture {
        picture: usize,
        place: Place,
    },
    Veil {
        picture: usize,
        first: usize,
    },
    Light {
        picture: usize,
        at: (i32, i32),
    },
    Night {
        veil: Option<usize>,
        first: usize,
    },
    Streaks {
        picture: usize,
    },
}

/// The pictures that items name by their numbers, each kind counted from 0; shared with other films.
#[derive(Debug, Default)]
pub struct Pictures {
    /// Pictures without opacity.
    pub tiles: Vec<Arc<Tile>>,
    /// Pictures with opacity.
    pub sprites: Vec<Arc<Sprite>>,
    /// Sheets that are drawn at any angle.
    pub textures: Vec<Arc<Texture>>,
    /// Fog and glare.
    pub veils: Vec<Arc<Veil>>,
    /// Patches of light.
    pub lights: Vec<Arc<Light>>,
    /// Rain.
    pub streaks: Vec<Arc<Streaks>>,
}

/// All frames of a film.
#[derive(Debug, Default)]
pub struct Show {
    width: usize,
    height: usize,
    moonlight: u16,
    /// What items name.
    pub pictures: Pictures,
    items: Vec<(Item, Rows)>,
    /// Number of items up to the end of each frame.
    ends: Vec<usize>,
}

impl Show {
    /// A film of no frames yet; width and height are even.
    ///
    /// # Errors
    /// The size is not that of a frame.
    pub fn new(width: usize, height: usize, moonlight: u16) -> Result<Self, String> {
        let is_even = width % 2 + height % 2 == 0;
        if !is_even || width == 0 || height == 0 || width.max(height) > 1 << 14 {
            return Err(format!(
                "frame: expected an even size, got {width} x {height}"
            ));
        }
        Ok(Self {
            width,
            height,
            moonlight: moonlight.min(crate::OPAQUE),
            ..Self::default()
        })
    }

    /// Number of samples of a frame.
    #[must_use]
    pub fn num_samples(&self) -> usize {
        self.width * self.height * 3 / 2
    }

    /// Number of frames.
    #[must_use]
    pub fn num_frames(&self) -> usize {
        self.ends.len()
    }

    /// Says what is on all frames.
    ///
    /// # Errors
    /// An item is of no kind, names a picture that is not there or lies where it cannot be drawn, or the
    /// ends do not grow up to the number of items.
    pub fn play(&mut self, numbers: &[i32], ends: &[i64]) -> Result<(), String> {
        let items = numbers.chunks(ITEM_LENGTH).map(|item| self.item(item));
        self.items = items.collect::<Result<_, _>>()?;
        let ends: Vec<usize> = ends.iter().map(|&end| end as usize).collect();
        if !ends.is_sorted() || ends.last().is_some_and(|&end| end != self.items.len()) {
            return Err("ends: expected numbers that grow to that of the items".to_owned());
        }
        self.ends = ends;
        Ok(())
    }

    /// Draws a frame.
    ///
    /// # Panics
    /// There is no such frame, or the samples are not those of one.
    pub fn draw(&self, frame: usize, samples: &mut [u8]) {
        let first = if frame == 0 { 0 } else { self.ends[frame - 1] };
        let mut canvas = Frame::new(samples, self.width, self.height);
        let mut night = None;
        for (item, rows) in &self.items[first..self.ends[frame]] {
            self.draw_item(*item, *rows, &mut canvas, &mut night);
        }
    }

    fn draw_item(&self, item: Item, rows: Rows, frame: &mut Frame<'_>, night: &mut Option<Night>) {
        let pictures = &self.pictures;
        match item {
            Item::Tile {
                picture,
                at: (x, y),
                columns: (first, count),
            } => pictures.tiles[picture].paste(frame, x, y, first, count),
            Item::Sprite {
                picture,
                at: (x, y),
            } => {
                pictures.sprites[picture].blend(frame, x, y, rows);
            }
            Item::Texture { picture, place } => {
                pictures.textures[picture].blend(frame, place, rows);
            }
            Item::Veil { picture, first } => pictures.veils[picture].lay(frame, first, rows),
            Item::Light {
                picture,
                at: (x, y),
            } => night
                .get_or_insert_with(|| Night::new(self.width, rows, self.moonlight))
                .shine(&pictures.lights[picture], x, y),
            Item::Night { veil, first } => {
                let veil = veil.map(|veil| (pictures.veils[veil].as_ref(), first));
                let dark = night
                    .take()
                    .unwrap_or_else(|| Night::new(self.width, rows, self.moonlight));
                dark.lay(frame, veil);
            }
            Item::Streaks { picture } => pictures.streaks[picture].lay(frame, rows),
        }
    }

    /// An item from its numbers.
    fn item(&self, numbers: &[i32]) -> Result<(Item, Rows), String> {
        let &[kind, picture, x, y, a, b, top, bottom] = numbers else {
            return Err(format!("items: expected {ITEM_LENGTH} numbers each"));
        };
        let rows = Rows { top, bottom };
        let is_inside = 0 <= top && top <= bottom && bottom as usize <= self.height;
        let is_even = (top | bottom) % 2 == 0;
        let kind = usize::try_from(kind).unwrap_or(KINDS.len());
        let count = self.count(kind);
        let is_dark = KINDS.get(kind) == Some(&"night") && picture == NONE;
        let is_there = is_dark || usize::try_from(picture).is_ok_and(|one| one < count);
        let item = self.made(kind, [picture, x, y, a, b], rows);
        match item {
            Some(item) if is_inside && is_even && is_there => Ok((item, rows)),
            _ => Err(format!(
                "items: expected something to draw, got {numbers:?}"
            )),
        }
    }

    /// How many pictures there are for items of a kind.
    fn count(&self, kind: usize) -> usize {
        let pictures = &self.pictures;
        match KINDS.get(kind) {
            Some(&"tile") => pictures.tiles.len(),
            Some(&"sprite") => pictures.sprites.len(),
            Some(&"texture") => pictures.textures.len(),
            Some(&("veil" | "night")) => pictures.veils.len(),
            Some(&"light") => pictures.lights.len(),
            Some(&"streaks") => pictures.streaks.len(),
            _ => 0,
        }
    }

    /// An item of a kind, if its picture lies where it can be drawn.
    fn made(&self, kind: usize, [picture, x, y, a, b]: [i32; 5], rows: Rows) -> Option<Item> {
        const FAR: u32 = 1 << 24;
        if [x, y, a, b].iter().any(|one| one.unsigned_abs() >= FAR) {
            return None;
        }
        let number = usize::try_from(picture);
        let item = match *KINDS.get(kind)? {
            "tile" => self.tile(number.ok()?, [x, y, a, b])?,
            "sprite" => Item::Sprite {
                picture: number.ok()?,
                at: even(x, y)?,
            },
            "texture" => Item::Texture {
                picture: number.ok()?,
                place: Place {
                    x,
                    y,
                    cosine: a,
                    sine: b,
                },
            },
            "veil" => {
                let picture = number.ok()?;
                Item::Veil {
                    picture,
                    first: self.veiled(picture, a)?,
                }
            }
            "light" => Item::Light {
                picture: number.ok()?,
                at: (x, y),
            },
            "night" => {
                let veil = number.ok();
                let first = veil.map_or(Some(0), |veil| self.veiled(veil, a))?;
                Item::Night { veil, first }
            }
            _ => {
                let picture = number.ok()?;
                let height = (rows.bottom - rows.top).max(0) as usize;
                let is_whole = self.pictures.streaks.get(picture)?.len() >= height * self.width;
                return is_whole.then_some(Item::Streaks { picture });
            }
        };
        Some(item)
    }

    fn tile(&self, picture: usize, place: [i32; 4]) -> Option<Item> {
        let (width, height) = self.pictures.tiles.get(picture)?.size();
        let is_even = place.iter().all(|one| one % 2 == 0);
        let [x, y, first, count] = place.map(|one| usize::try_from(one).ok());
        let (x, y, first, count) = (x?, y?, first?, count?);
        let fits = x + count <= self.width && y + height <= self.height && first + count <= width;
        (is_even && fits).then_some(Item::Tile {
            picture,
            at: (x, y),
            columns: (first, count),
        })
    }

    /// First column of a veil, if it reaches as far as a frame from there.
    fn veiled(&self, picture: usize, first: i32) -> Option<usize> {
        let first = usize::try_from(first).ok()?;
        let width = self.pictures.veils.get(picture)?.width();
        (first % 2 == 0 && first + self.width <= width).then_some(first)
    }
}

fn even(x: i32, y: i32) -> Option<(i32, i32)> {
    (x % 2 == 0 && y % 2 == 0).then_some((x, y))
}
