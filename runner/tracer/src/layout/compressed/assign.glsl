// Which slot a child gets: see layout/compressed/assign.rs, its twin, which gives the reasons.

const uint AUCTION = 0, GREEDY = 1, RANDOM = 2;
const uint NOBODY = 15;
const uint MOST_BIDS = 4096;

// Equation 9 of Ylitie et al. 2017.
float cost(vec3 offset, uint slot) {
    vec3 signed_ = vec3((slot & 1) != 0 ? -offset.x : offset.x, (slot & 2) != 0 ? -offset.y : offset.y,
                        (slot & 4) != 0 ? -offset.z : offset.z);
    precise float sum = signed_.x + signed_.y + signed_.z;
    return sum;
}

uint[8] auction(vec3 offset[8], uint children) {
    float price[8] = float[8](0, 0, 0, 0, 0, 0, 0, 0);
    uint owner[8] = uint[8](NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY);
    uint slot_of[8] = uint[8](NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY);
    float largest = 0.0;
    for (uint child = 0; child < children; child++) {
        vec3 a = abs(offset[child]);
        largest = max(largest, max(a.x, max(a.y, a.z)));
    }
    uint bids = largest > 1e-30 ? MOST_BIDS : 0;
    for (uint bid = 0; bid < bids; bid++) {
        uint child = 0;
        while (child < children && slot_of[child] != NOBODY) {
            child++;
        }
        if (child == children) {
            break;
        }
        float best = uintBitsToFloat(0xff800000u);
        float second = best;
        uint chosen = 0;
        for (uint slot = 0; slot < 8; slot++) {
            precise float value = -cost(offset[child], slot) - price[slot];
            if (value > best) {
                second = best;
                best = value;
                chosen = slot;
            } else if (value > second) {
                second = value;
            }
        }
        precise float raised = (price[chosen] + (best - second)) + largest * 0.0009765625;
        price[chosen] = raised;
        if (owner[chosen] != NOBODY) {
            slot_of[owner[chosen]] = NOBODY;
        }
        owner[chosen] = child;
        slot_of[child] = chosen;
    }
    uint free = 0;
    for (uint child = 0; child < children; child++) {
        if (slot_of[child] == NOBODY) {
            while (owner[free] != NOBODY) {
                free++;
            }
            slot_of[child] = free++;
        }
    }
    return slot_of;
}

uint[8] greedy(vec3 offset[8], uint children) {
    uint slot_of[8] = uint[8](NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY, NOBODY);
    uint taken = 0;
    for (uint turn = 0; turn < children; turn++) {
        float least = uintBitsToFloat(0x7f800000u);
        uint chosen = NOBODY;
        uint place = 0;
        for (uint child = 0; child < children; child++) {
            for (uint slot = 0; slot < 8; slot++) {
                if (slot_of[child] == NOBODY && (taken >> slot & 1) == 0) {
                    float c = cost(offset[child], slot);
                    if (c < least || chosen == NOBODY) {
                        least = c;
                        chosen = child;
                        place = slot;
                    }
                }
            }
        }
        slot_of[chosen] = place;
        taken |= 1 << place;
    }
    return slot_of;
}

uint[8] random_slots(uint seed) {
    uint slots[8] = uint[8](0, 1, 2, 3, 4, 5, 6, 7);
    uint state = seed;
    for (uint at = 7; at > 0; at--) {
        state = state * 747796405u + 2891336453u;
        uint word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
        uint other = (word >> 22 ^ word) % (at + 1);
        uint kept = slots[at];
        slots[at] = slots[other];
        slots[other] = kept;
    }
    return slots;
}
