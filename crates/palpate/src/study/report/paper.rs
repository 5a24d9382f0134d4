//! What the paper reports (Beltran-Hernandez et al. 2020, Table II and section IV), to set beside what is found here.

/// A row of Table II: average collisions per training session.
pub(super) struct Printed {
    pub(super) model: &'static str,
    pub(super) penalty: f64,
    pub(super) free: f64,
    /// The printed difference, %.
    pub(super) difference: f64,
}

const fn row(model: &'static str, penalty: f64, free: f64, difference: f64) -> Printed {
    Printed { model, penalty, free, difference }
}

pub(super) const TABLE_II: [Printed; 8] = [
    row("A-8", 326.0, 455.0, -39.0),
    row("A-13", 350.0, 408.0, -16.0),
    row("A-13pd", 300.0, 462.0, -54.0),
    row("A-18", 451.0, 457.0, -1.0),
    row("P-9", 187.0, 369.0, -98.0),
    row("P-14", 121.0, 206.0, -70.0),
    row("P-19", 183.0, 392.0, -115.0),
    row("P-24", 219.0, 337.0, -43.0),
];

/// Table II's "difference", %: relative to the count with the penalty.
pub(super) fn difference(penalty: f64, free: f64) -> f64 {
    100.0 * (penalty - free) / penalty
}

/// What a reduction usually means, %: relative to the count without.
pub(super) fn reduction(penalty: f64, free: f64) -> f64 {
    100.0 * (free - penalty) / free
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All but one printed difference follow from the printed counts, to the rounding of the counts.
    #[test]
    fn the_printed_differences_follow_but_for_p_24() {
        for row in TABLE_II {
            let recomputed = difference(row.penalty, row.free);
            let off = (recomputed - row.difference).abs();
            assert_eq!(off < 1.0, row.model != "P-24", "{}: {recomputed}", row.model);
        }
        assert!((difference(219.0, 337.0) + 53.9).abs() < 0.05);
        assert!((reduction(219.0, 337.0) - 35.0).abs() < 0.1);
    }
}
