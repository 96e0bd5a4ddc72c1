#version 460
// One sort of arithmetic again and again, eight results at a time that do not wait for each other. Each comes of others,
// so that no compiler knows them beforehand; all are whole numbers, so that the CPU comes to the same.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "roofline/table.glsl"

layout(local_size_x_id = 0) in;
// `Operation` of the host, in its order.
layout(constant_id = 1) const uint OPERATION = 0;

const uint WIDTH = 8;
const uint STEPS = 4;

layout(push_constant, scalar) uniform Arguments {
    Sums sums;
    uint turns;
    float factor;   // 1, which the compiler does not know
    float summand;  // 1, likewise
    uint unused;
};

void main() {
    uint own = gl_GlobalInvocationID.x;
    float a[WIDTH], b[WIDTH];
    uint x[WIDTH];
    [[unroll]] for (uint i = 0; i < WIDTH; ++i) {
        x[i] = word(own * WIDTH + i);
        a[i] = float(x[i] & 1023u);
        b[i] = a[i] + 512.0;
    }
    for (uint turn = 0; turn < turns; ++turn) {
        [[unroll]] for (uint step_ = 0; step_ < STEPS; ++step_) {
            [[unroll]] for (uint i = 0; i < WIDTH; ++i) {
                uint j = (i + 1) % WIDTH, k = (i + 3) % WIDTH;
                if (OPERATION == 0) {  // a fused multiply-add
                    a[i] = fma(a[i], factor, summand);
                } else if (OPERATION == 1) {  // a minimum and a maximum of two floats
                    a[i] = max(min(a[i], a[j]), a[k]);
                } else if (OPERATION == 2) {  // a minimum or a maximum of three integers
                    x[i] = step_ % 2 == 0 ? min(min(x[i], x[j]), x[k]) : max(max(x[i], x[j]), x[k]);
                } else if (OPERATION == 3) {  // an integer addition
                    x[i] += x[j];
                } else if (OPERATION == 4) {  // a bitwise function of three integers
                    x[i] = (x[i] & x[j]) ^ x[k];
                } else if (OPERATION == 5) {  // four bytes to floats
                    x[i] = x[i] * 1664525u + 1013904223u;
                    a[i] += float(x[i] & 255u);
                    b[i] += float((x[i] >> 8) & 255u);
                    a[i] += float((x[i] >> 16) & 255u);
                    b[i] += float(x[i] >> 24);
                } else {  // one axis of a slab test: two fused multiply-adds, a minimum and a maximum
                    float s = fma(a[j], factor, summand);
                    float t = fma(b[j], factor, -summand);
                    a[i] = min(s, t);
                    b[i] = max(s, t);
                }
            }
        }
    }
    uint sum = 0;
    [[unroll]] for (uint i = 0; i < WIDTH; ++i) {
        sum += x[i] + uint(a[i]) + 3 * uint(b[i]);
    }
    sums.items[own] = sum;
}
