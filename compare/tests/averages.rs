//! What the thesis says of averages over its scenes (Cezner 2025, chapters 6.7 and 7) follows from its tables, or it
//! is said here that it does not.
//!
//! Averages are arithmetic means over the five scenes of values relative to `Binary`. Where variants are compared
//! with each other, the thesis seems to divide such means; the mean of the quotients is given beside it.

use compare::figure::Figure::{self, *};
use compare::load::load;
use compare::select::{REFERENCE, Selection};
use record::{Record, mean};

fn reference() -> Record {
    load(concat!(env!("CARGO_MANIFEST_DIR"), "/../reports/reference/cezner2025.json")).unwrap()
}

/// The mean over the scenes of a variant's figure relative to `Binary`.
fn relative(selection: &Selection, variant: &str, figure: Figure) -> f64 {
    let own = selection.entries.iter().filter(|entry| entry.variant() == variant);
    mean(own.map(|entry| selection.relative(entry, REFERENCE, figure))).unwrap()
}

/// The same relative to another variant: the quotient of both means, and the mean of the quotients.
fn between(selection: &Selection, variant: &str, other: &str, figure: Figure) -> (f64, f64) {
    let own = selection.entries.iter().filter(|entry| entry.variant() == variant);
    let quotients = mean(own.map(|entry| selection.relative(entry, other, figure))).unwrap();
    (relative(selection, variant, figure) / relative(selection, other, figure), quotients)
}

/// By how many percent something is more, rounded.
fn percent(ratio: f64) -> i32 {
    (100.0 * (ratio - 1.0)).round() as i32
}

#[test]
fn averages_relative_to_binary_are_as_published() {
    let record = reference();
    let selection = Selection::new(&record);
    for (variant, figure, published) in [
        // 6.7, the second paragraph: uncompressed trees by area.
        ("Wide6", Secondary, 15),
        ("Wide8", Secondary, 2),
        ("Wide4", Primary, 7),
        ("Wide6", Primary, 0),
        ("Wide8", Primary, -11),
        ("Wide4", Total, 2),
        ("Wide8", Total, -1),
        // The first: about half the nodes, boxes up to -6%, triangles up to -3%.
        ("Wide4", Nodes, -50),
        ("Wide4 CBTC", Boxes, -6),
        ("Wide4 Slang CBTC", Triangles, -3),
        ("Wide8 Slang Quantized CBTC", Triangles, 22),
        // Quantized ones.
        ("Wide4 Quantized", Secondary, 74),
        ("Wide6 Quantized", Secondary, 78),
        ("Wide8 Quantized", Secondary, 61),
        // 7: the best in each category. The first is that written in Slang.
        ("Wide4 Slang", Secondary, 20),
        ("Wide4 CBTC", Secondary, 24),
        ("Wide4 Quantized CBTC", Secondary, 81),
    ] {
        let found = percent(relative(&selection, variant, figure));
        assert_eq!(found, published, "{variant} {figure:?}");
    }
}

#[test]
fn averages_relative_to_counterparts_are_as_published() {
    let record = reference();
    let selection = Selection::new(&record);
    for (variant, other, figure, published) in [
        // Quantized against uncompressed: "55% faster for 6-ary, and 58% faster for 8-ary".
        ("Wide6 Quantized", "Wide6", Secondary, 55),
        ("Wide8 Quantized", "Wide8", Secondary, 58),
        // "MRps performance decreases by about 16–18%", "construction time increases approximately 8–12%".
        ("Wide4 Quantized", "Wide4", Primary, -16),
        ("Wide6 Quantized", "Wide6", Primary, -16),
        ("Wide8 Quantized", "Wide8", Primary, -18),
        ("Wide4 Quantized", "Wide4", Total, 9),
        ("Wide8 Quantized", "Wide8", Total, 12),
        // "2.5–4% more volumes tested".
        ("Wide6 Quantized", "Wide6", Boxes, 3),
        ("Wide8 Quantized", "Wide8", Boxes, 4),
        // Slang against GLSL: "+1%", "-7%", primary rays "-17% to -20%"; quantized "-9%" and "-12%".
        ("Wide4 Slang", "Wide4", Secondary, 1),
        ("Wide6 Slang", "Wide6", Secondary, 2),
        ("Wide8 Slang", "Wide8", Secondary, -7),
        ("Binary Slang", "Binary", Primary, -17),
        ("Wide8 Slang", "Wide8", Primary, -20),
        ("Wide4 Slang Quantized", "Wide4 Quantized", Secondary, -9),
        ("Wide8 Slang Quantized", "Wide8 Quantized", Secondary, -12),
        // By view against by area: "approximately 4% for secondary rays", "5% and 1%" of primary and secondary rays
        // with six children, "2% slower" with eight, boxes -5% and -4%, construction "about 19–21%".
        ("Wide4 CBTC", "Wide4", Secondary, 4),
        ("Wide4 Quantized CBTC", "Wide4 Quantized", Secondary, 4),
        ("Wide6 Quantized CBTC", "Wide6 Quantized", Primary, 5),
        ("Wide6 Quantized CBTC", "Wide6 Quantized", Secondary, 1),
        ("Wide8 Quantized CBTC", "Wide8 Quantized", Secondary, -2),
        ("Wide4 CBTC", "Wide4", Boxes, -5),
        ("Wide6 CBTC", "Wide6", Boxes, -4),
        ("Wide8 CBTC", "Wide8", Boxes, 0),
        ("Wide4 CBTC", "Wide4", Total, 21),
        ("Wide8 CBTC", "Wide8", Total, 19),
    ] {
        let (of_means, _) = between(&selection, variant, other, figure);
        assert_eq!(percent(of_means), published, "{variant} {figure:?}");
    }
}

#[test]
fn single_scenes_are_as_published() {
    let record = reference();
    let selection = Selection::new(&record);
    let of = |scene: &str, variant: &str, other: &str, figure: Figure| {
        let mut all = selection.entries.iter();
        let entry = all.find(|entry| entry.scene() == scene && entry.variant() == variant).unwrap();
        percent(selection.relative(entry, other, figure).unwrap())
    };
    // 6.7: "up to -39% in Wide8 Slang Quantized" on lynxsdesign, which is of primary rays.
    assert_eq!(of("lynxsdesign", "Wide8 Slang Quantized", "Binary", Primary), -39);
    // "San_miguel scene, where primary rays show a 30% increase".
    assert_eq!(of("san_miguel", "Wide4 CBTC", "Wide4", Primary), 30);
}

/// Published figures that are not what the tables give: the published one, the quotient of means, and the mean of
/// quotients. Of the last digits rounding may be the reason, of 48%, -14% and -28% it is not.
#[test]
fn some_published_figures_are_not_what_the_tables_give() {
    let record = reference();
    let selection = Selection::new(&record);
    // "+20% speedup for secondary rays in 4-ary BVH": the GLSL variant has 1.190, the Slang variant 1.201.
    assert_eq!(percent(relative(&selection, "Wide4", Secondary)), 19);
    // Boxes "up to +23%": six and eight children have up to +29%, uncompressed ones in GLSL +24%.
    assert_eq!(percent(relative(&selection, "Wide8", Boxes)), 24);
    assert_eq!(percent(relative(&selection, "Wide8 Quantized CBTC", Boxes)), 29);
    for (variant, other, figure, published, given) in [
        ("Wide4 Quantized", "Wide4", Secondary, 48, (46, 45)),
        ("Wide6 Slang Quantized", "Wide6 Quantized", Secondary, -14, (-16, -16)),
        // The lower end of "-18% to -28%" is Wide4 Slang Quantized relative to Binary, not to its GLSL counterpart.
        ("Wide4 Slang Quantized", "Wide4 Quantized", Primary, -28, (-21, -21)),
        // "9% for primary rays" of four children: 1.081 uncompressed, 1.090 quantized, as means of quotients.
        ("Wide4 CBTC", "Wide4", Primary, 9, (8, 8)),
        ("Wide6 CBTC", "Wide6", Primary, 5, (3, 4)),
    ] {
        let (of_means, of_quotients) = between(&selection, variant, other, figure);
        assert_eq!((percent(of_means), percent(of_quotients)), given, "{variant} {figure:?}");
        assert!(published != given.0 && published != given.1);
    }
}
