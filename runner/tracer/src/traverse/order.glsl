// Sorting networks of least comparisons (Knuth 5.3.4; thesis 2.3.4, figure 8): 1, 5, 12 and 19 for 2, 4, 6
// and 8 children. Every index is constant, so distances and children stay in registers.
#ifndef ORDER_GLSL
#define ORDER_GLSL

#define EXCHANGE(i, j)                    \
    {                                     \
        bool swapped = t[j] < t[i];       \
        float nearer = swapped ? t[j] : t[i]; \
        t[j] = swapped ? t[i] : t[j];     \
        t[i] = nearer;                    \
        uint first = swapped ? child[j] : child[i]; \
        child[j] = swapped ? child[i] : child[j]; \
        child[i] = first;                 \
    }

// The nearest first; misses, at infinity, last.
void order(inout float t[ARITY], inout uint child[ARITY]) {
#if ARITY == 2
    EXCHANGE(0, 1)
#elif ARITY == 4
    EXCHANGE(0, 1) EXCHANGE(2, 3)
    EXCHANGE(0, 2) EXCHANGE(1, 3)
    EXCHANGE(1, 2)
#elif ARITY == 6
    EXCHANGE(0, 5) EXCHANGE(1, 3) EXCHANGE(2, 4)
    EXCHANGE(1, 2) EXCHANGE(3, 4)
    EXCHANGE(0, 3) EXCHANGE(2, 5)
    EXCHANGE(0, 1) EXCHANGE(2, 3) EXCHANGE(4, 5)
    EXCHANGE(1, 2) EXCHANGE(3, 4)
#else
    EXCHANGE(0, 2) EXCHANGE(1, 3) EXCHANGE(4, 6) EXCHANGE(5, 7)
    EXCHANGE(0, 4) EXCHANGE(1, 5) EXCHANGE(2, 6) EXCHANGE(3, 7)
    EXCHANGE(0, 1) EXCHANGE(2, 3) EXCHANGE(4, 5) EXCHANGE(6, 7)
    EXCHANGE(2, 4) EXCHANGE(3, 5)
    EXCHANGE(1, 4) EXCHANGE(3, 6)
    EXCHANGE(1, 2) EXCHANGE(3, 4) EXCHANGE(5, 6)
#endif
}

#endif
