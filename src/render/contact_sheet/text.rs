//! Typefaces of a contact sheet, and lines of text shortened to fit.

use embedded_graphics::mono_font::MonoFont;
use embedded_graphics::mono_font::iso_8859_1::{
    FONT_6X13, FONT_6X13_BOLD, FONT_8X13, FONT_8X13_BOLD, FONT_9X18, FONT_9X18_BOLD, FONT_10X20,
};

/// A typeface. All characters of one have the same width.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Face {
    Title,
    Large,
    LargeBold,
    Medium,
    MediumBold,
    Small,
    SmallBold,
}

impl Face {
    /// The typeface for captions of a panel of this inner width.
    pub(super) fn for_width(pixels: u32) -> Self {
        match pixels {
            ..240 => Self::Small,
            240..400 => Self::Medium,
            _ => Self::Large,
        }
    }

    pub(super) fn bold(self) -> Self {
        match self {
            Self::Large => Self::LargeBold,
            Self::Medium => Self::MediumBold,
            Self::Small => Self::SmallBold,
            other => other,
        }
    }

    pub(super) fn font(self) -> &'static MonoFont<'static> {
        match self {
            Self::Title => &FONT_10X20,
            Self::Large => &FONT_9X18,
            Self::LargeBold => &FONT_9X18_BOLD,
            Self::Medium => &FONT_8X13,
            Self::MediumBold => &FONT_8X13_BOLD,
            Self::Small => &FONT_6X13,
            Self::SmallBold => &FONT_6X13_BOLD,
        }
    }

    /// Pixels from one line to the next.
    pub(super) fn line(self) -> u32 {
        self.font().character_size.height + 2
    }

    /// The width of a text, in pixels.
    pub(super) fn width(self, characters: usize) -> u32 {
        u32::try_from(characters).unwrap_or(u32::MAX).saturating_mul(self.font().character_size.width)
    }

    /// The line as it is drawn in at most `pixels` pixels.
    pub(super) fn fit(self, line: &str, pixels: u32) -> String {
        shorten(&printable(line), (pixels / self.font().character_size.width) as usize)
    }
}

/// The line with `?` for every character that the typefaces lack.
fn printable(line: &str) -> String {
    line.chars().map(|c| if matches!(c, ' '..='~' | '\u{a0}'..='\u{ff}') { c } else { '?' }).collect()
}

/// A line of at most `max` characters: the middle of a longer one is replaced by `...`.
fn shorten(line: &str, max: usize) -> String {
    let characters: Vec<char> = line.chars().collect();
    if characters.len() <= max {
        return line.into();
    }
    let Some(kept) = max.checked_sub(3) else { return ".".repeat(max) };
    let (head, tail) = (kept.div_ceil(2), kept / 2);
    let ends = characters.iter().take(head).chain(&['.'; 3]).chain(characters.iter().skip(characters.len() - tail));
    ends.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_lose_their_middle() {
        assert_eq!(shorten("marble-0012", 11), "marble-0012");
        assert_eq!(shorten("marble-0012", 10), "marb...012");
        assert_eq!(shorten("marble-0012", 4), "m...");
        assert_eq!(shorten("marble-0012", 3), "...");
        assert_eq!(shorten("marble-0012", 2), "..");
        assert_eq!(shorten("äöü", 3), "äöü");
        assert_eq!(Face::Small.fit("marble-0012", 60), "marb...012");
    }

    #[test]
    fn missing_characters_become_question_marks() {
        assert_eq!(printable("Sandstein (grün) 大理石\n\u{7f}"), "Sandstein (grün) ?????");
    }
}
