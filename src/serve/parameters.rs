//! Parameters that several routes and forms share.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use super::options::ServerOptions;
use super::problem::Problem;
use crate::volume::{Intensity, IntensityError, ReadOptions};
use crate::{ParseTagFilterError, TagFilter};

/// The sides that a block may have, in voxels.
pub(crate) const BLOCK_SIDES: RangeInclusive<usize> = 3..=4096;

/// A filter as `KEY=VALUE`, split at the first `=`. The value may be empty.
pub(crate) fn tag_filter(text: &str) -> Result<TagFilter, Problem> {
    text.parse().map_err(|error: ParseTagFilterError| Problem::bad_request(error.to_string()))
}

/// A tag as `KEY=VALUE`, neither side empty.
pub(crate) fn tag(text: &str) -> Result<(String, String), Problem> {
    let filter = tag_filter(text)?;
    check_tag(filter.key(), filter.value())?;
    Ok((filter.key().to_owned(), filter.value().to_owned()))
}

/// Refuses tags with an empty key or value.
pub(crate) fn check_tags(tags: &BTreeMap<String, String>) -> Result<(), Problem> {
    tags.iter().try_for_each(|(key, value)| check_tag(key, value))
}

fn check_tag(key: &str, value: &str) -> Result<(), Problem> {
    if key.is_empty() || value.is_empty() {
        let (key, value) = (key.escape_debug(), value.escape_debug());
        return Err(Problem::bad_request(format!("a tag needs a key and a value (got '{key}={value}')")));
    }
    Ok(())
}

/// A rule that maps samples to 256 levels.
pub(crate) fn intensity(text: &str) -> Result<Intensity, Problem> {
    text.parse().map_err(|error: IntensityError| Problem::bad_request(error.to_string()))
}

/// The side of a block as text.
pub(crate) fn block_side(text: &str) -> Result<usize, Problem> {
    text.parse().map_err(|_| bad_block_side(&text.escape_debug().to_string())).and_then(check_block_side)
}

/// Refuses sides that no block may have.
pub(crate) fn check_block_side(side: usize) -> Result<usize, Problem> {
    if BLOCK_SIDES.contains(&side) { Ok(side) } else { Err(bad_block_side(&side.to_string())) }
}

fn bad_block_side(found: &str) -> Problem {
    let (least, most) = BLOCK_SIDES.into_inner();
    Problem::bad_request(format!("the side of a block must be {least} to {most} voxels (got {found})"))
}

/// How untrusted files are read: with the limits of the server.
pub(crate) fn read_options(options: &ServerOptions) -> ReadOptions {
    let &ServerOptions { max_voxels, max_inflated, .. } = options;
    ReadOptions::new().max_voxels(max_voxels).max_inflated(max_inflated)
}
