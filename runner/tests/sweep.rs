//! Sweeps as their users meet them: stopped, killed, resumed, split and joined.

use record::{Exclusion, Method, Record, Sample, Stop};
use serde_json::Value;
use std::{
    collections::BTreeSet,
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};
use tempfile::TempDir;

fn runner(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_runner"));
    command.args(line.split_whitespace()).current_dir(folder);
    command.env_remove("BROADLEAF_SCENES").stdin(Stdio::null());
    command
}

fn run(folder: &Path, line: &str) -> (Output, String, String) {
    let output = runner(folder, line).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert!(!err.contains("panicked"), "runner {line}\n{err}");
    (output, out, err)
}

/// Runs it, requires success and returns what it printed and remarked.
#[track_caller]
fn works(folder: &Path, line: &str) -> (String, String) {
    let (output, out, err) = run(folder, line);
    assert!(output.status.success(), "runner {line}: {:?}\n{err}", output.status);
    (out, err)
}

/// Runs it, requires failure, and that the message holds all of `words`.
#[track_caller]
fn fails(folder: &Path, line: &str, words: &[&str]) {
    let (output, _, err) = run(folder, line);
    assert_eq!(output.status.code(), Some(1), "runner {line}\n{err}");
    for word in words {
        assert!(err.contains(word), "runner {line}: no {word:?} in\n{err}");
    }
}

#[track_caller]
fn valid(path: &Path) -> Record {
    let record = Record::read(path).unwrap();
    assert_eq!(record.validate(), Ok(()), "{}", path.display());
    record
}

/// A folder with a config of `points` quick points.
fn small(points: u32, more: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "title = \"Small\"\nscenes = [\"cornell:triangles=100\"]\nvariants = [\"Binary\"]\nviews = \"0\"\n\
         size = \"16x8\"\ndepth = 2\nsamples = 1\nbuilds = 1\norder = {{ seed = 7, reference-every = 0 }}\n{more}\n\
         [[axis]]\nparameter = \"collapse.c_t\"\nrange = {{ from = 1, to = {points}, step = 1 }}\n"
    );
    fs::write(folder.path().join("x.toml"), text).unwrap();
    folder
}

/// The points of a record, by what tells them apart.
fn points(record: &Record) -> Vec<String> {
    let key = |point: &record::Point| {
        let cost = record.parameters_of(point).get("collapse.c_t").unwrap().to_string();
        format!("{} {} {cost}", point.scene.name, point.variant)
    };
    record.results.iter().map(key).collect()
}

/// Keys of whole lines of the journal.
fn journaled(folder: &Path) -> Vec<String> {
    let text = fs::read(folder.join("journal.jsonl")).unwrap_or_default();
    let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
    let lines = text[..whole].split(|&byte| byte == b'\n').skip(1).filter(|line| !line.is_empty());
    lines
        .map(|line| serde_json::from_slice::<Value>(line).unwrap()["key"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn a_plan_names_every_point_and_measures_none() {
    let here = small(4, "");
    let (table, _) = works(here.path(), "sweep x.toml --plan");
    assert!(table.contains("collapse.c_t") && table.contains("Small: 4 points to measure, about"), "{table}");
    let (json, _) = works(here.path(), "sweep x.toml --plan --json -o out");
    let events: Vec<Value> = json.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let planned: Vec<&Value> = events.iter().filter(|event| event["event"] == "planned").collect();
    assert_eq!(planned.len(), 4);
    assert_eq!(planned[2]["axes"]["collapse.c_t"], 3.0);
    assert!(events.last().unwrap()["least_seconds"].as_f64().unwrap() > 0.0);
    assert!(!here.path().join("out").exists());
    fails(here.path(), "sweep x.toml", &["-o DIR", "--plan"]);
}

#[test]
fn a_sweep_writes_a_valid_record_and_has_nothing_left_to_do() {
    let here = small(4, "");
    let at = here.path();
    let (_, err) = works(at, "sweep x.toml -o out --validate");
    assert!(err.lines().any(|line| line.starts_with("4/4 ")), "a plain line a point\n{err}");
    assert!(!err.contains("validation:"), "{err}");
    let record = valid(&at.join("out/record.json"));
    assert!(record.finished.is_some());
    let sweep = record.sweep.as_ref().unwrap();
    assert_eq!((sweep.title.as_str(), sweep.order_seed, sweep.points), ("Small", 7, 4));
    assert_eq!(sweep.axes, ["collapse.c_t"]);
    // In the order of the config, measured in another.
    assert_eq!(points(&record), ["1.0", "2.0", "3.0", "4.0"].map(|cost| format!("cornell Binary {cost}")));
    let order: Vec<u64> = record.results.iter().map(|p| p.measurement.as_ref().unwrap().position).collect();
    assert_eq!(order.iter().copied().collect::<BTreeSet<_>>(), (0..4).collect());
    assert_ne!(order, [0, 1, 2, 3]);
    assert!(record.results.iter().all(|p| p.measurement.as_ref().unwrap().stopped == Stop::Samples));

    let before = fs::read(at.join("out/record.json")).unwrap();
    let (table, err) = works(at, "sweep x.toml -o out");
    assert!(err.contains("4 of 4 points are there already, nothing is left"), "{err}");
    assert!(table.contains("collapse.c_t"), "{table}");
    assert_eq!(fs::read(at.join("out/record.json")).unwrap(), before, "the record is the journal, merged");

    // The same seed gives the same order, another one another.
    works(at, "sweep x.toml -o again -q");
    assert_eq!(journaled(&at.join("again")), journaled(&at.join("out")));
    works(at, "sweep x.toml -o other --set order.seed=8 -q");
    assert_ne!(journaled(&at.join("other")), journaled(&at.join("out")));
}

/// Also of trees that go by view, which are made anew in every round, and goes on where it was stopped.
#[test]
fn launches_of_the_same_rays_are_swept_like_paths() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = "scenes = [\"sphereflake:triangles=1000,seed=3\"]\nvariants = [\"Binary\", \"Wide4 CBTC\"]\nviews = \"0-1\"\n\
                size = \"32x18\"\nmethod = \"replay\"\nbuilds = 1\norder = { reference-every = 0 }\n\
                samples = { least = 2, most = 4, half-width = \"0.001%\" }\n";
    fs::write(at.join("x.toml"), text).unwrap();
    works(at, "sweep x.toml -o out --validate");
    let record = valid(&at.join("out/record.json"));
    assert_eq!((record.run.method, record.run.depth), (Method::Replay, 9));
    assert_eq!(record.sweep.as_ref().unwrap().config["settings"]["method"], "replay");
    for view in record.results.iter().flat_map(|point| &point.views) {
        assert_eq!(view.samples.len(), 4, "rounds add to what is there");
        let rays = |sample: &Sample| sample.depths.iter().map(|launch| launch.rays).collect::<Vec<_>>();
        assert!(view.samples.iter().all(|sample| rays(sample) == rays(&view.samples[0])));
    }
    let journal = at.join("out/journal.jsonl");
    let whole = fs::read(&journal).unwrap();
    fs::write(&journal, &whole[..whole.len() - 50]).unwrap();
    let (_, err) = works(at, "sweep x.toml -o out");
    assert!(err.contains("1 of 2 points are there already"), "{err}");
    assert_eq!(valid(&at.join("out/record.json")).results.len(), 2);
}

#[test]
fn what_has_changed_is_not_resumed() {
    let here = small(2, "");
    let at = here.path();
    works(at, "sweep x.toml -o out -q");
    let journal = at.join("out/journal.jsonl");
    let text = fs::read_to_string(&journal).unwrap();
    fails(at, "sweep x.toml --set depth=3 -o out", &["another sweep", "depth", "Take another -o"]);
    fails(at, "sweep x.toml --set method=replay -o out", &["another sweep", "method was paths, now replay"]);
    fails(at, "sweep x.toml --only collapse.c_t=2 -o out", &["another sweep"]);
    fails(at, "sweep x.toml --shard 1/2 -o out", &["the share of the sweep was all of it, now 1/2"]);
    assert_eq!(fs::read_to_string(&journal).unwrap(), text, "a refusal changes nothing");

    let (head, rest) = text.split_once('\n').unwrap();
    let header: Value = serde_json::from_str(head).unwrap();
    for (place, word) in [
        ("/record/device/driver/version", "the driver was"),
        ("/record/device/uuid", "the device was"),
        ("/record/shaders/sort~1scan", "shaders have changed: sort/scan"),
    ] {
        let mut other = header.clone();
        let value = other.pointer_mut(place).unwrap_or_else(|| panic!("nothing at {place}"));
        *value = Value::String("0".repeat(64));
        fs::write(&journal, format!("{other}\n{rest}")).unwrap();
        fails(at, "sweep x.toml -o out", &["another sweep", word]);
    }
}

#[test]
fn a_torn_line_is_dropped_and_said_so() {
    let here = small(3, "");
    let at = here.path();
    works(at, "sweep x.toml -o out -q");
    let journal = at.join("out/journal.jsonl");
    let whole = fs::read(&journal).unwrap();
    fs::write(&journal, &whole[..whole.len() - 50]).unwrap();
    let (_, err) = works(at, "sweep x.toml -o out");
    assert!(err.contains("the journal's last line was torn"), "{err}");
    assert!(
        err.contains("2 of 3 points are there already, 1 are left") || err.contains("1 is left"),
        "{err}"
    );
    assert_eq!(valid(&at.join("out/record.json")).results.len(), 3);
}

/// Kill -9 comes at a random moment, a hundred times. Whatever was reported as finished is in the journal, what
/// was there before still is, and at most the running point is lost.
#[cfg(unix)]
#[test]
fn killed_a_hundred_times_it_loses_nothing_but_the_running_point() {
    const POINTS: u32 = 400;
    let here = small(POINTS, "");
    let at = here.path();
    let out = at.join("out");
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    let mut had = journaled(&out);
    let (mut cut_short, mut before_any) = (0, 0);
    // About as long as the first point takes to begin, which depends on the machine and on what else it does.
    let mut usual = Duration::from_millis(400);
    for _ in 0..100 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let moment = usual.mul_f64(0.5 + (random >> 33) as f64 / 2f64.powi(31));
        let mut child = runner(at, "sweep x.toml -o out --json -q")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let out_pipe = child.stdout.take().unwrap();
        let told = std::thread::spawn(move || {
            let lines = BufReader::new(out_pipe).lines().map_while(Result::ok);
            // The last line may be torn as well.
            lines.filter_map(|line| serde_json::from_str::<Value>(&line).ok()).collect::<Vec<_>>()
        });
        std::thread::sleep(moment);
        child.kill().unwrap();
        let ended = child.wait().unwrap();
        let told = told.join().unwrap();
        let keys = |name: &str| -> Vec<String> {
            let events = told.iter().filter(|event| event["event"] == name);
            events.map(|event| event["key"].as_str().unwrap().to_owned()).collect()
        };
        let (started, finished) = (keys("started"), keys("finished"));
        let has = journaled(&out);
        assert_eq!(has[..had.len()], had, "what was there before is lost");
        let new = &has[had.len()..];
        assert!(finished.iter().all(|key| new.contains(key)), "{finished:?} were told, {new:?} are there");
        assert!(started.len() <= new.len() + 1, "{started:?} were begun, {new:?} are there");
        cut_short += u32::from(started.len() > new.len());
        before_any += u32::from(!ended.success() && started.is_empty());
        usual = usual.mul_f64(if started.is_empty() { 1.1 } else { 0.95 });
        had = has;
    }
    assert!(cut_short > 10, "hardly any point was cut short: the test tests nothing");
    assert!(before_any < 90, "hardly any run came to its points");
    let distinct: BTreeSet<&String> = had.iter().collect();
    assert_eq!(distinct.len(), had.len(), "a point was measured twice");
    works(at, "sweep x.toml -o out -q");
    let record = valid(&out.join("record.json"));
    let expected: Vec<String> = (1..=POINTS).map(|cost| format!("cornell Binary {cost}.0")).collect();
    assert_eq!(points(&record), expected);
    assert!(record.finished.is_some());
}

#[cfg(unix)]
#[test]
fn interrupted_once_it_finishes_the_point_and_twice_it_stops_at_once() {
    let here = small(50, "");
    let at = here.path();
    let start = |folder: &str| {
        let mut child = runner(at, &format!("sweep x.toml -o {folder} --json"))
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        // Until the second point runs.
        let mut started = 0;
        while started < 2 {
            let line = lines.next().expect("it goes on").unwrap();
            started += usize::from(serde_json::from_str::<Value>(&line).unwrap()["event"] == "started");
        }
        (child, lines)
    };
    let signal = |child: &std::process::Child, name: &str| {
        let kill = Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
        assert!(kill.success());
    };
    // Schedulers say so with SIGTERM.
    for (folder, name) in [("int", "-INT"), ("term", "-TERM")] {
        let (mut child, lines) = start(folder);
        signal(&child, name);
        // Twice at once is once: a wrapper passes on what the whole group has had.
        signal(&child, name);
        let events: Vec<Value> =
            lines.map_while(Result::ok).map(|line| serde_json::from_str(&line).unwrap()).collect();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{name}");
        assert!(events.iter().any(|event| event["event"] == "finished"), "{events:?}");
        let told = events.last().unwrap();
        assert_eq!((&told["event"], &told["complete"]), (&Value::from("ended"), &Value::from(false)));
        let kept = journaled(&at.join(folder)).len();
        assert!((2..50).contains(&kept), "{kept}");
        let record = valid(&at.join(folder).join("record.json"));
        assert_eq!((record.results.len(), record.finished), (kept, None));
    }
    let (mut child, _lines) = start("twice");
    signal(&child, "-INT");
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        signal(&child, "-INT");
        assert!(begun.elapsed() < Duration::from_secs(20), "it did not stop");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn shards_join_to_what_one_process_measures() {
    let here = small(6, "");
    let at = here.path();
    works(at, "sweep x.toml -o all -q");
    let mut shared = Vec::new();
    for shard in 1..=3 {
        works(at, &format!("sweep x.toml --shard {shard}/3 -o part-{shard} -q"));
        shared.extend(journaled(&at.join(format!("part-{shard}"))));
    }
    fails(at, "merge part-1 part-2 -o joined.json", &["are missing", "--incomplete"]);
    assert!(!at.join("joined.json").exists());
    works(at, "merge part-1 part-2 part-3 -o joined.json");
    let (all, joined) = (valid(&at.join("all/record.json")), valid(&at.join("joined.json")));
    assert_eq!(points(&joined), points(&all));
    assert!(joined.finished.is_some() && joined.parts.len() == 3);
    for (one, other) in all.results.iter().zip(&joined.results) {
        assert_eq!(one.tree, other.tree);
        let (one, other) = (&one.views[0].counters, &other.views[0].counters);
        for (one, other) in one.as_ref().unwrap().depths.iter().zip(&other.as_ref().unwrap().depths) {
            assert_eq!(one.rays, other.rays);
            // Which rays share a subgroup, and so when their triangles are tested, is a matter of timing.
            let near = |a: u64, b: u64| a.abs_diff(b) as f64 <= 0.05 * a as f64;
            assert!(near(one.nodes, other.nodes) && near(one.boxes, other.boxes), "{one:?} {other:?}");
        }
    }
    // One more value leaves every point in its share.
    let config = fs::read_to_string(at.join("x.toml")).unwrap().replace("to = 6", "to = 8");
    fs::write(at.join("y.toml"), config).unwrap();
    for shard in 1..=3 {
        let (json, _) = works(at, &format!("sweep y.toml --shard {shard}/3 --plan --json"));
        let planned: BTreeSet<String> = json
            .lines()
            .map(|line| serde_json::from_str::<Value>(line).unwrap())
            .filter_map(|event| Some(event["key"].as_str()?.to_owned()))
            .collect();
        assert!(journaled(&at.join(format!("part-{shard}"))).iter().all(|key| planned.contains(key)));
    }
}

#[test]
fn samples_go_on_until_they_tell_enough() {
    let here = small(1, "[samples]\nleast = 4\nmost = 9\nhalf-width = \"0.01%\"\ntime = \"60 s\"");
    let at = here.path();
    let config = fs::read_to_string(at.join("x.toml")).unwrap().replace("samples = 1\n", "");
    fs::write(at.join("x.toml"), config).unwrap();
    let measured = |line: &str, folder: &str| {
        works(at, &format!("sweep x.toml {line} -o {folder} -q"));
        let record = valid(&at.join(folder).join("record.json"));
        let point = record.results[0].clone();
        (record, point.views[0].samples.len(), point.measurement.unwrap().stopped, point.views[0].clone())
    };
    // No CPU driver is so steady.
    let (record, samples, stopped, view) = measured("", "most");
    assert_eq!((samples, stopped), (9, Stop::Samples));
    assert_eq!(record.run.stopping.as_ref().map(|stopping| (stopping.least, stopping.most)), Some((4, 9)));
    assert!(view.samples.iter().all(|s| matches!(s.excluded, None | Some(Exclusion::WarmUp))));
    let (_, samples, stopped, _) = measured("--set samples.half-width=100%", "precise");
    assert!((4..9).contains(&samples) && stopped == Stop::Precise, "{samples} {stopped:?}");
    let (_, samples, stopped, _) = measured("--set samples.time=1ms", "time");
    assert!((4..9).contains(&samples) && stopped == Stop::Time, "{samples} {stopped:?}");
}

#[test]
fn the_reference_point_is_measured_again_and_again() {
    let here = small(6, "");
    let at = here.path();
    let (table, _) = works(at, "sweep x.toml --set order.reference-every=2 -o out");
    let record = valid(&at.join("out/record.json"));
    assert_eq!((record.results.len(), record.references.len()), (6, 4));
    assert!(table.contains("primary rays of the reference point, 4 times, rank correlation"), "{table}");
    let positions: BTreeSet<u64> =
        record.references.iter().map(|p| p.measurement.as_ref().unwrap().position).collect();
    assert_eq!(positions, [0, 3, 6, 9].into());
}

#[test]
fn one_bad_point_does_not_end_a_sweep() {
    let here = small(2, "");
    let at = here.path();
    let config = fs::read_to_string(at.join("x.toml")).unwrap();
    fs::write(at.join("x.toml"), config.replace("[\"cornell:", "[\"sponza\", \"cornell:")).unwrap();
    fails(at, "sweep x.toml -o out", &["sponza.glb", "2 points could not be measured", "sponza | Binary"]);
    let record = valid(&at.join("out/record.json"));
    assert_eq!((record.results.len(), record.finished), (2, None));
    // Sponza comes first, so it is the reference point too.
    let set = "--set order.reference-every=1";
    fails(at, &format!("sweep x.toml {set} -o other"), &["no drift can be told", "2 points could not be"]);
    assert_eq!(valid(&at.join("other/record.json")).results.len(), 2);
}

#[test]
fn the_best_of_a_sweep_is_a_config_for_others() {
    let here = small(3, "");
    let at = here.path();
    works(at, "sweep x.toml --set samples=3 -o out -q");
    let (table, _) = works(at, "best out/record.json -o tuned/gpu.toml");
    assert!(table.contains("collapse.c_t") && table.contains("significant"), "{table}");
    let (json, _) = works(at, "best out --json");
    let choices: Value = serde_json::from_str(&json).unwrap();
    let best = choices[0]["value"].as_f64().unwrap();
    let text = fs::read_to_string(at.join("tuned/gpu.toml")).unwrap();
    assert!(text.contains("[[set]]") && text.starts_with("# Best values on "), "{text}");
    let plain = "scenes = [\"cornell:triangles=100\"]\nvariants = [\"Binary\"]\nviews = \"0\"\nsize = \"16x8\"\n\
                 samples = 1\nbuilds = 1\ninclude = [\"tuned/gpu.toml\"]\n";
    fs::write(at.join("y.toml"), plain).unwrap();
    works(at, "sweep y.toml -o tuned-out -q");
    let record = valid(&at.join("tuned-out/record.json"));
    let used = record.parameters_of(&record.results[0]).get("collapse.c_t").unwrap().to_string();
    assert_eq!(used.parse(), Ok(best));
    works(at, "sweep y.toml --set views=0 -o one -q");
    fails(at, "best one", &["no axis with more than one value"]);
    fails(at, "best gone.json", &["cannot read gone.json"]);
}

#[test]
fn tuning_finds_values_with_a_part_of_the_samples() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let line =
        "tune cornell:triangles=100 --variant Wide4 --size 16x8 --views 0 --depth 2 --samples 4 -o t.toml";
    let (told, _) = works(at, line);
    let text = fs::read_to_string(at.join("t.toml")).unwrap();
    for name in ["collapse.c_t", "trace.primary_subgroups", "trace.secondary_subgroups"] {
        assert!(text.contains(name), "{text}");
    }
    // 54 + 27 + 28 of 54 × 4; fewer where some were far behind, more where samples did not count.
    let spent: u32 = told.split("; ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((58..=140).contains(&spent) && told.contains("of the grid's 216 samples"), "{told}");
    fails(at, "tune cornell --set collapse.c_t=2", &["that is what is looked for"]);
}

/// One config serves devices whose driver traces rays and others.
#[test]
fn points_of_a_driver_that_traces_no_rays_are_left_out() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let config = |variants: &str| {
        format!(
            "title = \"Driver\"\nscenes = [\"cornell:triangles=100\"]\nvariants = [{variants}]\nviews = \"0\"\n\
             size = \"16x9\"\nbuilds = 1\nsamples = 1\n[[axis]]\nparameter = \"driver.build\"\n\
             values = [\"fast-trace\", \"fast-build\"]\nwhen = {{ variant = \"Driver\" }}\n"
        )
    };
    fs::write(at.join("both.toml"), config("\"Binary\", \"Driver\"")).unwrap();
    fs::write(at.join("only.toml"), config("\"Driver\"")).unwrap();
    let (_, err) = works(at, "sweep both.toml -o out");
    let record = valid(&at.join("out/record.json"));
    let (output, _, alone) = run(at, "sweep only.toml -o only");
    if err.contains("2 points are left out: Driver is unavailable") {
        assert_eq!(points(&record).len(), 1);
        assert_eq!(output.status.code(), Some(3), "{alone}");
        assert!(alone.contains("VK_KHR_ray_tracing_pipeline"), "{alone}");
    } else {
        assert_eq!(points(&record).len(), 3, "{err}");
        assert!(output.status.success(), "{alone}");
    }
}
