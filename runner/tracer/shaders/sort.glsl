// What the three kernels of a radix sort pass share: see sort/mod.rs.

#ifndef SORT_GLSL
#define SORT_GLSL

const uint DIGITS = 256;

layout(local_size_x_id = 0) in;
// Keys an invocation handles.
layout(constant_id = 1) const uint ITEMS = 16;
// 32-bit words a key.
layout(constant_id = 2) const uint WORDS = 1;
// Subgroups a workgroup.
layout(constant_id = 3) const uint SUBGROUPS = 8;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words {
    uint v[];
};

layout(push_constant, scalar) uniform Push {
    Words keys_in;
    Words keys_out;
    Words values_in;
    Words values_out;
    // Of digit d and tile t at d * tiles + t: how many keys; after the scan, how many in earlier tiles.
    Words counts;
    // Keys of each digit.
    Words totals;
    uint count;
    uint tiles;
    // Which eight bits: from bit `shift` of word `word`.
    uint word;
    uint shift;
    // The first pass takes value i for key i instead of reading it.
    uint first;
};

#endif
