// Sums over a workgroup, for any subgroup size. To be called by all invocations.

#ifndef WORKGROUP_GLSL
#define WORKGROUP_GLSL

// One for each subgroup; no device has subgroups of fewer than 4 invocations or workgroups over 1024.
shared uint workgroup_partial[256];
shared uint workgroup_total;

// The sum of `x` over the invocations before this one, and over all of them.
uint workgroup_exclusive_add(uint x, out uint total) {
    uint inclusive = subgroupInclusiveAdd(x);
    if (gl_SubgroupInvocationID == gl_SubgroupSize - 1) {
        workgroup_partial[gl_SubgroupID] = inclusive;
    }
    barrier();
    if (gl_SubgroupID == 0) {
        uint carry = 0;
        for (uint begin = 0; begin < gl_NumSubgroups; begin += gl_SubgroupSize) {
            uint i = begin + gl_SubgroupInvocationID;
            uint own = i < gl_NumSubgroups ? workgroup_partial[i] : 0;
            uint sum = subgroupInclusiveAdd(own);
            if (i < gl_NumSubgroups) {
                workgroup_partial[i] = carry + sum - own;
            }
            carry += subgroupMax(sum);
        }
        if (gl_SubgroupInvocationID == 0) {
            workgroup_total = carry;
        }
    }
    barrier();
    uint before = workgroup_partial[gl_SubgroupID] + inclusive - x;
    total = workgroup_total;
    // The next call may overwrite both only when everyone has read them.
    barrier();
    return before;
}

#endif
