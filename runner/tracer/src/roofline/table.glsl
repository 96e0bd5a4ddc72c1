// What a table of nodes holds, and how pieces of it are added up: in 16 bytes each, as kernels load them.
#ifndef ROOFLINE_TABLE_GLSL
#define ROOFLINE_TABLE_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Pieces {
    uvec4 items[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Sums {
    uint items[];
};

// The word at a place, which the CPU knows too.
uint word(uint place) {
    return (place * 0x9E3779B1u) ^ (place >> 15);
}

uint folded(uvec4 piece) {
    return (piece.x ^ piece.y) + (piece.z ^ piece.w);
}

#endif
