//! Table I as published: what the reconstruction is compared with, by the paper's names.

/// Mean and standard deviation over the paper's executions.
pub(super) type Spread = (f64, f64);

/// One column of Table I.
#[derive(Debug)]
pub(super) struct Column {
    /// The file's name without its ending.
    pub(super) object: &'static str,
    /// Chamfer distance in mm, of the proactive strategy (OURS) and of minU.
    pub(super) chamfer_mm: [Spread; 2],
    /// Failures of 50 attempts, likewise.
    pub(super) failures: [Spread; 2],
}

/// The simulated columns of Table I in its order.
pub(super) const TABLE_I: [Column; 7] = [
    Column { object: "lamp", chamfer_mm: [(1.07, 0.01), (1.08, 0.01)], failures: [(1.0, 0.7), (6.7, 3.1)] },
    Column {
        object: "wine_bottle",
        chamfer_mm: [(3.05, 0.19), (3.47, 0.33)],
        failures: [(12.3, 1.8), (26.25, 1.9)],
    },
    Column {
        object: "coffee_can",
        chamfer_mm: [(3.89, 0.15), (7.56, 1.62)],
        failures: [(13.3, 0.9), (29.7, 6.2)],
    },
    Column {
        object: "sugar_box",
        chamfer_mm: [(3.82, 0.12), (9.97, 3.74)],
        failures: [(12.7, 1.8), (32.7, 7.8)],
    },
    Column {
        object: "mini_soccer_ball",
        chamfer_mm: [(1.92, 0.01), (1.93, 0.02)],
        failures: [(3.7, 1.1), (19.0, 4.7)],
    },
    Column { object: "pear", chamfer_mm: [(1.17, 0.0), (1.78, 0.82)], failures: [(0.0, 0.0), (14.7, 16.2)] },
    Column {
        object: "mustard_bottle",
        chamfer_mm: [(2.62, 0.13), (3.18, 0.93)],
        failures: [(4.1, 1.9), (11.3, 9.2)],
    },
];

/// The column of an object, if the paper has it.
pub(super) fn column(object: &str) -> Option<&'static Column> {
    TABLE_I.iter().find(|column| column.object == object)
}
