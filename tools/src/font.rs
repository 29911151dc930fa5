//! Text as pixels, from the 8x8 bitmap font of the `font8x8` crate.

use font8x8::{BASIC_FONTS, LATIN_FONTS, UnicodeFonts};

/// Rows and columns of one character, px.
pub const GLYPH_PX: u32 = 8;

/// Calls `plot(x, y)` for every lit pixel of `text`, set from (0, 0) to the right without line breaks. A character
/// that the font lacks becomes a question mark.
pub fn draw(text: &str, mut plot: impl FnMut(u32, u32)) {
    for (place, character) in (0u32..).zip(text.chars()) {
        let known = BASIC_FONTS.get(character).or_else(|| LATIN_FONTS.get(character));
        let rows = known.or_else(|| BASIC_FONTS.get('?')).unwrap_or_default();
        for (y, row) in (0u32..).zip(rows) {
            // The lowest bit is the leftmost pixel.
            (0..GLYPH_PX).filter(|x| row >> x & 1 == 1).for_each(|x| plot(place * GLYPH_PX + x, y));
        }
    }
}

/// Width of a text, px.
pub fn width_px(text: &str) -> u32 {
    GLYPH_PX * u32::try_from(text.chars().count()).unwrap_or(u32::MAX / GLYPH_PX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lit(text: &str) -> Vec<(u32, u32)> {
        let mut pixels = Vec::new();
        draw(text, |x, y| pixels.push((x, y)));
        pixels
    }

    #[test]
    fn letters_stand_the_right_way_round() {
        // An L has its stem on the left and its foot at the bottom; mirrored or upside down it would not.
        let pixels = lit("L");
        let left = pixels.iter().filter(|p| p.0 < 4).count();
        assert!(2 * left > pixels.len(), "stem on the left");
        let below = pixels.iter().filter(|p| p.1 >= 4).count();
        assert!(2 * below > pixels.len(), "foot at the bottom");
    }

    #[test]
    fn unknown_characters_show_and_text_moves_right() {
        assert_eq!(lit("\u{4e16}"), lit("?"));
        let shifted: Vec<_> = lit("A").into_iter().map(|(x, y)| (x + GLYPH_PX, y)).collect();
        assert_eq!(lit(" A"), shifted);
        assert_eq!(width_px("rolling"), 56);
    }
}
