//! The thesis's uncompressed wide layout (4.3.1, listing 3, figures 11 and 12): 120, 176 and 232 bytes for
//! up to 4, 6 and 8 children.
//!
//! ```text
//! byte  0           24          …    24k        28k       28k + 4
//!       box 0       box 1            child[k]   count     triangles
//!       lo.xyz hi.xyz
//! ```
//!
//! Child indices are those of the [binary layout](super::binary). `count` says how many children there
//! are; the boxes of absent ones are points at infinity. `triangles`, the number in the whole subtree, is
//! kept as the thesis keeps it; traversal does not read it.

use super::{Child, LayoutParams, Limits, NodeByNode, binary, in_turn};
use crate::bvh2::{Aabb, MAX_TRIANGLES};
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;

/// A box as nodes hold it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Bounds {
    /// Least corner.
    pub lo: [f32; 3],
    /// Greatest corner.
    pub hi: [f32; 3],
}

const ABSENT: Bounds = Bounds { lo: [f32::INFINITY; 3], hi: [f32::INFINITY; 3] };

macro_rules! layout {
    ($layout:ident, $node:ident, $arity:literal, $bytes:literal) => {
        #[doc = concat!("A node of up to ", $arity, " children, ", $bytes, " bytes: see the module's text.")]
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
        pub struct $node {
            /// The children's boxes.
            pub bounds: [Bounds; $arity],
            /// Their encoded indices.
            pub child: [u32; $arity],
            /// How many there are.
            pub count: u32,
            /// Triangles in the whole subtree.
            pub triangles: u32,
        }

        const _: () = {
            assert!(size_of::<$node>() == $bytes);
            assert!(offset_of!($node, child) == 24 * $arity && offset_of!($node, count) == 28 * $arity);
            assert!(offset_of!($node, triangles) == 28 * $arity + 4);
        };

        #[doc = concat!("The uncompressed layout of up to ", $arity, " children.")]
        #[derive(Clone, Copy, Debug)]
        pub struct $layout;

        impl NodeByNode for $layout {
            type Node = $node;
            const NAME: &'static str = stringify!($layout);
            const EXACT: bool = true;
            const LIMITS: Limits = Limits {
                children: $arity,
                triangles_per_leaf: 16,
                triangles_per_node: 16 * $arity,
                triangles: MAX_TRIANGLES,
            };

            fn child(node: &$node, slot: usize) -> Option<Child> {
                let Bounds { lo, hi } = node.bounds[slot];
                let target = binary::target(node.child[slot]);
                (slot < node.count as usize).then_some(Child { bounds: Aabb { lo, hi }, target })
            }

            fn encode(slots: &[Option<Child>], triangles: u32, _params: &LayoutParams) -> $node {
                let children = in_turn(slots);
                assert!((1..=$arity).contains(&children.len()), "a node has 1 to {} children", $arity);
                let mut node = $node {
                    bounds: [ABSENT; $arity],
                    child: [binary::LEAF_BIT; $arity],
                    count: children.len() as u32,
                    triangles,
                };
                for (slot, child) in children.iter().enumerate() {
                    node.bounds[slot] = Bounds { lo: child.bounds.lo, hi: child.bounds.hi };
                    node.child[slot] = binary::code(child.target);
                }
                node
            }
        }
    };
}

layout!(Wide4, Wide4Node, 4, 120);
layout!(Wide6, Wide6Node, 6, 176);
layout!(Wide8, Wide8Node, 8, 232);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Target;

    #[test]
    fn a_node_decodes_to_what_it_was_encoded_from() {
        let bounds = |x: f32| Aabb { lo: [x, -1.0, 2.0], hi: [x + 1.0, 1.0, 3.0] };
        let children = [
            Child { bounds: bounds(0.0), target: Target::Leaf { first: 42, count: 4 } },
            Child { bounds: bounds(1.0), target: Target::Leaf { first: 46, count: 16 } },
            Child { bounds: bounds(2.0), target: Target::Node(133) },
        ];
        let node = Wide4::encode(&children.map(Some), 99, &LayoutParams::default());
        assert_eq!(node.child, [0x9800_002a, 0xf800_002e, 133, 0x8000_0000]);
        assert_eq!((node.count, node.triangles), (3, 99));
        let words: &[u32] = bytemuck::cast_slice(std::slice::from_ref(&node));
        assert_eq!(words[6..12], [1.0, -1.0, 2.0, 2.0, 1.0, 3.0].map(f32::to_bits));
        assert_eq!(words[18..24], [f32::INFINITY.to_bits(); 6]);
        assert_eq!(words[24..], [0x9800_002a, 0xf800_002e, 133, 0x8000_0000, 3, 99]);
        for slot in 0..4 {
            assert_eq!(Wide4::child(&node, slot), children.get(slot).copied());
        }
    }
}
