//! Frames against their definitions, sample by sample.

use std::sync::Arc;

use overtaking_pictures::{
    Frame, Light, Night, ONE, Pictures, Place, Raster, Rows, Show, Sprite, Streaks, Texture, Tile,
    Veil,
};

const WIDTH: usize = 32;
const HEIGHT: usize = 16;
const ALL: Rows = Rows {
    top: 0,
    bottom: HEIGHT as i32,
};

fn samples(luma: u8) -> Vec<u8> {
    vec![luma; WIDTH * HEIGHT * 3 / 2]
}

/// A sprite whose luma counts from 1, and that lets `keep` of 256 shine through.
fn sprite(width: usize, height: usize, keep: u16) -> Sprite {
    let full = width * height;
    let counted = |size: usize| (1..=size as u16).map(|one| one % 200).collect::<Vec<_>>();
    let luma = [counted(full), vec![keep; full]].concat();
    let chroma = [counted(full / 4), counted(full / 4), vec![keep; full / 4]].concat();
    let rasters = (
        Raster::new(width, height, &luma).unwrap(),
        Raster::new(width / 2, height / 2, &chroma).unwrap(),
    );
    Sprite::new(rasters.0, rasters.1).unwrap()
}

#[test]
fn a_sprite_lets_its_share_of_what_is_below_shine_through() {
    let mut below = samples(100);
    sprite(4, 4, 64).blend(&mut Frame::new(&mut below, WIDTH, HEIGHT), 6, 2, ALL);
    assert_eq!(below[2 * WIDTH + 6..2 * WIDTH + 10], [26, 27, 28, 29]); // 100 x 64 / 256 = 25.
    let chroma = WIDTH * HEIGHT;
    assert_eq!(
        below[chroma + WIDTH / 2 + 3..chroma + WIDTH / 2 + 5],
        [26, 27]
    );
}

#[test]
fn rows_that_may_not_be_drawn_on_stay_as_they_are() {
    let mut below = samples(100);
    let rows = Rows { top: 4, bottom: 8 };
    sprite(8, 16, 0).blend(&mut Frame::new(&mut below, WIDTH, HEIGHT), 0, 0, rows);
    let changed = (0..HEIGHT).filter(|row| below[row * WIDTH] != 100);
    assert_eq!(changed.collect::<Vec<_>>(), [4, 5, 6, 7]);
}

#[test]
fn a_texture_of_one_texel_to_the_pixel_that_is_not_turned_is_a_sprite() {
    let (mut one, mut other) = (samples(100), samples(100));
    sprite(8, 8, 32).blend(&mut Frame::new(&mut one, WIDTH, HEIGHT), 10, 4, ALL);
    let texture = Texture::new(&sprite(8, 8, 32), (0, 0), 1).unwrap();
    let place = Place {
        x: 10,
        y: 4,
        cosine: ONE as i32,
        sine: 0,
    };
    texture.blend(&mut Frame::new(&mut other, WIDTH, HEIGHT), place, ALL);
    assert_eq!(one, other);
}

#[test]
fn a_quarter_turn_anticlockwise_puts_columns_where_rows_were() {
    let mut drawn = samples(0);
    // Its origin is the corner in the middle, so that the turned sheet covers the same pixels.
    let texture = Texture::new(&sprite(8, 8, 0), (8, 8), 1).unwrap();
    let place = Place {
        x: 16,
        y: 8,
        cosine: 0,
        sine: ONE as i32,
    };
    texture.blend(&mut Frame::new(&mut drawn, WIDTH, HEIGHT), place, ALL);
    for row in 0..8 {
        for column in 0..8 {
            let meant = 1 + row + 8 * column; // What was on the right is now above.
            let got = drawn[(4 + 7 - row) * WIDTH + 12 + column];
            assert_eq!(usize::from(got), meant, "{row} {column}");
        }
    }
}

/// What a texture shows by its definition: the texel below the middle of a pixel, if there is one.
fn below(pixel: (i64, i64), place: Place, origin: (i64, i64), fine: i64) -> (i64, i64) {
    let half = |pixel: i64, place: i32| 2 * fine * pixel + fine - 2 * i64::from(place);
    let (right, down) = (half(pixel.0, place.x), half(pixel.1, place.y));
    let (cosine, sine) = (i64::from(place.cosine), i64::from(place.sine));
    let column = right * cosine - down * sine + origin.0 * ONE;
    let row = right * sine + down * cosine + origin.1 * ONE;
    ((column >> 1) >> 16, (row >> 1) >> 16)
}

#[test]
fn a_pixel_shows_the_texel_below_its_middle_whatever_the_place_and_the_angle() {
    let (width, height) = (20_usize, 12_usize);
    // Transparent at the upper left, so that not all of the sheet is kept.
    let is_there = |column: usize, row: usize| column > 4 && row > 2 || column == 9;
    let texels = (0..width * height).map(|at| (at % width, at / width));
    let keep: Vec<u16> = texels
        .map(|(column, row)| 256 * u16::from(!is_there(column, row)))
        .collect();
    let colour: Vec<u16> = (0..240)
        .map(|at| {
            if keep[at] == 0 {
                at as u16 % 200 + 10
            } else {
                0
            }
        })
        .collect();
    let half = [vec![0; width * height / 2], vec![256; width * height / 4]].concat();
    let rasters = (
        Raster::new(width, height, &[colour.clone(), keep.clone()].concat()).unwrap(),
        Raster::new(width / 2, height / 2, &half).unwrap(),
    );
    let sheet = Sprite::new(rasters.0, rasters.1).unwrap();
    let origin = (13, 9);
    for fine in [1, 2, 4] {
        let texture = Texture::new(&sheet, origin, fine).unwrap();
        for degrees in (-180..180).step_by(3) {
            let (sine, cosine) = f64::from(degrees).to_radians().sin_cos();
            let fixed = |value: f64| (value * ONE as f64).round() as i32;
            let (cosine, sine) = (fixed(cosine), fixed(sine));
            for (x, y) in [(16, 8), (17, 7), (1, 2), (31, 14)] {
                let texels = fine as i32;
                let (x, y) = (x * texels + degrees % texels, y * texels);
                let place = Place { x, y, cosine, sine };
                let mut drawn = samples(5);
                texture.blend(&mut Frame::new(&mut drawn, WIDTH, HEIGHT), place, ALL);
                for at in 0..WIDTH * HEIGHT {
                    let pixel = ((at % WIDTH) as i64, (at / WIDTH) as i64);
                    let (column, row) = below(pixel, place, origin, fine);
                    let is_inside = (0..20).contains(&column) && (0..12).contains(&row);
                    let texel = if is_inside {
                        (row * 20 + column) as usize
                    } else {
                        0
                    };
                    let meant = if keep[texel] == 0 { colour[texel] } else { 5 };
                    assert_eq!(u16::from(drawn[at]), meant, "{fine} {place:?} {pixel:?}");
                }
            }
        }
    }
}

#[test]
fn a_texture_at_any_angle_draws_nothing_outside_of_its_circle() {
    for degrees in (-180..180).step_by(7) {
        let (sine, cosine) = f64::from(degrees).to_radians().sin_cos();
        let fixed = |value: f64| (value * ONE as f64).round() as i32;
        let texture = Texture::new(&sprite(8, 4, 0), (8 * 4, 4 * 4), 4).unwrap();
        let mut drawn = samples(0);
        let place = Place {
            x: 64,
            y: 32,
            cosine: fixed(cosine),
            sine: fixed(sine),
        };
        texture.blend(&mut Frame::new(&mut drawn, WIDTH, HEIGHT), place, ALL);
        let lit = (0..WIDTH * HEIGHT).filter(|&at| drawn[at] > 0);
        for at in lit {
            let (x, y) = (
                (at % WIDTH) as f64 + 0.5 - 16.0,
                (at / WIDTH) as f64 + 0.5 - 8.0,
            );
            assert!(x.hypot(y) <= 4.5, "{degrees} degrees: {x} {y}");
        }
    }
}

#[test]
fn night_is_the_light_times_the_day_whatever_the_veil() {
    let light = Light::new(4, vec![100; 16]).unwrap();
    let veil = Veil::new(&[128; 2 * WIDTH], [200, 128, 128]).unwrap();
    for (fog, lit, dark) in [
        (None, 192 * 160 / 256, 92 * 160 / 256),
        (Some(&veil), 160, 128),
    ] {
        let mut night = Night::new(WIDTH, ALL, 92);
        night.shine(&light, 2, 2);
        let mut below = samples(160);
        night.lay(
            &mut Frame::new(&mut below, WIDTH, HEIGHT),
            fog.map(|fog| (fog, 0)),
        );
        assert_eq!(i32::from(below[6 * WIDTH + 6]), lit);
        assert_eq!(i32::from(below[0]), dark);
    }
}

#[test]
fn full_light_through_clear_air_changes_nothing() {
    let mut night = Night::new(WIDTH, ALL, 92);
    let day = Light::new(WIDTH / 2, vec![256; WIDTH / 2 * HEIGHT / 2]).unwrap();
    night.shine(&day, 0, 0);
    let veil = Veil::new(&[256; WIDTH], [200, 10, 240]).unwrap();
    for value in 0..=255 {
        let mut below = samples(value);
        night.lay(&mut Frame::new(&mut below, WIDTH, HEIGHT), Some((&veil, 0)));
        assert_eq!(below, samples(value));
    }
}

/// A film with one picture of each kind.
fn show() -> Show {
    let mut show = Show::new(WIDTH, HEIGHT, 92).unwrap();
    show.pictures = Pictures {
        tiles: vec![Arc::new(Tile::new(8, 4, &[50; 32], &[60; 16]).unwrap())],
        sprites: vec![Arc::new(sprite(4, 4, 0))],
        textures: vec![Arc::new(Texture::new(&sprite(8, 8, 0), (0, 0), 1).unwrap())],
        veils: vec![Arc::new(Veil::new(&[128; WIDTH], [200, 128, 128]).unwrap())],
        lights: vec![Arc::new(Light::new(4, vec![100; 16]).unwrap())],
        streaks: vec![Arc::new(Streaks::new(vec![0; WIDTH * HEIGHT]))],
    };
    show
}

#[test]
fn what_is_later_in_the_list_lies_above() {
    let (tile, sprite) = ([0, 0, 4, 4, 0, 8, 0, 16], [1, 0, 4, 4, 0, 0, 0, 16]);
    for (items, top) in [([tile, sprite], 1), ([sprite, tile], 50)] {
        let (mut show, mut drawn) = (show(), samples(0));
        show.play(&items.concat(), &[2]).unwrap();
        show.draw(0, &mut drawn);
        assert_eq!(drawn[4 * WIDTH + 4], top);
    }
}

#[test]
fn a_frame_has_the_items_up_to_its_end_and_no_others() {
    let mut show = show();
    let items = [[0, 0, 0, 0, 0, 8, 0, 16], [0, 0, 24, 12, 0, 8, 0, 16]];
    show.play(&items.concat(), &[1, 1, 2]).unwrap();
    for (frame, places) in [(0, [50, 0]), (1, [0, 0]), (2, [0, 50])] {
        let mut drawn = samples(0);
        show.draw(frame, &mut drawn);
        assert_eq!([drawn[0], drawn[12 * WIDTH + 24]], places);
    }
}

#[test]
fn items_that_cannot_be_drawn_are_refused() {
    for item in [
        [7, 0, 0, 0, 0, 0, 0, 16], // No such kind.
        [-1, 0, 0, 0, 0, 0, 0, 16],
        [1, 1, 0, 0, 0, 0, 0, 16], // No such picture.
        [1, -1, 0, 0, 0, 0, 0, 16],
        [1, 0, 1, 0, 0, 0, 0, 16],       // An odd place.
        [1, 0, 1 << 30, 0, 0, 0, 0, 16], // Far away.
        [1, 0, i32::MIN, 0, 0, 0, 0, 16],
        [1, 0, 0, 0, 0, 0, 0, 18], // Rows that the frame does not have.
        [1, 0, 0, 0, 0, 0, -2, 16],
        [1, 0, 0, 0, 0, 0, 8, 6],
        [0, 0, 26, 0, 0, 8, 0, 16], // A tile that is not wholly inside.
        [0, 0, 0, 14, 0, 8, 0, 16],
        [0, 0, 0, 0, 2, 8, 0, 16], // Columns that it does not have.
        [0, 0, -2, 0, 0, 8, 0, 16],
        [3, 0, 0, 0, 2, 0, 0, 16], // A veil that ends within the frame.
        [5, 0, 0, 0, 2, 0, 0, 16],
        [5, 1, 0, 0, 0, 0, 0, 16],
    ] {
        assert!(show().play(&item, &[1]).is_err(), "{item:?}");
    }
    assert!(show().play(&[1, 0, 0, 0, 0, 0, 0, 16], &[2]).is_err());
    assert!(show().play(&[1, 0, 0, 0, 0, 0, 0, 16, 1], &[1]).is_err());
}
