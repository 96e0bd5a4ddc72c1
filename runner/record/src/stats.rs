//! How sure a mean is: the statistics that decide when measuring may stop, and which of two values is better.

use statrs::distribution::{ContinuousCDF, StudentsT};

/// A mean, and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// The variance of the mean (not of the values).
    pub variance: f64,
    /// Degrees of freedom of the variance.
    pub freedom: f64,
}

impl Estimate {
    /// The mean of independent values; nothing of fewer than two, of which one cannot tell how they scatter.
    pub fn of(values: &[f64]) -> Option<Estimate> {
        let n = values.len() as f64;
        if values.len() < 2 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Some(Estimate { mean, variance: squares / (n - 1.0) / n, freedom: n - 1.0 })
    }

    /// The plain average of several means, with the degrees of freedom that Welch and Satterthwaite give it
    /// (Welch 1947): each mean keeps a variance of its own. Nothing of nothing.
    pub fn average(means: &[Estimate]) -> Option<Estimate> {
        let n = means.len() as f64;
        (!means.is_empty()).then(|| Estimate {
            mean: means.iter().map(|one| one.mean).sum::<f64>() / n,
            variance: means.iter().map(|one| one.variance).sum::<f64>() / (n * n),
            freedom: freedom(means),
        })
    }

    /// Half the width of the 95% confidence interval of the mean.
    pub fn half_width(&self) -> f64 {
        if self.variance == 0.0 { 0.0 } else { quantile(0.975, self.freedom) * self.variance.sqrt() }
    }

    /// The same as a share of the mean.
    pub fn relative_half_width(&self) -> f64 {
        self.half_width() / self.mean.abs()
    }

    /// How probable it is that a mean at least so much greater than `other` comes about although the true one
    /// is not greater: Welch's t-test, one-sided.
    pub fn not_greater(&self, other: &Estimate) -> f64 {
        let difference = self.mean - other.mean;
        let variance = self.variance + other.variance;
        if variance == 0.0 {
            return if difference > 0.0 { 0.0 } else { 1.0 };
        }
        1.0 - student(freedom(&[*self, *other])).cdf(difference / variance.sqrt())
    }
}

/// Degrees of freedom of a sum of means (Welch 1947).
fn freedom(means: &[Estimate]) -> f64 {
    let sum: f64 = means.iter().map(|one| one.variance).sum();
    let parts: f64 = means.iter().map(|one| one.variance.powi(2) / one.freedom).sum();
    if parts > 0.0 { sum.powi(2) / parts } else { means.iter().map(|one| one.freedom).sum() }
}

fn student(freedom: f64) -> StudentsT {
    StudentsT::new(0.0, 1.0, freedom).expect("degrees of freedom are positive")
}

/// The value that Student's t with so many degrees of freedom stays below with probability `p`.
pub fn quantile(p: f64, freedom: f64) -> f64 {
    student(freedom).inverse_cdf(p)
}

/// The value in the middle, which one outlier does not move; nothing of nothing.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => None,
        count if count % 2 == 1 => Some(sorted[middle]),
        _ => Some((sorted[middle - 1] + sorted[middle]) / 2.0),
    }
}

/// How far values lie from their median, in the middle, times 1.4826: of values that are normally distributed
/// this is their standard deviation, and a few outliers do not move it. Nothing of nothing.
pub fn deviation(values: &[f64]) -> Option<f64> {
    let middle = median(values)?;
    let away: Vec<f64> = values.iter().map(|value| (value - middle).abs()).collect();
    Some(1.4826 * median(&away)?)
}

/// How strongly two series rise together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correlation {
    /// From −1, each rise of one is a fall of the other, to 1, both rise together.
    pub coefficient: f64,
    /// How probable so strong a correlation, of either sign, is between series that have nothing to do with
    /// each other.
    pub probability: f64,
}

/// Spearman's rank correlation. The probability is exact up to eight pairs without ties, and by Student's t
/// above. Nothing of fewer than four pairs, or where one series is constant.
pub fn spearman(x: &[f64], y: &[f64]) -> Option<Correlation> {
    let n = x.len();
    if n < 4 || n != y.len() {
        return None;
    }
    let (x, y) = (ranks(x), ranks(y));
    let coefficient = pearson(&x, &y)?;
    let probability = if n <= 8 {
        let mut order: Vec<usize> = (0..n).collect();
        let (mut all, mut as_strong) = (0u32, 0u32);
        permute(&mut order, n, &mut |order| {
            let shuffled: Vec<f64> = order.iter().map(|&i| y[i]).collect();
            all += 1;
            let strength = pearson(&x, &shuffled).map_or(0.0, f64::abs);
            as_strong += u32::from(strength >= coefficient.abs() - 1e-12);
        });
        f64::from(as_strong) / f64::from(all)
    } else if coefficient.abs() >= 1.0 {
        0.0
    } else {
        let freedom = n as f64 - 2.0;
        let t = coefficient.abs() * (freedom / (1.0 - coefficient * coefficient)).sqrt();
        2.0 * (1.0 - student(freedom).cdf(t))
    };
    Some(Correlation { coefficient, probability })
}

/// Calls `each` with every order of the first `n` items (Heap 1963).
fn permute(items: &mut [usize], n: usize, each: &mut impl FnMut(&[usize])) {
    if n <= 1 {
        return each(items);
    }
    for i in 0..n {
        permute(items, n - 1, each);
        items.swap(if n.is_multiple_of(2) { i } else { 0 }, n - 1);
    }
}

/// Places in order of size, from 1; equal values share the mean of their places.
fn ranks(values: &[f64]) -> Vec<f64> {
    values
        .iter()
        .map(|value| {
            let below = values.iter().filter(|other| *other < value).count() as f64;
            let equal = values.iter().filter(|other| *other == value).count() as f64;
            below + (equal + 1.0) / 2.0
        })
        .collect()
}

fn pearson(x: &[f64], y: &[f64]) -> Option<f64> {
    let n = x.len() as f64;
    let (mean_x, mean_y) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let sum =
        |of: fn(f64, f64) -> f64| -> f64 { x.iter().zip(y).map(|(x, y)| of(x - mean_x, y - mean_y)).sum() };
    let scale = (sum(|x, _| x * x) * sum(|_, y| y * y)).sqrt();
    (scale > 0.0).then(|| (sum(|x, y| x * y) / scale).clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-4 * b.abs().max(1.0), "{a} is not {b}");
    }

    /// Expected values are from tables of Student's t, or were found by integrating its density numerically.
    #[test]
    fn an_interval_is_as_wide_as_tables_say() {
        let estimate = Estimate::of(&[10.0, 12.0, 11.0, 13.0]).unwrap();
        near(estimate.mean, 11.5);
        // Standard error 0.6455, t of 3 degrees 3.1824.
        near(estimate.half_width(), 2.0542);
        near(quantile(0.975, 10.0), 2.2281);
        assert_eq!(Estimate::of(&[1.0]), None);
        assert_eq!(Estimate::of(&[2.0, 2.0]).unwrap().half_width(), 0.0);
    }

    #[test]
    fn an_average_keeps_the_variance_of_each() {
        let a = Estimate { mean: 100.0, variance: 4.0, freedom: 9.0 };
        let b = Estimate { mean: 200.0, variance: 0.0, freedom: 9.0 };
        let average = Estimate::average(&[a, b]).unwrap();
        near(average.mean, 150.0);
        near(average.variance, 1.0);
        near(average.freedom, 9.0);
        near(Estimate::average(&[a, a]).unwrap().freedom, 18.0);
        assert_eq!(Estimate::average(&[]), None);
    }

    #[test]
    fn of_two_means_the_greater_is_told() {
        let a = Estimate::of(&[10.1, 10.2, 10.3, 10.2]).unwrap();
        let b = Estimate::of(&[10.0, 10.1, 10.0, 10.1]).unwrap();
        // Difference 0.15, standard errors 0.0408 and 0.0289: t = 3.0, 5.4 degrees of freedom.
        near(a.not_greater(&b), 0.01367);
        near(b.not_greater(&a), 1.0 - 0.01367);
        let same = Estimate { mean: 1.0, variance: 0.0, freedom: 3.0 };
        assert_eq!(same.not_greater(&same), 1.0);
    }

    #[test]
    fn outliers_do_not_move_the_median() {
        assert_eq!(median(&[3.0, 1.0, 1e9]), Some(3.0));
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(&[]), None);
        near(deviation(&[1.0, 2.0, 3.0, 4.0, 1e9]).unwrap(), 1.4826);
    }

    #[test]
    fn ranks_correlate() {
        let time: Vec<f64> = (0..6).map(f64::from).collect();
        let falling = spearman(&time, &[9.0, 8.0, 7.0, 6.0, 5.0, 4.0]).unwrap();
        assert_eq!(falling.coefficient, -1.0);
        // Two of the 720 orders are so strong.
        near(falling.probability, 2.0 / 720.0);
        let noise = spearman(&time, &[5.0, 6.0, 4.0, 6.5, 4.5, 5.5]).unwrap();
        assert!(noise.probability > 0.5, "{noise:?}");
        let long: Vec<f64> = (0..10).map(f64::from).collect();
        let ties = [1.0, 2.0, 2.0, 4.0, 3.0, 6.0, 5.0, 8.0, 9.0, 7.0];
        let rising = spearman(&long, &ties).unwrap();
        near(rising.coefficient, 0.93617);
        assert!(rising.probability < 1e-3, "{rising:?}");
        assert_eq!(spearman(&time[..3], &time[..3]), None);
        assert_eq!(spearman(&time, &[1.0; 6]), None);
    }
}
