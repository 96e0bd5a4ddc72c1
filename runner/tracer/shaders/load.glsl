// Loads of a node's words from an address, as wide as its alignment allows.
#ifndef LOAD_GLSL
#define LOAD_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Words1 {
    uint v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Words2 {
    uvec2 v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Words4 {
    uvec4 v[];
};

// Two words at an address that is a multiple of `align`, which is constant.
uvec2 load2(uint64_t at, uint align_) {
    if (align_ >= 8) {
        return Words2(at).v[0];
    }
    Words1 w = Words1(at);
    return uvec2(w.v[0], w.v[1]);
}

// Four words.
uvec4 load4(uint64_t at, uint align_) {
    if (align_ >= 16) {
        return Words4(at).v[0];
    }
    return uvec4(load2(at, align_), load2(at + 8, align_));
}

#endif
