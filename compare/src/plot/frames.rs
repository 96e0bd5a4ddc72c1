//! The time of each frame, one after another, as a camera goes around a scene: figure 9 of Lewis 2024.

use super::chart::{Axis, Body, Chart, Curve, Place, Plane, Scale, Series, Value, slug};
use super::notes::{self, Found};
use super::ratios::{only, settled};
use super::theme::Look;
use crate::select::Selection;
use record::Point;

/// Fewest views that a camera passes on its way.
const FEWEST: usize = 9;

/// One chart a scene, with a curve a variant.
pub fn charts(selection: &Selection) -> Found {
    let mut found = Found::default();
    let variants = settled(selection);
    for scene in selection.scenes() {
        let points = variants.iter().filter_map(|variant| Some(only(selection, scene, variant)?.point));
        let courses: Vec<(&Point, Vec<f64>)> =
            points.map(|point| (point, frames(point))).filter(|(_, frames)| !frames.is_empty()).collect();
        if !courses.is_empty() {
            found.charts.push(chart(selection, scene, &courses));
        }
    }
    if found.charts.is_empty() {
        let what = format!(
            "no scene has {FEWEST} views or more, and the time of their frames: take one such as \
             teapot:orbit=40, and the method paths"
        );
        found.remarks.push(what);
    }
    found
}

fn chart(selection: &Selection, scene: &str, courses: &[(&Point, Vec<f64>)]) -> Chart {
    let axis = |title: &str, scale| Axis {
        title: title.to_owned(),
        scale,
        ticks: Vec::new(),
        names: Vec::new(),
        includes: Vec::new(),
    };
    let curve = |(series, (_, frames)): (usize, &(&Point, Vec<f64>))| Curve {
        series,
        right: false,
        places: (frames.iter().enumerate())
            .map(|(at, &milliseconds)| Place { x: (at + 1) as f64, y: Value::bare(milliseconds) })
            .collect(),
        band: Vec::new(),
    };
    let mean = |frames: &[f64]| frames.iter().sum::<f64>() / frames.len() as f64;
    let means: Vec<String> =
        (courses.iter()).map(|(point, frames)| format!("{} {:.3} ms", point.variant, mean(frames))).collect();
    let plane = Plane {
        title: String::new(),
        x: axis("frame", Scale::Linear),
        y: axis("time of a frame (ms)", Scale::Logarithmic),
        right: None,
        curves: courses.iter().enumerate().map(curve).collect(),
    };
    Chart {
        name: format!("frames-{}", slug(scene)),
        title: format!("Time of frames, view after view: {scene}"),
        note: format!(
            "All kernels of a frame, shading included; the first samples of all views, then the second ones, and so \
             on. On average: {}. {}{}",
            means.join(", "),
            notes::device(selection),
            notes::unreliable(courses.iter().map(|(point, _)| *point))
        ),
        series: (courses.iter().enumerate())
            .map(|(number, (point, _))| Series { label: point.variant.clone(), look: Look::numbered(number) })
            .collect(),
        body: Body::Planes(vec![plane]),
    }
}

/// The times of a point's frames that count, turn after turn; none where there are few views, or some have no times.
fn frames(point: &Point) -> Vec<f64> {
    if point.views.len() < FEWEST {
        return Vec::new();
    }
    let turns = point.views.iter().map(|view| view.samples.len()).max().unwrap_or(0);
    let samples =
        (0..turns).flat_map(|turn| point.views.iter().filter_map(move |view| view.samples.get(turn)));
    samples
        .filter(|sample| sample.excluded.is_none())
        .filter_map(|sample| sample.frame_milliseconds)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::select::Filter;
    use record::{Launch, Record, Sample, View};

    fn record(views: usize) -> Record {
        let mut record = record::example();
        record.results.truncate(1);
        let point = &mut record.results[0];
        let view = point.views[0].clone();
        let sample = |milliseconds: f64| Sample {
            depths: vec![Launch { rays: 10, milliseconds: 0.5 * milliseconds }],
            frame_milliseconds: Some(milliseconds),
            ..Sample::default()
        };
        point.views = (0..views)
            .map(|at| View {
                name: format!("orbit_{at}"),
                samples: vec![sample(1.0 + at as f64), sample(2.0)],
                ..view.clone()
            })
            .collect();
        record
    }

    #[test]
    fn frames_follow_the_camera_turn_after_turn() {
        let record = record(FEWEST);
        let found = charts(&Selection::filtered(&record, &Filter::default()).unwrap());
        let [chart] = &found.charts[..] else { panic!("{:?}", found.remarks) };
        let Body::Planes(planes) = &chart.body else { panic!("another body") };
        let course: Vec<f64> = planes[0].curves[0].places.iter().map(|place| place.y.value).collect();
        let turns = (1..=FEWEST).map(|at| at as f64).chain([2.0; FEWEST]);
        assert_eq!(course, turns.collect::<Vec<_>>());
        assert!(chart.note.contains(" 3.500 ms"), "{}", chart.note);
        assert!(super::super::svg(chart).contains("time of a frame"));
    }

    #[test]
    fn few_views_and_samples_without_times_are_left_out() {
        let mut without = record(FEWEST);
        let samples = without.results[0].views.iter_mut().flat_map(|view| &mut view.samples);
        samples.for_each(|sample| sample.frame_milliseconds = None);
        for record in [record(FEWEST - 1), without] {
            let found = charts(&Selection::filtered(&record, &Filter::default()).unwrap());
            assert!(found.charts.is_empty() && found.remarks[0].contains("orbit"), "{:?}", found.remarks);
        }
    }
}
