//! Natural order of names: `s9` before `s10`.
//!
//! A name is read as a sequence of numbers (runs of ASCII digits, of any length) and single bytes. Numbers compare by
//! value, bytes by value; names that read the same (`s1` and `s01`) compare bytewise, so that the order is total and
//! only equal names are equal. Names that are not UTF-8 have an order like any other.

use std::cmp::Ordering;
use std::ffi::OsStr;

/// Compares two names in natural order: a total order in which `s10` comes after `s9`.
///
/// Letters are compared as they are, capitals first. A name whose number has fewer leading zeros comes later than one
/// that has more (`s01` before `s1`), as in plain byte order.
///
/// ```
/// use hlacdb_volume::natural_cmp;
/// let mut names = ["s10.png", "s9.png", "s1.png"];
/// names.sort_by(|a, b| natural_cmp(a.as_ref(), b.as_ref()));
/// assert_eq!(names, ["s1.png", "s9.png", "s10.png"]);
/// ```
pub fn natural_cmp(a: &OsStr, b: &OsStr) -> Ordering {
    let (a, b) = (a.as_encoded_bytes(), b.as_encoded_bytes());
    tokens(a).cmp(tokens(b)).then_with(|| a.cmp(b))
}

/// One step of a name. A number never equals a byte, as digits are never bytes of their own.
#[derive(PartialEq, Eq)]
enum Token<'a> {
    /// A run of digits without its leading zeros.
    Number(&'a [u8]),
    /// Any byte that is not a digit.
    Byte(u8),
}

impl Ord for Token<'_> {
    fn cmp(&self, other: &Self) -> Ordering {
        match (self, other) {
            (Token::Number(a), Token::Number(b)) => a.len().cmp(&b.len()).then_with(|| a.cmp(b)),
            (Token::Byte(a), Token::Byte(b)) => a.cmp(b),
            // All digits are on the same side of any other byte.
            (Token::Number(_), Token::Byte(b)) => b'0'.cmp(b),
            (Token::Byte(a), Token::Number(_)) => a.cmp(&b'0'),
        }
    }
}

impl PartialOrd for Token<'_> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

fn tokens(name: &[u8]) -> impl Iterator<Item = Token<'_>> {
    let mut rest = name;
    std::iter::from_fn(move || {
        let (&first, tail) = rest.split_first()?;
        if !first.is_ascii_digit() {
            rest = tail;
            return Some(Token::Byte(first));
        }
        let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let (number, tail) = rest.split_at(digits);
        rest = tail;
        let zeros = number.iter().take_while(|&&digit| digit == b'0').count();
        Some(Token::Number(number.split_at(zeros).1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sorted(names: &[&str]) -> Vec<String> {
        let mut names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        names.sort_by(|a, b| natural_cmp(a.as_ref(), b.as_ref()));
        names
    }

    #[test]
    fn numbers_compare_by_value() {
        let expected = ["a", "a1", "a2", "a02b", "a2c", "a10", "a10b2", "a10b10", "a99999999999999999999999", "b"];
        assert_eq!(
            sorted(&["b", "a10b10", "a2c", "a10", "a99999999999999999999999", "a02b", "a", "a10b2", "a2", "a1"]),
            expected
        );
    }

    #[test]
    fn leading_zeros_only_break_ties() {
        assert_eq!(sorted(&["s1", "s001", "s01", "s2", "s0"]), ["s0", "s001", "s01", "s1", "s2"]);
    }

    #[test]
    fn digits_keep_their_place_in_ascii() {
        assert_eq!(sorted(&["s_", "s1", "s-1", "s.", "sA", "s"]), ["s", "s-1", "s.", "s1", "sA", "s_"]);
    }

    #[cfg(unix)]
    fn name(bytes: &[u8]) -> &OsStr {
        std::os::unix::ffi::OsStrExt::from_bytes(bytes)
    }

    #[cfg(unix)]
    proptest! {
        #![proptest_config(hlacdb_testing::cases(128))]
        // Few distinct bytes, so that equal prefixes and equal numbers are frequent; 0xff is never UTF-8.
        #[test]
        fn the_order_is_total(names in prop::collection::vec(prop::collection::vec(prop::sample::select(b"019aZ.\xff".to_vec()), 0..7), 3)) {
            let [a, b, c] = [name(&names[0]), name(&names[1]), name(&names[2])];
            prop_assert_eq!(natural_cmp(a, b), natural_cmp(b, a).reverse());
            prop_assert_eq!(natural_cmp(a, b) == Ordering::Equal, a == b);
            if natural_cmp(a, b).is_le() && natural_cmp(b, c).is_le() {
                prop_assert!(natural_cmp(a, c).is_le());
            }
        }

        #[test]
        fn plain_numbers_order_as_integers(a in any::<u64>(), b in any::<u64>()) {
            let (x, y) = (format!("s{a}.png"), format!("s{b}.png"));
            prop_assert_eq!(natural_cmp(x.as_ref(), y.as_ref()), a.cmp(&b));
        }
    }
}
