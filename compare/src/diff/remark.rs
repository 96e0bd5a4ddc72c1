//! What else to know about a comparison.

use super::cell::common_views;
use super::pair::Pairs;
use crate::select::{Entry, Pass, differing, in_order, text};
use record::{Parameters, Record};
use std::collections::BTreeMap;

/// Parameters that differ, points that only one side has, and what weakens either side.
pub fn remarks(old: &Record, new: &Record, pairs: &Pairs) -> Vec<String> {
    let mut remarks = parameters(pairs);
    for (side, only) in [("before", &pairs.only_old), ("after", &pairs.only_new)] {
        let names: Vec<String> = only.iter().map(|(pass, entry)| named(pass, entry, pairs)).collect();
        if !names.is_empty() {
            remarks.push(format!("only {side}: {}", in_order(names).join("; ")));
        }
    }
    for (scene, variant) in &pairs.ambiguous {
        remarks.push(format!(
            "{variant} on {scene} is not compared: several points belong to one of the other side, which does not \
             know the parameter that sets them apart"
        ));
    }
    remarks.extend(views(pairs));
    for (side, record) in [("before", old), ("after", new)] {
        if record.finished.is_none() {
            remarks.push(format!("the run {side} was interrupted, or goes on still"));
        }
        if record.drifts().iter().any(|drift| drift.significant()) {
            remarks.push(format!("the device drifted {side}: rates of the reference point follow the time"));
        }
    }
    let unreliable = pairs.pairs.iter().flat_map(|(_, pair)| [pair.old, pair.new]);
    let unreliable =
        unreliable.filter(|entry| entry.point.measurement.as_ref().is_some_and(|m| m.unreliable));
    let names: Vec<String> =
        unreliable.map(|entry| format!("{} on {}", entry.variant(), entry.scene())).collect();
    if !names.is_empty() {
        remarks.push(format!("unreliable, because too few samples count: {}", in_order(names).join("; ")));
    }
    remarks
}

/// A point in as few words as possible: its scene is enough if nothing is compared on it, its variant if that is
/// compared nowhere, and so on.
fn named(pass: &Pass, entry: &Entry, pairs: &Pairs) -> String {
    let compared =
        |is: &dyn Fn(&Pass, &Entry) -> bool| pairs.pairs.iter().any(|(pass, pair)| is(pass, pair.old));
    let variant = entry.variant();
    if !compared(&|_, other| other.scene() == entry.scene()) {
        return format!("scene {}", entry.scene());
    }
    if !compared(&|_, other| other.variant() == variant) {
        return variant.to_owned();
    }
    let of_pass = if pass.0.is_empty() { variant.to_owned() } else { format!("{variant} with {pass}") };
    if !compared(&|own, other| own == pass && other.variant() == variant) {
        return of_pass;
    }
    format!("{of_pass} on {}", entry.scene())
}

/// One line for each parameter that has another value, or that only one side has.
fn parameters(pairs: &Pairs) -> Vec<String> {
    let mut found: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for (_, pair) in &pairs.pairs {
        for name in differing(&pair.old.parameters, &pair.new.parameters) {
            let value = |of: &Parameters| of.get(&name).map_or("absent".into(), text);
            let told = format!(
                "{name}: {} before, {} after",
                value(&pair.old.parameters),
                value(&pair.new.parameters)
            );
            found.entry(told).or_default().push(pair.old.variant());
        }
    }
    let all = in_order(pairs.pairs.iter().map(|(_, pair)| pair.old.variant())).len();
    let lines = found.into_iter().map(|(told, variants)| match in_order(variants) {
        some if some.len() < all => format!("{told} ({})", some.join(", ")),
        _ => told,
    });
    lines.collect()
}

/// Points that were measured from other views: those that both have are compared.
fn views(pairs: &Pairs) -> Option<String> {
    let differ = pairs.pairs.iter().filter(|(_, pair)| {
        let (old, new) = (pair.old.point, pair.new.point);
        let common = common_views(old, new).len();
        common < old.views.len() || common < new.views.len()
    });
    let scenes = in_order(differ.map(|(_, pair)| pair.old.scene()));
    (!scenes.is_empty()).then(|| {
        format!("not the same views, so only those on both sides are compared: {}", scenes.join(", "))
    })
}
