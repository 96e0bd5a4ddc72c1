//! Small records for tests.

use record::{Launch, Point, Record, Sample, Value};

/// An axis for [`sweep`].
pub const AXIS: &str = "trace.secondary_subgroups";

/// A record without results, of no sweep.
pub fn record() -> Record {
    let mut record = record::example();
    record.sweep = None;
    record.references.clear();
    record.results.truncate(1);
    record
}

/// A point of a scene and a variant with rates of primary and secondary rays in MRps.
pub fn point(scene: &str, variant: &str, primary: f64, secondary: f64) -> Point {
    let mut point = record::example().results.swap_remove(0);
    point.scene.name = scene.into();
    point.variant = variant.into();
    let launch = |mrps: f64| Launch { rays: 1_000_000, milliseconds: 1e3 / mrps };
    point.views[0].samples =
        vec![Sample { depths: vec![launch(primary), launch(secondary)], ..Sample::default() }];
    point
}

/// The same with a parameter of its own.
pub fn with(mut point: Point, name: &str, value: impl Into<Value>) -> Point {
    point.parameters.set(name, value);
    point
}

/// A sweep over [`AXIS`] with a scene, a value and a rate of secondary rays for each point of `Binary`.
pub fn sweep(points: &[(&str, u32, f64)]) -> Record {
    let mut record = record();
    record.results = (points.iter())
        .map(|&(scene, value, rate)| with(point(scene, "Binary", 1000.0, rate), AXIS, value))
        .collect();
    record
}
