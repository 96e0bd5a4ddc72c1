use crate::{Build, Count, Kernel, Point, Record, SCHEMA, Source, Telemetry, Tree, Utilization, View};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Something in a record that cannot be, and where it stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Where it stands, such as `results[0].views[2].samples[1].depths[0].milliseconds`.
    pub at: String,
    /// What sort of problem it is.
    pub fault: Fault,
    /// What is wrong.
    pub what: String,
}

/// What sort of problem a [`Problem`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Something that must be there is not.
    Empty,
    /// A number that is infinite or none.
    NotFinite,
    /// A number outside the range it can have.
    Range,
    /// Rays were traced in no time.
    NoTime,
    /// The same thing twice.
    Duplicate,
    /// Two fields contradict each other.
    Mismatch,
}

impl fmt::Display for Problem {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}: {}", self.at, self.what)
    }
}

impl Record {
    /// Checks that the record makes sense, and names every place where it does not.
    pub fn validate(&self) -> Result<(), Vec<Problem>> {
        let mut problems = Problems::default();
        if self.schema == 0 || self.schema > SCHEMA {
            let what = format!("{} is no schema that this version knows", self.schema);
            problems.add("schema", Fault::Range, what);
        }
        problems.named("tool.name", &self.tool.name);
        problems.named("tool.version", &self.tool.version);
        if let Some(commit) = &self.tool.commit
            && !is_hex(&commit.hash, 40)
            && !is_hex(&commit.hash, 64)
        {
            let what = format!("{:?} is no git commit", commit.hash);
            problems.add("tool.commit.hash", Fault::Range, what);
        }
        if self.finished.is_some_and(|finished| finished < self.started) {
            problems.add("finished", Fault::Mismatch, "before the run started");
        }
        problems.named("device.name", &self.device.name);
        let limits = &self.device.limits;
        problems.positive("device.limits.timestamp_period_nanoseconds", limits.timestamp_period_nanoseconds);
        if limits.subgroup_size == 0 {
            problems.add("device.limits.subgroup_size", Fault::Range, "zero");
        }
        for (name, hash) in &self.shaders {
            problems.sha256(&format!("shaders[{name:?}]"), hash);
        }
        for (name, value) in [
            ("width", self.run.width),
            ("height", self.run.height),
            ("samples", self.run.samples),
            ("depth", self.run.depth),
        ] {
            if value == 0 {
                problems.add(&format!("run.{name}"), Fault::Range, "zero");
            }
        }
        if let Some(stopping) = &self.run.stopping {
            problems.positive("run.stopping.half_width", stopping.half_width);
            problems.not_negative("run.stopping.seconds", stopping.seconds);
            if stopping.least == 0 || stopping.least > stopping.most || stopping.most != self.run.samples {
                let what = format!(
                    "from {} to {}, and the run's limit is {}",
                    stopping.least, stopping.most, self.run.samples
                );
                problems.add("run.stopping", Fault::Mismatch, what);
            }
        }
        if let Some(clock) = &self.run.clock {
            problems.positive("run.clock.least_share", clock.least_share);
            if clock.mhz == 0 {
                problems.add("run.clock.mhz", Fault::Range, "zero");
            }
        }
        for (index, part) in self.parts.iter().enumerate() {
            problems.named(&format!("parts[{index}].device"), &part.device);
            if part.finished < part.started {
                problems.add(&format!("parts[{index}].finished"), Fault::Mismatch, "before it started");
            }
        }
        for (index, left_out) in self.left_out.iter().enumerate() {
            problems.named(&format!("left_out[{index}].variant"), &left_out.variant);
            problems.named(&format!("left_out[{index}].reason"), &left_out.reason);
        }
        if self.results.is_empty() {
            problems.add("results", Fault::Empty, "nothing was measured");
        }
        for (index, point) in self.references.iter().enumerate() {
            self.check_point(&format!("references[{index}]"), point, &mut problems);
        }
        let mut seen = BTreeMap::new();
        for (index, point) in self.results.iter().enumerate() {
            let at = format!("results[{index}]");
            let parameters: BTreeMap<_, _> = self
                .parameters_of(point)
                .0
                .into_iter()
                .chain(point.scene.parameters().0)
                .map(|(name, value)| (name, value.to_string()))
                .collect();
            let key = (point.scene.name.clone(), point.variant.clone(), parameters);
            if let Some(first) = seen.insert(key, index) {
                let what = format!(
                    "{} with {} was measured before, with the same parameters, in results[{first}]",
                    point.scene.name, point.variant
                );
                problems.add(&at, Fault::Duplicate, what);
            }
            self.check_point(&at, point, &mut problems);
        }
        if problems.0.is_empty() { Ok(()) } else { Err(problems.0) }
    }

    fn check_point(&self, at: &str, point: &Point, problems: &mut Problems) {
        problems.named(&format!("{at}.variant"), &point.variant);
        let scene = &point.scene;
        problems.named(&format!("{at}.scene.name"), &scene.name);
        let hash = match &scene.source {
            Source::File { sha256, .. } => Some(sha256),
            Source::Generator { sha256, .. } => sha256.as_ref(),
        };
        if let Some(hash) = hash {
            problems.sha256(&format!("{at}.scene.source.sha256"), hash);
        }
        if scene.triangles == 0 {
            problems.add(&format!("{at}.scene.triangles"), Fault::Empty, "no triangles");
        }
        problems.not_negative(&format!("{at}.scene.load_milliseconds"), scene.load_milliseconds);
        if let Some(adopted) = &point.adopted {
            let at = format!("{at}.adopted");
            problems.sha256(&format!("{at}.sha256"), &adopted.sha256);
            problems.not_negative(&format!("{at}.built_seconds"), adopted.built_seconds);
            problems.not_negative(&format!("{at}.read_milliseconds"), adopted.read_milliseconds);
        }
        check_build(&format!("{at}.build"), &point.build, problems);
        check_tree(&format!("{at}.tree"), &point.tree, scene.triangles, problems);
        let mut purposes = BTreeSet::new();
        for (index, kernel) in point.kernels.iter().enumerate() {
            let at = format!("{at}.kernels[{index}]");
            if !purposes.insert((&kernel.name, &kernel.purpose)) {
                let what = format!("a second kernel {:?} for {:?}", kernel.name, kernel.purpose);
                problems.add(&at, Fault::Duplicate, what);
            }
            self.check_kernel(&at, kernel, problems);
        }
        if let Some(measurement) = &point.measurement {
            let at = format!("{at}.measurement");
            if measurement.finished < measurement.started {
                problems.add(&format!("{at}.finished"), Fault::Mismatch, "before it started");
            }
            let part = measurement.part as usize;
            if part > 0 && part >= self.parts.len() {
                let what = format!("the record has {} parts", self.parts.len());
                problems.add(&format!("{at}.part"), Fault::Mismatch, what);
            }
        }
        if point.views.is_empty() {
            problems.add(&format!("{at}.views"), Fault::Empty, "no view was measured");
        }
        let mut names = BTreeSet::new();
        for (index, view) in point.views.iter().enumerate() {
            let at = format!("{at}.views[{index}]");
            problems.named(&format!("{at}.name"), &view.name);
            if !names.insert(&view.name) {
                let what = format!("a second view {:?}", view.name);
                problems.add(&at, Fault::Duplicate, what);
            }
            check_view(&at, view, self.run.depth as usize, problems);
            if let Some(adaptation) = &view.adaptation {
                let at = format!("{at}.adaptation");
                check_build(&format!("{at}.build"), &adaptation.build, problems);
                check_tree(&format!("{at}.tree"), &adaptation.tree, point.scene.triangles, problems);
                for (index, &milliseconds) in adaptation.sampling_milliseconds.iter().enumerate() {
                    problems.positive(&format!("{at}.sampling_milliseconds[{index}]"), milliseconds);
                }
                if adaptation.sampling_milliseconds.len() != adaptation.build.repetitions.len() {
                    problems.add(&at, Fault::Mismatch, "not as many samplings as builds");
                }
            }
        }
    }

    fn check_kernel(&self, at: &str, kernel: &Kernel, problems: &mut Problems) {
        if !self.shaders.contains_key(&kernel.name) {
            let what = format!("{:?} is none of the record's shaders", kernel.name);
            problems.add(&format!("{at}.name"), Fault::Mismatch, what);
        }
        problems.named(&format!("{at}.purpose"), &kernel.purpose);
        for (name, value) in
            [("workgroup_size", kernel.workgroup_size), ("subgroup_size", kernel.subgroup_size)]
        {
            if value == 0 {
                problems.add(&format!("{at}.{name}"), Fault::Range, "zero");
            }
        }
        if let Some(occupancy) = kernel.occupancy {
            let at = format!("{at}.occupancy");
            problems.positive(&at, occupancy);
            if occupancy.is_finite() && occupancy > 1.0 {
                problems.add(&at, Fault::Range, format!("{occupancy} is more than all"));
            }
        }
        if kernel.occupancy.is_some() != kernel.limited_by.is_some() {
            let what = "there without occupancy, or the other way round";
            problems.add(&format!("{at}.limited_by"), Fault::Mismatch, what);
        }
    }
}

fn check_build(at: &str, build: &Build, problems: &mut Problems) {
    if build.repetitions.is_empty() {
        problems.add(&format!("{at}.repetitions"), Fault::Empty, "no build was measured");
    }
    for (index, repetition) in build.repetitions.iter().enumerate() {
        let at = format!("{at}.repetitions[{index}]");
        problems.positive(&format!("{at}.milliseconds"), repetition.milliseconds);
        if repetition.phases.is_empty() {
            problems.add(&format!("{at}.phases"), Fault::Empty, "no phase was measured");
        }
        let mut names = BTreeSet::new();
        for (phase_index, phase) in repetition.phases.iter().enumerate() {
            let at = format!("{at}.phases[{phase_index}]");
            problems.named(&format!("{at}.name"), &phase.name);
            if !names.insert(&phase.name) {
                let what = format!("a second phase {:?}", phase.name);
                problems.add(&at, Fault::Duplicate, what);
            }
            problems.not_negative(&format!("{at}.milliseconds"), phase.milliseconds);
        }
        let first = build.repetitions[0].phases.iter().map(|phase| &phase.name);
        if !first.eq(repetition.phases.iter().map(|phase| &phase.name)) {
            let what = "not the phases of the first repetition";
            problems.add(&format!("{at}.phases"), Fault::Mismatch, what);
        }
    }
}

fn check_tree(at: &str, tree: &Tree, triangles: u64, problems: &mut Problems) {
    for (name, value) in [
        ("average_children", tree.average_children),
        ("average_triangles_per_leaf", tree.average_triangles_per_leaf),
        ("sah_cost", tree.sah_cost),
    ] {
        if let Some(value) = value {
            problems.not_negative(&format!("{at}.{name}"), value);
        }
    }
    if tree.bytes.is_some() && (tree.node_bytes.is_some() || tree.triangle_bytes.is_some()) {
        let what = "nodes and triangles are counted apart as well";
        problems.add(&format!("{at}.bytes"), Fault::Mismatch, what);
    }
    if tree.leaves == Some(0) && triangles > 0 {
        problems.add(&format!("{at}.leaves"), Fault::Mismatch, "no leaf holds the triangles");
    }
}

fn check_view(at: &str, view: &View, depth: usize, problems: &mut Problems) {
    if view.samples.is_empty() {
        problems.add(&format!("{at}.samples"), Fault::Empty, "no sample was measured");
    }
    for (index, sample) in view.samples.iter().enumerate() {
        // A record may have millions of these, so places are put in words for problems only.
        if let Some(milliseconds) = sample.frame_milliseconds.filter(|it| !(it.is_finite() && *it > 0.0)) {
            problems.positive(&format!("{at}.samples[{index}].frame_milliseconds"), milliseconds);
        }
        let at = format_args!("{at}.samples[{index}].depths");
        problems.wavefronts(&at, sample.depths.iter().map(|launch| launch.rays), depth);
        for (index, launch) in sample.depths.iter().enumerate() {
            let at = format_args!("{at}[{index}].milliseconds");
            problems.not_negative(&at, launch.milliseconds);
            if launch.rays > 0 && launch.milliseconds == 0.0 {
                let what = format!("{} rays in no time", launch.rays);
                problems.add(&at, Fault::NoTime, what);
            }
        }
    }
    if let Some(counters) = &view.counters {
        let at = format!("{at}.counters.depths");
        problems.wavefronts(&at, counters.depths.iter().map(|count| count.rays), depth);
        for (index, count) in counters.depths.iter().enumerate() {
            let met = Count { rays: 0, ..*count };
            if count.rays == 0 && met != Count::default() {
                let what = "counts without rays";
                problems.add(&format!("{at}[{index}]"), Fault::Mismatch, what);
            }
            if count.nodes.max(count.boxes).max(count.triangles) > COUNTABLE {
                problems.add(&format!("{at}[{index}]"), Fault::Range, "more than anybody can count");
            }
            if let Some(utilization) = &count.utilization {
                check_utilization(&format!("{at}[{index}].utilization"), utilization, problems);
            }
        }
    }
    for (name, telemetry) in [("before", &view.before), ("after", &view.after)] {
        match telemetry {
            Telemetry::Unavailable { reason } => {
                problems.named(&format!("{at}.{name}.reason"), reason);
            }
            Telemetry::Available(reading) => {
                if let Some(watts) = reading.power_watts {
                    problems.not_negative(&format!("{at}.{name}.power_watts"), watts);
                }
            }
        }
    }
}

fn check_utilization(at: &str, utilization: &Utilization, problems: &mut Problems) {
    let size = u64::from(utilization.subgroup_size);
    if size == 0 {
        problems.add(&format!("{at}.subgroup_size"), Fault::Range, "zero");
        return;
    }
    for (name, steps, lanes) in [
        ("node_lanes", utilization.node_steps, utilization.node_lanes),
        ("triangle_lanes", utilization.triangle_steps, utilization.triangle_lanes),
        ("fetch_lanes", utilization.fetches, utilization.fetch_lanes),
    ] {
        let at = format!("{at}.{name}");
        if steps.max(lanes) > COUNTABLE {
            problems.add(&at, Fault::Range, "more than anybody can count");
        } else if lanes < steps || lanes > steps * size {
            let what = format!("{lanes} lanes in {steps} steps of 1 to {size}");
            problems.add(&at, Fault::Mismatch, what);
        }
    }
}

/// Totals above this are mistakes. Below it, those of thousands of wavefronts can be added up in 64 bits.
const COUNTABLE: u64 = 1 << 50;

#[derive(Default)]
struct Problems(Vec<Problem>);

impl Problems {
    fn add(&mut self, at: &(impl fmt::Display + ?Sized), fault: Fault, what: impl Into<String>) {
        self.0.push(Problem { at: at.to_string(), fault, what: what.into() });
    }

    fn named(&mut self, at: &str, text: &str) {
        if text.trim().is_empty() {
            self.add(at, Fault::Empty, "empty");
        }
    }

    fn sha256(&mut self, at: &str, text: &str) {
        if !is_hex(text, 64) {
            self.add(at, Fault::Range, format!("{text:?} is no SHA-256 in lower-case hexadecimal"));
        }
    }

    fn not_negative(&mut self, at: &(impl fmt::Display + ?Sized), value: f64) {
        if !value.is_finite() {
            self.add(at, Fault::NotFinite, format!("{value} is not a finite number"));
        } else if value < 0.0 {
            self.add(at, Fault::Range, format!("{value} is negative"));
        }
    }

    fn positive(&mut self, at: &(impl fmt::Display + ?Sized), value: f64) {
        self.not_negative(at, value);
        if value == 0.0 {
            self.add(at, Fault::Range, "zero");
        }
    }

    /// Primary rays, then bounces: each has no more rays than the one before, since rays only end.
    fn wavefronts(
        &mut self,
        at: &(impl fmt::Display + ?Sized),
        rays: impl Iterator<Item = u64>,
        limit: usize,
    ) {
        let rays: Vec<u64> = rays.collect();
        if rays.first().is_none_or(|&primary| primary == 0) {
            self.add(at, Fault::Empty, "no primary rays");
        }
        if let Some(index) = rays.iter().position(|&rays| rays > COUNTABLE) {
            let what = format!("{} are more than anybody can trace", rays[index]);
            self.add(&format_args!("{at}[{index}].rays"), Fault::Range, what);
        }
        if rays.len() > limit {
            let what = format!("{} depths, and the run's limit is {limit}", rays.len());
            self.add(at, Fault::Mismatch, what);
        }
        for (index, pair) in rays.windows(2).enumerate() {
            if pair[1] > pair[0] {
                let what = format!("{} rays after {} at the depth before", pair[1], pair[0]);
                self.add(&format!("{at}[{}].rays", index + 1), Fault::Mismatch, what);
            }
        }
    }
}

fn is_hex(text: &str, digits: usize) -> bool {
    text.len() == digits && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Adopted, Parameters, Timestamp, example};
    use std::time::{Duration, UNIX_EPOCH};

    #[test]
    fn the_example_is_sound() {
        assert_eq!(example().validate(), Ok(()));
    }

    /// Breaks a sound record in one place and expects that place, and no other, to be named.
    #[track_caller]
    fn breaks(at: &str, fault: Fault, damage: impl FnOnce(&mut Record)) {
        let mut record = example();
        damage(&mut record);
        let problems = record.validate().expect_err("the damage was not noticed");
        let found: Vec<_> = problems.iter().map(|problem| (problem.at.as_str(), problem.fault)).collect();
        assert_eq!(found, [(at, fault)], "{problems:?}");
    }

    #[test]
    fn each_damage_is_named_where_it_is() {
        use Fault::*;
        let launch = "results[0].views[0].samples[1].depths[2]";
        let time = format!("{launch}.milliseconds");
        fn milliseconds(record: &mut Record) -> &mut f64 {
            &mut record.results[0].views[0].samples[1].depths[2].milliseconds
        }
        breaks(&time, NotFinite, |r| *milliseconds(r) = f64::NAN);
        breaks(&time, NotFinite, |r| *milliseconds(r) = f64::INFINITY);
        breaks(&time, Range, |r| *milliseconds(r) = -1.0);
        breaks(&time, NoTime, |r| *milliseconds(r) = 0.0);
        breaks(&format!("{launch}.rays"), Mismatch, |r| {
            r.results[0].views[0].samples[1].depths[2].rays = 1 << 40;
        });

        breaks("results[0].views[0].samples[1].depths[0].rays", Range, |r| {
            r.results[0].views[0].samples[1].depths[0].rays = u64::MAX;
        });
        breaks("results[0].views[0].counters.depths[1]", Range, |r| {
            r.results[0].views[0].counters.as_mut().unwrap().depths[1].boxes = u64::MAX;
        });

        let utilization = "results[0].views[0].counters.depths[1].utilization";
        fn utilized(record: &mut Record) -> &mut Utilization {
            let counters = record.results[0].views[0].counters.as_mut().unwrap();
            counters.depths[1].utilization.as_mut().unwrap()
        }
        breaks(&format!("{utilization}.subgroup_size"), Range, |r| utilized(r).subgroup_size = 0);
        breaks(&format!("{utilization}.node_lanes"), Mismatch, |r| utilized(r).node_steps /= 32);
        breaks(&format!("{utilization}.triangle_lanes"), Mismatch, |r| utilized(r).triangle_lanes = 1);
        breaks(&format!("{utilization}.fetch_lanes"), Mismatch, |r| utilized(r).fetches = 0);
        breaks(&format!("{utilization}.fetch_lanes"), Range, |r| utilized(r).fetches = u64::MAX);

        breaks("schema", Range, |r| r.schema = SCHEMA + 1);
        breaks("tool.name", Empty, |r| r.tool.name.clear());
        breaks("tool.commit.hash", Range, |r| {
            r.tool.commit.as_mut().unwrap().hash = "unknown".into();
        });
        breaks("finished", Mismatch, |r| {
            r.finished = Some(Timestamp::from(UNIX_EPOCH + Duration::from_secs(1)));
        });
        breaks("device.name", Empty, |r| r.device.name = " ".into());
        breaks("device.limits.timestamp_period_nanoseconds", Range, |r| {
            r.device.limits.timestamp_period_nanoseconds = 0.0;
        });
        breaks("device.limits.subgroup_size", Range, |r| r.device.limits.subgroup_size = 0);
        breaks("shaders[\"x\"]", Range, |r| {
            r.shaders.insert("x".into(), "E3".into());
        });
        breaks("run.samples", Range, |r| {
            r.run.samples = 0;
            r.run.stopping = None;
        });
        breaks("run.stopping", Mismatch, |r| r.run.stopping.as_mut().unwrap().least = 31);
        breaks("run.stopping", Mismatch, |r| r.run.samples = 29);
        breaks("run.stopping.half_width", NotFinite, |r| {
            r.run.stopping.as_mut().unwrap().half_width = f64::NAN;
        });
        breaks("run.clock.mhz", Range, |r| r.run.clock.as_mut().unwrap().mhz = 0);
        breaks("parts[0].finished", Mismatch, |r| {
            r.parts[0].finished = Timestamp::from(UNIX_EPOCH);
        });
        breaks("references[0].tree.leaves", Mismatch, |r| r.references[0].tree.leaves = Some(0));
        breaks("results[0].measurement.part", Mismatch, |r| {
            r.results[0].measurement.as_mut().unwrap().part = 1;
        });
        breaks("results[0].measurement.finished", Mismatch, |r| {
            r.results[0].measurement.as_mut().unwrap().finished = Timestamp::from(UNIX_EPOCH);
        });
        breaks("results", Empty, |r| r.results.clear());
        breaks("results[2]", Duplicate, |r| r.results.push(r.results[0].clone()));

        breaks("results[0].variant", Empty, |r| r.results[0].variant.clear());
        breaks("results[0].scene.triangles", Empty, |r| r.results[0].scene.triangles = 0);
        breaks("results[0].scene.load_milliseconds", Range, |r| {
            r.results[0].scene.load_milliseconds = -0.5;
        });
        let adopt = |r: &mut Record, sha256: &str, built_seconds| {
            r.results[0].adopted = Some(Adopted {
                name: "s.bvh".into(),
                sha256: sha256.into(),
                method: "ploc".into(),
                parameters: Parameters::default(),
                built_seconds,
                read_milliseconds: 0.5,
            });
        };
        breaks("results[0].adopted.sha256", Range, |r| adopt(r, "ABC", 1.0));
        breaks("results[0].adopted.built_seconds", Range, |r| adopt(r, &"a0".repeat(32), -1.0));
        breaks("results[1].scene.source.sha256", Range, |r| {
            r.results[1].scene.source = Source::File { name: "sponza.glb".into(), sha256: "ABC".into() };
        });
        breaks("results[0].build.repetitions", Empty, |r| {
            r.results[0].build.repetitions.clear();
        });
        breaks("results[0].build.repetitions[0].milliseconds", Range, |r| {
            r.results[0].build.repetitions[0].milliseconds = 0.0;
        });
        breaks("results[0].build.repetitions[1].phases[0].milliseconds", NotFinite, |r| {
            r.results[0].build.repetitions[1].phases[0].milliseconds = f64::NAN;
        });
        breaks("results[0].build.repetitions[1].phases", Mismatch, |r| {
            r.results[0].build.repetitions[1].phases.swap(0, 1);
        });
        breaks("results[0].tree.sah_cost", NotFinite, |r| {
            r.results[0].tree.sah_cost = Some(f64::INFINITY);
        });
        breaks("results[0].tree.leaves", Mismatch, |r| r.results[0].tree.leaves = Some(0));
        breaks("results[0].tree.bytes", Mismatch, |r| r.results[0].tree.bytes = Some(1));
        breaks("left_out[0].reason", Empty, |r| {
            r.left_out.push(crate::LeftOut { variant: "Driver".into(), reason: " ".into() });
        });
        let kernel = "results[0].kernels[1]";
        fn second(record: &mut Record) -> &mut Kernel {
            &mut record.results[0].kernels[1]
        }
        breaks(kernel, Duplicate, |r| second(r).purpose = "primary".into());
        breaks(&format!("{kernel}.name"), Mismatch, |r| second(r).name = "traverse/trinary".into());
        breaks(&format!("{kernel}.purpose"), Empty, |r| second(r).purpose.clear());
        breaks(&format!("{kernel}.workgroup_size"), Range, |r| second(r).workgroup_size = 0);
        breaks(&format!("{kernel}.subgroup_size"), Range, |r| second(r).subgroup_size = 0);
        breaks(&format!("{kernel}.occupancy"), NotFinite, |r| second(r).occupancy = Some(f64::NAN));
        breaks(&format!("{kernel}.occupancy"), Range, |r| second(r).occupancy = Some(0.0));
        breaks(&format!("{kernel}.occupancy"), Range, |r| second(r).occupancy = Some(1.01));
        breaks(&format!("{kernel}.limited_by"), Mismatch, |r| second(r).occupancy = None);
        breaks(&format!("{kernel}.limited_by"), Mismatch, |r| second(r).limited_by = None);
        breaks("results[0].views", Empty, |r| r.results[0].views.clear());
        breaks("results[0].views[1]", Duplicate, |r| {
            let view = r.results[0].views[0].clone();
            r.results[0].views.push(view);
        });
        breaks("results[0].views[0].samples[0].frame_milliseconds", Range, |r| {
            r.results[0].views[0].samples[0].frame_milliseconds = Some(0.0);
        });
        breaks("results[0].views[0].samples", Empty, |r| {
            r.results[0].views[0].samples.clear();
        });
        breaks("results[0].views[0].samples[0].depths", Empty, |r| {
            r.results[0].views[0].samples[0].depths.clear();
        });
        breaks("results[0].views[0].samples[0].depths", Mismatch, |r| {
            let depths = &mut r.results[0].views[0].samples[0].depths;
            let last = depths[depths.len() - 1];
            depths.resize(r.run.depth as usize + 1, last);
        });
        breaks("results[0].views[0].counters.depths[2]", Mismatch, |r| {
            r.results[0].views[0].counters.as_mut().unwrap().depths[2].rays = 0;
        });
        breaks("results[0].views[0].after.power_watts", NotFinite, |r| {
            if let Telemetry::Available(reading) = &mut r.results[0].views[0].after {
                reading.power_watts = Some(f64::NAN);
            }
        });
        breaks("results[0].views[0].before.reason", Empty, |r| {
            r.results[0].views[0].before = Telemetry::unavailable("");
        });
    }

    #[test]
    fn other_parameters_are_another_point() {
        let mut record = example();
        let mut point = record.results[0].clone();
        point.parameters.set("collapse.c_t", 3.0);
        record.results.push(point);
        assert_eq!(record.validate(), Ok(()));
    }

    #[test]
    fn other_parameters_of_the_generator_are_another_point() {
        let mut record = example();
        let mut point = record.results[1].clone();
        let Source::Generator { parameters, .. } = &mut point.scene.source else { panic!("it is generated") };
        parameters.set("seed", 2u32);
        record.results.push(point);
        assert_eq!(record.validate(), Ok(()));
    }

    #[test]
    fn a_kernel_need_not_tell_more_than_its_sizes() {
        let mut record = example();
        for kernel in &mut record.results[0].kernels {
            *kernel = Kernel {
                registers: None,
                local_bytes: None,
                shared_bytes: None,
                spills: None,
                code_bytes: None,
                occupancy: None,
                limited_by: None,
                ..kernel.clone()
            };
        }
        assert_eq!(record.validate(), Ok(()));
    }

    #[test]
    fn spelling_out_a_shared_parameter_is_no_other_point() {
        let mut record = example();
        let mut point = record.results[0].clone();
        let (name, value) = record.parameters.0.iter().next().unwrap();
        point.parameters.set(name.clone(), value.clone());
        record.results.push(point);
        let problems = record.validate().unwrap_err();
        assert_eq!(problems[0].fault, Fault::Duplicate);
    }

    #[test]
    fn a_wavefront_without_rays_may_take_no_time() {
        let mut record = example();
        let last = record.results[0].views[0].samples[0].depths.last_mut().unwrap();
        last.rays = 0;
        last.milliseconds = 0.0;
        assert_eq!(record.validate(), Ok(()));
    }
}
