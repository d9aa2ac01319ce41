//! Plain text output: tables, sizes, times.

use std::io::{self, Write};

/// How a column is aligned.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Align {
    Left,
    Right,
}

/// A table with a heading; columns are two spaces apart.
pub(super) struct Table {
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(super) fn new<const N: usize>(columns: [(&str, Align); N]) -> Self {
        Self { columns: columns.map(|(name, align)| (name.to_owned(), align)).into(), rows: Vec::new() }
    }

    /// Adds a row; missing cells are empty.
    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().map(|cell| one_line(&cell)).collect());
    }

    /// Writes the heading and the rows, without trailing spaces, so that answers can be compared with diff.
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let headings: Vec<String> = self.columns.iter().map(|(name, _)| name.clone()).collect();
        let lines = || std::iter::once(&headings).chain(&self.rows);
        let width = |column: usize| lines().filter_map(|line| line.get(column)).map(|c| c.chars().count()).max();
        let widths: Vec<usize> = (0..self.columns.len()).map(|column| width(column).unwrap_or(0)).collect();
        for line in lines() {
            let mut text = String::new();
            for ((cell, width), (_, align)) in line.iter().zip(&widths).zip(&self.columns) {
                match align {
                    Align::Left => text.push_str(&format!("{cell:<width$}  ")),
                    Align::Right => text.push_str(&format!("{cell:>width$}  ")),
                }
            }
            writeln!(out, "{}", text.trim_end())?;
        }
        Ok(())
    }
}

/// The text with control characters escaped, which could break the line or change the colours of the terminal.
pub(super) fn one_line(text: &str) -> String {
    let escaped = |c: char| if c.is_control() { c.escape_default().collect() } else { String::from(c) };
    text.chars().map(escaped).collect()
}

/// A human-readable number of bytes: `512 B`, `1.4 MiB`.
pub(super) fn bytes(count: u64) -> String {
    let mut value = count as f64;
    let mut unit = "B";
    for larger in ["KiB", "MiB", "GiB", "TiB"] {
        if value < 1024.0 {
            break;
        }
        value /= 1024.0;
        unit = larger;
    }
    if unit == "B" { format!("{count} B") } else { format!("{value:.1} {unit}") }
}

/// A human-readable time: `850 us`, `12.3 ms`, `4.5 s`.
pub(super) fn duration(time: std::time::Duration) -> String {
    let micros = time.as_micros();
    match micros {
        0..1_000 => format!("{micros} us"),
        1_000..1_000_000 => format!("{:.1} ms", time.as_secs_f64() * 1e3),
        _ => format!("{:.1} s", time.as_secs_f64()),
    }
}

/// `1 texture`, `2 textures`.
pub(super) fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

/// Tags as `key=value`, in key order.
pub(super) fn tags(tags: &std::collections::BTreeMap<String, String>) -> String {
    tags.iter().map(|(key, value)| format!("{key}={value}")).collect::<Vec<_>>().join(" ")
}

/// A shape as `64x64x64` (Z, Y, X).
pub(super) fn shape(shape: Option<[usize; 3]>) -> String {
    shape.map_or_else(|| "-".to_owned(), |[z, y, x]| format!("{z}x{y}x{x}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned_without_trailing_spaces() {
        let mut table = Table::new([("id", Align::Right), ("name", Align::Left), ("tags", Align::Left)]);
        table.row(["1".into(), "marble".into(), String::new()]);
        table.row(["12".into(), "oak".into(), "a=b".into()]);
        let mut out = Vec::new();
        table.write(&mut out).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "id  name    tags\n 1  marble\n12  oak     a=b\n");
    }

    #[test]
    fn control_characters_are_escaped() {
        assert_eq!(one_line("oak\n\u{1b}[31mred\tä 木"), "oak\\n\\u{1b}[31mred\\tä 木");
    }

    #[test]
    fn sizes_have_readable_units() {
        assert_eq!([bytes(512), bytes(1_468_006), bytes(5 << 30)], ["512 B", "1.4 MiB", "5.0 GiB"]);
    }
}
