use super::*;

fn volume() -> Volume {
    Volume::from_fn([9, 9, 9], |z, y, x| (z * 28 + y * 2 + x) as u8).unwrap()
}

fn panel<'a>(volume: &'a Volume, lines: &[&str]) -> Panel<'a> {
    Panel { volume, caption: lines.iter().map(|&line| line.into()).collect() }
}
