//! Signatures as text, spaced as rustfmt spaces them on one line.

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

const JOINED: [&str; 6] = ["::", "->", "=>", "..", "==", "&&"];

/// The tokens of a signature on one line.
pub(super) fn text(tokens: TokenStream) -> String {
    let mut parts = Vec::new();
    flatten(tokens, &mut parts);
    let mut text = String::new();
    for (at, part) in parts.iter().enumerate() {
        if at > 0 && is_spaced(parts.get(at.wrapping_sub(2)).map_or("", String::as_str), &parts[at - 1], part) {
            text.push(' ');
        }
        text.push_str(part);
    }
    text.replace(",)", ")").replace(",>", ">")
}

fn flatten(tokens: TokenStream, parts: &mut Vec<String>) {
    let mut joint = false;
    for token in tokens {
        let was_joint = std::mem::take(&mut joint);
        match token {
            TokenTree::Punct(punct) => {
                let last = parts.last_mut().filter(|_| was_joint);
                match last {
                    Some(last) if JOINED.contains(&&*format!("{last}{}", punct.as_char())) => {
                        last.push(punct.as_char())
                    }
                    _ => parts.push(punct.as_char().to_string()),
                }
                joint = punct.spacing() == Spacing::Joint;
            }
            TokenTree::Ident(ident) => match parts.last_mut() {
                Some(last) if last == "'" => last.push_str(&ident.to_string()),
                _ => parts.push(ident.to_string()),
            },
            TokenTree::Literal(literal) => parts.push(literal.to_string()),
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::None => ("", ""),
                };
                parts.push(open.to_owned());
                flatten(group.stream(), parts);
                parts.push(close.to_owned());
            }
        }
    }
    parts.retain(|part| !part.is_empty());
}

/// Whether a space stands between two tokens.
fn is_spaced(before: &str, left: &str, right: &str) -> bool {
    let is_word = |part: &str| part.starts_with(|letter: char| letter.is_alphanumeric() || letter == '_');
    let is_keyword = ["dyn", "mut", "as", "in", "where", "impl", "const", "pub", "return"].contains(&left);
    match (left, right) {
        ("(" | "[" | "<" | "::" | "!" | "?" | "." | "#" | "&&" | "..", _) => false,
        // A reference or a pointer, not an operator between two values.
        ("&" | "*", _) => is_word(before) && !["mut", "dyn", "in", "as"].contains(&before),
        (_, "," | ";" | ")" | "]" | ">" | ":" | "::" | "." | "!" | "..") => left == "{",
        (_, "<") => !(is_word(left) || left == "::") || left == "as",
        (_, "(") => !(is_word(left) || left == ">") || is_keyword,
        _ => true,
    }
}

mod tests {
    #[test]
    fn signatures_are_spaced_like_code() {
        for signature in [
            "fn f<'a, T: ?Sized + 'a>(x: &'a mut T, y: *const u8) -> Result<Vec<T>, Box<dyn Error + Send>>",
            "fn g(self: Box<Self>, f: impl Fn(&str, [u8; 3]) -> (u8, u8)) where Self: Sized",
            "fn h(range: std::ops::RangeInclusive<u64>, many: &[&str]) -> impl Iterator<Item = (u64, f32)> + '_",
            "fn i<const N: usize>(x: &dyn for<'b> Fn(&'b u8) -> &'b u8) -> Option<<T as Iterator>::Item>",
            "const unsafe fn j(x: fn(u8) -> bool, y: &'static [f32])",
        ] {
            assert_eq!(super::text(signature.parse().unwrap()), signature);
        }
    }
}
