//! [`plan`]: whether a batch of queries should build a tree first.
//!
//! The decision compares expected times, from a model of three costs. Measured with 32 coordinates and k = 10, in CPU time
//! of one core:
//!
//! | rows | one scan | one tree query | one build |
//! |---|---|---|---|
//! | 5 000 | 14 us | 10 us | 2 ms |
//! | 50 000 | 140 us | 30 us | 46 ms |
//! | 500 000 | 1.6 ms | 41 us | 0.8 s |
//! | 1 000 000 (real descriptors) | 3.7 ms | 220 us | 2 s |
//!
//! Other numbers of coordinates change the times of scans little (keys have the same size) and add to a build the time to
//! quantise the coordinates: 0.1 s for 50 000 rows of 245. A batch and a build use the same threads, so the ratio of CPU
//! times is that of elapsed times. The model need not be accurate: near the break-even point both plans take equally long.

/// How to answer a batch of queries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plan {
    /// Scan all rows.
    Scan,
    /// Search with the present tree and scan the rows that it does not cover.
    Tree,
    /// Build a tree over all rows first, then search with it.
    BuildTree,
}

/// The fastest plan for `queries` queries for few neighbours each, over `rows` rows of `dims` coordinates, of which the
/// present tree covers the first `covered` (0 without a tree).
///
/// Pure and deterministic: it depends on its arguments only. Plans of equal cost are preferred in the order of [`Plan`].
pub fn plan(queries: usize, rows: usize, covered: usize, dims: usize) -> Plan {
    let covered = covered.min(rows);
    let each = |time: f64| queries as f64 * time;
    let scan = each(scan_time(rows));
    let tree = if covered > 0 { each(tree_time(covered) + scan_time(rows - covered)) } else { f64::INFINITY };
    let build = build_time(rows, dims) + each(tree_time(rows));
    if build < scan.min(tree) {
        Plan::BuildTree
    } else if tree < scan {
        Plan::Tree
    } else {
        Plan::Scan
    }
}

/// Nanoseconds of a scan: 3.5 for each row.
fn scan_time(rows: usize) -> f64 {
    3.5 * rows as f64
}

/// Nanoseconds of a query to a tree: proportional to the square root of the rows, 220 us for a million.
fn tree_time(rows: usize) -> f64 {
    220.0 * (rows as f64).sqrt()
}

/// Nanoseconds of a build: for each row 175 for every doubling of the rows beyond 1024, and 4 for each coordinate.
fn build_time(rows: usize, dims: usize) -> f64 {
    let doublings = (rows as f64 / 1024.0).max(1.0).log2();
    rows as f64 * (175.0 * doublings + 4.0 * dims as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_is_built_for_large_batches_over_many_rows() {
        // 2000 queries over a million rows: 7 s of scans against 2 s to build and 0.5 s to search.
        assert_eq!(plan(2000, 1_000_000, 0, 32), Plan::BuildTree);
        assert_eq!(plan(100, 1_000_000, 0, 32), Plan::Scan);
        assert_eq!(plan(1, 1_000_000, 0, 32), Plan::Scan);
        assert_eq!(plan(1000, 100_000, 0, 32), Plan::BuildTree);
        assert_eq!(plan(1000, 100_000, 0, 251), Plan::BuildTree);
        assert_eq!(plan(200, 100_000, 0, 251), Plan::Scan);
        // A scan of few rows is as fast as a tree.
        assert_eq!(plan(1_000_000, 3000, 0, 32), Plan::Scan);
        assert_eq!(plan(0, 1_000_000, 0, 32), Plan::Scan);
        assert_eq!(plan(1000, 0, 0, 32), Plan::Scan);
    }

    #[test]
    fn a_present_tree_is_used_and_replaced_when_many_rows_are_not_in_it() {
        assert_eq!(plan(1, 1_000_000, 1_000_000, 32), Plan::Tree);
        assert_eq!(plan(1_000_000, 1_000_000, 1_000_000, 32), Plan::Tree);
        assert_eq!(plan(10, 1_000_000, 900_000, 32), Plan::Tree);
        assert_eq!(plan(100_000, 1_000_000, 900_000, 32), Plan::BuildTree);
        // `covered` beyond the rows means all of them.
        assert_eq!(plan(10, 100_000, usize::MAX, 32), Plan::Tree);
    }

    #[test]
    fn more_queries_never_speak_against_a_build() {
        for rows in [3000, 10_000, 100_000, 3_000_000] {
            for covered in [0, rows / 2] {
                let plans: Vec<Plan> = (0..24).map(|power| plan(1 << power, rows, covered, 32)).collect();
                let first = plans.iter().position(|plan| *plan == Plan::BuildTree).unwrap_or(plans.len());
                assert!(plans[first..].iter().all(|plan| *plan == Plan::BuildTree), "{rows} {covered}: {plans:?}");
            }
        }
    }
}
