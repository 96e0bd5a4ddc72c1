#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "sort.glsl"
#include "workgroup.glsl"

// Sorts a tile by digit in shared memory, then writes it out: equal digits lie side by side there, so
// neighbouring invocations write to neighbouring places.
//
// A key's place in the sorted tile is the sum of three counts:
//   keys of smaller digits in the tile                                  \  in histogram[subgroup][digit]
//   + keys of its digit in earlier subgroups' parts of the tile         /  after prepare()
//   + keys of its digit before it in its subgroup's part: its rank.
// Each subgroup takes its part of the tile in rounds of one key a lane, so ranks follow input order and
// the sort is stable.

shared uint histogram[SUBGROUPS * DIGITS];
// Where in the output the tile's first key of a digit goes, less that key's place in the tile.
shared uint to_output[DIGITS];
shared uint stage[ITEMS * gl_WorkGroupSize.x];

uint digit_of(uint key_word) {
    return (key_word >> shift) & (DIGITS - 1);
}

// The lanes that hold the same digit as this one, among those with a valid key.
uvec4 lanes_alike(uint digit, bool valid) {
    uvec4 alike = subgroupBallot(valid);
    [[unroll]] for (uint bit = 0; bit < 8; ++bit) {
        bool set = ((digit >> bit) & 1) != 0;
        uvec4 with = subgroupBallot(set);
        alike &= set ? with : ~with;
    }
    return alike;
}

// Turns the subgroups' counts into places, digit by digit.
void prepare() {
    uint carry_tile = 0;
    uint carry_all = 0;
    for (uint begin = 0; begin < DIGITS; begin += gl_WorkGroupSize.x) {
        uint d = begin + gl_LocalInvocationIndex;
        uint in_tile = 0;
        uint in_all = 0;
        if (d < DIGITS) {
            for (uint s = 0; s < SUBGROUPS; ++s) {
                uint own = histogram[s * DIGITS + d];
                histogram[s * DIGITS + d] = in_tile;
                in_tile += own;
            }
            in_all = totals.v[d];
        }
        uint total_tile, total_all;
        uint smaller_in_tile = carry_tile + workgroup_exclusive_add(in_tile, total_tile);
        uint smaller_in_all = carry_all + workgroup_exclusive_add(in_all, total_all);
        if (d < DIGITS) {
            for (uint s = 0; s < SUBGROUPS; ++s) {
                histogram[s * DIGITS + d] += smaller_in_tile;
            }
            to_output[d] = smaller_in_all + counts.v[d * tiles + gl_WorkGroupID.x] - smaller_in_tile;
        }
        carry_tile += total_tile;
        carry_all += total_all;
    }
    barrier();
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint size = gl_WorkGroupSize.x;
    for (uint i = lane; i < SUBGROUPS * DIGITS; i += size) {
        histogram[i] = 0;
    }
    barrier();

    uint tile = gl_WorkGroupID.x * size * ITEMS;
    uint tile_count = min(count - tile, size * ITEMS);
    // This lane's keys in the tile: first, first + gl_SubgroupSize, ….
    uint first_item = gl_SubgroupID * gl_SubgroupSize * ITEMS + gl_SubgroupInvocationID;
    uint key[ITEMS];
    uint place[ITEMS];
    // All at once: no load waits for the ranks of the keys before.
    [[unroll]] for (uint j = 0; j < ITEMS; ++j) {
        uint i = first_item + j * gl_SubgroupSize;
        key[j] = i < tile_count ? keys_in.v[(tile + i) * WORDS + word] : 0;
    }
    [[unroll]] for (uint j = 0; j < ITEMS; ++j) {
        bool valid = first_item + j * gl_SubgroupSize < tile_count;
        uint digit = digit_of(key[j]);
        uvec4 alike = lanes_alike(digit, valid);
        uint rank = subgroupBallotExclusiveBitCount(alike);
        uint slot = gl_SubgroupID * DIGITS + digit;
        uint earlier = histogram[slot];
        subgroupMemoryBarrierShared();
        subgroupBarrier();
        if (valid && rank == 0) {
            histogram[slot] = earlier + subgroupBallotBitCount(alike);
        }
        subgroupMemoryBarrierShared();
        subgroupBarrier();
        place[j] = earlier + rank;
    }
    barrier();
    prepare();

    [[unroll]] for (uint j = 0; j < ITEMS; ++j) {
        if (first_item + j * gl_SubgroupSize < tile_count) {
            place[j] += histogram[gl_SubgroupID * DIGITS + digit_of(key[j])];
            stage[place[j]] = key[j];
        }
    }
    barrier();
    uint target[ITEMS];
    [[unroll]] for (uint j = 0; j < ITEMS; ++j) {
        uint i = lane + j * size;
        if (i < tile_count) {
            target[j] = to_output[digit_of(stage[i])] + i;
            keys_out.v[target[j] * WORDS + word] = stage[i];
        }
    }
    barrier();

    if (WORDS == 2) {
        [[unroll]] for (uint j = 0; j < ITEMS; ++j) {
            uint i = first_item + j * gl_SubgroupSize;
            if (i < tile_count) {
                stage[place[j]] = keys_in.v[(tile + i) * WORDS + (word ^ 1)];
            }
        }
        barrier();
        [[unroll]] for (uint j = 0; j < ITEMS; ++j) {
            uint i = lane + j * size;
            if (i < tile_count) {
                keys_out.v[target[j] * WORDS + (word ^ 1)] = stage[i];
            }
        }
        barrier();
    }

    [[unroll]] for (uint j = 0; j < ITEMS; ++j) {
        uint i = first_item + j * gl_SubgroupSize;
        if (i < tile_count) {
            stage[place[j]] = first != 0 ? tile + i : values_in.v[tile + i];
        }
    }
    barrier();
    [[unroll]] for (uint j = 0; j < ITEMS; ++j) {
        uint i = lane + j * size;
        if (i < tile_count) {
            values_out.v[target[j]] = stage[i];
        }
    }
}
