use super::super::Image;
use super::*;

/// 9 x 9 x 9 voxels, each slice a ramp; darkest at the origin.
fn ramp() -> Volume {
    Volume::from_fn([9, 9, 9], |z, y, x| (z * 20 + y * 8 + x) as u8).unwrap()
}

fn panel<'a>(volume: &'a Volume, lines: &[&str]) -> Panel<'a> {
    Panel { volume, caption: lines.iter().map(|&line| line.into()).collect() }
}

/// Where the first slice of the first panel begins, without a title.
const FIRST: u32 = MARGIN + PADDING + 1;

fn pixel(sheet: &Image, x: u32, y: u32) -> [u8; 3] {
    let start = 3 * (y * sheet.size().0 + x) as usize;
    sheet.pixels()[start..start + 3].try_into().unwrap()
}

/// Columns and rows that differ between two sheets of one size: left, top, right, bottom.
fn difference(a: &Image, b: &Image) -> Option<[u32; 4]> {
    assert_eq!(a.size(), b.size());
    let (width, height) = a.size();
    let positions = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    positions.filter(|&(x, y)| pixel(a, x, y) != pixel(b, x, y)).fold(None, |range, (x, y)| {
        let [left, top, right, bottom] = range.unwrap_or([x, y, x, y]);
        Some([left.min(x), top.min(y), right.max(x), bottom.max(y)])
    })
}

#[test]
fn the_golden_sheet_has_not_changed() {
    let (grey, colour) =
        (ramp(), Volume::new([3, 4, 5], 3, (0..180).map(|i: u8| i.wrapping_mul(37)).collect()).unwrap());
    let panels = [panel(&grey, &["ramp", "9 x 9 x 9"]), panel(&colour, &["colour", "rank 1   distance 0.1250"])];
    let options = ContactSheetOptions::new().query_first(true).title("Golden").across(2);
    let sheet = contact_sheet(&panels, &options);
    assert_eq!(sheet.size(), (726, 255));
    assert_eq!(
        [pixel(&sheet, 0, 0), pixel(&sheet, 40, 46), pixel(&sheet, 30, 64)],
        [[0xeb; 3], [0x0b, 0x5c, 0xad], [0; 3]]
    );
    let hash = blake3::hash(sheet.pixels()).to_hex();
    assert_eq!(
        &hash[..16],
        "d44df736c21379f0",
        "the look of sheets changed: look at one before you accept the new hash"
    );
}

#[test]
fn voxels_are_enlarged_by_whole_factors_in_reading_order() {
    let volume = ramp();
    let sheet = contact_sheet(&[panel(&volume, &[])], &ContactSheetOptions::new());
    // Nine slices in two rows of five and four; a voxel is 7 x 7 pixels, slices have seams of one pixel.
    assert_eq!(sheet.size(), (2 * (MARGIN + PADDING) + 5 * 64 + 1, 2 * (MARGIN + PADDING) + 2 * 64 + 1));
    for z in 0..9_u32 {
        let (left, top) = (FIRST + z % 5 * 64, FIRST + z / 5 * 64);
        for y in 0..63 {
            for x in 0..63 {
                let expected = [(z * 20 + y / 7 * 8 + x / 7) as u8; 3];
                assert_eq!(pixel(&sheet, left + x, top + y), expected);
            }
        }
        assert_eq!(pixel(&sheet, left - 1, top + 9), pixel(&sheet, left + 63, top + 9), "seam");
    }
}

#[test]
fn large_slices_are_averaged_by_blocks_and_spread_evenly() {
    // 130 voxels at 64 pixels: blocks of 3 x 3, the last of 1 x 1.
    let volume =
        Volume::from_fn([130, 4, 130], |z, y, x| if x == 129 { 200 } else { (z + 2 * y + 30 * (x % 3)) as u8 })
            .unwrap();
    let sheet = contact_sheet(&[panel(&volume, &[])], &ContactSheetOptions::new().slices(10).columns(10));
    assert_eq!(sheet.size().0, 2 * (MARGIN + PADDING) + 10 * 45 + 1);
    for number in 0..10 {
        let (left, z) = (FIRST + number * 45, number * 13);
        assert_eq!(pixel(&sheet, left, FIRST), [(z + 2 + 30) as u8; 3], "mean of y 0, 1, 2 and x 0, 1, 2");
        assert_eq!(pixel(&sheet, left + 43, FIRST + 1), [200; 3]);
    }
}

#[test]
fn slices_can_be_taken_across_every_axis() {
    let volume = Volume::from_fn([3, 4, 5], |z, y, x| (z * 64 + y * 16 + x) as u8).unwrap();
    let first_two = |axis| {
        let options = ContactSheetOptions::new().axis(axis).slice_pixels(20);
        let sheet = contact_sheet(&[panel(&volume, &[])], &options);
        let aside = (0..).find(|&x| pixel(&sheet, FIRST + x, FIRST) == [0; 3]).unwrap();
        let scale = 20 / if axis == SliceAxis::X { 4 } else { 5 };
        [(scale, 0), (0, scale)].map(|(x, y)| pixel(&sheet, FIRST + aside + x, FIRST + y)[0])
    };
    // To the right and down.
    assert_eq!(first_two(SliceAxis::Z), [1, 16]);
    assert_eq!(first_two(SliceAxis::Y), [1, 64]);
    assert_eq!(first_two(SliceAxis::X), [16, 64]);
}

#[test]
fn colours_are_kept() {
    let volume = Volume::new([3, 3, 3], 3, [250, 10, 100].repeat(27)).unwrap();
    let sheet = contact_sheet(&[panel(&volume, &[])], &ContactSheetOptions::new());
    assert!(sheet.pixels().chunks_exact(3).filter(|pixel| *pixel == [250, 10, 100]).count() == 3 * 63 * 63);
}

#[test]
fn captions_change_the_pixels_below_the_slices_and_nothing_else() {
    let volume = ramp();
    let [a, b, c] = [["name", "rank 1"], ["name", "rank 2"], ["eman", "rank 1"]]
        .map(|lines| contact_sheet(&[panel(&volume, &lines)], &ContactSheetOptions::new()));
    let below = FIRST + 2 * 64;
    let [_, top, _, bottom] = difference(&a, &b).unwrap();
    assert!(top >= below + Face::Medium.line() && bottom < a.size().1 - MARGIN);
    let [_, top, _, bottom] = difference(&a, &c).unwrap();
    assert!(top >= below && bottom < below + PADDING + Face::Medium.line());
}

#[test]
fn the_query_is_framed_and_labelled() {
    let volume = ramp();
    let panels = [panel(&volume, &["one"]), panel(&volume, &["two"])];
    let options = ContactSheetOptions::new().across(2);
    let plain = contact_sheet(&panels, &options);
    let marked = contact_sheet(&panels, &options.clone().query_first(true));
    let [left, _, right, _] = difference(&plain, &marked).unwrap();
    assert!(left < MARGIN && right < plain.size().0 / 2);
    assert_ne!(contact_sheet(&panels, &options.theme(Theme::Dark)), plain);
}

#[test]
fn names_that_do_not_fit_stay_inside_their_panel() {
    let volume = ramp();
    let long = "ä".repeat(500);
    let panels = [panel(&volume, &[&long, &long]), panel(&volume, &["short", "short"])];
    let options = ContactSheetOptions::new().query_first(true).across(2).title(&long);
    let other = [panel(&volume, &["x", "x"]), panel(&volume, &["short", "short"])];
    let [left, _, right, _] = difference(&contact_sheet(&panels, &options), &contact_sheet(&other, &options)).unwrap();
    assert!(left >= MARGIN + PADDING && right < MARGIN + PADDING + 5 * 64 + 1);
}

#[test]
fn a_sheet_has_at_most_max_pixels() {
    let volume = Volume::from_fn([64, 64, 64], |z, y, x| (z ^ y ^ x) as u8).unwrap();
    let pixels = |count: usize, options: &ContactSheetOptions| {
        let panels = vec![panel(&volume, &["name", "rank"]); count];
        let layout = Layout::new(&panels, options);
        assert!(layout.pixels() <= MAX_PIXELS);
        (layout.slice_pixels, layout.slices, layout.shown)
    };
    assert_eq!(pixels(31, &ContactSheetOptions::new()), (64, 64, 31));
    assert_eq!(pixels(200, &ContactSheetOptions::new()), (32, 64, 200));
    let (size, slices, shown) = pixels(100_000, &ContactSheetOptions::new());
    assert!((size, slices) == (16, 16) && (500..100_000).contains(&shown), "{shown}");
    let greedy = ContactSheetOptions::new().slices(usize::MAX).columns(usize::MAX).slice_pixels(u32::MAX);
    assert_eq!(pixels(1, &greedy).2, 1);
    assert_eq!(pixels(1, &greedy.slices(0).columns(0).slice_pixels(0).across(0)), (8, 1, 1));
    let none = contact_sheet(&[], &ContactSheetOptions::new().title("nothing"));
    assert!(none.size().0 > 100);
}

#[test]
fn a_single_sheet_states_shape_and_scale() {
    let volume = Volume::from_fn([130, 130, 130], |z, _, _| z as u8).unwrap();
    let options = ContactSheetOptions::new();
    let explicit = ["rock", "130 x 130 x 130 voxels", "64 of 130 slices across Z, shown at 1:3"];
    assert_eq!(
        single_sheet(&panel(&volume, &["rock"]), &options),
        contact_sheet(&[panel(&volume, &explicit)], &options)
    );
}
