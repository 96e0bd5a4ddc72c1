#version 460
// The nearest of all triangles, an invocation a ray: see list/mod.rs.
#extension GL_GOOGLE_include_directive : require

layout(local_size_x_id = 0) in;

#include "traverse/tree.glsl"

layout(push_constant, scalar) uniform Arguments {
    Rays rays;
    Hits hits;
    Triangles triangles;
    Indices indices;
    Queue queue;
    Counts counts;
    Utilization utilization;
    // Those of this launch. What earlier ones have found is among the hits.
    uint begin;
    uint end;
    // Whether no launch follows.
    uint last;
};

void main() {
    Tree tree = Tree(uint64_t(0), triangles, indices, counts, Visits(uint64_t(0)), utilization, 0.0);
    uint ray = gl_GlobalInvocationID.x;
    bool there = ray < queue.count;
    vec3 origin;
    float t_min;
    Shear shear;
    Hit best;
    uint triangles_tested = end - begin;
    if (there) {
        Ray r = rays.items[ray];
        origin = r.origin;
        t_min = r.t_min;
        shear = aim(r.direction);
        best = Hit(min(r.t_max, LARGEST), MISS);
        if (begin > 0) {
            Hit before = hits.items[ray];
            best = before.triangle == MISS ? best : before;
            if (COUNT == RAYS) {
                triangles_tested += counts.items[ray].z;
            }
        }
    }
    float nearest = there ? best.t : 0.0;
    uint testing = lanes(there);
    uint index = there ? begin : end;
    while (index < end) {
        // As far as there is nothing uncertain: what is rare is kept out of the loop, because some drivers execute both
        // sides of a branch.
        bool uncertain = false;
        for (; index < end && !uncertain; index++) {
#include "traverse/try_triangle.glsl"
            if (!uncertain && t > t_min && t < best.t) {
                best = Hit(t, found);
            }
        }
        if (uncertain) {
            float t = exact_distance(rays, ray, triangles, index - 1);
            if (t > t_min && t < best.t) {
                best = Hit(t, floatBitsToUint(triangles.items[index - 1].v0_index.w));
            }
        }
    }
    if (there) {
        if (TRIANGLE_TEST == WOOP && best.t < nearest) {
            best.triangle = indices.items[best.triangle];
        }
        hits.items[ray] = Hit(best.triangle == MISS ? INFINITY : best.t, best.triangle);
        if (COUNT == RAYS) {
            counts.items[ray] = uvec4(0, 0, triangles_tested, 0);
        }
    }
    if (COUNT == RAYS) {
        uvec2 fetches = begin == 0 ? step_of(testing) : uvec2(0);
        // Lanes take the same steps but for few.
        uint steps = testing > 0 ? end - begin : 0;
        add_up(utilization, uvec2(0), uvec2(steps, steps * testing), fetches);
    }
    if (subgroupElect()) {
        if (begin == 0) {
            atomicAdd(queue.next, testing);
        }
        if (last != 0) {
            atomicAdd(queue.finished, testing);
        }
    }
}
