//! Parameters of all stages, settable by name.

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use tracer::builder::BuildParams;

/// One field a stage; each stage documents its own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Morton codes.
    pub morton: tracer::morton::MortonParams,
    /// Clustering.
    pub ploc: tracer::ploc::PlocParams,
    /// Merging of leaves.
    pub collapse: tracer::collapse::CollapseParams,
    /// Traversal.
    pub trace: tracer::traverse::Params,
}

impl Params {
    /// What the builder takes.
    pub fn build(&self) -> BuildParams {
        BuildParams { morton: self.morton.clone(), ploc: self.ploc.clone(), collapse: self.collapse.clone() }
    }

    /// Applies assignments such as `collapse.c_t=3`.
    ///
    /// # Errors
    /// No such parameter, or a value of the wrong kind or out of range.
    pub fn set(&mut self, assignments: &[String]) -> anyhow::Result<()> {
        let mut tree = serde_json::to_value(&*self)?;
        for assignment in assignments {
            let (name, text) = assignment
                .split_once('=')
                .with_context(|| format!("--set {assignment}: write NAME=VALUE"))?;
            let Some(slot) = find(&mut tree, name.trim()).filter(|slot| !slot.is_object()) else {
                let mut known = Vec::new();
                leaves("", &tree, &mut known);
                bail!(
                    "--set {assignment}: there is no parameter {name:?}; there are:\n  {}",
                    known.join("\n  ")
                );
            };
            let old = slot.clone();
            let text = text.trim();
            *slot = serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.into()));
            if std::mem::discriminant(slot) != std::mem::discriminant(&old) {
                bail!("--set {assignment}: {name} is of the kind of {old}, its default");
            }
        }
        let set: Self =
            serde_json::from_value(tree).with_context(|| format!("--set {}", assignments.join(" --set ")))?;
        set.check()?;
        *self = set;
        Ok(())
    }

    /// Refuses what stages cannot work with. Workgroup sizes depend on the device and are checked there.
    fn check(&self) -> anyhow::Result<()> {
        let ranges = [
            ("morton.bits", f64::from(self.morton.bits), 1.0..=21.0),
            ("ploc.radius", f64::from(self.ploc.radius), 1.0..=64.0),
            ("collapse.c_t", f64::from(self.collapse.traversal_cost), 0.0..=1e9),
            ("collapse.c_i", f64::from(self.collapse.intersection_cost), 0.0..=1e9),
            ("collapse.max_leaf", f64::from(self.collapse.max_leaf), 1.0..=16.0),
            ("trace.fetch_below", f64::from(self.trace.fetch_below), 0.0..=1.0),
            ("trace.postpone_below", f64::from(self.trace.postpone_below), 0.0..=1.0),
            ("trace.stack", f64::from(self.trace.stack), 1.0..=4096.0),
        ];
        for (name, value, range) in ranges {
            if !range.contains(&value) {
                bail!("--set: {name} is from {} to {}, not {value}", range.start(), range.end());
            }
        }
        Ok(())
    }
}

fn find<'t>(tree: &'t mut Value, name: &str) -> Option<&'t mut Value> {
    name.split('.').try_fold(tree, |node, part| node.as_object_mut()?.get_mut(part))
}

fn leaves(prefix: &str, tree: &Value, out: &mut Vec<String>) {
    match tree {
        Value::Object(fields) => {
            for (name, value) in fields {
                let dot = if prefix.is_empty() { "" } else { "." };
                leaves(&format!("{prefix}{dot}{name}"), value, out);
            }
        }
        value => out.push(format!("{prefix}={value}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_is_set_by_its_dotted_name() {
        let mut params = Params::default();
        params.set(&["collapse.c_t=3".into(), "trace.primary_subgroups=2".into()]).unwrap();
        assert_eq!(params.trace.primary_subgroups, 2);
        assert_ne!(params, Params::default());
    }

    #[test]
    fn a_wrong_name_lists_the_right_ones_and_a_wrong_kind_is_refused() {
        let mut params = Params::default();
        let error = params.set(&["collapse.ct=3".into()]).unwrap_err().to_string();
        assert!(error.contains("collapse.c_t="), "{error}");
        assert!(params.set(&["collapse.c_t=high".into()]).is_err());
        assert!(params.set(&["collapse.c_t".into()]).is_err());
        assert!(params.set(&["trace={}".into()]).is_err());
        let error = params.set(&["morton.bits=22".into()]).unwrap_err().to_string();
        assert!(error.contains("morton.bits is from 1 to 21"), "{error}");
        assert_eq!(params, Params::default());
    }
}
