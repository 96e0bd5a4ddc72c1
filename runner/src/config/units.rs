//! Quantities as files write them: with their unit.

use serde::Deserialize;
use std::{str::FromStr, time::Duration};

/// A share of a whole, written as a percentage.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub struct Share(pub f64);

impl FromStr for Share {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let number = text.trim().strip_suffix('%').and_then(|number| number.trim().parse::<f64>().ok());
        match number {
            Some(percent) if (0.0..=100.0).contains(&percent) => Ok(Self(percent / 100.0)),
            Some(_) => Err(format!("{text:?} is not between \"0%\" and \"100%\"")),
            None => Err(format!("{text:?} is no share; write a percentage, such as \"1%\"")),
        }
    }
}

/// A time with its unit.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub struct Time(pub Duration);

impl FromStr for Time {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is no time; write a number and ms, s, min or h, such as \"60 s\"");
        let start = text.find(char::is_alphabetic).ok_or_else(wrong)?;
        let (number, unit) = text.split_at(start);
        let seconds = match unit.trim() {
            "ms" => 0.001,
            "s" => 1.0,
            "min" => 60.0,
            "h" => 3600.0,
            _ => return Err(wrong()),
        };
        let number: f64 = number.trim().parse().map_err(|_| wrong())?;
        Duration::try_from_secs_f64(number * seconds)
            .map(Self)
            .map_err(|_| format!("{text:?} is too long or negative"))
    }
}

impl TryFrom<String> for Share {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl TryFrom<String> for Time {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_percentages() {
        assert_eq!("1%".parse(), Ok(Share(0.01)));
        assert_eq!(" 95 % ".parse(), Ok(Share(0.95)));
        assert_eq!("0.5%".parse(), Ok(Share(0.005)));
        for wrong in ["1", "1 s", "%", "-1%", "101%", "nan%", ""] {
            assert!(wrong.parse::<Share>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn times_have_a_unit() {
        for (text, milliseconds) in
            [("60 s", 60_000), ("1.5min", 90_000), ("2 h", 7_200_000), ("250 ms", 250)]
        {
            assert_eq!(text.parse(), Ok(Time(Duration::from_millis(milliseconds))));
        }
        for wrong in ["60", "5 parsecs", "s", "-1 s", "1e99 h", "1 s 2", "", "5%"] {
            assert!(wrong.parse::<Time>().is_err(), "{wrong}");
        }
    }
}
