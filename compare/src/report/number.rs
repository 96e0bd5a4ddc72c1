//! Numbers and gaps, as the page shows them.

use maud::{Markup, html};

/// A value with about three or four digits, all of those before the point.
pub fn short(value: f64) -> String {
    let decimals = match value.abs() {
        size if size >= 99.95 => 0,
        size if size >= 9.995 => 1,
        size if size >= 0.9995 || size == 0.0 => 2,
        _ => 3,
    };
    let text = format!("{value:.decimals$}");
    match text.split_once('.') {
        Some(_) => text,
        None => grouped_text(&text),
    }
}

/// A ratio.
pub fn ratio(value: f64) -> String {
    format!("{value:.2}")
}

/// Half the width of an interval, from its share of the value.
pub fn plus_minus(share: f64) -> String {
    match 100.0 * share {
        0.0 => "±0%".into(),
        percent if percent < 0.05 => "±<0.1%".into(),
        percent if percent < 9.95 => format!("±{percent:.1}%"),
        percent => format!("±{percent:.0}%"),
    }
}

/// A count, in groups of three digits.
pub fn grouped(count: u64) -> String {
    grouped_text(&count.to_string())
}

/// Groups of three digits, if there are more than four, with a narrow space that does not break.
fn grouped_text(digits: &str) -> String {
    let (sign, digits) = digits.strip_prefix('-').map_or(("", digits), |rest| ("-", rest));
    if digits.len() <= 4 {
        return format!("{sign}{digits}");
    }
    let mut text = sign.to_owned();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// A size in KiB, MiB or GiB.
pub fn bytes(count: u64) -> String {
    let size = count as f64;
    match count {
        0..1024 => format!("{count} bytes"),
        1024..0x10_0000 => format!("{} KiB", short(size / 1024.0)),
        0x10_0000..0x4000_0000 => format!("{} MiB", short(size / 1_048_576.0)),
        _ => format!("{} GiB", short(size / 1_073_741_824.0)),
    }
}

/// So many of something, in words: `1 view`, `2 views`.
pub fn count(number: usize, noun: &str) -> String {
    format!("{} {noun}{}", grouped(number as u64), if number == 1 { "" } else { "s" })
}

/// What stands where the record does not tell.
pub fn gap(why: &str) -> Markup {
    html! { span.gap title=(why) { "–" span.aside { " " (why) } } }
}

/// A text of the record, or a gap where it is empty.
pub fn text(text: &str) -> Markup {
    if text.trim().is_empty() {
        gap("not recorded")
    } else {
        html! { (text) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_or_all_before_the_point() {
        let shown: Vec<String> = [1772.4, 99.96, 99.9, 9.996, 1.0, 0.1234, 0.0, 1234567.0, -12345.0]
            .into_iter()
            .map(short)
            .collect();
        let expected = [
            "1772",
            "100",
            "99.9",
            "10.0",
            "1.00",
            "0.123",
            "0.00",
            "1\u{202f}234\u{202f}567",
            "-12\u{202f}345",
        ];
        assert_eq!(shown, expected);
    }

    #[test]
    fn intervals_have_one_digit_after_the_point() {
        let shown: Vec<String> = [0.0, 1e-5, 0.012, 0.5].into_iter().map(plus_minus).collect();
        assert_eq!(shown, ["±0%", "±<0.1%", "±1.2%", "±50%"]);
    }

    #[test]
    fn sizes_have_units() {
        assert_eq!(bytes(1023), "1023 bytes");
        assert_eq!(bytes(1536), "1.50 KiB");
        assert_eq!(bytes(32 << 30), "32.0 GiB");
    }

    #[test]
    fn a_gap_says_why_it_is_one() {
        assert!(text(" ").into_string().contains("not recorded"));
        assert_eq!(text("<b>").into_string(), "&lt;b&gt;");
    }
}
