//! The program as its users meet it: exit codes, messages, files.

use record::{Record, Source};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};
use tempfile::TempDir;
use tracer::{
    layout::LeafTriangles,
    scene::{self, SearchPath},
    traverse::{Hit, Ray, TriangleTest, cpu},
};

/// The program, to run in a folder, with no scenes but those that are built in.
fn runner(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_runner"));
    command.args(line.split_whitespace()).current_dir(folder);
    command.env_remove("BROADLEAF_SCENES").stdin(Stdio::null());
    // No window is opened by accident.
    command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    command
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// How many variants this build has: with or without those in Slang.
fn built() -> usize {
    let listed = works(folder().path(), "variants --json").stdout;
    let listed: serde_json::Value = serde_json::from_slice(&listed).unwrap();
    let with_tree = |variant: &&serde_json::Value| variant["name"] != "Blank" && variant["name"] != "Naive";
    listed.as_array().unwrap().iter().filter(with_tree).filter(|variant| variant["missing"].is_null()).count()
}

/// Runs it, requires success and returns what it printed.
fn works(folder: &Path, line: &str) -> Output {
    let output = runner(folder, line).output().unwrap();
    assert!(output.status.success(), "runner {line}: {:?}\n{}", output.status, text(&output.stderr));
    output
}

/// Runs it, requires failure with this code, and that the message holds all of `words`.
fn fails(folder: &Path, line: &str, code: i32, words: &[&str]) {
    let output = runner(folder, line).output().unwrap();
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "runner {line}\n{message}");
    for word in words {
        assert!(message.contains(word), "runner {line}: no {word:?} in\n{message}");
    }
    assert!(!message.contains("panicked"), "runner {line}\n{message}");
}

fn valid(path: &Path) -> Record {
    let record = Record::read(path).unwrap();
    assert_eq!(record.validate(), Ok(()), "{}", path.display());
    record
}

#[test]
fn devices_are_listed_for_people_and_for_scripts() {
    let here = folder();
    let json: serde_json::Value =
        serde_json::from_slice(&works(here.path(), "devices --json").stdout).unwrap();
    let devices = json.as_array().unwrap();
    assert!(!devices.is_empty());
    for field in [
        "index",
        "name",
        "kind",
        "uuid",
        "driver_name",
        "driver_info",
        "api_version",
        "subgroup_size",
        "shared_memory_bytes",
        "timestamp_period_ns",
        "max_workgroup_size",
        "memory_bytes",
        "optional",
        "missing",
    ] {
        assert!(devices.iter().all(|d| !d[field].is_null()), "{field} is missing in {json}");
    }
    let table = text(&works(here.path(), "devices").stdout);
    assert!(devices.iter().all(|d| table.contains(d["uuid"].as_str().unwrap())), "{table}");
}

#[test]
fn a_run_writes_a_valid_record_and_a_table() {
    let here = folder();
    let line = "run cornell sphereflake:triangles=1000,seed=3 --samples 2 --size 64x36 --views 0,2-3 \
                --builds 1 --depth 3 --seed 7 --set collapse.max_leaf=4 --validate -o new/x.json";
    let output = works(here.path(), line);
    let (table, remarks) = (text(&output.stdout), text(&output.stderr));
    assert!(table.contains("cornell") && table.contains("Binary"), "{table}");
    assert!(!remarks.contains("validation:"), "{remarks}");
    let record = valid(&here.path().join("new/x.json"));
    assert!(record.finished.is_some());
    assert_eq!((record.run.width, record.run.height, record.run.samples), (64, 36, 2));
    assert_eq!((record.run.depth, record.run.seed, record.run.warm_up), (3, 7, 1));
    assert_eq!(record.shaders.len(), tracer::gpu::shaders::ALL.len());
    assert!(record.parameters.get("collapse.max_leaf").is_some());
    assert_eq!(record.host.name, None, "a name is only told on request");
    assert_eq!(record.results.len(), 2);
    for point in &record.results {
        assert_eq!(point.build.repetitions.len(), 1);
        assert!(point.build.repetitions[0].phases.len() == 6);
        assert!(point.tree.average_triangles_per_leaf.unwrap() <= 4.0);
        assert_eq!(point.views.len(), 3);
        for view in &point.views {
            assert_eq!(view.samples.len(), 2);
            let counters = view.counters.as_ref().unwrap();
            assert_eq!(counters.depths[0].rays, 64 * 36);
            for (depth, count) in counters.depths.iter().enumerate() {
                assert_eq!(count.boxes, 2 * count.nodes, "depth {depth}");
                assert!(count.nodes >= count.rays, "depth {depth}");
                // Counting traces the first sample's rays once more.
                assert_eq!(count.rays, view.samples[0].depths[depth].rays, "depth {depth}");
            }
            assert!(view.samples.iter().all(|s| s.depths.iter().all(|d| d.milliseconds > 0.0)));
        }
    }
    // The room is closed: every path goes on to the last depth.
    assert!(record.results[0].views.iter().all(|v| v.samples.iter().all(|s| s.depths.len() == 3)));
    match &record.results[1].scene.source {
        Source::Generator { name, parameters, .. } => {
            assert_eq!(name, "sphereflake");
            assert!(parameters.get("seed").is_some());
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn resources_are_shown_and_recorded_as_far_as_the_driver_tells_them() {
    let here = folder();
    let set = "--set trace.primary_subgroups=2 --set trace.secondary_subgroups=4";
    let line = format!("resources --json {set}");
    let json: serde_json::Value = serde_json::from_slice(&works(here.path(), &line).stdout).unwrap();
    let kernels = json["kernels"].as_array().unwrap();
    let table = text(&works(here.path(), &format!("resources {set}")).stdout);
    works(here.path(), &format!("run cornell --samples 1 --size 16x8 --views 0 --builds 1 {set} -o x.json"));
    let recorded = &valid(&here.path().join("x.json")).results[0].kernels;
    assert_eq!(recorded.len(), 2);
    for (rays, subgroups) in [("primary", 2), ("secondary", 4)] {
        let kernel = kernels.iter().find(|k| k["rays"] == rays && k["variant"] == "Binary").unwrap();
        let subgroup = kernel["subgroup_size"].as_u64().unwrap();
        assert_eq!(kernel["workgroup_size"], subgroups * subgroup, "{rays}");
        let row = table.lines().find(|line| line.starts_with("Binary") && line.contains(rays));
        assert!(row.unwrap().contains(&format!(" {subgroup} × {subgroups} ")), "{table}");
        let recorded = recorded.iter().find(|k| k.purpose == rays).unwrap();
        assert_eq!(u64::from(recorded.workgroup_size), subgroups * subgroup);
        assert_eq!(u64::from(recorded.subgroup_size), subgroup);
        assert_eq!(recorded.registers.map(u64::from), kernel["registers"].as_u64());
        // A driver that tells something tells it in words of its own too.
        let told = !kernel["statistics"].as_array().unwrap().is_empty();
        assert!(told || kernel["registers"].is_null(), "{kernel}");
        assert_eq!(table.contains("VK_KHR_pipeline_executable_properties"), !told, "{table}");
    }
    assert!(table.lines().all(|line| line.chars().count() <= 120), "{table}");
}

#[test]
fn quiet_is_quiet_and_the_schema_is_json() {
    let here = folder();
    let output =
        works(here.path(), "run cornell:triangles=100 --samples 1 --size 8x8 --views 0 --builds 1 -q");
    assert_eq!(text(&output.stderr), "");
    assert!(!output.stdout.is_empty());
    assert_eq!(fs::read_dir(here.path()).unwrap().count(), 0, "nothing is written unasked");
    let schema: serde_json::Value = serde_json::from_slice(&works(here.path(), "schema").stdout).unwrap();
    assert_eq!(schema, record::json_schema());
    let schema: serde_json::Value =
        serde_json::from_slice(&works(here.path(), "config schema").stdout).unwrap();
    let parameters = &schema["properties"]["axis"]["items"]["properties"]["parameter"]["enum"];
    assert!(parameters.as_array().unwrap().contains(&"collapse.c_t".into()), "{parameters}");
    let scenes = text(&works(here.path(), "scenes").stdout);
    assert!(
        scenes.contains("cornell") && scenes.contains("sponza") && scenes.contains("missing"),
        "{scenes}"
    );
}

#[test]
fn mistakes_on_the_command_line_are_explained() {
    let here = folder();
    let at = here.path();
    fails(at, "run nowhere", 1, &["no scene called 'nowhere'", "cornell"]);
    fails(at, "run sponza", 1, &["sponza.glb", "--scene-dir", "BROADLEAF_SCENES"]);
    fails(at, "run city:colour=3", 1, &["colour", "triangles"]);
    fails(at, "run gone/model.glb", 1, &["gone/model.glb"]);
    fails(at, "run cornell --variant Wide99", 1, &["Wide99", "Binary"]);
    fails(at, "run cornell --views 12", 1, &["\"12\"", "7 tall block"]);
    fails(at, "render cornell --view backside -o x.png", 1, &["backside", "0 front"]);
    fails(at, "run cornell --set ploc.radus=3", 1, &["ploc.radus", "ploc.radius="]);
    fails(at, "run cornell --set ploc.radius=wide", 1, &["ploc.radius"]);
    fails(at, "run cornell --device 99", 1, &["99", "there are: 0: "]);
    fails(at, "run cornell --device Voodoo", 1, &["Voodoo", "there are: 0: "]);
    fails(at, "run cornell --size 64", 2, &["\"64\"", "1920x1080"]);
    fails(at, "run cornell --size 0x64", 2, &["between 1 and 32768"]);
    fails(at, "run cornell --samples 0", 2, &["--samples"]);
    fails(at, "run", 2, &["SCENE"]);
    fails(at, "render cornell", 2, &["--output"]);
    fails(at, "trace gone.rays --scene cornell", 1, &["gone.rays"]);
    fails(at, "trace . --scene cornell", 1, &["cannot read"]);
    assert_eq!(fs::read_dir(at).unwrap().count(), 0, "mistakes leave no files");
}

#[test]
fn what_the_device_can_do_at_best_is_measured_and_written() {
    let here = folder();
    let at = here.path();
    let started = Instant::now();
    let output = works(at, "roofline --quick -o new/roof.json --validate");
    assert!(started.elapsed() < Duration::from_secs(60), "{:?}", started.elapsed());
    let table = text(&output.stdout);
    for words in ["GB/s", "Random node reads, billions a second", "80 B", "together", "byte to float"] {
        assert!(table.contains(words), "{words} in\n{table}");
    }
    assert!(table.lines().all(|line| line.chars().count() <= 120), "{table}");
    let roofline = record::Roofline::read(at.join("new/roof.json")).unwrap();
    assert!(roofline.copy_bytes_per_second > 0.0 && roofline.rates.len() == 7);
    assert!(roofline.node_reads.iter().any(|reads| reads.node_bytes == 80 && reads.together));
    let json = works(at, "roofline --quick --json -q").stdout;
    let json: record::Roofline = serde_json::from_slice(&json).unwrap();
    assert_eq!(json.device, roofline.device);
    fails(at, "roofline --device Voodoo", 1, &["Voodoo"]);
}

/// Whether the driver of the device that tests run on traces rays.
fn driver_is_there() -> bool {
    let listed: serde_json::Value =
        serde_json::from_slice(&works(folder().path(), "variants --json").stdout).unwrap();
    listed.as_array().unwrap().iter().find(|v| v["name"] == "Driver").unwrap()["missing"].is_null()
}

#[test]
fn the_drivers_own_ray_tracing_is_measured_or_said_to_be_unavailable() {
    let here = folder();
    let at = here.path();
    let line = "run cornell:triangles=100 --samples 1 --size 16x9 --views 0 --builds 2 -o x.json";
    let listed = text(&works(at, "variants").stdout);
    let row = listed.lines().find(|line| line.starts_with("Driver ")).unwrap();
    if driver_is_there() {
        assert!(!row.contains("unavailable"), "{row}");
        let table = text(&works(at, &format!("{line} --variant Driver --variant Binary --validate")).stdout);
        let record = valid(&at.join("x.json"));
        assert!(record.left_out.is_empty());
        let [driver, binary] = &record.results[..] else { panic!() };
        assert_eq!(driver.variant, "Driver");
        // What the driver does not tell is absent.
        assert!(driver.kernels.is_empty() && driver.views[0].counters.is_none());
        let tree = &driver.tree;
        assert_eq!((tree.nodes, tree.sah_cost, tree.node_bytes), (None, None, None));
        assert!(tree.bytes.unwrap() > 0 && binary.tree.bytes.is_none());
        let phases: Vec<_> =
            driver.build.repetitions[1].phases.iter().map(|phase| phase.name.as_str()).collect();
        assert_eq!(phases, ["bottom", "compact", "top"]);
        // The same primary rays; a bounce from an edge may go another way.
        let rays = |point: &record::Point| point.views[0].samples[0].depths.iter().map(|d| d.rays).collect();
        let (theirs, ours): (Vec<u64>, Vec<u64>) = (rays(driver), rays(binary));
        assert_eq!((theirs[0], theirs.len()), (ours[0], ours.len()));
        assert!(theirs.iter().zip(&ours).all(|(a, b)| a.abs_diff(*b) <= 2), "{theirs:?} {ours:?}");
        let row = table.lines().find(|line| line.contains("Driver")).unwrap();
        assert!(row.matches('–').count() >= 4, "{row}");
        let replayed = format!("{line} --variant Driver --set driver.build=fast-build --method replay");
        works(at, &format!("{replayed} --set driver.compact=false --set driver.row=8"));
        let record = valid(&at.join("x.json"));
        assert_eq!(record.results[0].build.repetitions[0].phases.len(), 2);
        let checked = text(&works(at, "validate cornell:triangles=100 --variant Driver --views 0").stdout);
        assert!(checked.contains("brute force") && checked.contains("everything holds"), "{checked}");
        fails(at, "render cornell --view 0 --variant Driver --heatmap nodes -o x.png", 1, &["does not tell"]);
        let single = format!("{line} --variant Driver --set trace.kernels=single");
        fails(at, &single, 1, &["trace.kernels=separate"]);
        return;
    }
    assert!(row.contains("unavailable") && listed.contains("VK_KHR_ray_tracing_pipeline"), "{listed}");
    fails(at, "resources --variant Driver", 1, &["does not tell"]);
    let words = ["Driver is unavailable", "VK_KHR_ray_tracing_pipeline", "runner devices"];
    fails(at, &format!("{line} --variant Driver"), 3, &words);
    for other in ["validate", "render --view 0 -o x.png", "rays -o x.rays"] {
        let (command, rest) = other.split_once(' ').unwrap_or((other, ""));
        fails(at, &format!("{command} cornell:triangles=100 {rest} --variant Driver"), 3, &words);
    }
    assert_eq!(fs::read_dir(at).unwrap().count(), 0, "nothing was measured");
    // What else was asked for is measured all the same.
    fails(at, &format!("{line} --variant Driver --variant Binary -q"), 3, &words);
    let record = valid(&at.join("x.json"));
    assert!(record.finished.is_some() && record.results.len() == 1);
    assert_eq!(record.left_out.len(), 1);
    assert!(record.left_out[0].variant == "Driver" && record.left_out[0].reason.contains(words[0]));
    // Among many it is left out with a remark.
    let remarks = text(&works(at, &format!("{line} --variant *r* --variant !*CBTC")).stderr);
    assert!(remarks.contains("left out: Driver is unavailable"), "{remarks}");
    assert!(valid(&at.join("x.json")).left_out.is_empty());
}

#[test]
fn parameters_out_of_range_are_refused_in_words() {
    let here = folder();
    for (name, value) in [
        ("trace.primary_subgroups", "0"),
        ("trace.secondary_subgroups", "1000"),
        ("trace.stack", "4000000000"),
        ("morton.bits", "0"),
        ("morton.bits", "22"),
        ("ploc.radius", "0"),
        ("ploc.radius", "100000"),
        ("collapse.max_leaf", "0"),
        ("collapse.max_leaf", "17"),
        ("collapse.c_t", "-1"),
        ("collapse.c_i", "1e300"),
    ] {
        let line = format!("run cornell:triangles=100 --samples 1 --size 8x8 --set {name}={value}");
        let words: &[&str] = if value == "1000" { &["workgroup"] } else { &[name, "not"] };
        fails(here.path(), &line, 1, words);
    }
}

#[test]
fn damaged_models_are_refused_or_mended_in_words() {
    let here = folder();
    let at = here.path();
    let small = "--samples 1 --size 8x8 --views 0 --builds 1";
    let write = |name: &str, bytes: &[u8]| fs::write(at.join(name), bytes).unwrap();
    let mut glb = b"glTF\x02\0\0\0\x00\x10\0\0".to_vec();
    glb.extend(b"\x20\0\0\0JSON{\"asset\":{\"version\":");
    write("cut.glb", &glb);
    fails(at, &format!("run ./cut.glb {small}"), 1, &["cut.glb", "cut short"]);
    write("empty.glb", b"");
    fails(at, &format!("run ./empty.glb {small}"), 1, &["empty.glb"]);
    write("empty.obj", b"");
    fails(at, &format!("run ./empty.obj {small}"), 1, &["empty.obj", "no triangles"]);
    write("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 inf\nf 1 2 3\n");
    fails(at, &format!("run ./nan.obj {small}"), 1, &["nan.obj", "no triangles"]);
    write("part.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 nan\nf 1 2 3\nf 1 2 4\nf 1 1 1\n");
    let output = works(at, &format!("run ./part.obj {small} -o part.json"));
    assert!(text(&output.stderr).contains("skipped 1 triangles with NaN"), "{}", text(&output.stderr));
    let record = valid(&at.join("part.json"));
    assert_eq!(record.results[0].scene.triangles, 2);
    assert_eq!(record.results[0].scene.skipped.get("non_finite"), Some(&1));
    // One triangle is a scene, too.
    write("one.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    works(at, "render ./one.obj --samples 1 --size 16x9 -q -o one.png");
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_a_valid_record_of_what_was_measured() {
    let here = folder();
    let path = here.path().join("x.json");
    let line = "run cornell:triangles=500 --samples 30 --size 64x36 --builds 1 -q -o x.json";
    for wait_for_a_view in [false, true] {
        let mut child =
            runner(here.path(), line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let started = Instant::now();
        let ready = || match Record::read(&path) {
            Ok(record) => !wait_for_a_view || record.results.iter().any(|p| !p.views.is_empty()),
            Err(_) => false,
        };
        while !ready() {
            assert!(started.elapsed() < Duration::from_secs(60), "no record appears");
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
            std::thread::sleep(Duration::from_millis(20));
        }
        let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let status = child.wait().unwrap();
        assert_eq!(status.code(), Some(130), "{status:?}");
        // Before the first view is done, the record says who, where and how, but holds no numbers yet.
        let record = if wait_for_a_view { valid(&path) } else { Record::read(&path).unwrap() };
        assert!(record.finished.is_none(), "an interrupted run has no end");
        let views: Vec<_> = record.results.iter().flat_map(|p| &p.views).collect();
        assert!(views.iter().all(|v| v.samples.len() == 30), "no view is there in part");
        assert!(views.len() < 8 && (!wait_for_a_view || !views.is_empty()));
        fs::remove_file(&path).unwrap();
    }
    assert_eq!(fs::read_dir(here.path()).unwrap().count(), 0, "no temporary file is left");
}

#[test]
fn without_a_driver_the_message_says_what_to_install() {
    let here = folder();
    for line in ["devices", "run cornell", "render cornell -o x.png"] {
        let output = runner(here.path(), line)
            .env("VK_DRIVER_FILES", "/nonexistent")
            .env("VK_ICD_FILENAMES", "/nonexistent")
            .output()
            .unwrap();
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{line}: {message}");
        assert!(message.contains("no Vulkan device") && message.contains("mesa-vulkan-drivers"), "{message}");
    }
}

#[test]
fn the_same_seed_renders_the_same_bytes() {
    let here = folder();
    let at = here.path();
    let render = |name: &str, more: &str| {
        works(at, &format!("render cornell --samples 2 --size 64x36 {more} -o {name}"));
        fs::read(at.join(name)).unwrap()
    };
    let first = render("a.png", "--seed 5 -q");
    assert!(first.starts_with(b"\x89PNG"));
    assert!(first == render("b.png", "--seed 5 -q"), "the same seed");
    assert!(first != render("c.png", "--seed 6 -q"), "another seed");
    assert!(first != render("d.png", "--seed 5 --exposure -1 -q"), "another exposure");
    for cost in ["nodes", "boxes", "triangles"] {
        let output = works(at, &format!("render cornell --size 64x36 --heatmap {cost} -o {cost}.png"));
        let line = text(&output.stdout).to_lowercase();
        assert!(line.starts_with(cost) && line.contains("median"), "{line}");
        assert!(fs::read(at.join(format!("{cost}.png"))).unwrap().starts_with(b"\x89PNG"));
    }
    // A picture that cannot be written is an error that names it.
    fails(at, "render cornell --samples 1 --size 8x8 -o a.png/b.png", 1, &["a.png/b.png"]);
}

fn items<const N: usize>(path: &Path, magic: &[u8; 4]) -> Vec<[u32; N]> {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[..4], magic);
    let word = |b: &[u8]| u32::from_le_bytes(b.try_into().unwrap());
    assert_eq!(word(&bytes[4..8]), 1);
    let count = u64::from_le_bytes(bytes[8..16].try_into().unwrap()) as usize;
    assert_eq!(bytes.len(), 16 + 4 * N * count);
    bytes[16..].chunks_exact(4 * N).map(|c| std::array::from_fn(|i| word(&c[4 * i..4 * i + 4]))).collect()
}

fn rays(path: &Path) -> Vec<Ray> {
    let float = f32::from_bits;
    let ray = |w: [u32; 8]| Ray {
        origin: [float(w[0]), float(w[1]), float(w[2])],
        t_min: float(w[3]),
        direction: [float(w[4]), float(w[5]), float(w[6])],
        t_max: float(w[7]),
    };
    items(path, b"RAYS").into_iter().map(ray).collect()
}

fn hits(path: &Path) -> Vec<Hit> {
    items(path, b"HITS").into_iter().map(|[t, triangle]| Hit { t: f32::from_bits(t), triangle }).collect()
}

/// Whether distances agree; a hit never agrees with a miss.
fn near(a: f32, b: f32, relative: f32) -> bool {
    let off = (a - b).abs();
    a == b || off.is_finite() && off <= relative * a.abs()
}

/// Writes one wavefront's rays and hits, traces the rays again, and holds every `step`th hit against brute
/// force. Returns the number of rays.
fn rays_and_hits(at: &Path, spec: &str, more: &str, scene: &scene::Scene, depth: u32, step: usize) -> usize {
    works(
        at,
        &format!("rays {spec} {more} --view 0 --depth {depth} --size 128x72 -o a/r.rays --hits a/r.hits"),
    );
    let output = works(
        at,
        &format!("trace a/r.rays --scene {spec} {more} --variant Binary --launches 2 --hits a/r2.hits"),
    );
    assert!(text(&output.stdout).contains("fastest") && text(&output.stdout).contains("median"));
    let (rays, first) = (rays(&at.join("a/r.rays")), hits(&at.join("a/r.hits")));
    let again = hits(&at.join("a/r2.hits"));
    assert_eq!((first.len(), again.len()), (rays.len(), rays.len()));
    // Where rays meet an edge, the two sides may be told apart differently; distances may not.
    for ((ray, a), b) in rays.iter().zip(&first).zip(&again) {
        assert!(a == b || near(a.t, b.t, 1e-6), "{spec}: {ray:?}: {a:?}, then {b:?}");
    }
    let triangles = LeafTriangles::in_file_order(TriangleTest::default(), &scene.positions);
    for (ray, hit) in rays.iter().zip(&first).step_by(step) {
        let mut want = cpu::brute_force(&triangles, ray);
        if want.triangle != Hit::MISS {
            want.t = cpu::refine(ray, &scene.positions[want.triangle as usize], want.t);
        }
        assert!(near(hit.t, want.t, 1e-5), "{spec}: {ray:?}: {hit:?}, brute force {want:?}");
    }
    rays.len()
}

#[test]
fn rays_traced_from_a_file_hit_what_brute_force_hits() {
    let here = folder();
    let at = here.path();
    let spec = "cornell:triangles=2000";
    let room = scene::load(spec, &SearchPath::only([])).unwrap();
    for depth in [0, 2] {
        assert_eq!(rays_and_hits(at, spec, "", &room, depth, 2), 128 * 72, "the room is closed");
    }
    let spec = "hairball:triangles=3000";
    let open = scene::load(spec, &SearchPath::only([])).unwrap();
    let second = rays_and_hits(at, spec, "", &open, 1, 1);
    assert!((1..128 * 72).contains(&second), "{second}");
    // Deeper than any path goes there may be no rays, and a file without rays is a file.
    works(at, &format!("rays {spec} --depth 63 --size 16x9 -o none.rays --hits none.hits"));
    works(at, &format!("trace none.rays --scene {spec} --launches 1 --primary --hits none2.hits"));
    assert_eq!(hits(&at.join("none.hits")).len(), hits(&at.join("none2.hits")).len());
    fs::copy(at.join("none.hits"), at.join("wrong.rays")).unwrap();
    fails(at, &format!("trace wrong.rays --scene {spec}"), 1, &["wrong.rays", "not a RAYS file"]);
}

#[test]
fn a_real_scene_is_traced_as_by_brute_force() {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes");
    let folders = std::env::var_os("BROADLEAF_SCENES").map(|v| std::env::split_paths(&v).collect::<Vec<_>>());
    let mut folders: Vec<PathBuf> = folders.unwrap_or_default();
    folders.push(beside);
    let Some(at) = folders.iter().find(|f| f.join("sponza.glb").is_file()) else {
        println!("SKIPPED: sponza.glb is not there; set BROADLEAF_SCENES");
        return;
    };
    let here = folder();
    let scene = scene::load("sponza", &SearchPath::only([at.clone()])).unwrap();
    let more = format!("--scene-dir {}", fs::canonicalize(at).unwrap().display());
    assert!(rays_and_hits(here.path(), "sponza", &more, &scene, 1, 20) > 4000);
}

#[test]
fn every_variant_is_measured_and_compared() {
    let here = folder();
    let line = "run sphereflake:triangles=2000 --variant all --samples 1 --size 48x27 --views 0-1 --builds 1 \
                --depth 3 --set cbtc.threshold=1 --set cbtc.depth-limit=2 --set cbtc.subsampling=10 --validate \
                -o x.json";
    let output = works(here.path(), line);
    let table = text(&output.stdout);
    let record = valid(&here.path().join("x.json"));
    assert_eq!(record.results.len(), built());
    assert!(table.contains("secondary rays: "), "{table}");
    for point in &record.results {
        assert!(table.contains(&point.variant), "{table}");
        let by_view = point.variant.contains("CBTC");
        for view in &point.views {
            assert_eq!(view.adaptation.is_some(), by_view, "{}", point.variant);
            if let Some(adaptation) = &view.adaptation {
                let phases: Vec<&str> =
                    adaptation.build.repetitions[0].phases.iter().map(|p| p.name.as_str()).collect();
                assert_eq!(phases, ["contract", "layout"]);
                assert!(adaptation.sampling_milliseconds[0] > 0.0);
            }
        }
        let children = point.of_trees(|t| t.average_children).unwrap();
        let binary = ["Binary", "Binary Slang", "Direct", "Reduced"].contains(&point.variant.as_str());
        assert_eq!(binary, children == 2.0, "{}: {children}", point.variant);
        // What a variant has of its own is in its point.
        let compressed = point.variant == "Wide8 Compressed";
        let wide = point.variant.starts_with("Wide8") || point.variant.starts_with("Wide6");
        assert_eq!(point.parameters.get("collapse.c_t").is_some(), wide && !compressed, "{}", point.variant);
        assert_eq!(point.parameters.get("contract.by-area").is_some(), compressed, "{}", point.variant);
    }
    let nodes = |name: &str| {
        let point = record.results.iter().find(|p| p.variant == name).unwrap();
        point.counters().unwrap().all().per_ray().unwrap().nodes
    };
    assert!(nodes("Wide4") < 0.7 * nodes("Binary") && nodes("Wide8") < nodes("Wide4"));
}

/// The binary tree that rays and views' samples go through has no packets.
#[test]
fn packets_are_checked_of_the_variants_that_have_them() {
    let here = folder();
    let line = "validate cornell --variant Wide4* --variant !*Quantized* --variant !*Slang* --set trace.primary_packets=2 --size 16x9 --views 0";
    let found = text(&works(here.path(), line).stdout);
    assert!(found.contains("Wide4 CBTC: hits") && found.trim_end().ends_with("everything holds"), "{found}");
    let none = "validate cornell --variant Binary --set trace.primary_packets=2 --size 16x9 --views 0";
    fails(here.path(), none, 1, &["trace.primary_packets=0"]);
}

#[test]
fn a_tree_with_spatial_splits_is_measured_validated_and_kept() {
    let here = folder();
    let set = "--set build.method=sbvh";
    let line = format!(
        "run city:triangles=3000 --variant Wide4 --variant *Compressed --variant Wide4*CBTC --samples 1 --size 48x27 \
         --views 0 --builds 2 --depth 3 {set} -o x.json"
    );
    let kept = "a tree of";
    // Where drivers keep their kernels, too.
    let cache = folder();
    let kept_there = |line: &str| {
        let output = runner(here.path(), line).env("XDG_CACHE_HOME", cache.path()).output().unwrap();
        assert!(output.status.success(), "runner {line}: {}", text(&output.stderr));
        output
    };
    let (first, again) = (kept_there(&line), kept_there(&line));
    let told = [text(&first.stderr), text(&again.stderr)].map(|told| {
        let line = told.lines().find(|line| line.contains(kept)).unwrap_or_default().to_owned();
        assert_eq!(told.matches(kept).count(), 1, "built once for all variants: {told}");
        line
    });
    assert!(told[0].contains("built in") && told[1].contains("kept from before"), "{told:?}");
    let record = valid(&here.path().join("x.json"));
    for point in &record.results {
        let phases: Vec<&str> = point.build.repetitions[0].phases.iter().map(|p| p.name.as_str()).collect();
        assert!(phases.starts_with(&["sbvh"]) && !phases.contains(&"ploc"), "{phases:?}");
    }
    let line = format!(
        "validate city:triangles=3000 --variant Wide4*CBTC --variant *Compressed --size 48x27 --views 0 {set}"
    );
    let found = text(&works(here.path(), &line).stdout);
    assert!(
        found.contains("leaves cover the triangles") && found.trim_end().ends_with("everything holds"),
        "{found}"
    );
    fails(here.path(), "run cornell --variant *Compressed --set contract.p_max=4", 1, &["contract.p_max=3"]);
}

/// Those of RTRS, with trees and without, on an orbit and by its own build.
#[test]
fn memory_lean_nodes_are_measured_beside_no_tree() {
    let here = folder();
    let four = "--variant Blank --variant Naive --variant Direct --variant Reduced";
    let line = format!(
        "run cornell:triangles=300,orbit=3 {four} --samples 2 --size 24x14 --builds 1 --depth 3 \
         --set build.method=midpoint --set collapse.max_leaf=8 --validate -o x.json"
    );
    works(here.path(), &line);
    let record = valid(&here.path().join("x.json"));
    let names: Vec<_> = record.results.iter().map(|point| point.variant.as_str()).collect();
    assert_eq!(names, ["Blank", "Naive", "Direct", "Reduced"]);
    let bytes: Vec<_> = record.results.iter().map(|point| point.tree.node_bytes.unwrap()).collect();
    // Of the same tree: 2w + 1 nodes of 40 bytes, 3w + 2 items of 16.
    let wide = (bytes[2] / 40 - 1) / 2;
    assert_eq!((bytes[0], bytes[1], bytes[3]), (0, 0, 16 * (3 * wide + 2)));
    for point in &record.results {
        let phases: Vec<&str> = point.build.repetitions[0].phases.iter().map(|p| p.name.as_str()).collect();
        let tree = ["Direct", "Reduced"].contains(&point.variant.as_str());
        assert_eq!(phases.contains(&"midpoint"), tree, "{}: {phases:?}", point.variant);
        assert_eq!(
            point.views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(),
            ["orbit_0", "orbit_1", "orbit_2"]
        );
        // From some places on the circle the room is seen from outside, and paths leave.
        let depths = if point.variant == "Blank" { 1..=1 } else { 2..=3 };
        for sample in point.views.iter().flat_map(|view| &view.samples) {
            assert!(depths.contains(&sample.depths.len()), "{}: {:?}", point.variant, sample.depths);
            let traced: f64 = sample.depths.iter().map(|launch| launch.milliseconds).sum();
            assert!(sample.frame_milliseconds.unwrap() > traced, "{}: shading takes time", point.variant);
        }
    }
    let tested = record.results[1].counters().unwrap().all();
    assert_eq!(tested.triangles, tested.rays * record.results[1].scene.triangles);

    let line = format!(
        "run cornell:triangles=300 {four} --samples 2 --size 24x14 --views 0 --method replay -o y.json"
    );
    works(here.path(), &line);
    let replayed = valid(&here.path().join("y.json"));
    let rays = |at: usize| -> Vec<u64> {
        replayed.results[at].views[0].samples[0].depths.iter().map(|launch| launch.rays).collect()
    };
    assert!(
        rays(0).len() > 3 && (1..4).all(|at| rays(at) == rays(0)),
        "the same rays for all: {:?}",
        rays(0)
    );

    let line =
        format!("validate cornell:triangles=300 {four} --size 24x14 --set build.method=midpoint --validate");
    let found = text(&works(here.path(), &line).stdout);
    assert!(
        found.contains("none hits anything") && found.trim_end().ends_with("everything holds"),
        "{found}"
    );
    fails(here.path(), "run city:triangles=70000 --variant Naive", 1, &["65536", "Direct"]);
    fails(
        here.path(),
        "run cornell --variant Reduced --set collapse.max_leaf=9",
        1,
        &["collapse.max_leaf=8"],
    );
}

#[test]
fn local_shading_is_rendered_and_measured() {
    let here = folder();
    works(here.path(), "render cornell:triangles=300 --size 24x14 --samples 2 -o path.png");
    works(
        here.path(),
        "render cornell:triangles=300 --size 24x14 --samples 2 --integrator phong -o phong.png",
    );
    let [path, phong] = ["path.png", "phong.png"].map(|name| fs::read(here.path().join(name)).unwrap());
    assert_ne!(path, phong);
    let line = "run cornell:triangles=300 --integrator phong --samples 1 --size 24x14 --views 0 --builds 1 -o x.json";
    works(here.path(), line);
    let record = valid(&here.path().join("x.json"));
    assert_eq!(record.parameters.get("shade.integrator").unwrap().to_string(), "phong");
    // Nothing there mirrors.
    assert_eq!(record.results[0].views[0].samples[0].depths.len(), 1);
    fails(here.path(), "run cornell --integrator phonk", 2, &["path, phong"]);
    fails(here.path(), "run cornell --set shade.specular=2", 1, &["shade.specular is from 0 to 1"]);
}

#[test]
fn a_user_validates_a_scene() {
    let here = folder();
    let found = text(&works(here.path(), "validate cornell:triangles=300 --size 24x14 --validate").stdout);
    for what in ["binary tree", "collapse", "contraction", "layout", "hits", "brute force"] {
        assert_eq!(found.matches(&format!(": {what}: ")).count(), built(), "{what}: {found}");
    }
    assert!(found.trim_end().ends_with("everything holds") && !found.contains("FAILED"), "{found}");
    for test in ["moeller-trumbore", "woop"] {
        let line = format!(
            "validate cornell:triangles=300 --size 24x14 --variant Binary --variant Wide6* --validate \
             --set triangle.test={test}"
        );
        let found = text(&works(here.path(), &line).stdout);
        assert!(found.trim_end().ends_with("everything holds") && !found.contains("FAILED"), "{found}");
    }
}

#[test]
fn variants_are_listed_with_their_nodes() {
    let here = folder();
    let table = text(&works(here.path(), "variants").stdout);
    for (name, bytes) in [
        ("Binary", 56),
        ("Wide4", 120),
        ("Wide6 Quantized CBTC", 64),
        ("Wide8 Quantized", 76),
        ("Wide8 Compressed", 80),
        ("Direct", 40),
        ("Reduced", 16),
    ] {
        let row = table.lines().find(|l| l.starts_with(&format!("{name}  "))).unwrap();
        assert!(row.contains(&format!(" {bytes} ")) && row.contains("GLSL"), "{row}");
    }
    let json: serde_json::Value =
        serde_json::from_slice(&works(here.path(), "variants --json").stdout).unwrap();
    let all = json.as_array().unwrap();
    assert_eq!(all.len(), 32);
    let slang = all.iter().filter(|variant| variant["language"] == "Slang");
    assert_eq!(slang.clone().count(), 13);
    // Where the build has no Slang compiler, all of them are unavailable, and nothing else that is ours.
    let glsl = |variant: &serde_json::Value| variant["language"] == "GLSL" && variant["missing"].is_null();
    assert_eq!(all.iter().filter(|variant| glsl(variant)).count(), 18);
    let without_slang = slang.clone().all(|variant| variant["missing"].is_string());
    for variant in slang {
        let name = variant["name"].as_str().unwrap();
        let row = table.lines().find(|line| line.starts_with(&format!("{name}  "))).unwrap();
        assert_eq!(row.contains("unavailable"), variant["missing"].is_string(), "{row}");
        assert_eq!(variant["missing"].is_string(), without_slang, "{name}");
    }
    if without_slang {
        assert!(table.contains("unavailable: no slangc"), "{table}");
        fails(here.path(), "resources --variant *Slang*", 1, &["without Binary Slang: no slangc"]);
    }
}

#[test]
fn a_path_in_one_kernel_is_measured_as_well() {
    let here = folder();
    let line = "run cornell:triangles=300 --samples 1 --size 24x14 --views 0 --builds 1 --depth 3 \
                --variant Binary --variant Wide6*Quantized --variant !*Slang* --set trace.kernels=single -o x.json";
    works(here.path(), line);
    let record = valid(&here.path().join("x.json"));
    for point in &record.results {
        let purposes: Vec<&str> = point.kernels.iter().map(|k| k.purpose.as_str()).collect();
        assert_eq!(purposes, ["all"]);
        assert_eq!(point.views[0].samples[0].depths[0].rays, 24 * 14);
    }
}

/// Launch after launch of the same rays: those that the other method counts.
#[test]
fn a_replay_launches_the_rays_of_each_bounce_ten_times() {
    let here = folder();
    let line = "run sphereflake:triangles=1000,seed=3 --views 0-1 --size 64x36 --builds 1 --seed 7 \
                --variant Wide4 --validate";
    let output = works(here.path(), &format!("{line} --method replay -o replay.json"));
    assert!(!text(&output.stderr).contains("validation:"), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("Bounce by bounce"), "{}", text(&output.stdout));
    works(here.path(), &format!("{line} --depth 9 --samples 1 -o paths.json"));
    let [replay, paths] = ["replay.json", "paths.json"].map(|name| valid(&here.path().join(name)));
    assert_eq!((replay.run.method, paths.run.method), (record::Method::Replay, record::Method::Paths));
    assert_eq!((replay.run.depth, replay.run.samples), (9, 10));
    for (view, other) in replay.results[0].views.iter().zip(&paths.results[0].views) {
        assert_eq!(view.samples.len(), 10);
        let rays =
            |sample: &record::Sample| sample.depths.iter().map(|launch| launch.rays).collect::<Vec<_>>();
        let counted = |view: &record::View| {
            view.counters.as_ref().unwrap().depths.iter().map(|count| count.rays).collect::<Vec<_>>()
        };
        assert!(view.samples.iter().all(|sample| rays(sample) == rays(&other.samples[0])));
        assert_eq!(rays(&view.samples[0]), counted(view));
        assert_eq!(counted(view), counted(other));
        assert!(view.samples.iter().all(|s| s.depths.iter().all(|d| d.milliseconds > 0.0)));
    }
    let single = format!("{line} --method replay --set trace.kernels=single");
    fails(here.path(), &single, 1, &["replay", "trace.kernels"]);
}

/// A model of two triangles, one of them far up.
const LEAVES: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 9 0\nv 1 9 0\nv 0 9 1\nf 1 2 3\nf 4 5 6\n";

#[test]
fn a_precomputed_tree_takes_the_place_of_building_one() {
    let here = folder();
    let path = |name: &str| here.path().join(name);
    let scene = "sphereflake:triangles=2000";
    for (build, method, phase) in [
        ("", "ploc", "ploc"),
        ("--build hploc", "hploc", "hploc"),
        ("--build sbvh --set sbvh.alpha=1e-4", "sbvh", "sbvh"),
    ] {
        let mut precompute = runner(here.path(), &format!("bvh precompute {scene} {build} -o new/s.bvh"));
        let output = precompute.env("XDG_CACHE_HOME", path("cache")).output().unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
        let said = text(&output.stdout);
        assert!(said.contains(&format!("built by {method}")), "{said}");
        let line = format!("run {scene} --views 0 --samples 1 --size 32x18 --builds 2");
        works(
            here.path(),
            &format!("{line} --bvh new/s.bvh --variant Wide4 --variant Wide4*d*CBTC -o p.json"),
        );
        let record = valid(&path("p.json"));
        for point in &record.results {
            let adopted = point.adopted.as_ref().unwrap();
            assert_eq!((&*adopted.name, &*adopted.method), ("s.bvh", method));
            assert!(said.contains(&adopted.sha256) && adopted.built_seconds > 0.0, "{adopted:?}");
            let parameters = record.parameters_of(point);
            assert_eq!(parameters.get("build.method").unwrap().to_string(), method);
            assert_eq!(parameters.get("bvh.sha256").unwrap().to_string(), adopted.sha256);
            for (name, value) in &adopted.parameters.0 {
                assert!(name.starts_with(phase) || name.starts_with("morton"), "{name}");
                assert_eq!(parameters.get(name), Some(value), "{name}");
            }
            for build in &point.build.repetitions {
                let phases: Vec<&str> = build.phases.iter().map(|phase| &*phase.name).collect();
                assert!(phases.contains(&"adopt") && phases.contains(&"layout"), "{phases:?}");
                assert!(
                    !phases.iter().any(|phase| ["ploc", "hploc", "sort", "sbvh"].contains(phase)),
                    "{phases:?}"
                );
                assert!(
                    build.milliseconds >= build.phases.iter().map(|phase| phase.milliseconds).sum::<f64>()
                );
            }
        }
        assert!(record.results.iter().any(|point| point.variant == "Wide4 Quantized CBTC"));
        // The tree is the one that is built otherwise, and its rays hit the same.
        let set = match method {
            "sbvh" => "--set build.method=sbvh --set sbvh.alpha=1e-4",
            "hploc" => "--set build.method=hploc",
            _ => "",
        };
        let mut built = runner(here.path(), &format!("{line} {set} --variant Wide4 -o q.json"));
        assert!(built.env("XDG_CACHE_HOME", path("cache")).output().unwrap().status.success());
        let built = valid(&path("q.json"));
        assert_eq!(built.results[0].adopted, None);
        assert_eq!(built.results[0].tree, record.results[0].tree);
        // What rays meet varies a little from run to run, as lanes wait for each other; how many go on does not.
        let met = |record: &Record| {
            let counters = record.results[0].views[0].counters.clone().unwrap();
            counters.depths.iter().map(|depth| depth.rays).collect::<Vec<_>>()
        };
        assert_eq!(met(&built), met(&record));
    }

    let sound = fs::read(path("new/s.bvh")).unwrap();
    let damage = |bytes: &[u8]| fs::write(path("d.bvh"), bytes).unwrap();
    let line = format!("run {scene} --bvh d.bvh");
    let way_out = "runner bvh precompute sphereflake:triangles=2000 -o d.bvh";
    for at in [12, 40, 70, sound.len() / 2, sound.len() - 1] {
        let mut bytes = sound.clone();
        bytes[at] ^= 0x10;
        damage(&bytes);
        fails(here.path(), &line, 1, &["d.bvh is damaged", "checksum", way_out]);
    }
    damage(&sound[..sound.len() - 7]);
    fails(here.path(), &line, 1, &["d.bvh is damaged", way_out]);
    damage(b"an essay on trees");
    fails(here.path(), &line, 1, &["is no file of a binary tree", way_out]);
    let mut newer = sound.clone();
    newer[8] = 9;
    damage(&newer);
    fails(here.path(), &line, 1, &["of version 9", way_out]);
    fails(
        here.path(),
        "run cornell --bvh new/s.bvh",
        1,
        &["triangles of sphereflake", "bvh precompute cornell"],
    );
    fails(
        here.path(),
        &format!("run {scene} --bvh none.bvh"),
        1,
        &["cannot read none.bvh", "bvh precompute"],
    );
    fails(here.path(), &format!("run {scene} cornell --bvh new/s.bvh"), 1, &["one by one"]);
    fails(here.path(), &format!("run {scene} --bvh new/s.bvh --set ploc.radius=4"), 1, &["built already"]);
    for variant in ["Naive", "all"] {
        fails(
            here.path(),
            &format!("run {scene} --bvh new/s.bvh --variant {variant}"),
            1,
            &["not made from"],
        );
    }
}

#[test]
fn a_constructed_scene_is_one_for_every_command() {
    let here = folder();
    let path = |name: &str| here.path().join(name);
    fs::create_dir(path("models")).unwrap();
    fs::write(path("models/leaves.obj"), LEAVES).unwrap();
    let line = "scene construct --model models/leaves.obj 1 --scale 2 2 2 --rotate 0 0 90 --translate 0 0 -1 \
                --model models/leaves.obj 0 --material 0.4 0.4 0.3 0.6 0.3 0.1 50 \
                --material 0.3 0.1 0.1 0.9 0.1 0 10 --light 20 20 20 1.5 --light 0 50 25 1.8 \
                --camera-pos 8 4 8 0 1 0 --camera-orbit --out out/tea.toml";
    let said = text(&works(here.path(), line).stdout);
    assert!(said.contains("4 triangles; models: 2, materials: 2, lights: 2, views: 8"), "{said}");
    let written = fs::read_to_string(path("out/tea.toml")).unwrap();
    assert!(written.contains("\"../models/leaves.obj\"") && written.contains("0.4, 0.4, 0.3"), "{written}");

    let load = |path: PathBuf| scene::load(path.to_str().unwrap(), &SearchPath::only([]));
    let scene = load(path("out/tea.toml")).unwrap();
    let first = scene.positions[0].map(|corner| corner.map(|x| (x * 1e4).round() / 1e4));
    assert_eq!(first, [[0.0, 0.0, -1.0], [0.0, 2.0, -1.0], [-2.0, 0.0, -1.0]]);
    assert_eq!(scene.positions[2], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(scene.material_ids, [1, 1, 0, 0]);
    assert_eq!(scene.materials.len(), 2);
    assert_eq!(scene.materials[1].albedo, [0.3, 0.1, 0.1]);
    assert_eq!(scene.materials[0].phong.unwrap().shininess, 50.0);
    assert_eq!(
        (scene.lights.len(), scene.lights[1].position, scene.lights[1].strength),
        (2, [0.0, 50.0, 25.0], 1.8)
    );
    assert_eq!(
        (scene.views.len(), scene.views[0].eye, scene.views[0].target),
        (8, [8.0, 4.0, 8.0], [0.0, 1.0, 0.0])
    );
    assert_eq!(scene.name, "tea");

    works(here.path(), "run out/tea.toml --views 0 --samples 1 --size 16x9 --builds 1 -o r.json");
    match &valid(&path("r.json")).results[0].scene.source {
        Source::File { name, sha256 } => {
            assert_eq!((&**name, &**sha256), ("tea.toml", &*scene::sha256(written.as_bytes())));
        }
        other => panic!("{other:?}"),
    }
    works(here.path(), "render out/tea.toml --view orbit_3 --samples 1 --size 16x9 -o tea.png");
    works(here.path(), "validate out/tea.toml --variant Wide4 --views 0 --size 16x9");
    works(here.path(), &line.replace("--camera-orbit --out out/tea.toml", "--camera-fixed --name tea"));
    assert_eq!(load(path("scenes/tea.toml")).unwrap().views.len(), 1);
    works(here.path(), "run tea --samples 1 --size 16x9 --builds 1");

    // A model that has changed since, and one that has gone.
    fs::write(path("models/leaves.obj"), LEAVES.replace("9", "8")).unwrap();
    fails(here.path(), "run out/tea.toml", 1, &["leaves.obj has changed", "write the hash"]);
    fs::remove_file(path("models/leaves.obj")).unwrap();
    fails(here.path(), "run out/tea.toml", 1, &["needs the file ../models/leaves.obj"]);
}

#[test]
fn a_scene_that_cannot_be_constructed_is_explained_and_not_written() {
    let here = folder();
    fs::write(here.path().join("leaves.obj"), LEAVES).unwrap();
    let line = |model: &str, rest: &str| {
        format!("scene construct --model {model} --camera-pos 8 4 8 0 1 0 --out t.toml {rest}")
    };
    for (model, rest, code, words) in [
        ("leaves.obj 1", "", 1, ["material is 1", "only 0"]),
        ("leaves.obj 2", "--material 0.4 0.4 0.3 0.6 0.3 0.1 50", 1, ["material is 2", "which is 0"]),
        ("leaves.obj 0", "--material 0.4 1.4 0.3 0.6 0.3 0.1 50", 1, ["material 0", "from 0 to 1"]),
        ("leaves.obj 0", "--material 0.4 0.4 0.3 0.6 inf 0.1 50", 2, ["--material", "finite"]),
        ("leaves.obj 0", "--light 1 2 NaN 4", 2, ["--light", "finite"]),
        ("leaves.obj 0", "--light 1 2 3 -4", 1, ["light 0", "not negative"]),
        ("leaves.obj 0", "--scale 1 0 1", 1, ["model 0", "flat"]),
        ("leaves.obj 0", "--camera-orbit 0", 2, ["--camera-orbit", "1..=360"]),
        ("leaves.obj 0", "--camera-pos 0 1 0 0 1 0", 1, ["camera", "must differ"]),
        ("none.obj 0", "", 1, ["none.obj", "cannot read"]),
        ("leaves.png 0", "", 1, ["leaves.png", "does not read"]),
    ] {
        fails(here.path(), &line(model, rest), code, &words);
        assert!(!here.path().join("t.toml").exists(), "{model} {rest}");
    }
    fails(here.path(), &line("leaves.obj 0", "--out t.txt"), 1, &["NAME.toml"]);
}

#[test]
fn a_scene_of_rtrs_is_run() {
    let here = folder();
    let json = serde_json::json!({
        "camera": { "pos": [0.3, 0.3, 4.0], "at": [0.3, 0.3, 0.0] },
        "camera_controller": "Fixed",
        "prims": [{ "indices": [0, 1, 2], "material": 0 }],
        "vertices": [
            { "pos": [0, 0, 0], "normal": [0, 0, 1] },
            { "pos": [1, 0, 0], "normal": [0, 0, 1] },
            { "pos": [0, 1, 0], "normal": [0, 0, 1] },
        ],
        "lights": [{ "pos": [20, 20, 20], "strength": 1.5 }],
        "materials": [{ "color": [0.4, 0.4, 0.3], "albedo": [0.6, 0.3, 0.1], "spec": 50 }],
    });
    fs::write(here.path().join("tri.json"), json.to_string()).unwrap();
    works(here.path(), "run tri.json --samples 1 --size 16x9 --builds 1 -o r.json");
    let record = valid(&here.path().join("r.json"));
    assert_eq!((record.results[0].scene.triangles, record.results[0].views.len()), (1, 1));
    fs::write(here.path().join("no.json"), "{}").unwrap();
    fails(here.path(), "run no.json", 1, &["no.json", "no scene of RTRS", "camera"]);
}

/// With one, `scripts/test-view` looks through it.
#[cfg(target_os = "linux")]
#[test]
fn a_window_needs_a_display() {
    let folder = folder();
    let way_out = ["DISPLAY is not set", "xvfb-run", "runner render cornell", "runner run cornell"];
    fails(folder.path(), "view cornell", 1, &way_out);
    fails(folder.path(), "view cornell --benchmark 2 -o r.json", 1, &way_out);
    assert!(!folder.path().join("r.json").exists());
    // Mistakes are told in any case.
    fails(folder.path(), "view cornell --variant Wide5", 1, &["Wide5"]);
    fails(folder.path(), "view cornell --benchmark soon", 2, &["soon", "200f"]);
    fails(folder.path(), "view cornell -o r.json", 2, &["--benchmark"]);
    let help = text(&works(folder.path(), "view --help").stdout);
    for key in ["Page Up", "heat map", "save the picture", "Esc"] {
        assert!(help.contains(key), "{help}");
    }
}
