//! What keys do. One table gives what is done, what is printed when the viewer starts, and its `--help`.

use super::camera::Direction;
use winit::keyboard::{Key, NamedKey};

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Move the camera while the key is held.
    Go(Direction),
    /// Turn about the point that is looked at.
    Orbit,
    /// Fly through the scene.
    Fly,
    /// Turn by itself, or stop.
    Turn,
    /// The scene's view of that number.
    View(usize),
    /// The next view, or the one before.
    NextView(Step),
    /// Back to the view that was chosen last.
    Reset,
    /// The next variant, or the one before.
    NextVariant(Step),
    /// More rays in a path, or fewer.
    Depth(Step),
    /// The other integrator.
    Integrator,
    /// The next heat map, or the one before; after the last one the picture.
    HeatMap(Step),
    /// Brighter or darker.
    Exposure(Step),
    /// Keep the picture and the view.
    Save,
    /// Show or hide chart and words.
    Chart,
    /// Show or hide what keys do.
    Help,
    /// End.
    Quit,
}

/// One on, or one back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    On,
    Back,
}

impl Step {
    /// The index after, or before, `from` of `count`, beginning anew behind the last.
    pub fn around(self, from: usize, count: usize) -> usize {
        match self {
            Self::On => (from + 1) % count,
            Self::Back => (from + count - 1) % count,
        }
    }
}

/// A row of what is printed: keys, and what they do.
type Row = (&'static str, &'static str);

/// Every key; a test holds that each does what its row says.
pub const TABLE: &[Row] = &[
    ("arrows, Page Up/Down", "move the camera; with Shift four times as fast"),
    ("O", "orbit: arrows go about the point looked at, Page Up and Down nearer and away"),
    ("F", "fly: arrows go forward, back and sideways, Page Up and Down up and down"),
    ("mouse", "drag to turn, wheel to go nearer and away"),
    ("Space", "turn about the scene without end, or stop"),
    ("V, 1 to 9", "next view (with Shift the one before), or the view of that number"),
    ("R", "back to the view as it was"),
    ("T", "next variant (with Shift the one before)"),
    ("+, -", "more or fewer rays in a path"),
    ("I", "path tracing, or local shading by point lights with mirror reflections"),
    ("H", "heat map of nodes, boxes, triangles, or the picture again (with Shift the other way)"),
    ("E", "brighter (with Shift darker)"),
    ("C", "chart and words on or off"),
    ("S", "save the picture, and the view into the scene's file"),
    ("F1, ?", "these keys, in the window"),
    ("Q, Esc", "quit"),
];

/// What a key asks for, if anything.
pub fn action(key: &Key, shift: bool) -> Option<Action> {
    let step = if shift { Step::Back } else { Step::On };
    match key {
        Key::Named(named) => Some(match named {
            NamedKey::ArrowUp => Action::Go(Direction::Forward),
            NamedKey::ArrowDown => Action::Go(Direction::Back),
            NamedKey::ArrowLeft => Action::Go(Direction::Left),
            NamedKey::ArrowRight => Action::Go(Direction::Right),
            NamedKey::PageUp => Action::Go(Direction::Up),
            NamedKey::PageDown => Action::Go(Direction::Down),
            NamedKey::Space => Action::Turn,
            NamedKey::F1 => Action::Help,
            NamedKey::Escape => Action::Quit,
            _ => return None,
        }),
        Key::Character(text) => Some(match text.to_lowercase().as_str() {
            "o" => Action::Orbit,
            "f" => Action::Fly,
            "v" => Action::NextView(step),
            "r" => Action::Reset,
            "t" => Action::NextVariant(step),
            // The same key without Shift on many keyboards.
            "+" | "=" => Action::Depth(Step::On),
            "-" | "_" => Action::Depth(Step::Back),
            "i" => Action::Integrator,
            "h" => Action::HeatMap(step),
            "e" => Action::Exposure(step),
            "c" => Action::Chart,
            "s" => Action::Save,
            "?" => Action::Help,
            "q" => Action::Quit,
            digit => match digit.parse() {
                Ok(number @ 1..=9) => Action::View(number - 1),
                _ => return None,
            },
        }),
        _ => None,
    }
}

/// The table as lines of text.
pub fn listed() -> String {
    let width = TABLE.iter().map(|(keys, _)| keys.len()).max().unwrap_or(0);
    let lines: Vec<_> = TABLE.iter().map(|(keys, does)| format!("  {keys:width$}  {does}")).collect();
    format!("Keys in the window:\n{}", lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The keys that a row names.
    fn named(row: &str) -> Vec<Key> {
        let named = |key| Key::Named(key);
        match row {
            "mouse" => vec![],
            "arrows, Page Up/Down" => [
                NamedKey::ArrowUp,
                NamedKey::ArrowDown,
                NamedKey::ArrowLeft,
                NamedKey::ArrowRight,
                NamedKey::PageUp,
                NamedKey::PageDown,
            ]
            .map(named)
            .to_vec(),
            "V, 1 to 9" => ["v", "1", "2", "3", "4", "5", "6", "7", "8", "9"]
                .map(|key| Key::Character(key.into()))
                .to_vec(),
            row => row
                .split(", ")
                .map(|key| match key {
                    "Space" => named(NamedKey::Space),
                    "F1" => named(NamedKey::F1),
                    "Esc" => named(NamedKey::Escape),
                    key => Key::Character(key.to_lowercase().as_str().into()),
                })
                .collect(),
        }
    }

    #[test]
    fn every_key_that_is_told_of_does_something_of_its_own() {
        let mut actions: Vec<Action> = Vec::new();
        for (keys, _) in TABLE {
            let mut own: Vec<Action> = named(keys)
                .iter()
                .map(|key| action(key, false).unwrap_or_else(|| panic!("{keys}: {key:?}")))
                .collect();
            // Two keys of a row may do the same, keys of two rows never.
            own.dedup();
            for action in own {
                assert!(!actions.contains(&action), "{keys}: {action:?} again");
                actions.push(action);
            }
        }
        // Six ways to go, nine views, two steps of the depth, and one each of the other twelve rows with keys and V.
        assert_eq!(actions.len(), 6 + 9 + 2 + 13);
    }

    #[test]
    fn shift_goes_back() {
        let of = |key: &str, shift| action(&Key::Character(key.into()), shift);
        assert_eq!(of("t", false), Some(Action::NextVariant(Step::On)));
        // With Shift the system gives the capital.
        assert_eq!(of("T", true), Some(Action::NextVariant(Step::Back)));
        assert_eq!(of("V", true), Some(Action::NextView(Step::Back)));
        assert_eq!(of("H", true), Some(Action::HeatMap(Step::Back)));
        assert_eq!(of("E", true), Some(Action::Exposure(Step::Back)));
        // Caps Lock alone changes nothing.
        assert_eq!(of("S", false), Some(Action::Save));
        assert_eq!(of("0", false), None);
        assert_eq!(of("x", false), None);
        assert_eq!(action(&Key::Named(NamedKey::Tab), false), None);
    }

    #[test]
    fn steps_go_round() {
        assert_eq!([Step::On.around(2, 3), Step::On.around(0, 3)], [0, 1]);
        assert_eq!([Step::Back.around(0, 3), Step::Back.around(2, 3)], [2, 1]);
        assert_eq!(Step::On.around(0, 1), 0);
    }
}
