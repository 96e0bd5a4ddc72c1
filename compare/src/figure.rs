//! Every value that a point can be asked for, with its name, its unit and which way is better.

use record::{Count, PerRay, Point, Tree};

/// Which way a figure is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// More is better.
    High,
    /// Less is better.
    Low,
    /// Neither: it describes.
    Neither,
}

/// A value that a point can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Figure {
    /// Million primary rays per second.
    Primary,
    /// Million secondary rays per second.
    Secondary,
    /// Milliseconds of all builds that a picture from one view takes.
    Build,
    /// Milliseconds of tracing sample rays before the final build; only variants that go by view have it.
    Sampling,
    /// Both together: what a picture from one view waits for before its first ray.
    Total,
    /// Nodes that a ray visits.
    Nodes,
    /// Boxes that a ray is tested against.
    Boxes,
    /// Triangles that a ray is tested against.
    Triangles,
    /// Children of a node, on average.
    Children,
    /// Triangles of a leaf, on average.
    LeafTriangles,
    /// Most edges between the root and a leaf.
    Depth,
    /// The tree's expected cost by the surface area heuristic.
    SahCost,
    /// Bytes of nodes and triangles.
    Bytes,
}

/// By the name of its column.
impl serde::Serialize for Figure {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.column())
    }
}

impl Figure {
    /// All of them.
    pub const ALL: [Figure; 13] = [
        Figure::Primary,
        Figure::Secondary,
        Figure::Build,
        Figure::Sampling,
        Figure::Total,
        Figure::Nodes,
        Figure::Boxes,
        Figure::Triangles,
        Figure::Children,
        Figure::LeafTriangles,
        Figure::Depth,
        Figure::SahCost,
        Figure::Bytes,
    ];

    /// The name of its column, with the unit: it stays the same for good.
    pub fn column(self) -> &'static str {
        match self {
            Figure::Primary => "primary_mrps",
            Figure::Secondary => "secondary_mrps",
            Figure::Build => "build_ms",
            Figure::Sampling => "sampling_ms",
            Figure::Total => "total_build_ms",
            Figure::Nodes => "nodes_per_ray",
            Figure::Boxes => "boxes_per_ray",
            Figure::Triangles => "triangles_per_ray",
            Figure::Children => "children_per_node",
            Figure::LeafTriangles => "triangles_per_leaf",
            Figure::Depth => "tree_depth",
            Figure::SahCost => "sah_cost",
            Figure::Bytes => "tree_bytes",
        }
    }

    /// Which way it is better.
    pub fn better(self) -> Better {
        match self {
            Figure::Primary | Figure::Secondary => Better::High,
            Figure::Children | Figure::LeafTriangles | Figure::Depth => Better::Neither,
            _ => Better::Low,
        }
    }

    /// Its value; nothing where the record does not tell.
    ///
    /// A figure of a tree that is absent or 0 is one that the record's writer did not know: there are triangles in every
    /// tree, so none of them can be 0 but the depth, of a tree that is a single leaf.
    pub fn of(self, point: &Point) -> Option<f64> {
        match self {
            Figure::Primary => point.primary_mrps(),
            Figure::Secondary => point.secondary_mrps(),
            Figure::Build => point.build_milliseconds(),
            Figure::Sampling => point.sampling_milliseconds(),
            Figure::Total => {
                let goes_by_view = point.views.iter().any(|view| view.adaptation.is_some());
                let sampling = if goes_by_view { point.sampling_milliseconds()? } else { 0.0 };
                Some(point.build_milliseconds()? + sampling)
            }
            Figure::Nodes => Some(per_ray(point)?.nodes),
            Figure::Boxes => Some(per_ray(point)?.boxes),
            Figure::Triangles => Some(per_ray(point)?.triangles),
            Figure::Children => of_trees(point, |tree| tree.average_children),
            Figure::LeafTriangles => of_trees(point, |tree| tree.average_triangles_per_leaf),
            Figure::Depth => of_trees(point, |tree| tree.depth.map(f64::from)),
            Figure::SahCost => of_trees(point, |tree| tree.sah_cost),
            Figure::Bytes => of_trees(point, |tree| tree.all_bytes().map(|bytes| bytes as f64)),
        }
    }
}

/// What a ray met, primary and secondary rays together.
fn per_ray(point: &Point) -> Option<PerRay> {
    Count::per_ray(&point.counters()?.all())
}

fn of_trees(point: &Point, figure: fn(&Tree) -> Option<f64>) -> Option<f64> {
    point.of_trees(figure).filter(|&value| value > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::example;
    use std::collections::BTreeSet;

    #[test]
    fn every_figure_has_a_column_of_its_own() {
        let columns: BTreeSet<_> = Figure::ALL.iter().map(|figure| figure.column()).collect();
        assert_eq!(columns.len(), Figure::ALL.len());
    }

    #[test]
    fn what_goes_before_the_first_ray_is_added_up() {
        let record = example();
        let [binary, by_view] = &record.results[..] else { panic!() };
        assert_eq!(Figure::Total.of(binary), Figure::Build.of(binary));
        assert_eq!(Figure::Sampling.of(binary), None);
        let total = Figure::Total.of(by_view).unwrap();
        assert!((total - (0.31 + 0.05 + 0.07)).abs() < 1e-12, "{total}");
    }

    #[test]
    fn what_nobody_told_is_a_gap() {
        let mut point = example().results[0].clone();
        assert_eq!(Figure::SahCost.of(&point), Some(181.25));
        point.tree.sah_cost = Some(0.0);
        point.views[0].counters = None;
        for sample in &mut point.views[0].samples {
            sample.depths.truncate(1);
        }
        for figure in [Figure::SahCost, Figure::Nodes, Figure::Secondary] {
            assert_eq!(figure.of(&point), None, "{figure:?}");
        }
        assert!(Figure::Primary.of(&point).is_some());
        // Of a tree that the driver has built, its size at most.
        point.tree = Tree { bytes: Some(123), ..Tree::default() };
        assert_eq!((Figure::SahCost.of(&point), Figure::Depth.of(&point)), (None, None));
        assert_eq!(Figure::Bytes.of(&point), Some(123.0));
    }
}
