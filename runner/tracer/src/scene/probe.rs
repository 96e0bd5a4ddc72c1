//! A plain bounding volume hierarchy on the CPU, to ask a scene a few thousand questions while it is
//! loaded: does a camera here see anything, does light come in? It has nothing to do with the trees
//! that are measured.

use glam::Vec3;

const LEAF: usize = 8;
/// Below this many triangles a subtree is built on one thread.
const PARALLEL: usize = 1 << 13;

/// Triangles in a median-split tree.
pub(super) struct Probe<'a> {
    triangles: &'a [[[f32; 3]; 3]],
    order: Vec<Item>,
    root: Option<Subtree>,
}

/// The nearest triangle on a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    pub triangle: u32,
    /// Unit normal by the triangle's winding.
    pub normal: Vec3,
}

#[derive(Clone, Copy)]
struct Item {
    centre: [f32; 3],
    triangle: u32,
}

struct Subtree {
    low: Vec3,
    high: Vec3,
    kind: Kind,
}

enum Kind {
    Leaf { start: usize, end: usize },
    Pair(Box<[Subtree; 2]>),
}

impl<'a> Probe<'a> {
    pub fn new(triangles: &'a [[[f32; 3]; 3]]) -> Self {
        use rayon::prelude::*;
        let mut order: Vec<Item> = triangles
            .par_iter()
            .enumerate()
            .map(|(i, [a, b, c])| Item {
                centre: std::array::from_fn(|k| a[k] / 3.0 + b[k] / 3.0 + c[k] / 3.0),
                triangle: i as u32,
            })
            .collect();
        let root = (!order.is_empty()).then(|| build(triangles, &mut order, 0));
        Self { triangles, order, root }
    }

    /// The nearest hit farther than `min` along the ray.
    pub fn hit(&self, origin: Vec3, direction: Vec3, min: f32) -> Option<Hit> {
        let inverse = direction.recip();
        let mut best: Option<Hit> = None;
        let mut limit = f32::INFINITY;
        let mut stack: Vec<(&Subtree, f32)> = Vec::with_capacity(64);
        stack.extend(self.root.as_ref().map(|root| (root, 0.0)));
        while let Some((tree, entry)) = stack.pop() {
            if entry > limit {
                continue;
            }
            match &tree.kind {
                Kind::Leaf { start, end } => {
                    for item in &self.order[*start..*end] {
                        let corners = self.triangles[item.triangle as usize].map(Vec3::from_array);
                        if let Some(t) =
                            intersect(corners, origin, direction).filter(|&t| t > min && t < limit)
                        {
                            limit = t;
                            let normal =
                                (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
                            best = Some(Hit { t, triangle: item.triangle, normal });
                        }
                    }
                }
                Kind::Pair(pair) => {
                    let [a, b] = &**pair;
                    let enter = |tree: &Subtree| {
                        let (x, y) = ((tree.low - origin) * inverse, (tree.high - origin) * inverse);
                        let near = x.min(y).max_element().max(0.0);
                        (near <= x.max(y).min_element()).then_some(near)
                    };
                    match (enter(a), enter(b)) {
                        (Some(near_a), Some(near_b)) if near_a <= near_b => {
                            stack.extend([(b, near_b), (a, near_a)])
                        }
                        (Some(near_a), Some(near_b)) => stack.extend([(a, near_a), (b, near_b)]),
                        (Some(near), None) => stack.push((a, near)),
                        (None, Some(near)) => stack.push((b, near)),
                        (None, None) => {}
                    }
                }
            }
        }
        best
    }
}

fn build(triangles: &[[[f32; 3]; 3]], items: &mut [Item], start: usize) -> Subtree {
    if items.len() <= LEAF {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for corner in items.iter().flat_map(|item| triangles[item.triangle as usize]).map(Vec3::from_array) {
            low = low.min(corner);
            high = high.max(corner);
        }
        return Subtree { low, high, kind: Kind::Leaf { start, end: start + items.len() } };
    }
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for item in items.iter() {
        low = low.min(Vec3::from_array(item.centre));
        high = high.max(Vec3::from_array(item.centre));
    }
    let size = high - low;
    let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.centre[axis].total_cmp(&b.centre[axis]).then(a.triangle.cmp(&b.triangle))
    });
    let large = items.len() > PARALLEL;
    let (left, right) = items.split_at_mut(middle);
    let (a, b) = if large {
        rayon::join(|| build(triangles, left, start), || build(triangles, right, start + middle))
    } else {
        (build(triangles, left, start), build(triangles, right, start + middle))
    };
    Subtree { low: a.low.min(b.low), high: a.high.max(b.high), kind: Kind::Pair(Box::new([a, b])) }
}

/// Möller and Trumbore's test; good enough for asking.
fn intersect([a, b, c]: [Vec3; 3], origin: Vec3, direction: Vec3) -> Option<f32> {
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let scale = e1.dot(p);
    if scale == 0.0 {
        return None;
    }
    let from = (origin - a) / scale;
    let u = from.dot(p);
    let q = from.cross(e1);
    let v = direction.dot(q);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| e2.dot(q))
}

#[cfg(test)]
mod tests {
    use super::super::random::Random;
    use super::*;

    #[test]
    fn agrees_with_testing_every_triangle() {
        let mut random = Random::new(5);
        let triangles: Vec<[[f32; 3]; 3]> = (0..2000)
            .map(|_| {
                let at = random.direction() * random.unit();
                std::array::from_fn(|_| (at + 0.1 * random.direction()).to_array())
            })
            .collect();
        let probe = Probe::new(&triangles);
        let mut hits = 0;
        for _ in 0..500 {
            let (origin, direction) = (2.0 * random.direction(), random.direction());
            let direction = (0.5 * direction - origin).normalize();
            let oracle = triangles
                .iter()
                .filter_map(|t| intersect(t.map(Vec3::from_array), origin, direction))
                .filter(|&t| t > 0.0)
                .min_by(f32::total_cmp);
            let found = probe.hit(origin, direction, 0.0).map(|hit| hit.t);
            assert_eq!(found, oracle);
            hits += u32::from(found.is_some());
        }
        assert!(hits > 100, "{hits}");
    }

    #[test]
    fn nothing_and_identical_triangles_are_fine() {
        assert!(Probe::new(&[]).hit(Vec3::ZERO, Vec3::X, 0.0).is_none());
        let same = vec![[[1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 0.0, 1.0]]; 100];
        let hit = Probe::new(&same).hit(Vec3::ZERO, Vec3::X, 0.0).unwrap();
        assert!((hit.t - 1.0).abs() < 1e-6);
    }
}
