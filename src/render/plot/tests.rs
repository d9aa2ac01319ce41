//! Plots are valid SVG, deterministic, and show the numbers they are given.

use std::collections::BTreeMap;

use super::*;
use crate::database::{MomentStatistics, SettingsReport, SpaceReport, StatisticsReport};
use crate::eval::{CURVE_RANKS, CURVE_RECALLS, Evaluation, Measures, SpaceMeasures};

/// Measures that differ by class and space, with falling curves.
fn measured(space: &str, strength: f64, classes: &[&str]) -> SpaceMeasures {
    let measures = |map: f64| Measures { queries: 20, p_at_1: map, p_at_k: map, map };
    let of_class = |(at, class): (usize, &&str)| ((*class).to_owned(), measures(strength / (1.0 + at as f64 / 10.0)));
    let fall = |count: usize| (0..count).map(|at| strength * (1.0 - at as f64 / (2 * count) as f64)).collect();
    SpaceMeasures {
        space: space.to_owned(),
        all: Measures { queries: 20 * classes.len(), ..measures(strength) },
        precision_at_rank: fall(CURVE_RANKS),
        precision_at_recall: fall(CURVE_RECALLS),
        per_class: classes.iter().enumerate().map(of_class).collect(),
        confusion: BTreeMap::new(),
    }
}

fn evaluated(spaces: &[&str], classes: &[&str]) -> Evaluation {
    let spaces =
        spaces.iter().enumerate().map(|(at, space)| measured(space, 1.0 / (1.0 + at as f64), classes)).collect();
    Evaluation { label: "family".into(), k: 10, spaces }
}

fn reported(count: u64, axes: usize) -> StatisticsReport {
    let moments = |scale: f64| (0..251).map(|at| scale / (1.0 + f64::from(at) / 100.0)).collect();
    StatisticsReport {
        textures: count,
        descriptors: 8 * count,
        bytes: BTreeMap::new(),
        space: SpaceReport {
            name: "default".into(),
            epoch: 1,
            fitted_on: count,
            dims: 32,
            formula: String::new(),
            variances: (0..axes).map(|_| 1.0 / axes as f64).collect(),
            axes: Vec::new(),
            drift: None,
        },
        statistics: MomentStatistics {
            count,
            mean: moments(0.4),
            std: moments(0.5),
            min: if count > 0 { moments(0.1) } else { Vec::new() },
            max: if count > 0 { moments(0.7) } else { Vec::new() },
            leading_share: 0.9,
        },
        settings: SettingsReport {
            views: vec![],
            volumes: "keep",
            spaces: vec![],
            nuisance: None,
            format: 1,
            kernel: "scalar",
        },
        quarantined: Vec::new(),
        revision: 1,
    }
}

/// Parses a plot and returns its texts; every number of its shapes must lie on the page.
fn texts(svg: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(svg).unwrap();
    let root = document.root_element();
    assert_eq!(root.tag_name().namespace(), Some("http://www.w3.org/2000/svg"));
    for name in ["title", "desc"] {
        let words = root.children().find(|node| node.has_tag_name(("http://www.w3.org/2000/svg", name))).unwrap();
        let named = root.attribute("aria-labelledby").unwrap().split(' ').any(|id| Some(id) == words.attribute("id"));
        assert!(named && !words.text().unwrap().is_empty());
    }
    let sides: Vec<f64> = root.attribute("viewBox").unwrap().split(' ').map(|side| side.parse().unwrap()).collect();
    let within = |value: &str, side: f64| {
        let value: f64 = value.trim().parse().unwrap();
        assert!((0.0..=side).contains(&value), "{value} of {side}");
    };
    for shape in root.descendants() {
        for (names, side) in [(["x", "x1", "x2", "cx"], sides[2]), (["y", "y1", "y2", "cy"], sides[3])] {
            names.iter().filter_map(|name| shape.attribute(*name)).for_each(|value| within(value, side));
        }
        for (size, side) in [("width", sides[2]), ("height", sides[3])] {
            shape.attribute(size).filter(|_| shape != root).into_iter().for_each(|value| within(value, side));
        }
        for pair in shape.attribute("points").into_iter().flat_map(str::split_ascii_whitespace) {
            let (x, y) = pair.split_once(',').unwrap();
            within(x, sides[2]);
            within(y, sides[3]);
        }
    }
    root.descendants().filter_map(|node| node.text()).map(|text| text.trim().to_owned()).collect()
}

#[test]
fn an_evaluation_is_drawn_with_its_numbers() {
    let classes = ["marble", "<oak> & \"ash\"", "bell\u{7}", "日本の木目"];
    let mut evaluated = evaluated(&["paper", "default"], &classes);
    for space in &mut evaluated.spaces {
        space.per_class.insert("lonely".into(), Measures::default());
    }
    let texts = texts(&evaluation_plot(&evaluated).unwrap());
    let said = |words: &str| assert!(texts.iter().any(|text| text == words), "{words}: {texts:?}");
    said("paper  mAP 1.000");
    said("default  mAP 0.500");
    said("<oak> & \"ash\"");
    said("bell\u{fffd}");
    said("日本の木目");
    said("80 textures of 4 classes, each asks for the others of its own");
    assert!(!texts.iter().any(|text| text == "lonely"), "a class of one texture has nothing to find");
    // The second class, in the first and in the second space.
    said(&format!("{:.2}", 1.0 / 1.1));
    said(&format!("{:.2}", 0.5 / 1.1));
    said("Mean average precision by 'family', in the order of paper");
}

#[test]
fn the_same_numbers_give_the_same_bytes() {
    let spaces = ["paper", "zscore", "oriented", "default", "invariant", "mine"];
    let draw = || evaluation_plot(&evaluated(&spaces, &["a", "b", "c"])).unwrap();
    assert_eq!(draw(), draw());
    let draw = || statistics_plot(&reported(7, 32)).unwrap();
    assert_eq!(draw(), draw());
    assert_ne!(draw(), statistics_plot(&reported(8, 32)).unwrap());
}

#[test]
fn omitted_spaces_and_classes_are_counted() {
    let spaces: Vec<String> = (0..14).map(|at| format!("space-of-a-long-name-{at}")).collect();
    let classes: Vec<String> =
        (0..200).map(|at| format!("class {at} of a very long name that no row can hold")).collect();
    let spaces: Vec<&str> = spaces.iter().map(String::as_str).collect();
    let classes: Vec<&str> = classes.iter().map(String::as_str).collect();
    let texts = texts(&evaluation_plot(&evaluated(&spaces, &classes)).unwrap());
    assert!(texts.iter().any(|text| text.contains("the 60 of 200 that are found worst")), "{texts:?}");
    assert!(texts.iter().any(|text| text.contains("the first 10 of 14 spaces")));
}

#[test]
fn a_store_is_drawn_in_every_kind_of_space() {
    assert!(texts(&statistics_plot(&reported(1, 32)).unwrap()).iter().any(|text| text.contains("over 1 texture")));
    assert!(texts(&statistics_plot(&reported(9, 0)).unwrap()).iter().any(|text| text.contains("none of its own")));
    texts(&statistics_plot(&reported(9, 1)).unwrap());
    texts(&statistics_plot(&reported(9, 128)).unwrap());
}

#[test]
fn missing_data_are_an_error() {
    let nothing = statistics_plot(&reported(0, 32)).unwrap_err().to_string();
    assert!(nothing.contains("the store has no textures"), "{nothing}");
    assert!(evaluation_plot(&evaluated(&[], &["a"])).is_err());
    assert!(evaluation_plot(&evaluated(&["paper"], &[])).is_err());
    let error = write_svg(Path::new("/no/such/folder/plot.svg"), "").unwrap_err();
    assert!(error.to_string().contains("/no/such/folder/plot.svg"));
}
