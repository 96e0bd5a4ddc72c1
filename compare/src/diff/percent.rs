//! Shares that are written in percent.

use std::fmt;
use std::str::FromStr;

/// A share, such as 0.01, written as `1%` or `1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Percent(pub f64);

impl FromStr for Percent {
    type Err = String;

    fn from_str(text: &str) -> Result<Percent, String> {
        let number = text.strip_suffix('%').unwrap_or(text).trim().parse::<f64>();
        match number {
            Ok(percent) if (0.0..=1e6).contains(&percent) => Ok(Percent(percent / 100.0)),
            _ => Err("not a percentage from 0 on, such as 1%".into()),
        }
    }
}

impl fmt::Display for Percent {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Without the digits that dividing by 100 brought.
        write!(out, "{}%", (self.0 * 1e12).round() / 1e10)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentages_are_read_with_and_without_their_sign() {
        for (text, share) in
            [("1%", 0.01), ("1", 0.01), ("0.5 %", 0.005), ("0", 0.0), ("7%", 0.07), ("150%", 1.5)]
        {
            let percent: Percent = text.parse().unwrap();
            assert!((percent.0 - share).abs() < 1e-15, "{text}");
            assert_eq!(percent.to_string(), format!("{}%", text.trim_end_matches('%').trim()));
        }
        for text in ["", "%", "-1%", "NaN", "inf", "one"] {
            assert!(text.parse::<Percent>().is_err(), "{text}");
        }
    }
}
