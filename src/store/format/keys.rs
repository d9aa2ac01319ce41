//! Keys that begin with a name, and the key bytes that checksums cover.

/// The longest name of statistics or a space, and the longest key of a tag, in bytes.
pub const MAX_NAME: usize = 255;
/// The longest value of a tag, in bytes.
pub const MAX_TAG_VALUE: usize = 4096;

/// `name 0`: the beginning of every key that belongs to `name`. Names contain no NUL.
pub(crate) fn prefix(name: &str) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(name.len() + 16);
    bytes.extend_from_slice(name.as_bytes());
    bytes.push(0);
    bytes
}

/// The smallest key above all keys that begin with `prefix`; `None` if there is none.
pub(crate) fn after(prefix: &[u8]) -> Option<Vec<u8>> {
    let mut end = prefix.to_vec();
    while let Some(last) = end.last_mut() {
        if *last < u8::MAX {
            *last += 1;
            return Some(end);
        }
        end.pop();
    }
    None
}

/// The key bytes of (id, n) in `chunks`: the engine stores the integers of a tuple one after the other.
pub(crate) fn chunk(id: u64, n: u32) -> [u8; 12] {
    let mut bytes = [0; 12];
    for (byte, value) in bytes.iter_mut().zip(id.to_le_bytes().into_iter().chain(n.to_le_bytes())) {
        *byte = value;
    }
    bytes
}

/// The key bytes of (view, block) in `descriptors`.
pub(crate) fn descriptors(view: u8, block: u32) -> [u8; 5] {
    let [b0, b1, b2, b3] = block.to_le_bytes();
    [view, b0, b1, b2, b3]
}

#[cfg(test)]
mod tests {
    use redb::{Key, Value};

    use super::*;

    #[test]
    fn checksummed_keys_are_the_bytes_that_the_engine_stores() {
        assert_eq!(chunk(7, 2), [7, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!(<(u64, u32)>::as_bytes(&(7, 2)), chunk(7, 2));
        assert_eq!(<(u8, u32)>::as_bytes(&(3, 258)), descriptors(3, 258));
        assert_eq!(<(u64, u32)>::fixed_width(), Some(12));
        assert!(<(u64, u32)>::compare(&chunk(255, 1), &chunk(256, 0)).is_lt());
    }

    #[test]
    fn the_key_after_a_prefix_is_above_all_that_begin_with_it() {
        assert_eq!(prefix("default"), b"default\0");
        assert_eq!(after(b"a\xFF\xFF"), Some(b"b".to_vec()));
        assert_eq!(after(b"\xFF"), None);
    }
}
