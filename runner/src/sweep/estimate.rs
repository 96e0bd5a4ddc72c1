//! How long a sweep will take.

use crate::{
    measure::{Measuring, Plan, Sampling, Unwatched},
    params::Params,
    session::Session,
    telemetry::Telemetry,
    variant::Variant,
};
use std::time::{Duration, Instant};
use tracer::scene::{Source, built_in};

/// The scene that tells how fast a device is.
const SCENE: &str = "sphereflake:triangles=20000";

/// How fast a device is, roughly: found out by measuring `Binary` on a small scene.
pub struct Speed {
    /// Rays that the path through one pixel has.
    rays_a_pixel: f64,
    /// Rays a second, shading and transfers included.
    rays_a_second: f64,
    /// Triangles built into a tree a second.
    triangles_a_second: f64,
    /// Seconds that go by for each point with other things, such as compiling kernels.
    point_seconds: f64,
}

impl Speed {
    /// Measures it; takes about a second.
    ///
    /// # Errors
    /// The device failed.
    pub fn of(session: &Session, telemetry: &Telemetry, plan: &Plan, cpu: bool) -> anyhow::Result<Self> {
        let loaded = session.load(SCENE)?;
        // As large as keeps the device busy.
        let size = if cpu { (96, 54) } else { (1280, 720) };
        let variant = Variant::BINARY;
        let params = Params::of(variant);
        let measure = |samples, builds| -> anyhow::Result<(f64, record::Point)> {
            let plan = Plan {
                size,
                builds,
                sampling: Sampling::exactly(samples),
                warm_up: 1,
                counting: false,
                ..plan.clone()
            };
            let common = record::Parameters::default();
            let measuring = Measuring {
                session,
                telemetry,
                loaded: &loaded,
                variant,
                params: &params,
                plan: &plan,
                common: &common,
                position: 0,
            };
            let started = Instant::now();
            let point = measuring.measure(&[0], &mut Unwatched)?.expect("nobody interrupts it");
            Ok((started.elapsed().as_secs_f64(), point))
        };
        let (few, _) = measure(1, 1)?;
        let (more, point) = measure(3, 1)?;
        let pixels = f64::from(size.0) * f64::from(size.1);
        let rays: u64 = point.views[0].samples[0].depths.iter().map(|launch| launch.rays).sum();
        let sample_seconds = ((more - few) / 2.0).max(1e-5);
        let build_seconds = point.build.median_milliseconds().unwrap_or(1.0) / 1e3;
        Ok(Self {
            rays_a_pixel: rays as f64 / pixels,
            rays_a_second: rays as f64 / sample_seconds,
            triangles_a_second: loaded.scene.positions.len() as f64 / build_seconds,
            // One sample counts, and one before it warms up.
            point_seconds: (few - 2.0 * sample_seconds).max(0.01),
        })
    }

    /// Seconds that a point takes with the fewest and with the most samples.
    pub fn seconds(&self, plan: &Plan, triangles: u64, views: usize, by_view: bool) -> [f64; 2] {
        let pixels = f64::from(plan.size.0) * f64::from(plan.size.1);
        let sample = pixels * self.rays_a_pixel / self.rays_a_second;
        let trees = if by_view { 1 + views } else { 1 } as f64;
        // A build that is not measured comes before those that are.
        let builds = trees * f64::from(plan.builds + 1) * triangles as f64 / self.triangles_a_second;
        let of = |samples: u32| {
            self.point_seconds + builds + views as f64 * sample * f64::from(samples + plan.warm_up + 1)
        };
        let least = of(plan.sampling.least);
        let cap = plan.sampling.time.as_secs_f64().max(least);
        [least, of(plan.sampling.most).min(cap)]
    }
}

/// Triangles of a scene, without loading it; nothing where only loading tells.
pub fn triangles(spec: &str) -> Option<u64> {
    let (name, options) = spec.split_once(':').unwrap_or((spec, ""));
    let asked = options.split(',').find_map(|option| option.trim().strip_prefix("triangles="));
    if let Some(count) = asked {
        return count.parse().ok();
    }
    let entry = built_in().iter().find(|entry| entry.name == name)?;
    match entry.descriptor().ok()?.source {
        Source::Generator { triangles, .. } => Some(triangles),
        Source::File { triangles, .. } => triangles,
        Source::Models(_) => None,
    }
}

/// A duration as people say it: `45 s`, `12 min`, `3 h 20 min`.
pub fn spoken(seconds: f64) -> String {
    let whole = Duration::from_secs_f64(seconds.clamp(0.0, 1e9)).as_secs_f64().round() as u64;
    match whole {
        0..100 => format!("{whole} s"),
        100..6000 => format!("{} min", (whole + 30) / 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_known_without_loading() {
        assert_eq!(triangles("city:triangles=1000,seed=3"), Some(1000));
        assert!(triangles("sphereflake").is_some_and(|count| count > 1000));
        assert_eq!(triangles("models/thing.glb"), None);
    }

    #[test]
    fn durations_are_said_as_people_do() {
        assert_eq!(spoken(44.6), "45 s");
        assert_eq!(spoken(150.0), "3 min");
        assert_eq!(spoken(12_000.0), "3 h 20 min");
    }
}
