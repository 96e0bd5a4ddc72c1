//! Parameters of all stages, settable by name.

use anyhow::{Context, anyhow, bail};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use tracer::{
    builder::{BuildParams, Method},
    collapse::CollapseParams,
    contract::{ContractParams, Contraction, Form, Numbering},
    gpu::Gpu,
    layout::{Layout, LayoutParams},
    traverse::{Language, Technique},
    treefile::Recipe,
};

use crate::variant::Variant;

/// One field a stage; each stage documents its own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Where the binary tree comes from.
    pub build: Build,
    /// Splits in space, where it comes from the CPU.
    pub sbvh: tracer::sbvh::SbvhParams,
    /// Morton codes.
    pub morton: tracer::morton::MortonParams,
    /// Sorting of the codes.
    pub sort: tracer::sort::SortParams,
    /// Clustering.
    pub ploc: tracer::ploc::PlocParams,
    /// Clustering in a single launch.
    pub hploc: tracer::hploc::HplocParams,
    /// Merging of leaves.
    pub collapse: CollapseParams,
    /// Which boxes share a node.
    pub contract: Contract,
    /// What happens where a ray hits a surface.
    pub shade: tracer::path::Shading,
    /// Sample rays for variants that go by view.
    pub cbtc: tracer::path::Sampling,
    /// How nodes are stored.
    pub layout: LayoutParams,
    /// What the order of a node's children comes from, in the compressed layout.
    pub order: Order,
    /// How triangles are stored, and tested.
    pub triangle: tracer::traverse::TriangleParams,
    /// Traversal.
    pub trace: tracer::traverse::Params,
    /// The schedule of the compressed layout's traversal.
    pub groups: tracer::traverse::groups::Params,
    /// The driver's own ray tracing.
    pub driver: tracer::driver::Params,
    /// What is done differently in GLSL.
    pub glsl: Technique,
    /// What is done differently in Slang.
    pub slang: Technique,
}

/// Where the binary tree comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Build {
    /// `ploc` or `hploc` on the device, `sbvh` or `midpoint` on the CPU.
    pub method: Method,
}

/// The order in which the children of a compressed node are visited.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Order {
    /// How children are assigned to slots: `auction`, `greedy` or `random`.
    pub assignment: tracer::layout::compressed::Assignment,
    /// How slots are visited: `octant`, `distance` or `random`.
    pub traversal: tracer::traverse::groups::Order,
}

/// Contraction: a method for variants that go by area and one for those that go by view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Contract {
    /// `sah`, `satc`, `wald`, `afra`, `fixed` or `optimal`.
    pub by_area: Contraction,
    /// `cbtc` or `rdtc`.
    pub by_view: Contraction,
    /// α of `satc` and `rdtc`.
    pub alpha: f32,
    /// `auto`, `handover` or `levels`.
    pub form: Form,
    /// `creation` or `depth-first`.
    pub numbering: Numbering,
    /// c_node of `optimal`.
    #[serde(rename = "c_node")]
    pub c_node: f32,
    /// c_prim of `optimal`.
    #[serde(rename = "c_prim")]
    pub c_prim: f32,
    /// P_max of `optimal`.
    #[serde(rename = "p_max")]
    pub p_max: u32,
}

impl Default for Contract {
    fn default() -> Self {
        let ContractParams { method, alpha, form, numbering, c_node, c_prim, p_max } =
            ContractParams::default();
        Self { by_area: method, by_view: Contraction::Cbtc, alpha, form, numbering, c_node, c_prim, p_max }
    }
}

impl Params {
    /// The defaults of a variant.
    pub fn of(variant: Variant) -> Self {
        let mut params = Self::default();
        // What has no tree of ours takes none of what is below.
        let Some(layout) = variant.layout() else { return params };
        // Thesis 6.3, table 5: wider nodes are dearer to visit.
        params.collapse.traversal_cost = match layout {
            Layout::Binary | Layout::Wide4 | Layout::Quantized4 => 2.0,
            Layout::Wide6 | Layout::Quantized6 | Layout::Quantized8 => 3.0,
            Layout::Wide8 => 4.0,
            Layout::Compressed8 | Layout::Direct | Layout::Reduced => 2.0,
        };
        if layout.is_compressed() {
            // Ylitie et al. 2017, 3.4; where another method is chosen, leaves are no larger.
            params.contract.by_area = Contraction::Optimal;
            params.contract.numbering = Numbering::DepthFirst;
            params.collapse.max_leaf = layout.limits().triangles_per_leaf as u32;
        }
        let largest = layout.limits().triangles_per_leaf as u32;
        params.collapse.max_leaf = params.collapse.max_leaf.min(largest);
        params
    }

    /// The defaults of a variant with assignments applied.
    ///
    /// # Errors
    /// No such parameter, or a value of the wrong kind or out of range.
    pub fn with(variant: Variant, assignments: &[String]) -> anyhow::Result<Self> {
        let mut params = Self::of(variant);
        params.set(assignments)?;
        Ok(params)
    }

    /// What the builder takes for a variant; where that goes by view, this is the last step's.
    pub fn build(&self, variant: Variant) -> BuildParams {
        let Contract { by_area, by_view, alpha, form, numbering, c_node, c_prim, p_max } = self.contract;
        let method = if variant.by_view { by_view } else { by_area };
        BuildParams {
            method: self.build.method,
            morton: self.morton.clone(),
            sort: self.sort.clone(),
            ploc: self.ploc.clone(),
            hploc: self.hploc.clone(),
            collapse: self.collapse(),
            contract: ContractParams { method, alpha, form, numbering, c_node, c_prim, p_max },
            layout: LayoutParams { assignment: self.order.assignment, ..self.layout.clone() },
            triangle: self.triangle.clone(),
        }
    }

    /// How leaves are merged.
    pub fn collapse(&self) -> CollapseParams {
        CollapseParams { by_size: self.build.method == Method::Midpoint, ..self.collapse.clone() }
    }

    /// What the traversal of a variant takes.
    pub fn trace(&self, variant: Variant) -> tracer::traverse::Params {
        let language = variant.language;
        let technique = match language {
            Language::Glsl => self.glsl,
            Language::Slang => self.slang,
        };
        let (groups, order, driver) = (self.groups.clone(), self.order.traversal, self.driver.clone());
        tracer::traverse::Params { language, technique, groups, order, driver, ..self.trace.clone() }
    }

    /// What is taken for the binary tree that a variant is made from or held against, which is never traced in packets.
    pub fn of_binary(&self) -> Self {
        let mut own = self.clone();
        own.trace.primary_packets = 0;
        own
    }

    /// Whether the device has room for the workgroups of a variant's kernels.
    pub fn fits(&self, variant: Variant, gpu: &Gpu) -> bool {
        variant.layout().is_none_or(|layout| self.trace(variant).fits(gpu, layout))
    }

    /// What the binary tree is made by.
    pub fn recipe(&self) -> Recipe {
        match self.build.method {
            Method::Ploc => Recipe::Ploc { morton: self.morton.clone(), ploc: self.ploc.clone() },
            Method::Hploc => Recipe::Hploc { morton: self.morton.clone(), hploc: self.hploc.clone() },
            Method::Sbvh => Recipe::Sbvh { sbvh: self.sbvh.clone() },
            Method::Midpoint => Recipe::Midpoint,
        }
    }

    /// Takes over what a binary tree was made by, so that they tell the truth of it.
    pub fn adopt(&mut self, recipe: &Recipe) {
        self.build.method = recipe.method();
        match recipe.clone() {
            Recipe::Ploc { morton, ploc } => (self.morton, self.ploc) = (morton, ploc),
            Recipe::Hploc { morton, hploc } => (self.morton, self.hploc) = (morton, hploc),
            Recipe::Sbvh { sbvh } => self.sbvh = sbvh,
            Recipe::Midpoint => {}
        }
    }

    /// Whether an assignment is about how the binary tree is made, so that one from a file has no use for it.
    pub fn is_of_binary_tree(assignment: &str) -> bool {
        let stage = assignment.split(['.', '=']).next().unwrap_or_default().trim();
        ["build", "morton", "ploc", "hploc", "sbvh"].contains(&stage)
    }

    /// Applies assignments such as `collapse.c_t=3`, all or none.
    ///
    /// # Errors
    /// No such parameter, or a value of the wrong kind or out of range.
    pub fn set(&mut self, assignments: &[String]) -> anyhow::Result<()> {
        let mut set = self.clone();
        for assignment in assignments {
            let (name, text) = assignment
                .split_once('=')
                .with_context(|| format!("--set {assignment}: write NAME=VALUE"))?;
            set.assign(name.trim(), value(text)).map_err(|error| anyhow!("--set {assignment}: {error:#}"))?;
        }
        *self = set;
        Ok(())
    }

    /// Gives one parameter, by its dotted name, a value.
    ///
    /// # Errors
    /// No such parameter, or a value of the wrong kind or out of range; nothing has changed then.
    pub fn assign(&mut self, name: &str, value: Value) -> anyhow::Result<()> {
        let mut tree = serde_json::to_value(&*self)?;
        let Some(slot) = find(&mut tree, name).filter(|slot| !slot.is_object()) else {
            let known: Vec<_> =
                self.by_name().0.into_iter().map(|(name, value)| format!("{name}={value}")).collect();
            bail!("there is no parameter {name:?}; there are:\n  {}", known.join("\n  "));
        };
        if std::mem::discriminant(slot) != std::mem::discriminant(&value) {
            bail!("{name} is of the kind of {slot}, its default");
        }
        *slot = value;
        let set: Self = serde_json::from_value(tree).with_context(|| name.to_owned())?;
        set.check()?;
        *self = set;
        Ok(())
    }

    /// All parameters by their dotted names.
    pub fn by_name(&self) -> record::Parameters {
        // By way of text, in which an f32 of 0.6 is "0.6".
        let text = serde_json::to_string(self).expect("parameters are plain data");
        let stages: BTreeMap<String, Value> = serde_json::from_str(&text).expect("just written");
        let mut flat = record::Parameters::default();
        for (stage, value) in &stages {
            flat.add(stage, value).expect("plain data too");
        }
        flat
    }

    /// Refuses what stages cannot work with. How large a workgroup can be depends on the device and is checked
    /// there.
    fn check(&self) -> anyhow::Result<()> {
        let ranges = [
            ("morton.bits", f64::from(self.morton.bits), 1.0..=21.0),
            ("sort.keys", f64::from(self.sort.keys), 1.0..=16.0),
            ("ploc.radius", f64::from(self.ploc.radius), 1.0..=64.0),
            ("hploc.radius", f64::from(self.hploc.radius), 1.0..=64.0),
            ("hploc.window", f64::from(self.hploc.window), 4.0..=64.0),
            ("collapse.c_t", f64::from(self.collapse.traversal_cost), 0.0..=1e9),
            ("collapse.c_i", f64::from(self.collapse.intersection_cost), 0.0..=1e9),
            ("collapse.max_leaf", f64::from(self.collapse.max_leaf), 1.0..=16.0),
            ("contract.alpha", f64::from(self.contract.alpha), 0.0..=1.0),
            ("contract.c_node", f64::from(self.contract.c_node), 0.0..=1e6),
            ("contract.c_prim", f64::from(self.contract.c_prim), 0.0..=1e6),
            ("contract.p_max", f64::from(self.contract.p_max), 1.0..=16.0),
            ("cbtc.depth-limit", f64::from(self.cbtc.depth_limit), 0.0..=63.0),
            ("cbtc.subsampling", f64::from(self.cbtc.subsampling), 1.0..=1e9),
            ("trace.primary_subgroups", f64::from(self.trace.primary_subgroups), 1.0..=1024.0),
            ("trace.secondary_subgroups", f64::from(self.trace.secondary_subgroups), 1.0..=1024.0),
            ("trace.primary_fetch_below", f64::from(self.trace.primary_fetch_below), 0.0..=1.0),
            ("trace.secondary_fetch_below", f64::from(self.trace.secondary_fetch_below), 0.0..=1.0),
            ("trace.postpone_below", f64::from(self.trace.postpone_below), 0.0..=1.0),
            ("trace.primary_vote", f64::from(self.trace.primary_vote), 0.0..=32.0),
            ("trace.secondary_vote", f64::from(self.trace.secondary_vote), 0.0..=32.0),
            ("trace.visits_a_vote", f64::from(self.trace.visits_a_vote), 1.0..=4.0),
            ("trace.search_above", f64::from(self.trace.search_above), 0.0..=1.0),
            ("trace.primary_packets", f64::from(self.trace.primary_packets), 0.0..=4.0),
            ("trace.end_together", f64::from(self.trace.end_together), 0.0..=1.0),
            ("trace.end_steps", f64::from(self.trace.end_steps), 1.0..=1024.0),
            ("trace.stack", f64::from(self.trace.stack), 1.0..=4096.0),
            ("sbvh.alpha", f64::from(self.sbvh.alpha), 0.0..=1e6),
            ("sbvh.object_bins", f64::from(self.sbvh.object_bins), 2.0..=256.0),
            ("sbvh.spatial_bins", f64::from(self.sbvh.spatial_bins), 2.0..=256.0),
            ("sbvh.sweep", f64::from(self.sbvh.sweep), 0.0..=4096.0),
            ("sbvh.budget", f64::from(self.sbvh.budget), 0.0..=16.0),
            ("sbvh.reinsertions", f64::from(self.sbvh.reinsertions), 0.0..=100.0),
            ("layout.bits", f64::from(self.layout.bits), 4.0..=8.0),
            ("shade.specular", f64::from(self.shade.specular), 0.0..=1.0),
            ("shade.ambience", f64::from(self.shade.ambience), 0.0..=1e6),
            ("shade.camera_light", f64::from(self.shade.camera_light), 0.0..=1e6),
            ("groups.n_w", f64::from(self.groups.n_w), 0.0..=1e6),
            ("groups.n_d", f64::from(self.groups.n_d), 0.0..=32.0),
            ("groups.n_t", f64::from(self.groups.n_t), 0.0..=32.0),
            ("groups.r_t", f64::from(self.groups.r_t), 0.0..=1.0),
            ("groups.share_from", f64::from(self.groups.share_from), 0.0..=1.0),
            ("groups.steal_below", f64::from(self.groups.steal_below), 0.0..=1.0),
            ("driver.row", f64::from(self.driver.row), 0.0..=65_536.0),
            ("groups.shared_stack", f64::from(self.groups.shared_stack), 0.0..=16.0),
        ];
        for (name, value, range) in ranges {
            if !range.contains(&value) {
                bail!("{name} is from {} to {}, not {value}", range.start(), range.end());
            }
        }
        if !self.hploc.window.is_multiple_of(2) {
            bail!("hploc.window is even, not {}", self.hploc.window);
        }
        let methods = [("by-area", self.contract.by_area, false), ("by-view", self.contract.by_view, true)];
        for (name, method, by_view) in methods {
            if method.by_view() != by_view {
                let fit = Contraction::ALL.iter().filter(|m| m.by_view() == by_view);
                let fit: Vec<_> = fit.map(ToString::to_string).collect();
                bail!("contract.{name} is one of {}, not {method}", fit.join(", "));
            }
        }
        if ![4, 8, 16].contains(&self.layout.align) {
            bail!("layout.align is 4, 8 or 16, not {}", self.layout.align);
        }
        Ok(())
    }
}

fn find<'t>(tree: &'t mut Value, name: &str) -> Option<&'t mut Value> {
    name.split('.').try_fold(tree, |node, part| node.as_object_mut()?.get_mut(part))
}

/// What a text on the command line stands for: JSON, such as a number, or else the text itself.
pub fn value(text: &str) -> Value {
    let text = text.trim();
    serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracer::traverse::TriangleTest;

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
        assert!(
            params
                .set(&["contract.by-area=cbtc".into()])
                .unwrap_err()
                .to_string()
                .contains("one of sah, satc, wald")
        );
        assert!(params.set(&["contract.by-view=best".into()]).is_err());
        assert!(params.set(&["layout.align=12".into()]).is_err());
        assert_eq!(params, Params::default());
    }

    #[test]
    fn all_or_none_of_the_assignments_hold() {
        let mut params = Params::default();
        assert!(params.set(&["ploc.radius=3".into(), "ploc.radius=0".into()]).is_err());
        assert_eq!(params, Params::default());
    }

    #[test]
    fn names_have_the_values_that_are_meant() {
        let names = Params::default().by_name();
        assert_eq!(names.get("contract.alpha").unwrap().to_string(), "0.6");
        assert_eq!(names.get("cbtc.depth-limit"), Some(&4u32.into()));
        for (name, value) in names.0 {
            let mut params = Params::default();
            params.assign(&name, serde_json::to_value(value).unwrap()).unwrap();
            assert_eq!(params, Params::default(), "{name}");
        }
    }

    #[test]
    fn a_triangle_test_is_chosen_by_name_and_a_tree_is_built_for_it() {
        for (name, test) in [
            ("watertight", TriangleTest::Watertight),
            ("moeller-trumbore", TriangleTest::MoellerTrumbore),
            ("kensler-shirley", TriangleTest::KenslerShirley),
            ("woop", TriangleTest::Woop),
        ] {
            let params = Params::with(Variant::BINARY, &[format!("triangle.test={name}")]).unwrap();
            assert_eq!(params.build(Variant::BINARY).triangle.test, test);
            assert_eq!(params.by_name().get("triangle.test").unwrap().to_string(), name);
        }
        let error = Params::default().set(&["triangle.test=plücker".into()]).unwrap_err().to_string();
        assert!(error.contains("moeller-trumbore"), "{error}");
    }

    #[test]
    fn what_is_set_wins_over_what_a_variant_has() {
        let wide8 = Variant::one("Wide8").unwrap();
        assert_eq!(Params::of(wide8).collapse.traversal_cost, 4.0);
        let set = Params::with(wide8, &["collapse.c_t=2".into(), "cbtc.depth-limit=2".into()]).unwrap();
        assert_eq!((set.collapse.traversal_cost, set.cbtc.depth_limit), (2.0, 2));
    }

    #[test]
    fn the_recipe_of_a_tree_is_taken_over_whole() {
        for assignment in ["build.method=sbvh", "build.method=midpoint", "ploc.radius=4"] {
            let set = ["sbvh.alpha=0.5".into(), "morton.bits=12".into(), assignment.into()];
            let made = Params::with(Variant::BINARY, &set).unwrap().recipe();
            let mut params = Params::default();
            params.adopt(&made);
            assert_eq!(params.recipe(), made);
            assert!(Params::is_of_binary_tree(assignment));
        }
        assert!(Params::is_of_binary_tree("sbvh.alpha=1") && Params::is_of_binary_tree(" morton.bits=9"));
        assert!(!Params::is_of_binary_tree("collapse.c_t=1") && !Params::is_of_binary_tree("builder=1"));
    }

    #[test]
    fn a_variant_takes_the_method_of_its_kind() {
        let params = Params::default();
        assert_eq!(params.build(Variant::BINARY).contract.method, Contraction::Sah);
        let by_view = Variant::one("Wide4 CBTC").unwrap();
        assert_eq!(params.build(by_view).contract.method, Contraction::Cbtc);
    }
}
