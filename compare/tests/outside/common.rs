//! Small synthetic records, and the program from outside.

use record::{Launch, Point, Record, Repetition, Sample, example};
use std::path::Path;
use std::process::{Command, Output};

/// Runs the program in a folder.
pub fn compare_in(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_compare")).current_dir(folder).args(arguments).output().unwrap()
}

/// Its stdout as text.
pub fn stdout(output: &Output) -> &str {
    std::str::from_utf8(&output.stdout).unwrap()
}

/// Its stderr as text.
pub fn stderr(output: &Output) -> &str {
    std::str::from_utf8(&output.stderr).unwrap()
}

/// A record of `Binary` and `Wide4` on three scenes, of 4 views with 6 samples each that scatter by about 0.5%. Rates
/// are multiplied by what `faster` says of a scene, a variant and a depth; of two seeds samples differ, and the rest
/// does not.
pub fn synthetic(seed: u64, faster: impl Fn(&str, &str, usize) -> f64) -> Record {
    let mut record = example();
    let template = record.results[0].clone();
    let mut noise = Noise(seed);
    record.parts.clear();
    record.references.clear();
    record.results.clear();
    for (scene, rate) in [("sponza", 400.0), ("city", 900.0), ("forest", 150.0)] {
        for (variant, gain) in [("Binary", 1.0), ("Wide4", 1.25)] {
            let mut point = Point { variant: variant.into(), ..template.clone() };
            point.scene.name = scene.into();
            let repetition = &template.build.repetitions[0];
            let milliseconds = (0..6).map(|index| 1.5 + 0.001 * f64::from(index));
            point.build.repetitions =
                milliseconds.map(|milliseconds| Repetition { milliseconds, ..repetition.clone() }).collect();
            let view = point.views[0].clone();
            point.views = ["east", "west", "north", "south"]
                .map(|name| {
                    let mut view = view.clone();
                    view.name = name.into();
                    let mrps =
                        |depth: usize| rate * gain * faster(scene, variant, depth) * [3.0, 1.0, 0.9][depth];
                    let launch = |depth: usize, noise: &mut Noise| Launch {
                        rays: 1_000_000,
                        milliseconds: 1e3 / (mrps(depth) * (1.0 + 0.01 * noise.next())),
                    };
                    view.samples = (0..6)
                        .map(|_| Sample {
                            depths: (0..3).map(|depth| launch(depth, &mut noise)).collect(),
                            ..Sample::default()
                        })
                        .collect();
                    view
                })
                .to_vec();
            record.results.push(point);
        }
    }
    assert_eq!(record.validate(), Ok(()));
    record
}

/// Numbers from -1 to 1 that look random (Knuth's MMIX generator).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}
