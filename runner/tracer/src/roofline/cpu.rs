//! The kernels' twins: what one invocation comes to.

use super::Operation;

/// Results at a time, and steps a turn, of `rates.comp`.
pub const WIDTH: usize = 8;
/// Steps of a turn.
pub const STEPS: u32 = 4;

/// The word of a table at a place.
pub fn word(place: u32) -> u32 {
    place.wrapping_mul(0x9E37_79B1) ^ (place >> 15)
}

fn folded(piece: u32) -> u32 {
    let [x, y, z, w] = [0, 1, 2, 3].map(|i| word(piece.wrapping_mul(4).wrapping_add(i)));
    (x ^ y).wrapping_add(z ^ w)
}

fn shuffled(state: u32) -> u32 {
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// What an invocation of `nodes.comp` adds up, where it reads alone.
pub fn nodes(own: u32, nodes: u32, pieces: u32, turns: u32) -> u32 {
    let mut state = own.wrapping_mul(0x9E37_79B1);
    (0..turns).fold(0, |sum: u32, _| {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let node = ((u64::from(shuffled(state)) * u64::from(nodes)) >> 32) as u32;
        (0..pieces).fold(sum, |sum, k| sum.wrapping_add(folded(node * pieces + k)))
    })
}

/// What an invocation of `rates.comp` comes to.
pub fn rates(own: u32, operation: Operation, turns: u32) -> u32 {
    let mut x: [u32; WIDTH] =
        std::array::from_fn(|i| word(own.wrapping_mul(WIDTH as u32).wrapping_add(i as u32)));
    let mut a = x.map(|x| (x & 1023) as f32);
    let mut b = a.map(|a| a + 512.0);
    for step in (0..turns).flat_map(|_| 0..STEPS) {
        for i in 0..WIDTH {
            let (j, k) = ((i + 1) % WIDTH, (i + 3) % WIDTH);
            match operation {
                Operation::FusedMultiplyAdd => a[i] += 1.0,
                Operation::MinMax => a[i] = a[i].min(a[j]).max(a[k]),
                Operation::MinMaxOfThree if step % 2 == 0 => x[i] = x[i].min(x[j]).min(x[k]),
                Operation::MinMaxOfThree => x[i] = x[i].max(x[j]).max(x[k]),
                Operation::Add => x[i] = x[i].wrapping_add(x[j]),
                Operation::Logic => x[i] = (x[i] & x[j]) ^ x[k],
                Operation::ByteToFloat => {
                    x[i] = x[i].wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let [first, second, third, fourth] = x[i].to_le_bytes().map(f32::from);
                    a[i] += first;
                    b[i] += second;
                    a[i] += third;
                    b[i] += fourth;
                }
                Operation::SlabAxis => {
                    let (s, t) = (a[j] + 1.0, b[j] - 1.0);
                    a[i] = s.min(t);
                    b[i] = s.max(t);
                }
            }
        }
    }
    (0..WIDTH).fold(0, |sum: u32, i| {
        sum.wrapping_add(x[i]).wrapping_add(a[i] as u32).wrapping_add(3u32.wrapping_mul(b[i] as u32))
    })
}
