//! The ray-triangle tests against exact arithmetic, and that against cases done by hand. `examples/accuracy` measures
//! what is only required here.

#[path = "../examples/accuracy/exact.rs"]
mod exact;
#[path = "../examples/accuracy/inputs.rs"]
mod inputs;
#[path = "../examples/accuracy/tally.rs"]
mod tally;

use exact::{LARGEST, Truth, meet};
use inputs::{Inputs, Kind};
use tally::Tally;
use tracer::{
    layout::{LeafTriangles, UnitTriangle},
    traverse::{Ray, TriangleTest, cpu},
};

fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
    Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
}

#[test]
fn the_oracle_is_right_where_the_answer_is_known() {
    let plate = [[0.0, 0.0, 6.0], [4.0, 0.0, 6.0], [0.0, 4.0, 6.0]];
    let mirrored = [plate[0], plate[2], plate[1]];
    for triangle in [plate, mirrored] {
        for (origin, direction, truth) in [
            ([1.0, 1.0, 0.0], [0.0, 0.0, 1.0], Truth::Inside(6.0)),
            ([1.0, 1.0, 0.0], [0.0, 0.0, 4.0], Truth::Inside(1.5)),
            ([1.0, 1.0, 8.0], [0.0, 0.0, -3.0], Truth::Inside(2.0 / 3.0)),
            ([0.0, 0.0, 0.0], [1.0, 1.0, 6.0], Truth::Inside(1.0)),
            // Edges, and a corner.
            ([2.0, 0.0, 0.0], [0.0, 0.0, 1.0], Truth::Edge(6.0)),
            ([2.0, 2.0, 0.0], [0.0, 0.0, 1.0], Truth::Edge(6.0)),
            ([4.0, 0.0, 5.0], [0.0, 0.0, 1.0], Truth::Edge(1.0)),
            // Beside it, behind the origin, at the origin, parallel to it, in its plane.
            ([3.0, 2.0, 0.0], [0.0, 0.0, 1.0], Truth::Miss),
            ([1.0, 1.0, 0.0], [0.0, 0.0, -1.0], Truth::Miss),
            ([1.0, 1.0, 6.0], [0.0, 0.0, 1.0], Truth::Miss),
            ([1.0, 1.0, 5.0], [1.0, 0.0, 0.0], Truth::Miss),
            ([-1.0, 1.0, 6.0], [1.0, 0.0, 0.0], Truth::Miss),
        ] {
            assert_eq!(meet(&ray(origin, direction), &triangle), truth, "{origin:?}, {direction:?}");
        }
    }
    // By one unit at the end of the range, where floats would see nothing.
    let far = LARGEST as f32;
    let large = [[-far, -far, far], [far, -far, far], [-far, far - 1.0, far]];
    let at = |y: f32| meet(&ray([-far + 1.0, y, -far], [0.0, 0.0, 1.0]), &large);
    assert_eq!(at(far - 3.0), Truth::Inside(f64::from(2.0 * far)));
    assert_eq!(at(far - 2.0), Truth::Inside(f64::from(2.0 * far)));
    assert_eq!(at(far - 1.0), Truth::Miss);
    // Without area.
    let line = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [3.0, 0.0, 1.0]];
    assert_eq!(meet(&ray([2.0, 0.0, 0.0], [0.0, 0.0, 1.0]), &line), Truth::Miss);
}

#[test]
#[should_panic(expected = "no whole number")]
fn the_oracle_takes_nothing_but_whole_numbers() {
    meet(&ray([0.5, 0.0, 0.0], [0.0, 0.0, 1.0]), &[[0.0; 3]; 3]);
}

fn tally(test: TriangleTest, kind: Kind, rays: u64) -> Tally {
    let mut inputs = Inputs::new(7);
    let mut tally = Tally::default();
    (0..rays).for_each(|_| tally.add(test, &inputs.case(kind)));
    tally
}

#[test]
fn rays_slip_through_shared_edges_unless_the_test_is_watertight() {
    for kind in [Kind::MeshEdges, Kind::MeshCorners, Kind::FarMeshEdges] {
        let [watertight, others @ ..] = TriangleTest::ALL.map(|test| tally(test, kind, 100_000));
        assert!(watertight.met > 99_000, "{kind:?}: {} rays meet the mesh", watertight.met);
        assert_eq!(watertight.slips, 0, "{kind:?}");
        // The others are not, or these rays would prove nothing.
        let slips = others.each_ref().map(|tally| tally.slips);
        println!("{kind:?}: {slips:?} of {} rays slip through", watertight.met);
        assert!(kind != Kind::MeshEdges || slips.iter().all(|slips| *slips > 0), "{kind:?}: {slips:?}");
    }
}

#[test]
fn no_box_loses_a_hit_that_is_true() {
    let mut false_hits = 0;
    for kind in Kind::ALL {
        let of_all = TriangleTest::ALL.map(|test| tally(test, kind, 50_000));
        let of_all = of_all.into_iter().fold(Tally::default(), Tally::merge);
        assert_eq!(of_all.true_outside, 0, "{}: of {} hits", kind.name(), of_all.hits);
        false_hits += of_all.false_outside;
    }
    // Some rays do pass outside boxes that tests count as hits, or nothing would have been looked at.
    assert!(false_hits > 0);
}

#[test]
fn every_test_is_right_about_nearly_all_rays_and_distances() {
    for kind in [Kind::Ordinary, Kind::Needles, Kind::Slivers] {
        for test in TriangleTest::ALL {
            let mut tally = tally(test, kind, 20_000);
            assert!(
                tally.inside > 2000 && tally.outside > 2000,
                "{kind:?}: {}, {}",
                tally.inside,
                tally.outside
            );
            let (median, _) = tally.error().unwrap();
            let few = if kind == Kind::Ordinary { 10_000 } else { 20 };
            assert!(tally.false_misses <= tally.inside / few, "{kind:?}, {test:?}: {}", tally.false_misses);
            assert!(tally.false_hits <= tally.outside / few, "{kind:?}, {test:?}: {}", tally.false_hits);
            assert!(median < 1e-4, "{kind:?}, {test:?}: {median}");
        }
    }
}

#[test]
fn no_ray_hits_a_triangle_without_area_and_none_spoils_a_hit() {
    let behind = [[-9.0, -9.0, 9.0], [9.0, -9.0, 9.0], [0.0, 9.0, 9.0]];
    let degenerate = [
        [[0.0, 0.0, 4.0]; 3],
        [[0.0, 0.0, 4.0], [1.0, 0.0, 4.0], [3.0, 0.0, 4.0]],
        [[-1.0, -1.0, 4.0], [-1.0, -1.0, 4.0], [1.0, 1.0, 4.0]],
        [[f32::NAN; 3]; 3],
        [[f32::MAX; 3], [-f32::MAX; 3], [0.0; 3]],
    ];
    let rays = [
        ray([0.0; 3], [0.0, 0.0, 1.0]),
        ray([0.0, 0.0, 4.0], [0.0, 0.0, 1.0]),
        ray([1.0, 1.0, 0.0], [-1.0, -1.0, 4.0]),
        ray([-1.0, 0.0, 4.0], [1.0, 0.0, 0.0]),
    ];
    for test in TriangleTest::ALL {
        for triangle in degenerate {
            for ray in rays {
                assert_eq!(
                    cpu::intersect(test, &ray, f32::INFINITY, &triangle),
                    None,
                    "{test:?}, {triangle:?}"
                );
                let both = LeafTriangles::in_file_order(test, &[triangle, behind, triangle]);
                let alone = cpu::intersect(test, &ray, f32::INFINITY, &behind);
                let hit = cpu::brute_force(&both, &ray);
                assert_eq!(hit.t, alone.unwrap_or(f32::INFINITY), "{test:?}, {triangle:?}, {ray:?}");
            }
        }
    }
    assert_eq!(UnitTriangle::new(&degenerate[3]), UnitTriangle::NOWHERE);
}
