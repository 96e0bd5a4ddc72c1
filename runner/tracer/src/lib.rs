//! Broadleaf's tracer: builds bounding volume hierarchies on the GPU, traces rays through them, and
//! measures both. It knows nothing of sweeps or of the record's JSON.

pub mod gpu;
pub mod scene;
