//! From printed numbers back to numbers that print so.

use anyhow::ensure;

/// A cell: a value and, in parentheses, what it is relative to the first row's.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// The value, as printed.
    pub value: f64,
    /// The true value is at most this far away.
    pub off: f64,
    /// Relative to the first row, printed with two decimals.
    pub relative: f64,
}

/// The printed ratios are off by at most this much.
const OFF: f64 = 0.005;

/// Values of a column that print as the cells do, ratios to the first of them included: the ratios were computed
/// before rounding, so ratios of the printed values may differ from them in the last digit. A value that fits stays
/// as it was printed.
///
/// # Errors
/// No values print so: there is a misprint.
pub fn unrounded(column: &[Cell]) -> anyhow::Result<Vec<f64>> {
    let first = column[0];
    let mut range = (first.value - first.off, first.value + first.off);
    for cell in &column[1..] {
        range.0 = range.0.max((cell.value - cell.off) / (cell.relative + OFF));
        range.1 = range.1.min((cell.value + cell.off) / (cell.relative - OFF));
    }
    let first = within(range, first.value)?;
    let others = column[1..].iter().map(|cell| {
        let least = (cell.value - cell.off).max(first * (cell.relative - OFF));
        let greatest = (cell.value + cell.off).min(first * (cell.relative + OFF));
        within((least, greatest), cell.value)
    });
    std::iter::once(Ok(first)).chain(others).collect()
}

/// The value, or the middle of the range where the value lies outside or at its very edge.
fn within((least, greatest): (f64, f64), value: f64) -> anyhow::Result<f64> {
    ensure!(least < greatest, "no number prints as {value} and as its ratio");
    let edge = 1e-3 * (greatest - least);
    Ok(if value > least + edge && value < greatest - edge { value } else { (least + greatest) / 2.0 })
}
