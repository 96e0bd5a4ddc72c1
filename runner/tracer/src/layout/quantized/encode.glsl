// See layout/quantized/mod.rs, which draws the format and gives the reasons.

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

// Exponent bits of the least power of two of which 255 cover `extent`.
uint exponent_for(float extent) {
    uint bits = floatBitsToUint(extent);
    // 255 is 1.9921875 * 2^7, and 0x7f0000 the mantissa of the former.
    uint exponent = (bits >> 23) + ((bits & 0x7fffff) > 0x7f0000 ? 1 : 0);
    return max(exponent, 8) - 7;
}

void encode(Words to, WideNode node, Box box[ARITY]) {
    Box all = box[0];
    [[unroll]] for (uint slot = 1; slot < ARITY; slot++) {
        if (slot < node.children) {
            all = box_union(all, box[slot]);
        }
    }
    // Per slot, the grid's lines below and above: 8 bits each.
    uint lo[ARITY][3];
    uint hi[ARITY][3];
    uint exponents = 0;
    [[unroll]] for (uint axis = 0; axis < 3; axis++) {
        float origin = all.lo[axis];
        float extent = difference(all.hi[axis], origin, true, false);
        bool halved = isinf(extent);
        if (halved) {
            extent = difference(all.hi[axis], origin, true, true);
        }
        uint exponent = exponent_for(extent);
        float inverse = uintBitsToFloat((254 - exponent) << 23);
        exponents |= (exponent + (halved ? 1 : 0)) << (8 * axis);
        [[unroll]] for (uint slot = 0; slot < ARITY; slot++) {
            lo[slot][axis] = 0;
            hi[slot][axis] = 0;
            if (slot < node.children) {
                lo[slot][axis] = uint(floor(difference(box[slot].lo[axis], origin, false, halved) * inverse));
                // A step may be so much longer that the product is nothing.
                float above = difference(box[slot].hi[axis], origin, true, halved);
                hi[slot][axis] = max(uint(ceil(above * inverse)), above > 0.0 ? 1 : 0);
            }
        }
        to.v[axis] = floatBitsToUint(origin);
    }
    to.v[3] = exponents | node.leaves << 24 | node.children << 28;
    to.v[4] = node.first_node;
    to.v[5] = node.first_triangle;
    uint sizes = 0;
    [[unroll]] for (uint slot = 0; slot < ARITY; slot++) {
        if (slot < node.leaves) {
            sizes |= node.size[slot] << (4 * slot);
        }
        to.v[7 + slot] = lo[slot][0] | hi[slot][0] << 8 | lo[slot][1] << 16 | hi[slot][1] << 24;
    }
    to.v[6] = sizes;
    [[unroll]] for (uint pair = 0; pair < ARITY / 2; pair++) {
        uint even = lo[2 * pair][2] | hi[2 * pair][2] << 8;
        uint odd = lo[2 * pair + 1][2] | hi[2 * pair + 1][2] << 8;
        to.v[7 + ARITY + pair] = even | odd << 16;
    }
}
