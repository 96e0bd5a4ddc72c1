//! Which points of two records belong together.

use crate::select::{Entry, Pass, Selection, in_order};
use std::collections::BTreeSet;

/// Two points that are compared.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'s, 'r> {
    /// The point from before.
    pub old: &'s Entry<'r>,
    /// The point from after.
    pub new: &'s Entry<'r>,
}

/// All points of two records.
#[derive(Debug, Default)]
pub struct Pairs<'s, 'r> {
    /// Those that belong together, by variant, then by pass, then by scene; each in order of first appearance.
    pub pairs: Vec<(Pass, Pair<'s, 'r>)>,
    /// Those that only the old record has.
    pub only_old: Vec<(Pass, &'s Entry<'r>)>,
    /// Those that only the new record has.
    pub only_new: Vec<(Pass, &'s Entry<'r>)>,
    /// Variants on scenes where several points of one side would belong to one of the other, because what sets them
    /// apart is a parameter that the other side does not have.
    pub ambiguous: BTreeSet<(String, String)>,
}

impl Pairs<'_, '_> {
    /// Names of the scenes, in order of first appearance.
    pub fn scenes(&self) -> Vec<&str> {
        in_order(self.pairs.iter().map(|(_, pair)| pair.old.scene()))
    }
}

/// Points belong together if scene and variant have the same name, and those parameters the same value that tell
/// points of a variant apart and that both sides know. Other parameters may differ: they may be what was changed.
pub fn pairs<'s, 'r>(old: &'s Selection<'r>, new: &'s Selection<'r>) -> Pairs<'s, 'r> {
    let mut found = Pairs::default();
    let scenes = in_order(old.scenes().into_iter().chain(new.scenes()));
    for variant in in_order(old.variants().into_iter().chain(new.variants())) {
        let axes = axes(old, new, variant);
        let of = |selection: &'s Selection<'r>| -> Vec<(Pass, &'s Entry<'r>)> {
            let own = selection.entries.iter().filter(|entry| entry.variant() == variant);
            own.map(|entry| (entry.pass_of(&axes), entry)).collect()
        };
        let (old, new) = (of(old), of(new));
        for pass in in_order(old.iter().chain(&new).map(|(pass, _)| pass)) {
            for scene in &scenes {
                let own = |side: &[(Pass, &'s Entry<'r>)]| -> Vec<&'s Entry<'r>> {
                    let own = side.iter().filter(|(its, entry)| its == pass && entry.scene() == *scene);
                    own.map(|(_, entry)| *entry).collect()
                };
                match (&own(&old)[..], &own(&new)[..]) {
                    ([old], [new]) => found.pairs.push((pass.clone(), Pair { old, new })),
                    (old, []) => found.only_old.extend(old.iter().map(|entry| (pass.clone(), *entry))),
                    ([], new) => found.only_new.extend(new.iter().map(|entry| (pass.clone(), *entry))),
                    _ => {
                        found.ambiguous.insert((scene.to_string(), variant.to_owned()));
                    }
                }
            }
        }
    }
    found
}

/// Names of the parameters that tell points of a variant apart on one of the sides and that both know.
fn axes(old: &Selection, new: &Selection, variant: &str) -> BTreeSet<String> {
    let knows = |selection: &Selection, name: &str| {
        let mut own = selection.entries.iter().filter(|entry| entry.variant() == variant);
        own.any(|entry| entry.parameters.get(name).is_some())
    };
    let mut axes = old.axes(variant);
    axes.append(&mut new.axes(variant));
    axes.retain(|name| knows(old, name) && knows(new, name));
    axes
}
