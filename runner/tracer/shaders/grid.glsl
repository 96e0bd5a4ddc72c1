// The grid on which planes are rounded outward, one axis at a time: see layout/grid.rs, which gives the reasons.
#ifndef GRID_GLSL
#define GRID_GLSL

struct Grid {
    float origin;
    uint exponent;   // biased, of the step
    float inverse;   // of the step, or of half of it where differences are taken of halves
    bool halved;
};

// x - y for x >= y, rounded down or up, so that it is never more or never less than the exact difference.
// With `halved` both are halved first, because the difference may not fit a float, and any rounding is
// counted; half of the largest difference there is is the largest float.
float difference(float x, float y, bool up, bool halved) {
    if (halved) {
        x *= 0.5;
        y *= 0.5;
    }
    // The error of a sum of two floats (Knuth, TwoSum).
    precise float d = x - y;
    precise float v = d - x;
    precise float error = (x - (d - v)) - (y + v);
    bool off = up ? error > 0.0 || halved : error < 0.0 || halved;
    uint bits = floatBitsToUint(d);
    return off && d > 0.0 ? uintBitsToFloat(up ? min(bits + 1, 0x7f7fffff) : bits - 1) : d;
}

// The finest one on which 2^bits - 1 steps lead from `lo` to `hi`.
Grid grid_of(float lo, float hi, uint bits) {
    float extent = difference(hi, lo, true, false);
    bool halved = isinf(extent);
    if (halved) {
        extent = difference(hi, lo, true, true);
    }
    uint pattern = floatBitsToUint(extent);
    // Mantissa of the largest line: 255 is 1.9921875 * 2^7, with 0x7f0000.
    uint mantissa = 0x800000 - (1 << (24 - bits));
    uint exponent = (pattern >> 23) + ((pattern & 0x7fffff) > mantissa ? 1 : 0);
    exponent = max(exponent, bits) - (bits - 1);
    return Grid(lo, exponent + (halved ? 1 : 0), uintBitsToFloat((254 - exponent) << 23), halved);
}

uint line_below(Grid grid, float plane) {
    return uint(floor(difference(plane, grid.origin, false, grid.halved) * grid.inverse));
}

uint line_above(Grid grid, float plane) {
    float above = difference(plane, grid.origin, true, grid.halved);
    // A step may be so much longer that the product is nothing.
    return max(uint(ceil(above * grid.inverse)), above > 0.0 ? 1 : 0);
}

#endif
