//! What all parts of a contact sheet agree on: its colours, and the seam around slices.

/// Pixels around every slice of a panel; neighbours share theirs.
pub(super) const SEAM: u32 = 1;

/// The colours of a contact sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Theme {
    /// Light grey, for paper and web pages.
    #[default]
    Light,
    /// Dark grey, for screens and bright textures.
    Dark,
}
