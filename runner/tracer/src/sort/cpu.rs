//! The plain twin: the standard library's stable sort.

/// The permutation that sorts `keys`, equal ones in input order: element i of the result is the index of
/// the i-th smallest key.
pub fn order(keys: &[u64]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..u32::try_from(keys.len()).expect("indices fit u32")).collect();
    order.sort_by_key(|&i| keys[i as usize]);
    order
}
