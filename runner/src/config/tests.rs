//! Configs as their users meet them: files in, points or messages out.

use super::{document::Document, when::When, *};
use record::Parameters;
use serde_json::Value;
use std::{collections::BTreeSet, fs};
use tempfile::TempDir;
use tracer::{layout::Layout, traverse::Language};

/// Files in a folder of their own.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    folder
}

fn options(options: &[&str]) -> Vec<String> {
    options.iter().map(|&option| option.to_owned()).collect()
}

/// Reads `a.toml` of a folder.
fn open(folder: &TempDir, overrides: &[&str]) -> anyhow::Result<Config> {
    Config::load(&folder.path().join("a.toml"), &[], &options(overrides), &SearchPath::only([]))
}

/// Reads a single file.
fn load(text: &str, overrides: &[&str]) -> anyhow::Result<Config> {
    open(&folder(&[("a.toml", text)]), overrides)
}

fn keys(config: &Config) -> Vec<String> {
    config.points().unwrap().iter().map(Setup::key).collect()
}

const SMALL: &str = "scenes = [\"city\"]\nvariants = [\"Binary\", \"Wide4\"]\n";

#[test]
fn what_is_left_out_has_its_default() {
    let config = load(SMALL, &[]).unwrap();
    assert_eq!(config.title, "a");
    assert_eq!((config.method, config.depth(), config.seed, config.warm_up), (Method::Paths, 8, 0, 1));
    assert_eq!(load(SMALL, &["method=replay"]).unwrap().depth(), 9);
    assert_eq!((config.views.as_ref(), config.size, config.builds), (None, None, None));
    let Samples { least, most, half_width, time, least_clock } = config.samples;
    assert_eq!((least, most, half_width, least_clock), (None, None, 0.01, 0.95));
    assert_eq!(time, Duration::from_secs(60));
    assert_eq!(config.order, Order { seed: 0, reference_every: 20 });
    assert_eq!(keys(&config), ["city | Binary", "city | Wide4"]);
    assert_eq!(config.points().unwrap()[0].params, crate::params::Params::of(Variant::BINARY));
}

#[test]
fn everything_that_is_said_arrives() {
    let text = r#"
        title = "All"
        scenes = ["city:triangles=1e6,seed=3", "models/thing.glb", "city:triangles=1e6,seed=3"]
        variants = ["wide6*cbtc", "Wide6 CBTC", "!* Slang *"]
        views = "0-3"
        size = "640x360"
        method = "replay"
        depth = 4
        seed = 9
        builds = 2
        warm-up = 0
        samples = { least = 5, most = 60, half-width = "2.5%", time = "2 min", least-clock = "90%" }
        order = { seed = 7, reference-every = 0 }
    "#;
    let config = load(text, &[]).unwrap();
    assert_eq!(config.title, "All");
    assert_eq!(config.scenes, ["city:triangles=1e6,seed=3", "models/thing.glb"], "each once");
    let names: Vec<_> = config.variants.iter().map(|variant| variant.name()).collect();
    assert_eq!(names, ["Wide6 CBTC", "Wide6 Quantized CBTC"]);
    assert_eq!((config.views.as_deref(), config.builds), (Some("0-3"), Some(2)));
    assert_eq!(config.size, Some(Size { width: 640, height: 360 }));
    assert_eq!((config.method, config.depth(), config.seed, config.warm_up), (Method::Replay, 4, 9, 0));
    let Samples { least, most, half_width, time, least_clock } = config.samples;
    assert_eq!((least, most, half_width, least_clock), (Some(5), Some(60), 0.025, 0.9));
    assert_eq!((time, config.order), (Duration::from_secs(120), Order { seed: 7, reference_every: 0 }));
    let exact = load(&format!("{SMALL}samples = 15"), &[]).unwrap().samples;
    assert_eq!((exact.least, exact.most), (Some(15), Some(15)));
}

#[test]
fn axes_cross_and_zipped_ones_walk_together() {
    let text = r#"
        scenes = ["city"]
        variants = ["Wide4"]
        [[axis]]
        parameter = "trace.primary_subgroups"
        values = [2, 4]
        zip = "workgroup"
        [[axis]]
        parameter = "collapse.c_t"
        values = [1, 2.5, 1.0]
        [[axis]]
        parameter = "trace.secondary_subgroups"
        range = { from = 2, to = 4, factor = 2 }
        zip = "workgroup"
    "#;
    let config = load(text, &[]).unwrap();
    assert_eq!(
        keys(&config),
        [
            "city | Wide4 | collapse.c_t=1, trace.primary_subgroups=2, trace.secondary_subgroups=2",
            "city | Wide4 | collapse.c_t=2.5, trace.primary_subgroups=2, trace.secondary_subgroups=2",
            "city | Wide4 | collapse.c_t=1, trace.primary_subgroups=4, trace.secondary_subgroups=4",
            "city | Wide4 | collapse.c_t=2.5, trace.primary_subgroups=4, trace.secondary_subgroups=4",
        ]
    );
    let last = config.points().unwrap().pop().unwrap();
    assert_eq!((last.params.collapse.traversal_cost, last.params.trace.secondary_subgroups), (2.5, 4));
    assert_eq!(last.axes.get("trace.primary_subgroups"), Some(&4u32.into()));
}

#[test]
fn an_axis_is_left_out_where_its_condition_does_not_hold() {
    let text = r#"
        scenes = ["city", "sponza"]
        variants = ["Binary", "Wide4 CBTC"]
        [[axis]]
        parameter = "cbtc.subsampling"
        values = [1, 4]
        when = { "cbtc.threshold" = [8, 16], scene = "c*" }
        [[axis]]
        parameter = "cbtc.threshold"
        values = [4, 8]
        when = { variant = "*CBTC" }
    "#;
    let error = load(text, &[]).unwrap_err().to_string();
    assert!(error.contains("never 16; its values are 4, 8"), "{error}");
    let config = load(&text.replace("[8, 16]", "8"), &[]).unwrap();
    assert_eq!(
        keys(&config),
        [
            "city | Binary",
            "city | Wide4 CBTC | cbtc.threshold=4",
            "city | Wide4 CBTC | cbtc.subsampling=1, cbtc.threshold=8",
            "city | Wide4 CBTC | cbtc.subsampling=4, cbtc.threshold=8",
            "sponza | Binary",
            "sponza | Wide4 CBTC | cbtc.threshold=4",
            "sponza | Wide4 CBTC | cbtc.threshold=8",
        ]
    );
    let points = config.points().unwrap();
    assert_eq!((points[1].params.cbtc.threshold, points[1].params.cbtc.subsampling), (4, 64));
}

#[test]
fn later_sets_win_and_axes_win_over_sets() {
    let text = r#"
        scenes = ["city"]
        variants = ["Binary", "Wide4"]
        [[set]]
        parameters = { "collapse.c_t" = 3, "ploc.radius" = 16, "trace.stack" = 50 }
        [[set]]
        when = { variant = ["Wide4*", "Wide6"], scene = "city" }
        parameters = { "ploc.radius" = 32 }
        [[set]]
        when = { "trace.stack" = 80 }
        parameters = { "collapse.max_leaf" = 4 }
        [[axis]]
        parameter = "trace.stack"
        values = [70, 80]
    "#;
    let params = |overrides| {
        let points = load(text, overrides).unwrap().points().unwrap();
        let shown = |p: &crate::params::Params| {
            (p.collapse.traversal_cost, p.ploc.radius, p.trace.stack, p.collapse.max_leaf)
        };
        points.iter().map(|point| shown(&point.params)).collect::<Vec<_>>()
    };
    assert_eq!(params(&[]), [(3.0, 16, 70, 16), (3.0, 16, 80, 4), (3.0, 32, 70, 16), (3.0, 32, 80, 4)]);
    assert_eq!(params(&["ploc.radius=5", "ploc.radius=6"])[3], (3.0, 6, 80, 4));
}

#[test]
fn an_include_says_what_the_file_does_not() {
    let files = folder(&[
        (
            "a.toml",
            "include = [\"in/b.toml\", \"c.toml\"]\nscenes = [\"city\"]\nsamples = { most = 9 }\n[[set]]\nparameters = { \"ploc.radius\" = 3 }",
        ),
        (
            "in/b.toml",
            "include = [\"d.toml\"]\nscenes = [\"forest\"]\nvariants = [\"Wide8\"]\ndepth = 3\nseed = 3\n[[set]]\nparameters = { \"ploc.radius\" = 1, \"morton.bits\" = 1 }\n[[axis]]\nparameter = \"collapse.c_t\"\nvalues = [1]",
        ),
        (
            "in/d.toml",
            "samples = 5\ndepth = 4\nbuilds = 4\n[[set]]\nparameters = { \"morton.bits\" = 4, \"trace.stack\" = 4 }",
        ),
        ("c.toml", "depth = 5\n[[set]]\nparameters = { \"ploc.radius\" = 2, \"contract.alpha\" = 0.25 }"),
        ("e.toml", "depth = 6\nsamples = 2\n[[set]]\nparameters = { \"contract.alpha\" = 0.75 }"),
    ]);
    let config = open(&files, &[]).unwrap();
    assert_eq!(config.scenes, ["city"]);
    assert_eq!((config.depth(), config.seed, config.builds), (5, 3, Some(4)));
    assert_eq!((config.samples.least, config.samples.most), (Some(5), Some(9)), "key by key");
    let point = config.points().unwrap().remove(0);
    assert_eq!(point.key(), "city | Wide8 | collapse.c_t=1");
    let params = &point.params;
    assert_eq!((params.ploc.radius, params.morton.bits, params.trace.stack), (3, 1, 4));
    assert_eq!(params.contract.alpha, 0.25);

    let path = files.path().join("a.toml");
    let last = [files.path().join("e.toml")];
    let config = Config::load(&path, &last, &[], &SearchPath::only([])).unwrap();
    assert_eq!((config.depth(), config.samples.least), (6, Some(2)), "as if it were listed last");
    assert_eq!(config.points().unwrap()[0].params.contract.alpha, 0.75);
}

#[test]
fn options_reach_settings_and_parameters() {
    let text = &format!("{SMALL}samples = {{ least = 5, most = 60 }}\nviews = \"0-3\"");
    let config = load(
        text,
        &[
            "samples.most=7",
            "size = 160x90",
            "order.seed=5",
            "views=1",
            "samples.time=5 s",
            "scenes=sphereflake",
            "variants=[\"Wide8\", \"Wide6\"]",
            "collapse.c_t=9",
            "contract.form=levels",
        ],
    )
    .unwrap();
    assert_eq!((config.samples.least, config.samples.most), (Some(5), Some(7)));
    assert_eq!(config.samples.time, Duration::from_secs(5));
    assert_eq!(config.size, Some(Size { width: 160, height: 90 }));
    assert_eq!((config.order.seed, config.views.as_deref()), (5, Some("1")));
    assert_eq!(
        keys(&config),
        ["sphereflake | Wide6", "sphereflake | Wide8"]
            .map(str::to_owned)
            .iter()
            .rev()
            .cloned()
            .collect::<Vec<_>>()
    );
    assert_eq!(config.points().unwrap()[0].params.collapse.traversal_cost, 9.0);
    let one = load(text, &["samples=1"]).unwrap().samples;
    assert_eq!((one.least, one.most), (Some(1), Some(1)));
}

#[test]
fn only_a_part_is_left() {
    let text = r#"
        scenes = ["city", "sponza"]
        variants = ["Binary", "Wide4", "Wide4 CBTC", "Wide6 CBTC"]
        views = "0-3"
        [[axis]]
        parameter = "cbtc.threshold"
        values = [4, 8, 16]
        when = { variant = "*CBTC" }
    "#;
    let restricted = |only: &[&str]| {
        let mut config = load(text, &[]).unwrap();
        config.restrict(&options(only)).map(|()| config)
    };
    assert_eq!(keys(&restricted(&[]).unwrap()).len(), 16);
    let config = restricted(&["scene=city", "variant=Wide4*", "variant=!*CBTC"]).unwrap();
    assert_eq!(keys(&config), ["city | Wide4"]);
    let config = restricted(&["scene=city", "variant=!*CBTC"]).unwrap();
    assert_eq!(keys(&config), ["city | Binary", "city | Wide4"]);
    let config = restricted(&["scene=city", "variant=Wide4*"]).unwrap();
    assert_eq!(
        keys(&config),
        [
            "city | Wide4",
            "city | Wide4 CBTC | cbtc.threshold=4",
            "city | Wide4 CBTC | cbtc.threshold=8",
            "city | Wide4 CBTC | cbtc.threshold=16",
        ]
    );
    let config = restricted(&["cbtc.threshold=4", "cbtc.threshold=16", "scene=sponza", "view=1", "view=3"]);
    let config = config.unwrap();
    assert_eq!((keys(&config).len(), config.views.as_deref()), (4, Some("1,3")));
    for (only, words) in [
        ("scene=forest", "--only scene=forest: the scenes are city, sponza"),
        ("variant=Wide8", "the variants are Binary, Wide4, Wide4 CBTC, Wide6 CBTC"),
        ("view=7", "the views are 0, 1, 2, 3"),
        ("cbtc.threshold=5", "its values are 4, 8, 16"),
        ("cbtc.threshold=many", "its values are 4, 8, 16"),
        ("cbtc.treshold=4", "did you mean cbtc.threshold?"),
        ("ploc.radius=8", "no axis of this config"),
        ("city", "write AXIS=VALUE"),
    ] {
        let error = format!("{:#}", restricted(&[only]).unwrap_err());
        assert!(error.starts_with("--only ") && error.contains(words), "{only}: {error}");
    }
    let error = restricted(&["variant=Binary", "cbtc.threshold=4"]).unwrap_err().to_string();
    assert!(error.contains("no point is left"), "{error}");
}

/// Lines that make a file wrong, where the message must point, and what it must say.
const MISTAKES: &[(&str, &str, &[&str])] = &[
    // What TOML does not allow.
    ("depth = ", "3:9", &["value"]),
    ("depth = 1\ndepth = 2", "4:1", &["duplicate key"]),
    // Keys.
    ("smaples = 1", "3:1", &["no key `smaples`", "did you mean samples?"]),
    ("samples = { mst = 1 }", "3:13", &["`samples` has no key `mst`", "most"]),
    ("[samples]\nhalfwidth = \"1%\"", "4:1", &["half-width?"]),
    ("order.reference_every = 3", "3:7", &["reference-every?"]),
    ("[[axis]]\nparameter = \"ploc.radius\"\nvalues = [1]\nwith = 1", "6:1", &["with"]),
    ("[[axis]]\nvalues = [1]", "3:1", &["needs the key `parameter`"]),
    ("[[set]]\nwhen = { variant = \"*\" }", "3:1", &["needs the key `parameters`"]),
    ("[[set]]\nparameters = { \"collapse.ct\" = 1 }", "4:16", &["collapse.ct", "collapse.c_t?"]),
    ("[[set]]\nparameters = { collapse.c_t = 1 }", "4:16", &["quotes", "\"collapse.c_t\" = "]),
    ("[[set]]\nwhen = { varient = \"*\" }\nparameters = {}", "4:10", &["variant?"]),
    ("[[axis]]\nparameter = \"collapse.ct\"\nvalues = [1]", "4:13", &["collapse.c_t?"]),
    // Names.
    ("scenes = [\"sphereflak\"]", "1:11", &["no scene is called", "sphereflake?"]),
    ("scenes = [\"zzz\"]", "1:11", &["no scene is called", "cornell, sphereflake"]),
    ("scenes = [\"city:size=3\"]", "1:11", &["triangles, seed and orbit"]),
    ("scenes = [\"a/b\"]", "1:11", &["a/b"]),
    ("variants = [\"Wide5\"]", "2:13", &["no variant is called", "Wide"]),
    ("variants = [\"Binary\", \"Wide4 Quantised\"]", "2:23", &["Wide4 Quantized?"]),
    ("[[set]]\nwhen = { variant = \"Wide5\" }\nparameters = {}", "4:20", &["no variant is called"]),
    ("[[set]]\nwhen = { scene = \"citty\" }\nparameters = {}", "4:18", &["no scene is called", "city?"]),
    // Kinds and units.
    ("samples = 0", "3:11", &["from 1", "not 0"]),
    ("samples = 5000000000", "3:11", &["not 5000000000"]),
    ("samples = \"many\"", "3:11", &["a whole number from 1 or a table", "not text"]),
    ("samples = { time = \"5 parsecs\" }", "3:20", &["no time", "ms, s, min or h"]),
    ("samples = { time = 60 }", "3:20", &["text such as \"60 s\""]),
    ("samples = { half-width = \"1 s\" }", "3:26", &["no share", "\"1%\""]),
    ("samples = { half-width = 1 }", "3:26", &["text such as \"1%\""]),
    ("samples = { least-clock = \"140%\" }", "3:27", &["100%"]),
    ("samples = { least = 5, most = 4 }", "3:11", &["`least` (5) is more than `most` (4)"]),
    ("depth = 65", "3:9", &["from 1 to 64", "not 65"]),
    ("method = \"replays\"", "3:10", &["no `method` \"replays\"", "replay"]),
    ("depth = 1.5", "3:9", &["a whole number from 1 to 64", "not a number"]),
    ("seed = -1", "3:8", &["from 0", "not -1"]),
    ("builds = 0", "3:10", &["from 1"]),
    ("size = \"large\"", "3:8", &["1920x1080"]),
    ("size = \"0x10\"", "3:8", &["between 1 and 32768"]),
    ("views = 0", "3:9", &["text such as \"0-3\""]),
    ("views = \"3-1\"", "3:9", &["backwards"]),
    ("scenes = []", "1:10", &["`scenes` is empty"]),
    ("scenes = \"city\"", "1:10", &["a list"]),
    ("scenes = [1]", "1:11", &["each of `scenes` is text"]),
    ("[order]\nreference-every = -1", "4:19", &["from 0"]),
    ("[[set]]\nparameters = { \"collapse.c_t\" = \"high\" }", "4:33", &["a number, not text"]),
    ("[[set]]\nparameters = { \"morton.bits\" = 22 }", "4:32", &["morton.bits is from 1 to 21, not 22"]),
    ("[[set]]\nparameters = { \"layout.align\" = 12 }", "4:33", &["4, 8 or 16"]),
    ("[[set]]\nparameters = { \"trace.kernels\" = \"twin\" }", "4:34", &["separate"]),
    // Axes.
    ("[[axis]]\nparameter = \"morton.bits\"\nvalues = [10, 22]", "5:15", &["from 1 to 21, not 22"]),
    ("[[axis]]\nparameter = \"morton.bits\"\nvalues = [\"ten\"]", "5:11", &["morton.bits"]),
    ("[[axis]]\nparameter = \"morton.bits\"\nvalues = []", "5:10", &["`values` is empty"]),
    ("[[axis]]\nparameter = \"morton.bits\"", "3:1", &["`values` or `range`"]),
    (
        "[[axis]]\nparameter = \"morton.bits\"\nvalues = [1]\nrange = { from = 1, to = 2, step = 1 }",
        "6:9",
        &["not both"],
    ),
    ("[[axis]]\nparameter = \"morton.bits\"\nrange = { from = 1, to = 2 }", "5:9", &["`step` or `factor`"]),
    ("[[axis]]\nparameter = \"morton.bits\"\nrange = { from = 1, step = 2 }", "5:9", &["needs the key `to`"]),
    (
        "[[axis]]\nparameter = \"morton.bits\"\nrange = { from = 1, to = 2, step = 0 }",
        "5:9",
        &["`step`", "not 0"],
    ),
    (
        "[[axis]]\nparameter = \"morton.bits\"\nrange = { from = 3, to = 2, step = 1 }",
        "5:9",
        &["more than `to`"],
    ),
    ("[[axis]]\nparameter = \"morton.bits\"\nrange = { from = 0, to = 2, factor = 2 }", "5:9", &["`from`"]),
    ("[[axis]]\nparameter = \"morton.bits\"\nrange = { from = 1, to = 2, factor = 1 }", "5:9", &["`factor`"]),
    (
        "[[axis]]\nparameter = \"morton.bits\"\nrange = { from = 1, to = 30, step = 5 }",
        "5:9",
        &["from 1 to 21"],
    ),
    (
        "[[axis]]\nparameter = \"ploc.radius\"\nvalues = [1]\n[[axis]]\nparameter = \"ploc.radius\"\nvalues = [2]",
        "7:13",
        &["ploc.radius is an axis already"],
    ),
    (
        "[[axis]]\nparameter = \"ploc.radius\"\nvalues = [1]\nzip = \"z\"\n\
         [[axis]]\nparameter = \"morton.bits\"\nvalues = [1, 2]\nzip = \"z\"",
        "10:7",
        &["differ in length", "ploc.radius has 1 values and morton.bits has 2"],
    ),
    (
        "[[axis]]\nparameter = \"ploc.radius\"\nvalues = [1]\nzip = \"group\"\n\
         [[axis]]\nparameter = \"morton.bits\"\nvalues = [1]\nzip = \"gruop\"",
        "6:7",
        &["no other axis", "gruop?"],
    ),
    (
        "[[axis]]\nparameter = \"ploc.radius\"\nvalues = [1]\nwhen = { \"morton.bits\" = 1 }",
        "6:8",
        &["morton.bits is no axis here"],
    ),
    (
        "[[axis]]\nparameter = \"ploc.radius\"\nvalues = [1]\nwhen = { \"ploc.radius\" = 1 }",
        "4:13",
        &["about itself"],
    ),
    (
        "[[set]]\nwhen = { \"morton.bits\" = 1 }\nparameters = { \"ploc.radius\" = 1 }",
        "4:8",
        &["morton.bits is no axis here"],
    ),
    // Includes.
    ("include = [\"gone.toml\"]", "3:12", &["cannot read", "gone.toml"]),
    ("include = [\"a.toml\"]", "3:12", &["includes itself"]),
];

#[test]
fn a_mistake_is_told_with_its_place_and_what_would_be_right() {
    let mut failures = Vec::new();
    for &(lines, place, words) in MISTAKES {
        // Scenes and variants of the wrong lines take the place of the right ones.
        let text: String = SMALL
            .lines()
            .map(|line| {
                let key = line.split_once(" =").unwrap().0;
                if lines.starts_with(key) { format!("{lines}\n") } else { format!("{line}\n") }
            })
            .collect();
        let text = if text == SMALL { text + lines } else { text };
        let error = format!("{:#}", load(&text, &[]).expect_err(lines));
        if !error.contains(&format!("a.toml:{place}: ")) {
            failures.push(format!("{lines}\nis not at {place}: {error}"));
        }
        for word in words.iter().filter(|&&word| !error.contains(word)) {
            failures.push(format!("{lines}\ndoes not say {word:?}: {error}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
}

#[test]
fn several_mistakes_are_told_at_once_in_order() {
    let error = load("depht = 1\nscenes = 1\nviws = \"0\"", &[]).unwrap_err().to_string();
    let places: Vec<_> = error.lines().map(|line| line.split("a.toml:").nth(1).unwrap()).collect();
    assert_eq!(places.len(), 3, "{error}");
    assert!(places[0].starts_with("1:1") && places[1].starts_with("2:10") && places[2].starts_with("3:1"));
}

#[test]
fn files_that_cannot_be_used_are_named() {
    let nowhere = Config::load(Path::new("no/such.toml"), &[], &[], &SearchPath::only([]));
    assert!(format!("{:#}", nowhere.unwrap_err()).contains("cannot read no/such.toml"));
    let error = load("scenes = [\"city\"]", &[]).unwrap_err().to_string();
    assert!(error.contains("a.toml") && error.contains("`variants`"), "{error}");

    let here = folder(&[
        ("a.toml", SMALL),
        ("b.toml", "include = [\"c.toml\"]"),
        ("c.toml", "\ninclude = [\"b.toml\"]"),
    ]);
    let with = |name: &str| {
        let includes = [here.path().join(name)];
        let loaded = Config::load(&here.path().join("a.toml"), &includes, &[], &SearchPath::only([]));
        loaded.unwrap_err().to_string()
    };
    assert!(with("gone.toml").starts_with("--include "), "{}", with("gone.toml"));
    let error = with("b.toml");
    assert!(error.contains("c.toml:2:12") && error.contains("b.toml includes itself"), "{error}");
}

#[test]
fn options_that_are_wrong_are_named() {
    let text =
        &format!("{SMALL}samples = {{ least = 5 }}\n[[axis]]\nparameter = \"ploc.radius\"\nvalues = [1, 2]");
    for (option, words) in [
        ("ploc.radius=3", "--only ploc.radius=3"),
        ("collapse.ct=3", "did you mean collapse.c_t?"),
        ("sample=3", "did you mean samples?"),
        ("samples.mots=3", "did you mean samples.most?"),
        ("samples=0", "from 1"),
        ("samples.most=3", "`least` (5) is more than `most` (3)"),
        ("samples.time=60", "no time"),
        ("size=big", "1920x1080"),
        ("scenes=zzz", "no scene is called \"zzz\""),
        ("morton.bits=22", "morton.bits is from 1 to 21, not 22"),
        ("collapse.c_t=high", "of the kind of"),
        ("depth=", "a whole number"),
        ("depth=1\nseed=1", "a whole number"),
        ("depth", "write NAME=VALUE"),
        ("axis=1", "there is no axis"),
    ] {
        let error = format!("{:#}", load(text, &[option]).expect_err(option));
        assert!(
            error.starts_with(&format!("--set {option}: ")) && error.contains(words),
            "{option}: {error}"
        );
    }
}

#[test]
fn configs_that_mean_the_same_are_the_same_experiment() {
    let one = load(
        r#"
        # One way to say it.
        scenes = ["city", "sponza"]
        variants = ["Wide4*", "!* Slang *"]
        views = "0-2"
        samples = 15
        [[set]]
        parameters = { "collapse.c_i" = 2, "cbtc.threshold" = 16 }
        [[axis]]
        parameter = "ploc.radius"
        range = { from = 8, to = 32, factor = 2 }
        [[axis]]
        parameter = "collapse.c_t"
        values = [1, 2]
        "#,
        &["depth=8"],
    )
    .unwrap();
    let mut other = load(
        r#"
        title = "Another"
        scenes = ["sponza", "city", "cornell"]
        variants = ["Wide4 CBTC", "Wide4", "Wide4 Quantized", "Wide4 Quantized CBTC"]
        views = "0,1,2"
        size = "2x2"
        samples = { least = 15, most = 15, half-width = "1%" }
        [[set]]
        when = { variant = "Wide*" }
        parameters = { "cbtc.threshold" = 16 }
        [[axis]]
        parameter = "collapse.c_t"
        values = [2.0, 1.0, 2.0]
        [[axis]]
        parameter = "ploc.radius"
        values = [8, 16, 32, 64]
        "#,
        &["samples.time=1 min"],
    )
    .unwrap();
    let first = one.experiment().unwrap();
    assert_ne!(first, other.experiment().unwrap());
    let only = ["scene=city", "scene=sponza", "ploc.radius=8", "ploc.radius=16", "ploc.radius=32"];
    other.restrict(&options(&only)).unwrap();
    other.size = None;
    let second = other.experiment().unwrap();
    assert_eq!(second.changes_since(&first), None);
    assert_eq!(first, second);
    let text = serde_json::to_string(&first).unwrap();
    assert_eq!(serde_json::from_str::<Experiment>(&text).unwrap(), second, "a journal gives it back");
}

#[test]
fn changes_are_told_in_words() {
    let text = &format!("{SMALL}[[axis]]\nparameter = \"ploc.radius\"\nvalues = [4, 8]");
    let was = load(text, &[]).unwrap().experiment().unwrap();
    let changes = |text: &str, overrides: &[&str]| {
        load(text, overrides).unwrap().experiment().unwrap().changes_since(&was).unwrap_or_default()
    };
    assert_eq!(changes(text, &["title=Other"]), "");
    assert_eq!(
        changes(text, &["samples.most=9", "views=0"]),
        "samples.most was none, now 9\nviews was none, now 0"
    );
    assert_eq!(
        changes(&text.replace("[4, 8]", "[4, 16]").replace(", \"Wide4\"", ""), &["collapse.c_t=3"]),
        "city | Binary | ploc.radius=4: collapse.c_t was at its default, now 3.0\n\
         city | Binary | ploc.radius=8: is no point any more\n\
         city | Wide4 | ploc.radius=4: is no point any more\n\
         city | Wide4 | ploc.radius=8: is no point any more\n\
         city | Binary | ploc.radius=16: is a new point"
    );
    let many = changes(&text.replace("[4, 8]", "[1, 2, 3, 5, 6]"), &["collapse.c_t=3"]);
    assert!(many.ends_with("\nand 9 more") && many.lines().count() == 6, "{many}");
}

#[test]
fn sets_that_are_written_are_read_again() {
    let parameters = |pairs: &[(&str, record::Value)]| {
        Parameters(pairs.iter().map(|(name, value)| (name.to_string(), value.clone())).collect())
    };
    let mut sets: Vec<_> = Variant::ALL
        .iter()
        .map(|&variant| {
            Set::of(
                variant,
                parameters(&[
                    ("collapse.c_t", 3.0.into()),
                    ("trace.kernels", "single".into()),
                    ("trace.primary_subgroups", (variant.layout().map_or(4, Layout::arity) as u32).into()),
                    ("trace.postpone_below", 0.1.into()),
                ]),
            )
        })
        .collect();
    sets.push(Set { when: When::default(), parameters: parameters(&[("ploc.radius", 9u32.into())]) });
    sets.push(Set {
        when: When {
            scenes: vec!["city".into(), "b\"*".into()],
            variants: vec!["*CBTC".into()],
            axes: [("morton.bits".into(), vec![8u32.into(), 9u32.into()])].into(),
        },
        parameters: parameters(&[]),
    });
    let main = format!(
        "include = [\"tuned/b.toml\"]\n{SMALL}[[axis]]\nparameter = \"morton.bits\"\nvalues = [8, 9]"
    );
    let files = folder(&[("a.toml", &main), ("tuned/b.toml", &Set::to_toml(&sets))]);
    let config = open(&files, &[]).unwrap();
    assert_eq!(config.sets, sets);
    let params = config.points().unwrap().pop().unwrap().params;
    assert_eq!((params.trace.primary_subgroups, params.ploc.radius), (4, 9));
    assert_eq!(Set::to_toml(&[]), "");
}

#[test]
fn every_config_of_the_project_says_what_it_should() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let mut files = BTreeSet::new();
    for entry in fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let config = Config::load(&path, &[], &[], &SearchPath::only([])).unwrap();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let readme = fs::read_to_string(folder.join("README.md")).unwrap();
            let row = readme.lines().find(|line| line.starts_with(&format!("| [`{name}`]({name}) |")));
            let row = row.unwrap_or_else(|| panic!("README.md has no row for {name}"));
            let points = config.points().unwrap().len();
            // Where there are two languages, each has half of the variants.
            let in_slang = ["language.toml", "overall.toml", "traversal-cost.toml", "workgroup.toml"];
            let halved = in_slang.contains(&name.as_str()) && Language::Slang.missing().is_some();
            let points = points * if halved { 2 } else { 1 };
            assert!(row.ends_with(&format!(" {points} |")), "{name} has {points} points; README.md: {row}");
            assert!(!config.title.is_empty() && config.title != name.trim_end_matches(".toml"), "{name}");
            files.insert(name);
        }
    }
    let load = |name: &str| Config::load(&folder.join(name), &[], &[], &SearchPath::only([])).unwrap();
    let values =
        |config: &Config| config.axes.iter().map(|axis| value::list(&axis.values)).collect::<Vec<_>>();
    // The thesis's values.
    assert_eq!(values(&load("workgroup.toml")), ["2, 4, 8, 12, 16, 20, 24, 28, 32"; 2]);
    assert_eq!(values(&load("traversal-cost.toml")), ["1, 2, 3, 4, 5, 6"]);
    assert_eq!(values(&load("depth-limit.toml")), ["0, 1, 2, 3, 4, 5, 6, 7"]);
    assert_eq!(values(&load("single-kernel.toml")), ["separate, single"]);
    let point = |name: &str| load(name).points().unwrap().into_iter().rfind(|p| p.variant.by_view).unwrap();
    let full = |p: Setup| (p.params.cbtc.threshold, p.params.cbtc.depth_limit, p.params.cbtc.subsampling);
    assert_eq!(full(point("cbtc-threshold.toml")), (1024, 7, 1));
    assert_eq!(full(point("depth-limit.toml")), (8, 7, 1));
    assert_eq!(full(point("subsampling.toml")), (8, 7, 4096));
    assert_eq!(
        load("overall.toml").variants,
        Variant::select(&["all", "!*Compressed", "!Direct", "!Reduced", "!Driver"].map(String::from))
            .unwrap()
    );
    assert_eq!(load("quick.toml").variants.len(), 16);
    // So that these two can be tried without any file.
    let generated = |scene: &String| ["sphereflake", "city"].contains(&scene.as_str());
    assert!(load("quick.toml").scenes.iter().all(generated));
    assert!(load("workgroup.toml").scenes.contains(&"sphereflake".to_owned()));
    // One at a time, and the first point has all defaults.
    for (name, points) in [
        ("ylitie-table8.toml", 4 + 2 + 6),
        ("ylitie-table9.toml", 4 + 6 + 2),
        ("ylitie-table10.toml", 6 + 5 + 2 + 4),
    ] {
        let config = load(name);
        assert_eq!((config.method, config.depth()), (Method::Replay, 9), "{name}");
        let scene = |setup: &&Setup| setup.scene == "sphereflake";
        let all = config.points().unwrap();
        let own: Vec<&Setup> = all.iter().filter(scene).collect();
        assert_eq!(own.len(), points, "{name}");
        let defaults = crate::params::Params::of(own[0].variant).by_name();
        assert!(
            own[0].axes.0.iter().all(|(axis, value)| defaults.get(axis) == Some(value)),
            "{name}: {}",
            own[0]
        );
    }
    assert_eq!(files.len(), 20, "{files:?}");
    // Five turns of 40 views: the frames of the paper.
    let rtrs = load("rtrs.toml");
    assert!(rtrs.scenes.iter().all(|scene| scene.ends_with("orbit=40")));
    assert_eq!((rtrs.size, rtrs.depth()), (Some(Size { width: 384, height: 288 }), 5));
    let largest = |variant: &str| {
        let points = rtrs.points().unwrap().into_iter();
        points.filter(|p| p.variant.name() == variant).map(|p| p.params.collapse.max_leaf).collect::<Vec<_>>()
    };
    assert_eq!((largest("Direct"), largest("Reduced")), (vec![2; 3], vec![8; 3]));
}

#[test]
fn the_examples_of_the_manual_are_right() {
    let manual = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/README.md");
    let manual = fs::read_to_string(manual).unwrap();
    let examples: Vec<_> =
        manual.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    let mut points = Vec::new();
    for example in examples {
        let whole =
            if example.contains("scenes =") { example.to_owned() } else { format!("{SMALL}{example}") };
        let files = folder(&[("a.toml", &whole), ("tuned/some-device.toml", "")]);
        let config = open(&files, &[]).unwrap_or_else(|error| panic!("{example}\n{error:#}"));
        points.push(config.points().unwrap().len());
    }
    // As the text below the example counts them.
    assert_eq!(points, [2 * (2 * 3 * 4 + 3 * 3), 2 * (2 + 1 + 3)]);
}

#[test]
fn the_schema_names_the_keys_that_the_parser_takes() {
    // The parser lists its keys when it meets one that it does not know.
    let taken = |before: &str, after: &str| {
        let text = format!("{before}zzz = 1{after}");
        let error = toml::from_str::<Document>(&text).unwrap_err();
        let keys: BTreeSet<_> = error.message().split('`').skip(3).step_by(2).map(str::to_owned).collect();
        assert!(!keys.is_empty(), "{error}");
        keys
    };
    let named = |schema: &Value| -> BTreeSet<String> {
        assert_eq!(schema["additionalProperties"], false, "{schema}");
        schema["properties"].as_object().unwrap().keys().cloned().collect()
    };
    let schema = json_schema();
    let inner = |key: &str| &schema["properties"][key];
    assert_eq!(named(schema), taken("", ""));
    assert_eq!(named(inner("samples")), taken("samples = { ", " }"));
    assert_eq!(named(inner("order")), taken("order = { ", " }"));
    assert_eq!(named(&inner("set")["items"]), taken("[[set]]\n", ""));
    let axis = &inner("axis")["items"];
    assert_eq!(named(axis), taken("[[axis]]\n", ""));
    assert_eq!(named(&axis["properties"]["range"]), taken("[[axis]]\nrange = { ", " }"));

    let parameters: BTreeSet<_> = crate::params::Params::default().by_name().0.into_keys().collect();
    let listed: BTreeSet<_> = axis["properties"]["parameter"]["enum"]
        .as_array()
        .unwrap()
        .iter()
        .map(|name| name.as_str().unwrap().to_owned())
        .collect();
    assert_eq!(listed, parameters);
    assert_eq!(named(&inner("set")["items"]["properties"]["parameters"]), parameters);
    let conditions: BTreeSet<_> = parameters.into_iter().chain(["scene".into(), "variant".into()]).collect();
    assert_eq!(named(&axis["properties"]["when"]), conditions);
}

#[test]
fn the_schema_explains_every_key() {
    fn explained(name: &str, schema: &Value) {
        for (key, inner) in schema["properties"].as_object().into_iter().flatten() {
            // Parameters are explained where they are defined.
            if !key.contains('.') {
                assert!(inner["description"].is_string(), "{name}.{key}");
            }
            explained(&format!("{name}.{key}"), inner);
            explained(&format!("{name}.{key}[]"), &inner["items"]);
        }
    }
    explained("", json_schema());
    let text = json_schema().to_string();
    assert!(!text.contains("null") && !text.contains("$ref"), "{text}");
}
