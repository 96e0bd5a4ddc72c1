//! A row of the thesis's tables, as the CSV has it.

use serde::Deserialize;

/// One variant on one scene. `_rel` is relative to `Binary`; of a build time it includes the sampling.
#[derive(Deserialize)]
pub struct Row {
    pub scene: String,
    /// Million triangles.
    pub mtris: f64,
    pub variant: String,
    /// Milliseconds of tracing sample rays; only variants that go by view have it.
    pub sample_ms: Option<f64>,
    pub build_ms: f64,
    pub build_rel: f64,
    pub avg_children: f64,
    pub primary_mrps: f64,
    pub primary_rel: f64,
    pub secondary_mrps: f64,
    pub secondary_rel: f64,
    pub nodes_per_ray: f64,
    pub nodes_rel: f64,
    pub bvs_per_ray: f64,
    pub bvs_rel: f64,
    pub tris_per_ray: f64,
    pub tris_rel: f64,
}
