// Intervals of the rays of a packet, and their conservative test against boxes.
#ifndef INTERVALS_GLSL
#define INTERVALS_GLSL

#include "ray.glsl"
#include "slab.glsl"

// Bounds of origins, a pad wider on each side, and of inverse directions.
struct Packet {
    vec3 origin_lo;
    vec3 origin_hi;
    vec3 inverse_lo;
    vec3 inverse_hi;
    float t_min;
};

// The least of a subgroup's numbers. As integers, which some devices compare over a subgroup in one instruction: the
// bits of floats are in their order, those below zero once all but the sign are turned over.
float least_of(float x) {
    int bits = floatBitsToInt(x);
    bits = subgroupMin(bits ^ (bits >> 31 & 0x7fffffff));
    return intBitsToFloat(bits ^ (bits >> 31 & 0x7fffffff));
}

// A distance, at least 0, before which no ray of the packet enters the box, or infinity when all miss it before t_max,
// which is finite. Along each axis the planes are crossed within the product of two intervals, that of their distances
// from the origins and that of the inverse directions.
float enter(Packet packet, vec3 lo, vec3 hi, float t_max) {
    vec3 below = lo - packet.origin_hi, above = hi - packet.origin_lo;
    vec3 a = below * packet.inverse_lo, b = below * packet.inverse_hi;
    vec3 c = above * packet.inverse_lo, d = above * packet.inverse_hi;
    vec3 near = min(min(a, b), min(c, d));
    vec3 far = max(max(a, b), max(c, d));
    float enters = max(max(near.x, near.y), max(near.z, packet.t_min));
    float leaves = min(min(far.x, far.y), min(far.z, t_max));
    return enters <= leaves ? max(enters, 0.0) : INFINITY;
}

// Bounds swapped along the axes where all directions fall.
Packet in_octant(Packet packet, bvec3 fall) {
    return Packet(mix(packet.origin_lo, packet.origin_hi, fall), mix(packet.origin_hi, packet.origin_lo, fall),
                  mix(packet.inverse_lo, packet.inverse_hi, fall), mix(packet.inverse_hi, packet.inverse_lo, fall),
                  packet.t_min);
}

// The same, where all rays point into one octant, so that they enter boxes through `entry` and leave through `exit`. Along an
// axis none enters before a ray would that starts the farthest on and is the fastest, and none leaves after one that starts the
// farthest back and is the slowest. (With planes behind the rays it is the other way round, but where these are does not matter.)
// The packet is what `in_octant` makes of it.
float enter_in_octant(Packet packet, vec3 entry, vec3 exit, float t_max) {
    int enters = max(last_entry((entry - packet.origin_hi) * packet.inverse_lo), floatBitsToInt(packet.t_min));
    int leaves = first_exit((exit - packet.origin_lo) * packet.inverse_hi, t_max);
    return enters <= leaves ? intBitsToFloat(enters) : INFINITY;
}

#endif
