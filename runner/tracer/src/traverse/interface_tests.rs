//! The traversal kernels' memory, held against the host's.

use super::*;
use crate::{
    gpu::interface::{Module, fields},
    layout::{LeafTriangle, UnitTriangle},
};

#[test]
fn the_shaders_see_memory_as_the_host_does() {
    let kernels = Layout::ALL.iter().map(|&layout| shaders::traverse_closest_hit(layout));
    for kernel in kernels.chain([&shaders::TRAVERSE_BY_OCTANT]) {
        Module::read(kernel)
            .assert_push_constants(
                size_of::<Arguments>(),
                &fields!(Arguments: rays, hits, nodes, triangles, indices, queue, counts, visits,
                    utilization, extent),
            )
            .assert_items("Rays", size_of::<Ray>(), Some(&fields!(Ray: origin, t_min, direction, t_max)))
            .assert_items("Hits", size_of::<Hit>(), Some(&fields!(Hit: t, triangle)))
            .assert_items("Triangles", size_of::<LeafTriangle>(), None)
            .assert_items("UnitTriangles", size_of::<UnitTriangle>(), Some(&fields!(UnitTriangle: z, u, v)))
            .assert_items("Indices", 4, None)
            .assert_items("Counts", size_of::<Counts>(), None)
            .assert_items("Visits", 4, None)
            .assert_items("Utilization", size_of::<u64>(), None)
            .assert_items("Words1", 4, None)
            .assert_items("Words2", 8, None)
            .assert_items("Words4", 16, None)
            .assert_specialization(1, "STACK_SIZE")
            .assert_specialization(4, "COUNT")
            .assert_specialization(6, "STRIDE")
            .assert_specialization(10, "TRIANGLE_TEST")
            .assert_block("Queue", &fields!(Queue: next, count, finished, unused));
    }
}
