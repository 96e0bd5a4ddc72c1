// Which inner nodes can be processed together: see Levels in bvh2.rs.
//
// Level k holds the inner nodes [first[k], first[k + 1]), whose children all lie in front of first[k].
// Large levels have a dispatch each, whose workgroup count the GPU wrote; from level `tail` on they are
// so small that one workgroup goes through them all, with a barrier after each, in less time than it takes
// to launch one.

#ifndef LEVELS_GLSL
#define LEVELS_GLSL

const uint MAX_LEVELS = 256;
const uint TAIL = 0xffffffffu;
// Instead of a count: the nodes are in no order.
const uint UNORDERED = 0xffffffffu;

struct DispatchArguments {
    uint x, y, z;
};

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Levels {
    // 0 until the tree is complete.
    uint count;
    uint tail;
    uint leaves;
    // Those that the clustering made before it, too, went on in one workgroup.
    uint iterations;
    uint first[MAX_LEVELS + 1];
    DispatchArguments arguments[MAX_LEVELS];
};

#endif
