//! What happens during a sweep, for scripts that follow it: a line of JSON each.

use crate::config::Setup;
use record::{Measurement, Parameters, Point, Rays, stats::Estimate};
use serde::Serialize;
use std::io::Write;

/// Something that happened.
#[derive(Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event<'a> {
    /// A point that is to be measured, or has been.
    Planned { key: &'a str, scene: &'a str, variant: &'a str, axes: &'a Parameters, measured: bool },
    /// How long the planned points will take.
    Estimated { points: usize, least_seconds: f64, most_seconds: f64 },
    /// The sweep begins.
    Begun { title: &'a str, points: usize, left: usize },
    /// A point begins.
    Started { key: &'a str, reference: bool },
    /// So many views of a point have samples.
    Progress { key: &'a str, views: usize, rates: Vec<Rate> },
    /// A point is in the journal.
    Finished {
        key: &'a str,
        reference: bool,
        rates: Vec<Rate>,
        samples: usize,
        #[serde(flatten)]
        measurement: Option<&'a Measurement>,
    },
    /// A point could not be measured.
    Failed { key: &'a str, error: &'a str },
    /// The record is written.
    Ended { points: usize, complete: bool },
}

/// How fast some rays are, and how sure that is.
#[derive(Serialize)]
pub struct Rate {
    rays: &'static str,
    mrps: f64,
    /// Half the width of the 95% confidence interval, as a share of the rate.
    half_width: Option<f64>,
}

/// The rates of a point.
pub fn rates(point: &Point) -> Vec<Rate> {
    [(Rays::Primary, "primary"), (Rays::Secondary, "secondary")]
        .into_iter()
        .filter_map(|(rays, name)| {
            let half_width = point.estimate(rays).as_ref().map(Estimate::relative_half_width);
            Some(Rate { rays: name, mrps: point.rate(rays)?, half_width })
        })
        .collect()
}

impl<'a> Event<'a> {
    /// A point of the plan.
    pub fn planned(key: &'a str, setup: &'a Setup, measured: bool) -> Self {
        Self::Planned { key, scene: &setup.scene, variant: setup.variant.name(), axes: &setup.axes, measured }
    }

    /// A point in the journal.
    pub fn finished(key: &'a str, reference: bool, point: &'a Point) -> Self {
        Self::Finished {
            key,
            reference,
            rates: rates(point),
            samples: point.views.iter().map(|view| view.samples.len()).sum(),
            measurement: point.measurement.as_ref(),
        }
    }
}

/// Where events go: to stdout, or nowhere.
pub struct Events(bool);

impl Events {
    /// To stdout, where they are asked for.
    pub fn new(asked: bool) -> Self {
        Self(asked)
    }

    /// Whether they are asked for.
    pub fn are_told(&self) -> bool {
        self.0
    }

    /// Tells one. A reader that has gone away is no reason to stop measuring.
    pub fn tell(&self, event: &Event<'_>) {
        if self.0
            && let Ok(line) = serde_json::to_string(event)
        {
            let mut out = std::io::stdout().lock();
            let _ = writeln!(out, "{line}").and_then(|()| out.flush());
        }
    }
}
