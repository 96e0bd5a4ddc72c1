// What one wavefront of rays has hit: light is gathered, and one ray continues each path that hit a surface,
// cosine-distributed or mirrored. Paths that left the scene are dropped, so the next wavefront is compact.
#extension GL_KHR_shader_subgroup_ballot : require
#include "path/phong.glsl"
#include "random.glsl"
#include "ray.glsl"
#include "scene.glsl"
#include "triangle.glsl"

// A wavefront that has been traced.
struct Wavefront {
    Rays rays;
    Hits hits;
    Paths paths;
    Queue queue;
    Scene scene;
    Image image;
    uint sample_;
    uint seed;
    Shading shading;
};

// Of a depth, another random number.
const uint MIRROR = 0x80000000u;

vec3 sky(Scene scene, vec3 direction) {
    return direction.y >= 0.0 ? mix(scene.horizon, scene.zenith, direction.y) : scene.ground;
}

// The unit normal that faces the ray. Edges are first brought to a length near one, since the square of a
// cross product leaves the range of a float when edges are ten orders of magnitude from it. A triangle
// without area, which a ray can only hit through rounding, faces the ray.
vec3 normal_towards(vec3 direction, vec3 v0, vec3 v1, vec3 v2) {
    vec3 a = v1 - v0, b = v2 - v0;
    vec3 largest = max(abs(a), abs(b));
    float scale = 1.0 / max(largest.x, max(largest.y, largest.z));
    vec3 normal = cross(a * scale, b * scale);
    float squared = dot(normal, normal);
    normal = squared > 0.0 ? normal * inversesqrt(squared) : -direction;
    return dot(normal, direction) > 0.0 ? -normal : normal;
}

// A direction about `normal` with density cosine / pi.
vec3 cosine_direction(vec3 normal, vec2 random) {
    // Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017.
    float s = normal.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + normal.z);
    float b = normal.x * normal.y * a;
    vec3 tangent = vec3(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x);
    vec3 bitangent = vec3(b, s + normal.y * normal.y * a, -normal.y);
    float radius = sqrt(random.x);
    float angle = 6.28318530717958648 * random.y;
    return radius * cos(angle) * tangent + radius * sin(angle) * bitangent + sqrt(1.0 - random.x) * normal;
}

// Shades the ray at an index, if there is one, and queues the next ray of its path unless these were the
// `last`. All invocations of a subgroup take part.
void shade(Wavefront w, uint index, uint depth, bool last, Rays next_rays, Paths next_paths, Queue next_queue) {
    bool continues = false;
    Ray next;
    Path path;
    if (index < w.queue.count) {
        Ray ray = w.rays.items[index];
        Hit hit = w.hits.items[index];
        path = w.paths.items[index];
        if (hit.triangle == MISS) {
            w.image.items[path.pixel].rgb += path.throughput * sky(w.scene, ray.direction);
        } else {
            Material material = w.scene.materials.items[w.scene.material_ids.items[hit.triangle]];
            vec3 v0 = w.scene.positions.items[3 * hit.triangle];
            vec3 v1 = w.scene.positions.items[3 * hit.triangle + 1];
            vec3 v2 = w.scene.positions.items[3 * hit.triangle + 2];
            vec3 normal = normal_towards(ray.direction, v0, v1, v2);

            // The next ray must not meet this surface, nor its neighbours in the same plane, through
            // rounding. It starts a little above the plane, by more than the triangle test's error, which
            // grows with the scene's extent; and a little inside the triangle, so that at an edge it is
            // not already behind the neighbour.
            vec3 edges = project(ray.origin, shear_of(ray.direction), v0, v1, v2).edges;
            vec3 weights = clamp(edges / (edges.x + edges.y + edges.z), 0.0, 1.0);
            weights = mix(weights, vec3(1.0 / 3.0), 3.814697265625e-6);  // 2^-18
            vec3 position = weights.x * v0 + weights.y * v1 + weights.z * v2;
            position += normal * (w.scene.extent * 3.814697265625e-6);  // 2^-18

            vec3 light = material.emission;
            vec3 direction;
            if (w.shading.integrator == PHONG) {
                vec3 incoming = normalize(ray.direction);
                light += local_light(w.scene, material, w.shading, position, normal, -incoming);
                direction = reflect(incoming, normal);
                continues = !last && material.phong.z > 0.0;
            } else {
                // A share of all rays is mirrored and loses nothing, the others lose what is not reflected.
                float mirrored = clamp(max(material.phong.z, w.shading.specular), 0.0, 1.0);
                bool mirrors =
                    mirrored > 0.0 && random2(path.pixel, w.sample_, depth | MIRROR, w.seed).x < mirrored;
                direction = mirrors
                    ? reflect(ray.direction, normal)
                    : cosine_direction(normal, random2(path.pixel, w.sample_, depth, w.seed));
                material.phong.z = mirrors ? 1.0 : 0.0;
                continues = !last;
            }
            w.image.items[path.pixel].rgb += path.throughput * light;
            next = Ray(position, 0.0, direction, INFINITY);
            path.throughput *= w.shading.integrator == PHONG || material.phong.z > 0.0
                ? vec3(material.phong.z) : material.albedo;
        }
    }
    uvec4 ballot = subgroupBallot(continues);
    uint first = 0;
    if (subgroupElect()) {
        first = atomicAdd(next_queue.count, subgroupBallotBitCount(ballot));
    }
    first = subgroupBroadcastFirst(first);
    if (continues) {
        uint slot = first + subgroupBallotExclusiveBitCount(ballot);
        next_rays.items[slot] = next;
        next_paths.items[slot] = path;
    }
}
