//! Tuned configs: the best values for a device, for other configs to include.

use crate::{config, variant::Variant};
use anyhow::Context;
use record::Parameters;
use std::path::Path;

/// Values for one variant, and why.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// For which.
    pub variant: Variant,
    /// A line each.
    pub comments: Vec<String>,
    /// By name.
    pub parameters: Parameters,
}

/// Writes a config that sets them, with `head` for a comment at its beginning.
///
/// # Errors
/// It cannot be written; what was there before is still there.
pub fn write(path: &Path, head: &str, all: &[Tuned]) -> anyhow::Result<()> {
    let comment = |lines: &str| lines.lines().map(|line| format!("# {line}\n")).collect::<String>();
    let mut text = comment(head);
    for tuned in all {
        text += "\n";
        text += &comment(&tuned.comments.join("\n"));
        text += &config::Set::to_toml(&[config::Set::of(tuned.variant, tuned.parameters.clone())]);
    }
    record::replace(path, |out| out.write_all(text.as_bytes()))
        .with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::Value;

    #[test]
    fn what_is_written_is_what_an_experiment_includes() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let parameters = [
            ("collapse.c_t".to_owned(), Value::from(3.0)),
            ("trace.primary_subgroups".to_owned(), Value::from(20u32)),
        ];
        let tuned = Tuned {
            variant: Variant::one("Wide4").unwrap(),
            comments: vec!["why:\nbecause".into()],
            parameters: Parameters(parameters.into()),
        };
        write(&at("tuned/gpu.toml"), "On a GPU\nin two lines", &[tuned]).unwrap();
        let text =
            "include = [\"tuned/gpu.toml\"]\nscenes = [\"cornell\"]\nvariants = [\"Wide4\", \"Wide6\"]\n";
        std::fs::write(at("x.toml"), text).unwrap();
        let search = tracer::scene::SearchPath::new([]);
        let points = config::Config::load(&at("x.toml"), &[], &[], &search).unwrap().points().unwrap();
        let of = |place: usize| {
            let params = &points[place].params;
            (params.collapse.traversal_cost, params.trace.primary_subgroups)
        };
        assert_eq!((of(0), of(1)), ((3.0, 20), (3.0, 8)));
    }
}
