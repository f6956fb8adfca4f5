//! Which is which: the nearest pairs of two lists.

/// Pairs the numbers below `rows` with those below `columns`, the nearest first, each once, until one side is used up.
/// `distance` is none where two are no pair; of equal ones the lower numbers win.
pub(crate) fn nearest_pairs(
    rows: usize,
    columns: usize,
    distance: impl Fn(usize, usize) -> Option<f64>,
) -> Vec<(usize, usize)> {
    let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let mut pairs: Vec<_> = all.filter_map(|(i, j)| Some((distance(i, j)?, i, j))).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut row_free, mut column_free) = (vec![true; rows], vec![true; columns]);
    pairs.retain(|&(_, i, j)| {
        let free = row_free[i] && column_free[j];
        if free {
            (row_free[i], column_free[j]) = (false, false);
        }
        free
    });
    pairs.into_iter().map(|(_, i, j)| (i, j)).collect()
}

/// In place of a distance that nobody knows, metres: farther than anything in a cell, to another farther than to itself.
pub(crate) fn unknown(itself: bool) -> f64 {
    if itself { 1e3 } else { 2e3 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_pair_is_taken_first_and_nothing_twice() {
        let (rows, columns) = ([0.0, 1.0, 5.0], [0.9, 0.1]);
        let distance = |i: usize, j: usize| Some(f64::abs(rows[i] - columns[j]));
        let mut pairs = nearest_pairs(3, 2, distance);
        pairs.sort_unstable();
        assert_eq!(pairs, [(0, 1), (1, 0)]);
        assert_eq!(nearest_pairs(2, 2, |i, j| (i != j).then_some(1.0)), [(0, 1), (1, 0)]);
        assert_eq!(nearest_pairs(2, 2, |_, _| Some(1.0)), [(0, 0), (1, 1)]);
    }
}
