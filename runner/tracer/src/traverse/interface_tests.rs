//! The traversal kernel's memory, held against the host's.

use super::*;
use crate::{
    gpu::interface::{Module, fields},
    layout::{LeafTriangle, binary::BinaryNode},
};

#[test]
fn the_shader_sees_memory_as_the_host_does() {
    Module::read(&shaders::TRAVERSE_BINARY)
        .assert_push_constants(
            size_of::<Arguments>(),
            &fields!(Arguments: rays, hits, nodes, triangles, queue, counts, extent),
        )
        .assert_items("Rays", size_of::<Ray>(), Some(&fields!(Ray: origin, t_min, direction, t_max)))
        .assert_items("Hits", size_of::<Hit>(), Some(&fields!(Hit: t, triangle)))
        .assert_items("Nodes", size_of::<BinaryNode>(), None)
        .assert_items("Triangles", size_of::<LeafTriangle>(), None)
        .assert_items("Counts", size_of::<Counts>(), None)
        .assert_block("Queue", &fields!(Queue: next, count, finished, unused));
}
