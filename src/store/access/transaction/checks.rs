//! Checks of what a caller wants to store.

use crate::hlac::MASK_COUNT;
use crate::store::error::StoreError;
use crate::store::format::descriptors::ViewCode;
use crate::store::format::keys::{MAX_NAME, MAX_TAG_VALUE};

/// Checks the name of statistics or a space.
pub(crate) fn check_name(name: &str) -> Result<(), StoreError> {
    if name.is_empty() || name.len() > MAX_NAME || name.contains('\0') {
        let name = name.escape_debug();
        let what = format!("\"{name}\" is not a valid name: names have 1 to {MAX_NAME} bytes and no NUL");
        return Err(StoreError::invalid(what));
    }
    Ok(())
}

/// Checks a tag.
pub(crate) fn check_tag(key: &str, value: &str) -> Result<(), StoreError> {
    if key.is_empty() || key.len() > MAX_NAME || key.contains('\0') {
        let key = key.escape_debug();
        let what = format!("\"{key}\" is not a valid tag key: keys have 1 to {MAX_NAME} bytes and no NUL");
        return Err(StoreError::invalid(what));
    }
    if value.len() > MAX_TAG_VALUE || value.contains('\0') {
        let key = key.escape_debug();
        let what = format!("the value of tag {key} is not valid: values have at most {MAX_TAG_VALUE} bytes and no NUL");
        return Err(StoreError::invalid(what));
    }
    Ok(())
}

/// Checks the moments of one texture: all finite, each view once.
pub(crate) fn check_descriptors(descriptors: &[(ViewCode, [f32; MASK_COUNT])]) -> Result<(), StoreError> {
    for (number, (view, moments)) in descriptors.iter().enumerate() {
        if let Some(mask) = moments.iter().position(|moment| !moment.is_finite()) {
            return Err(StoreError::invalid(format!("moment {mask} of view {} is not finite", view.0)));
        }
        if descriptors.iter().take(number).any(|(other, _)| other == view) {
            return Err(StoreError::invalid(format!("view {} is given twice", view.0)));
        }
    }
    Ok(())
}
