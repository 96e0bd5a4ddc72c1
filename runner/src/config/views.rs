//! Lists of views, which are names and numbers until a scene is loaded.

/// Each view of a list such as `0,3-5,door`, ranges of numbers spelt out.
///
/// # Errors
/// There is none, or a range runs backwards.
pub fn each(list: &str) -> Result<Vec<String>, String> {
    let mut each: Vec<String> = Vec::new();
    for part in list.split(',').map(str::trim).filter(|part| !part.is_empty()) {
        let number = |text: &str| text.trim().parse::<u32>().ok();
        let ends = part.split_once('-').and_then(|(from, to)| Some((number(from)?, number(to)?)));
        let views: Vec<_> = match ends {
            Some((from, to)) if from > to => return Err(format!("{part:?} runs backwards")),
            Some((_, to)) if to > 9999 => return Err(format!("{part:?} are too many views")),
            Some((from, to)) => (from..=to).map(|view| view.to_string()).collect(),
            None => vec![part.to_owned()],
        };
        for view in views {
            if !each.contains(&view) {
                each.push(view);
            }
        }
    }
    if each.is_empty() { Err(format!("{list:?} names no view")) } else { Ok(each) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_spelt_out_and_each_view_comes_once() {
        assert_eq!(each("0, 2-4,3,front-door").unwrap(), ["0", "2", "3", "4", "front-door"]);
        assert!(each(" , ").unwrap_err().contains("no view"));
        assert!(each("3-1").unwrap_err().contains("backwards"));
        assert!(each("0-4000000000").unwrap_err().contains("many"));
    }
}
