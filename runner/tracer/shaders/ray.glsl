// Rays and hits as they lie in memory, and as the files of `runner rays` store them.
#ifndef RAY_GLSL
#define RAY_GLSL

// Memory through which stages hand rays on. Where the stages are one kernel, no barrier between launches makes
// one invocation see what another wrote.
#ifdef SINGLE_KERNEL
#define BETWEEN_STAGES coherent
#else
#define BETWEEN_STAGES
#endif

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

// 32 bytes. Points of the ray are origin + t * direction for t_min < t < t_max.
struct Ray {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};

// 8 bytes. The triangle's index in file order; infinity and MISS where nothing was hit.
struct Hit {
    float t;
    uint triangle;
};

const uint MISS = 0xFFFFFFFFu;
#define INFINITY uintBitsToFloat(0x7F800000u)
#define LARGEST uintBitsToFloat(0x7F7FFFFFu)

layout(buffer_reference, scalar, buffer_reference_align = 16) BETWEEN_STAGES buffer Rays {
    Ray items[];
};
layout(buffer_reference, scalar, buffer_reference_align = 8) BETWEEN_STAGES buffer Hits {
    Hit items[];
};

// One wavefront's queue. 16 bytes.
layout(buffer_reference, scalar, buffer_reference_align = 16) BETWEEN_STAGES buffer Queue {
    uint next;      // the first ray that no invocation has fetched
    uint count;     // rays in the wavefront
    uint finished;  // rays whose hit has been written
    uint unused;
};

#endif
