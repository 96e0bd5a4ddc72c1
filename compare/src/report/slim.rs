//! Plots with fewer bytes, for a page that holds many of them.

use crate::plot::{self, Chart};
use std::fmt::Write;

/// A plot as SVG that looks the same and is a fraction of the size: what is the default anyway is left out, and
/// the lines of a hatching become one path. Its letters are those of the style sheet.
pub fn svg(chart: &Chart) -> String {
    slim(&plot::svg(chart))
}

fn slim(svg: &str) -> String {
    let mut out = String::with_capacity(svg.len() / 3);
    // The look of the lines that are being gathered.
    let mut look: Option<&str> = None;
    let end = |out: &mut String, look: &mut Option<&str>| {
        if look.take().is_some() {
            out.push_str("\"/>");
        }
    };
    // A text of the record cannot begin like an element: its `<` is escaped.
    for line in svg.lines() {
        if let Some((own, points)) = polyline(line) {
            if look != Some(own) {
                end(&mut out, &mut look);
                let _ = write!(out, "<path fill=\"none\"{own} d=\"");
                look = Some(own);
            }
            path(&mut out, points);
            continue;
        }
        end(&mut out, &mut look);
        if line.starts_with('<') {
            out.push_str(&without_font(line).replace(" opacity=\"1\"", "").replace(" stroke=\"none\"", ""));
        } else {
            out.push_str(line);
        }
    }
    end(&mut out, &mut look);
    out
}

/// The look and the places of a line that hides what is below it all.
fn polyline(line: &str) -> Option<(&str, &str)> {
    let rest = line.strip_prefix("<polyline fill=\"none\" opacity=\"1\"")?;
    rest.strip_suffix(" \"/>")?.split_once(" points=\"")
}

/// Adds a line through places that are given as `x,y x,y`, from each to the next.
fn path(out: &mut String, points: &str) {
    let mut last: Option<(i64, i64)> = None;
    for point in points.split(' ') {
        let place = point.split_once(',').and_then(|(x, y)| Some((x.parse().ok()?, y.parse().ok()?)));
        let Some((x, y)) = place else { continue };
        let _ = match last {
            None => write!(out, "M{x} {y}"),
            Some((before, _)) if before == x => write!(out, "V{y}"),
            Some((_, before)) if before == y => write!(out, "H{x}"),
            Some((left, above)) => write!(out, "l{} {}", x - left, y - above),
        };
        last = Some((x, y));
    }
}

/// An element without the name of its font.
fn without_font(element: &str) -> String {
    let name = " font-family=\"";
    let Some((before, rest)) = element.split_once(name) else { return element.to_owned() };
    let after = rest.split_once('"').map_or("", |(_, after)| after);
    format!("{before}{after}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_one_look_become_one_path() {
        let svg = "<svg>\n<polyline fill=\"none\" opacity=\"1\" stroke=\"#FFF\" stroke-width=\"7\" points=\"1,2 3,4 \"/>\n\
                   <polyline fill=\"none\" opacity=\"1\" stroke=\"#FFF\" stroke-width=\"7\" points=\"5,6 5,7 9,7 \"/>\n\
                   <polyline fill=\"none\" opacity=\"1\" stroke=\"#000\" stroke-width=\"7\" points=\"1,1 0,0 \"/>\n</svg>";
        let expected = "<svg><path fill=\"none\" stroke=\"#FFF\" stroke-width=\"7\" d=\"M1 2l2 2M5 6V7H9\"/>\
                        <path fill=\"none\" stroke=\"#000\" stroke-width=\"7\" d=\"M1 1l-1 -1\"/></svg>";
        assert_eq!(slim(svg), expected);
    }

    #[test]
    fn texts_stay_as_they_are() {
        let svg = "<text x=\"1\" font-family=\"A, B\" opacity=\"1\" fill=\"#000\">\nan opacity=\"1\" &lt;b\n</text>";
        assert_eq!(slim(svg), "<text x=\"1\" fill=\"#000\">an opacity=\"1\" &lt;b</text>");
    }
}
