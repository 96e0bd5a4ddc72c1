//! What a tree costs by the number of triangles: its build, and each ray.

use super::chart::{Axis, Body, Chart, Curve, Place, Plane, Scale, Value, slug};
use super::names::{flavour, flavours};
use super::notes::{self, Found};
use super::ratios::{total, unvaried};
use super::scenes::series_of_arities;
use crate::estimate::estimate;
use crate::select::{Entry, Selection};
use record::Rays;

/// One chart a flavour, with the variant `reference` in each.
pub fn charts(selection: &Selection, reference: &str) -> Found {
    let variants = unvaried(selection);
    let mut sizes: Vec<u64> = selection.entries.iter().map(|entry| entry.point.scene.triangles).collect();
    sizes.sort_unstable();
    sizes.dedup();
    if sizes.len() < 2 || variants.is_empty() {
        return Found::nothing("it takes scenes of at least two sizes, measured with one set of parameters");
    }
    let others: Vec<&str> = variants.iter().copied().filter(|variant| *variant != reference).collect();
    let mut found = Found::default();
    let mut of_flavours = flavours(&others);
    if of_flavours.is_empty() {
        of_flavours = flavours(&variants);
    }
    for of in of_flavours {
        let those: Vec<&str> =
            variants.iter().copied().filter(|name| *name == reference || flavour(name) == of).collect();
        found.charts.push(chart(selection, &of, &those, reference));
    }
    found
}

fn chart(selection: &Selection, of: &str, variants: &[&str], reference: &str) -> Chart {
    let axis = |title: &str| Axis {
        title: title.to_owned(),
        scale: Scale::Logarithmic,
        ticks: Vec::new(),
        names: Vec::new(),
        includes: Vec::new(),
    };
    let panels = [
        ("Build, with sample rays", "device time (ms)", build as fn(&Entry) -> Option<Value>),
        ("Primary rays", "time of a ray (ns)", |entry| of_a_ray(entry, Rays::Primary)),
        ("Secondary rays", "time of a ray (ns)", |entry| of_a_ray(entry, Rays::Secondary)),
    ]
    .into_iter()
    .filter_map(|(title, unit, cost)| {
        let curves: Vec<Curve> = variants
            .iter()
            .enumerate()
            .map(|(series, variant)| Curve {
                series,
                right: false,
                places: places(selection, variant, cost),
                band: Vec::new(),
            })
            .filter(|curve| !curve.places.is_empty())
            .collect();
        (!curves.is_empty()).then(|| Plane {
            title: title.to_owned(),
            x: axis("triangles"),
            y: axis(unit),
            right: None,
            curves,
        })
    });
    let interval =
        |plane: &Plane| plane.curves.iter().flat_map(|c| &c.places).any(|place| place.y.interval.is_some());
    let panels: Vec<Plane> = panels.collect();
    let bars = if panels.iter().any(interval) { "Error bars: 95% confidence intervals. " } else { "" };
    let shown = selection.entries.iter().filter(|entry| variants.contains(&entry.variant()));
    let scenes = selection.scenes().join(", ");
    let with = if flavour(reference) == *of || !variants.contains(&reference) {
        String::new()
    } else {
        format!(", with {reference}")
    };
    Chart {
        name: format!("cost-{}", slug(of)),
        title: format!("Cost by the size of the scene: {of} variants{with}"),
        note: format!(
            "Each place is a scene ({scenes}); scenes differ in more than their size. {bars}{}{}",
            notes::device(selection),
            notes::unreliable(shown.map(|entry| entry.point))
        ),
        series: series_of_arities(variants),
        body: Body::Planes(panels),
    }
}

/// A variant's scenes by size.
fn places(selection: &Selection, variant: &str, cost: fn(&Entry) -> Option<Value>) -> Vec<Place> {
    let entries = selection.entries.iter().filter(|entry| entry.variant() == variant);
    let mut places: Vec<Place> = entries
        .filter_map(|entry| Some(Place { x: entry.point.scene.triangles as f64, y: cost(entry)? }))
        .filter(|place| place.x > 0.0 && place.y.value > 0.0)
        .collect();
    places.sort_by(|a, b| a.x.total_cmp(&b.x));
    places
}

fn build(entry: &Entry) -> Option<Value> {
    total(entry.point)
}

/// Nanoseconds: a thousand over million rays a second. The ends of the interval are those of the rate's.
fn of_a_ray(entry: &Entry, rays: Rays) -> Option<Value> {
    let nanoseconds = |mrps: f64| 1e3 / mrps;
    let interval = estimate(entry.point, rays).and_then(|estimate| {
        let [low, high] = [estimate.mean - estimate.half_width(), estimate.mean + estimate.half_width()];
        (low > 0.0).then(|| [nanoseconds(high), nanoseconds(low)])
    });
    Some(Value { value: nanoseconds(entry.point.rate(rays)?), interval })
}
