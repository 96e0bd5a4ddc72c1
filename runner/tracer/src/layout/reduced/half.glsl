// Planes of boxes in half precision, rounded outward: see layout/reduced/half.rs.

// Of a magnitude, the last half that is not above it; `inexact` if it is below it.
uint half_truncated(uint magnitude, out bool inexact) {
    if (magnitude < 0x38800000u) {
        inexact = magnitude != 0;
        return 0;
    }
    if (magnitude >= 0x47800000u) {
        inexact = true;
        return 0x7bffu;
    }
    inexact = (magnitude & 0x1fffu) != 0;
    return (magnitude >> 13) - (112u << 10);
}

// The first half that is not below it.
uint half_away(uint magnitude) {
    bool inexact;
    uint bits = half_truncated(magnitude, inexact);
    return inexact ? (bits == 0 ? 0x0400u : bits + 1) : bits;
}

uint half_below(float plane) {
    uint bits = floatBitsToUint(plane);
    uint magnitude = bits & 0x7fffffffu;
    bool inexact;
    return (bits >> 31) == 0 ? half_truncated(magnitude, inexact) : 0x8000u | half_away(magnitude);
}

uint half_above(float plane) {
    uint bits = floatBitsToUint(plane);
    uint magnitude = bits & 0x7fffffffu;
    bool inexact;
    return (bits >> 31) == 0 ? half_away(magnitude) : 0x8000u | half_truncated(magnitude, inexact);
}
