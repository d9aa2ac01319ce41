//! Random tokens.

use std::fmt::Write;
use std::io;

use rand::TryRng;
use rand::rngs::SysRng;

/// Random bytes in a token.
const BYTES: usize = 16;

/// A token that nobody can predict: 128 bits of the operating system's generator, as 32 hexadecimal digits.
pub(crate) fn random_token() -> io::Result<String> {
    let mut bytes = [0_u8; BYTES];
    SysRng.try_fill_bytes(&mut bytes).map_err(|error| io::Error::other(error.to_string()))?;
    let mut token = String::with_capacity(2 * BYTES);
    for byte in bytes {
        // Writing to a string does not fail.
        let _ = write!(token, "{byte:02x}");
    }
    Ok(token)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::path::Path;

    use super::*;

    #[test]
    fn tokens_are_32_hexadecimal_digits_and_differ() {
        let tokens: HashSet<String> = (0..1000).map(|_| random_token().unwrap()).collect();
        assert_eq!(tokens.len(), 1000);
        for token in &tokens {
            assert_eq!(token.len(), 32, "{token}");
            assert!(token.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f')), "{token}");
        }
        // All 128 positions vary; a generator that were stuck on one would fail here.
        for at in 0..32 {
            let digits: HashSet<u8> = tokens.iter().map(|token| token.as_bytes()[at]).collect();
            assert_eq!(digits.len(), 16, "digit {at}");
        }
    }

    /// Hashers of the standard library are keyed per process and promise nothing about their output.
    #[test]
    fn the_server_draws_no_token_from_a_hasher() {
        let forbidden = ["Random", "State"].concat();
        let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src/serve")];
        let mut files = 0;
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|extension| extension == "rs") {
                    files += 1;
                    let text = std::fs::read_to_string(&path).unwrap();
                    assert!(!text.contains(&forbidden), "{}", path.display());
                }
            }
        }
        assert!(files > 15, "{files} files were read");
    }
}
