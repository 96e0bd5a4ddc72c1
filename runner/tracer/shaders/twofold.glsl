// Arithmetic on unevaluated sums of two floats (Dekker 1971), for the few numbers that need it: half the
// devices have no doubles, and on most of the others they are 32 or 64 times slower than floats.
#ifndef TWOFOLD_GLSL
#define TWOFOLD_GLSL

vec2 two_sum(float a, float b) {
    precise float s = a + b;
    precise float v = s - a;
    precise float r = (a - (s - v)) + (b - v);
    return vec2(s, r);
}
vec2 twofold_add(vec2 a, vec2 b) {
    vec2 s = two_sum(a.x, b.x);
    precise float r = s.y + (a.y + b.y);
    return two_sum(s.x, r);
}
// Upper and lower twelve bits. Vulkan lets `fma` round twice, so a product's error is found the old way.
vec2 halves(float a) {
    precise float c = 4097.0 * a;
    precise float upper = c - (c - a);
    precise float lower = a - upper;
    return vec2(upper, lower);
}
vec2 twofold_multiply(vec2 a, vec2 b) {
    vec2 u = halves(a.x), v = halves(b.x);
    precise float p = a.x * b.x;
    precise float e = ((u.x * v.x - p) + u.x * v.y + u.y * v.x) + u.y * v.y;
    precise float r = e + (a.x * b.y + a.y * b.x);
    return two_sum(p, r);
}
vec2 twofold_determinant(vec2 a, vec2 b, vec2 c, vec2 d) {
    return twofold_add(twofold_multiply(a, d), -twofold_multiply(b, c));
}

#endif
