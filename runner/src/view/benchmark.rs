//! What the chart shows becomes a record.

use super::{camera::Pose, stage::Stage};
use crate::{
    measure::{self, Held, Plan, Sampling, mark_warm_up, slowed},
    session::Session,
    telemetry::{Moment, Telemetry},
};
use record::{Launch, Measurement, Point, Record, Stop, ThrottleTimes, Timestamp};
use std::{
    str::FromStr,
    time::{Duration, Instant},
};
use tracer::path;

/// When a benchmark ends by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// When the window is closed.
    Never,
    /// So long after the first sample.
    After(Duration),
    /// After so many samples.
    Frames(u64),
}

impl FromStr for Limit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "{text:?} is no time and no number of frames; write seconds, such as 10 or 2.5, or frames, such as 200f"
            )
        };
        if text.is_empty() {
            return Ok(Self::Never);
        }
        match text.strip_suffix('f') {
            Some(frames) => match frames.parse() {
                Ok(frames @ 1..) => Ok(Self::Frames(frames)),
                _ => Err(wrong()),
            },
            None => {
                let seconds: f64 = text.strip_suffix('s').unwrap_or(text).parse().map_err(|_| wrong())?;
                let time = Duration::try_from_secs_f64(seconds).map_err(|_| wrong())?;
                if time.is_zero() { Err(wrong()) } else { Ok(Self::After(time)) }
            }
        }
    }
}

impl Limit {
    /// Why no more samples are taken, once that is so.
    fn stop(self, samples: u64, taken: Duration) -> Option<Stop> {
        match self {
            Self::Never => None,
            Self::After(time) => (taken >= time).then_some(Stop::Time),
            Self::Frames(frames) => (samples >= frames).then_some(Stop::Samples),
        }
    }
}

/// What samples are called that were taken from none of the scene's views.
const MOVED: &str = "moved";

/// A record that grows by each sample.
pub struct Benchmark {
    limit: Limit,
    telemetry: Telemetry,
    held: Held,
    record: Record,
    /// When each of the record's points began, and how long its device had been slowed down by then.
    begun: Vec<(Instant, ThrottleTimes)>,
    /// The point and its view that the last sample belongs to.
    current: Option<(usize, usize)>,
    samples: u64,
    /// When the first sample was there.
    first: Option<Instant>,
}

impl Benchmark {
    /// An empty one, of pictures of that size and paths like these.
    pub fn new(session: &Session, limit: Limit, size: (u32, u32), path: &path::Params) -> Self {
        let telemetry = measure::telemetry(session);
        let held = Held::of(session);
        let plan = Plan {
            size,
            method: record::Method::Paths,
            path: path.clone(),
            builds: 1,
            // By the stage, whenever kernels are compiled.
            warm_up: 1,
            busy_before_point: Duration::ZERO,
            busy_before_view: Duration::ZERO,
            // How many there were is known in the end.
            sampling: Sampling::exactly(1),
            clock: measure::clock(&telemetry, &held, None, measure::LEAST_CLOCK),
            held: held.clone(),
            counting: true,
        };
        let record = measure::begin(session, &plan, false);
        Self { limit, telemetry, held, record, begun: Vec::new(), current: None, samples: 0, first: None }
    }

    /// Keeps a sample of what is on stage, from the view of that name or, without one, from somewhere else.
    ///
    /// # Errors
    /// The device failed.
    pub fn add(
        &mut self,
        stage: &mut Stage<'_>,
        (view, pose): (Option<&str>, Pose),
        sample: &path::Sample,
    ) -> anyhow::Result<()> {
        let moment = self.telemetry.moment();
        let at = self.point(stage);
        let name = view.unwrap_or(MOVED);
        let there = self.record.results[at].views.iter().position(|view| view.name == name);
        let place = there.unwrap_or(self.record.results[at].views.len());
        if self.current != Some((at, place)) {
            self.leave();
            self.current = Some((at, place));
        }
        if there.is_none() {
            let before = self.telemetry.sample();
            self.record.results[at].views.push(record::View {
                name: name.into(),
                // A camera that moves has many trees, and its rays meet now this and now that.
                adaptation: if view.is_some() { stage.adaptation()? } else { None },
                samples: Vec::new(),
                counters: if view.is_some() { stage.count(pose)? } else { None },
                after: before.clone(),
                before,
                pictures: Vec::new(),
            });
        }
        let sample = kept(sample, moment, self.record.run.clock.as_ref());
        self.record.results[at].views[place].samples.push(sample);
        self.samples += 1;
        self.first.get_or_insert_with(Instant::now);
        Ok(())
    }

    /// Why no more samples are wanted, once that is so.
    pub fn over(&self) -> Option<Stop> {
        self.limit.stop(self.samples, self.first?.elapsed())
    }

    /// The place of the point that is on stage.
    fn point(&mut self, stage: &Stage<'_>) -> usize {
        let results = &mut self.record.results;
        let variant = stage.variant().name();
        if let Some(at) = results.iter().position(|there| there.variant == variant) {
            return at;
        }
        let mut point = stage.point();
        if results.is_empty() {
            self.record.parameters = point.parameters.clone();
        }
        let common = &self.record.parameters;
        point.parameters.0.retain(|name, value| common.get(name) != Some(value));
        let started = Timestamp::now();
        point.measurement = Some(Measurement {
            part: 0,
            position: results.len() as u64,
            started,
            finished: started,
            stopped: Stop::Interrupted,
            unreliable: false,
            verdict: None,
        });
        self.begun.push((Instant::now(), self.telemetry.throttle_times()));
        results.push(point);
        results.len() - 1
    }

    /// How far it is, in words.
    pub fn progress(&self) -> String {
        let taken = self.first.map_or(0.0, |first| first.elapsed().as_secs_f64());
        match self.limit {
            Limit::Never => format!("benchmark: {} samples", self.samples),
            Limit::After(time) => format!("benchmark: {taken:.0} of {} s", time.as_secs_f64()),
            Limit::Frames(frames) => format!("benchmark: {} of {frames} samples", self.samples),
        }
    }

    /// Something else is measured from now on, or nothing: puts down the state that the device is in.
    fn leave(&mut self) {
        let Some((at, place)) = self.current.take() else { return };
        let (begun, throttled) = &self.begun[at];
        let point = &mut self.record.results[at];
        point.views[place].after = self.telemetry.sample();
        let measurement = point.measurement.as_mut().expect("every point here has one");
        measurement.finished = Timestamp::now();
        let milliseconds = 1e3 * begun.elapsed().as_secs_f64();
        let times = self.telemetry.throttle_times();
        measurement.verdict = Some(self.held.judge(throttled, &times, milliseconds));
    }

    /// The record; `None` where nothing was measured.
    pub fn finish(mut self) -> Option<Record> {
        self.leave();
        let stopped = self.over().unwrap_or(Stop::Interrupted);
        complete(&mut self.record, stopped).then_some(self.record)
    }
}

/// A sample in the record's words.
fn kept(sample: &path::Sample, moment: Moment, clock: Option<&record::Clock>) -> record::Sample {
    let launch = |wave: &path::WaveTime| Launch { rays: wave.rays, milliseconds: wave.milliseconds };
    record::Sample {
        depths: sample.waves.iter().map(launch).collect(),
        frame_milliseconds: Some(sample.milliseconds),
        sm_clock_mhz: moment.sm_clock_mhz,
        excluded: slowed(&moment, clock),
    }
}

/// Puts down what is known in the end; whether anything was measured.
fn complete(record: &mut Record, stopped: Stop) -> bool {
    let mut most = 0;
    for point in &mut record.results {
        for view in &mut point.views {
            mark_warm_up(&mut view.samples);
            most = most.max(view.samples.len());
        }
        let unreliable = is_unreliable(point);
        if let Some(measurement) = &mut point.measurement {
            measurement.stopped = stopped;
            measurement.unreliable = unreliable;
        }
    }
    record.run.samples = u32::try_from(most).unwrap_or(u32::MAX);
    record.finished = Some(Timestamp::now());
    most > 0
}

/// Whether fewer than half of the samples of a view count.
fn is_unreliable(point: &Point) -> bool {
    point.views.iter().any(|view| 2 * view.counted().count() < view.samples.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::Exclusion;

    #[test]
    fn limits_are_seconds_or_frames() {
        assert_eq!("".parse(), Ok(Limit::Never));
        assert_eq!("10".parse(), Ok(Limit::After(Duration::from_secs(10))));
        assert_eq!("2.5s".parse(), Ok(Limit::After(Duration::from_millis(2500))));
        assert_eq!("200f".parse(), Ok(Limit::Frames(200)));
        for wrong in ["0", "0f", "-1", "1.5f", "cornell", "f", "inf", "1e30", "NaN"] {
            assert!(wrong.parse::<Limit>().unwrap_err().contains("200f"), "{wrong}");
        }
        let second = Duration::from_secs(1);
        assert_eq!(Limit::Never.stop(u64::MAX, Duration::MAX), None);
        assert_eq!([0, 1].map(|s| Limit::After(second).stop(9, s * second)), [None, Some(Stop::Time)]);
        assert_eq!([9, 10].map(|n| Limit::Frames(10).stop(n, second)), [None, Some(Stop::Samples)]);
    }

    #[test]
    fn a_sample_is_kept_with_its_frame_and_its_clock() {
        let wave = |rays, milliseconds| path::WaveTime { rays, milliseconds };
        let sample = path::Sample { waves: vec![wave(100, 0.5), wave(60, 0.75)], milliseconds: 2.0 };
        let moment = Moment { sm_clock_mhz: Some(1000), throttled: Some(false) };
        let clock = record::Clock { kind: record::ClockKind::Base, mhz: 2000, least_share: 0.95 };
        let own = kept(&sample, moment, Some(&clock));
        assert_eq!(own.depths[1], Launch { rays: 60, milliseconds: 0.75 });
        assert_eq!((own.frame_milliseconds, own.sm_clock_mhz), (Some(2.0), Some(1000)));
        assert_eq!(own.excluded, Some(Exclusion::LowClock));
        assert_eq!(kept(&sample, moment, None).excluded, None);
    }

    #[test]
    fn a_completed_record_is_sound_and_says_how_many_samples_there_were() {
        let mut record = record::example();
        let samples = &mut record.results[0].views[0].samples;
        let sample = samples.last().unwrap().clone();
        *samples = vec![sample; 9];
        // The first one is cold.
        samples[0].depths[0].milliseconds *= 50.0;
        samples.iter_mut().for_each(|sample| sample.frame_milliseconds = Some(3.5));
        record.finished = None;
        // A window has no rule by which it stops.
        record.run.stopping = None;
        assert!(complete(&mut record, Stop::Time));
        assert_eq!(record.validate(), Ok(()));
        assert_eq!(record.run.samples, 9);
        let view = &record.results[0].views[0];
        assert_eq!((view.samples[0].excluded, view.counted().count()), (Some(Exclusion::WarmUp), 8));
        let measurement = record.results[0].measurement.as_ref().unwrap();
        assert_eq!((measurement.stopped, measurement.unreliable), (Stop::Time, false));
        for sample in &mut record.results[0].views[0].samples[1..6] {
            sample.excluded = Some(Exclusion::Throttled);
        }
        complete(&mut record, Stop::Time);
        assert!(record.results[0].measurement.as_ref().unwrap().unreliable);
        record.results.clear();
        assert!(!complete(&mut record, Stop::Interrupted), "nothing was measured");
    }
}
