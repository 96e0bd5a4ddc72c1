//! `compare hook` in real repositories.

use crate::common::{compare_in, stderr, stdout, synthetic};
use crate::repository::Repository;
use record::Record;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

const BEGIN: &str = "Performance changes from the last benchmark:\n";

fn faster(seed: u64, by: f64) -> Record {
    synthetic(seed, |_, variant, depth| if variant == "Wide4" && depth > 0 { by } else { 1.0 })
}

/// A repository with the hook and a record in HEAD.
fn measured() -> Repository {
    let repository = Repository::new();
    repository.record("out/a record.json", 1, &faster(1, 1.0));
    repository.commit(&["-m", "Measure"]);
    install(&repository);
    repository
}

#[track_caller]
fn install(repository: &Repository) {
    let output = repository.compare(&["hook", "install"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(stdout(&output), "", "messages go to stderr");
    assert!(!stderr(&output).is_empty());
}

/// Writes a hook, or another script.
fn script(path: &Path, text: &str) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, format!("#!/bin/sh\n{text}\n")).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
}

#[track_caller]
fn told(message: &str) {
    assert_eq!(message.matches(BEGIN).count(), 1, "{message}");
}

#[track_caller]
fn untold(message: &str) {
    assert_eq!(message.matches(BEGIN).count(), 0, "{message}");
}

#[test]
fn a_changed_record_is_compared_with_its_version_in_head() {
    let repository = measured();
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    let message = repository.commit(&["-m", "Collapse more", "-m", "Words."]);
    assert!(message.starts_with(&format!("Collapse more\n\nWords.\n\n{BEGIN} Binary:\n")), "{message}");
    assert!(message.contains(" Wide4:\n   Pass normal:\n     pMRps: ~\n     sMRps: avg +"), "{message}");
    assert!(message.ends_with("~: inside the noise"), "{message}");
    let direct = {
        let old = repository.git(&["show", "HEAD~:out/a record.json"]);
        repository.write("old.json", old.as_bytes());
        compare_in(&repository.top, &["diff", "old.json", "out/a record.json", "--format", "commit"])
    };
    assert!(message.contains(stdout(&direct).trim_end()), "what diff says");
}

#[test]
fn only_what_is_staged_counts() {
    let repository = measured();
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    repository.write("README", b"more\n");
    repository.git(&["commit", "-qm", "More words", "README"]);
    untold(&repository.message());
    repository.git(&["commit", "-qam", "All"]);
    told(&repository.message());
    repository.write("README", b"less\n");
    untold(&repository.commit(&["-m", "Less words"]));
    repository.git(&["mv", "out/a record.json", "out/b.json"]);
    untold(&repository.commit(&["-m", "Another name"]));
    repository.git(&["rm", "-q", "out/b.json"]);
    untold(&repository.commit(&["-m", "Away"]));
}

#[test]
fn an_added_record_is_compared_with_the_newest_of_its_folder_and_device() {
    let repository = measured();
    let mut other = faster(3, 3.0);
    other.device.name = "Another GPU".into();
    repository.record("out/other.json", 4, &other);
    repository.record("elsewhere/b.json", 5, &faster(4, 1.5));
    repository.record("out/later.json", 50, &faster(5, 1.5));
    let mut scenes = faster(6, 1.0);
    scenes.results.iter_mut().for_each(|point| point.scene.name += " 2");
    repository.record("out/scenes.json", 6, &scenes);
    repository.write("out/broken.json", b"{\"schema\": 1, \"tool\"");
    repository.commit(&["-m", "Others"]);
    repository.record("out/new.json", 10, &faster(7, 1.1));
    let message = repository.commit(&["-m", "Measure again"]);
    assert!(message.contains("sMRps: avg +10.") || message.contains("sMRps: avg +9."), "{message}");
    // With nothing in its folder, those of others count.
    repository.record("third/c.json", 11, &faster(8, 1.1));
    let message = repository.commit(&["-m", "Third"]);
    assert!(message.contains(" Wide4:\n   Pass normal:\n     pMRps: ~\n     sMRps: ~\n"), "{message}");
}

#[test]
fn with_nothing_to_compare_a_comment_says_why() {
    let repository = Repository::new();
    install(&repository);
    repository.record("a.json", 1, &faster(1, 1.0));
    repository.git(&["add", "-A"]);
    let output = repository.output(&repository.top, "git", &["commit", "-qm", "First"], &[]);
    assert!(
        stderr(&output).contains("compare: HEAD has no earlier record of Example GPU 4070"),
        "{}",
        stderr(&output)
    );
    assert_eq!(repository.message(), "First");
    let mut driver = faster(2, 1.0);
    driver.device.driver.info = "999.9".into();
    repository.record("a.json", 2, &driver);
    repository.git(&["add", "-A"]);
    let output = repository.output(&repository.top, "git", &["commit", "-qm", "Driver"], &[]);
    assert!(
        stderr(&output).contains("driver: NVIDIA 570.124 before, NVIDIA 999.9 after"),
        "{}",
        stderr(&output)
    );
    assert_eq!(repository.message(), "Driver");
}

#[test]
fn the_first_commit_of_all_has_nothing_before() {
    let repository = Repository::new();
    repository.git(&["checkout", "-q", "--orphan", "other"]);
    install(&repository);
    repository.record("a.json", 1, &faster(1, 1.0));
    assert_eq!(repository.commit(&["-m", "First"]), "First");
}

#[test]
fn the_newest_of_several_is_told() {
    let repository = measured();
    repository.record("out/a record.json", 2, &faster(2, 1.0));
    repository.record("out/b.json", 3, &faster(3, 1.1));
    repository.git(&["add", "-A"]);
    let output = repository.output(&repository.top, "git", &["commit", "-qm", "Two"], &[]);
    told(&repository.message());
    assert!(repository.message().contains("sMRps: avg +"), "{}", repository.message());
    assert!(stderr(&output).contains("nothing is said of out/a record.json"), "{}", stderr(&output));
}

#[test]
fn journals_of_sweeps_are_records() {
    let repository = measured();
    let journal = |by: f64, seed: u64| {
        let mut record = faster(seed, by);
        let points = std::mem::take(&mut record.results);
        let keys: Vec<String> = (0..points.len()).map(|index| index.to_string()).collect();
        record.sweep.as_mut().unwrap().shard = None;
        record.finished = None;
        let header = serde_json::json!({ "record": record, "points": keys });
        let mut text = header.to_string().replacen('{', "{\"journal\":1,", 1) + "\n";
        for (key, point) in keys.iter().zip(points) {
            text += &format!("{}\n", serde_json::json!({ "key": key, "point": point }));
        }
        text
    };
    repository.write("sweep/journal.jsonl", journal(1.0, 1).as_bytes());
    repository.commit(&["-m", "Sweep"]);
    repository.write("sweep/journal.jsonl", journal(1.1, 2).as_bytes());
    let message = repository.commit(&["-m", "Sweep again"]);
    assert!(message.contains("sMRps: avg +"), "{message}");
}

#[test]
fn a_broken_record_fails_no_commit() {
    let repository = measured();
    for broken in
        [&b"{\"schema\": 1, \"tool\""[..], b"{\"schema\": 9, \"results\": []}", b"{\"journal\":1,\"\xff"]
    {
        repository.write("out/a record.json", broken);
        repository.git(&["add", "-A"]);
        let output = repository.output(&repository.top, "git", &["commit", "-qm", "Broken"], &[]);
        assert!(output.status.success());
        assert!(stderr(&output).contains("out/a record.json"), "{}", stderr(&output));
        assert_eq!(repository.message(), "Broken");
    }
    // A sound one in its place has nothing to be compared with.
    repository.record("out/a record.json", 2, &faster(2, 1.0));
    repository.git(&["add", "-A"]);
    let output = repository.output(&repository.top, "git", &["commit", "-qm", "Sound"], &[]);
    assert!(stderr(&output).contains("nothing to compare out/a record.json with"), "{}", stderr(&output));
    assert_eq!(repository.message(), "Sound");
    let gone =
        repository.output(&repository.top, env!("CARGO_BIN_EXE_compare"), &["hook", "run", "none"], &[]);
    assert_eq!(gone.status.code(), Some(0));
    assert!(stderr(&gone).contains("cannot read none"), "{}", stderr(&gone));
}

#[test]
fn other_files_are_no_records() {
    let repository = measured();
    repository.write("package.json", b"{\"schema\": \"x\", \"results\": []}");
    repository.write("blob.bin", &[0xff; 5000]);
    repository.write("empty.json", b"");
    std::os::unix::fs::symlink("out/a record.json", repository.top.join("link.json")).unwrap();
    repository.git(&["add", "-A"]);
    let output = repository.output(&repository.top, "git", &["commit", "-qm", "Files"], &[]);
    assert_eq!((stderr(&output), repository.message().as_str()), ("", "Files"));
}

#[test]
fn commits_made_of_others_are_left_alone() {
    let repository = measured();
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    told(&repository.commit(&["-m", "Faster"]));
    // Amends: with and without a message of their own.
    repository.record("out/a record.json", 3, &faster(3, 1.2));
    told(&repository.commit(&["--amend", "--no-edit"]));
    repository.record("out/a record.json", 4, &faster(4, 1.3));
    if Path::new("/proc/self/cmdline").exists() {
        assert_eq!(repository.commit(&["--amend", "-m", "Another word"]), "Another word");
    }
    repository.record("out/a record.json", 5, &faster(5, 1.2));
    assert_eq!(repository.commit(&["--fixup", "HEAD"]), "fixup! Another word");
    repository.record("out/a record.json", 6, &faster(6, 1.3));
    untold(&repository.commit(&["--squash", "HEAD~", "-m", "more"]));
    repository.git(&["rebase", "-q", "-i", "--autosquash", "--root"]);
    untold(&repository.message());
    // A merge that brings a record, and a squash.
    repository.git(&["checkout", "-q", "-b", "side", "HEAD~"]);
    repository.record("side.json", 7, &faster(7, 1.5));
    told(&repository.commit(&["-m", "Beside"]));
    repository.git(&["checkout", "-q", "main"]);
    repository.git(&["merge", "-q", "--no-ff", "-m", "Join", "side"]);
    assert_eq!(repository.message(), "Join");
    repository.git(&["reset", "-q", "--hard", "HEAD~"]);
    repository.git(&["merge", "-q", "--squash", "side"]);
    repository.git(&["commit", "-q", "--no-edit"]);
    assert_eq!(repository.message().matches(BEGIN.trim_end()).count(), 1, "only the one that was squashed");
    repository.git(&["revert", "--no-edit", "HEAD"]);
    assert!(!repository.message().contains(BEGIN), "{}", repository.message());
    repository.git(&["cherry-pick", "side"]);
    told(&repository.message());
}

#[test]
fn a_rebase_keeps_messages() {
    let repository = measured();
    repository.git(&["checkout", "-q", "-b", "side"]);
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    let message = repository.commit(&["-m", "Faster"]);
    repository.git(&["checkout", "-q", "main"]);
    repository.write("README", b"meanwhile\n");
    repository.commit(&["-m", "Meanwhile"]);
    repository.git(&["checkout", "-q", "side"]);
    repository.git(&["rebase", "-q", "main"]);
    assert_eq!(repository.message(), message);
    repository.git(&["rebase", "-q", "-i", "--force-rebase", "HEAD~2"]);
    assert_eq!(repository.message(), message);
}

#[test]
fn the_text_is_above_comments_and_scissors() {
    let repository = measured();
    // The editor keeps what it got, and puts a subject into the line that was left for it.
    let editor = repository.beside("editor");
    script(&editor, "cp \"$1\" ../seen; sed -i '1s/^$/Subject/' \"$1\"");
    let editor = [("GIT_EDITOR", editor.to_str().unwrap())];
    let commit = |arguments: &[&str]| {
        repository.git(&["add", "-A"]);
        repository.git_with(&[&["commit", "-q", "-s"], arguments].concat(), &editor);
        (fs::read_to_string(repository.beside("seen")).unwrap(), repository.message())
    };
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    let (seen, message) = commit(&["-v"]);
    assert!(seen.starts_with(&format!("\n\n{BEGIN}")), "{seen}");
    assert!(seen.contains("\ndiff --git"), "{seen}");
    let place = |what: &str| seen.find(what).unwrap_or_else(|| panic!("no {what}: {seen}"));
    let order = [
        BEGIN,
        "Signed-off-by:",
        "# Please enter",
        ">8",
        "# compare: out/a record.json against HEAD:out/a record.json",
        "diff --git",
    ];
    assert!(order.map(place).is_sorted(), "{seen}");
    assert!(message.starts_with(&format!("Subject\n\n{BEGIN}")), "{message}");
    assert!(
        message.ends_with("~: inside the noise\n\nSigned-off-by: Somebody <somebody@example.org>"),
        "{message}"
    );
    // Another comment character, and comments that stay.
    for (number, (name, value)) in [
        ("core.commentChar", ";"),
        ("core.commentChar", "auto"),
        ("commit.cleanup", "scissors"),
        ("commit.verbose", "true"),
    ]
    .into_iter()
    .enumerate()
    {
        repository.git(&["config", name, value]);
        repository.record("out/a record.json", 10, &faster(3 + number as u64, 1.1 + number as f64));
        let (seen, message) = commit(&[]);
        assert!(message.starts_with(&format!("Subject\n\n{BEGIN}")), "{name}: {message}");
        assert!(
            message.ends_with("Signed-off-by: Somebody <somebody@example.org>"),
            "{name}: {message}\n{seen}"
        );
        assert!(seen.contains("compare: out/a record.json against"), "{name}: {seen}");
    }
    // A broken one is a comment there.
    repository.write("out/a record.json", b"{\"schema\": 1, \"tool\"");
    let (seen, message) = commit(&["-e", "-m", "Broken"]);
    assert!(seen.contains("compare: out/a record.json is no benchmark record"), "{seen}");
    assert!(!message.contains("compare:"), "{message}");
}

#[test]
fn comments_that_git_keeps_are_none() {
    let repository = measured();
    repository.git(&["config", "commit.cleanup", "verbatim"]);
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    repository.git(&["add", "-A"]);
    let output = repository.output(&repository.top, "git", &["commit", "-q", "-e", "-m", "Kept"], &[]);
    assert!(stderr(&output).contains("compare: out/a record.json against"), "{}", stderr(&output));
    assert!(!repository.message().contains("compare:"));
}

#[test]
fn a_text_that_is_there_is_not_said_twice() {
    let repository = measured();
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    told(&repository.commit(&["-m", "By hand", "-m", &format!("{BEGIN} Wide4: none")]));
}

#[test]
fn a_former_hook_runs_first_and_comes_back() {
    let repository = measured();
    let hook = repository.top.join(".git/hooks/prepare-commit-msg");
    assert_eq!(repository.compare(&["hook", "uninstall"]).status.code(), Some(0));
    assert!(!hook.exists());
    script(&hook, "echo \"former $2\" >> \"$1\"; ! test -e refuse");
    let former = fs::read(&hook).unwrap();
    install(&repository);
    install(&repository);
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    let message = repository.commit(&["-m", "Both"]);
    assert!(message.starts_with(&format!("Both\nformer message\n\n{BEGIN}")), "{message}");
    // What it refuses stays refused.
    repository.write("refuse", b"");
    repository.git(&["add", "-A"]);
    assert!(!repository.output(&repository.top, "git", &["commit", "-qm", "Refused"], &[]).status.success());
    let output = repository.compare(&["hook", "uninstall"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(fs::read(&hook).unwrap(), former);
    assert_ne!(fs::metadata(&hook).unwrap().permissions().mode() & 0o111, 0);
    let again = repository.compare(&["hook", "uninstall"]);
    assert_eq!(again.status.code(), Some(1));
    assert!(stderr(&again).contains("is not compare's"), "{}", stderr(&again));
}

#[test]
fn a_hook_that_git_would_not_run_is_not_run() {
    let repository = measured();
    let hook = repository.top.join(".git/hooks/prepare-commit-msg");
    repository.compare(&["hook", "uninstall"]);
    fs::write(&hook, "#!/bin/sh\nexit 1\n").unwrap();
    install(&repository);
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    told(&repository.commit(&["-m", "Go on"]));
}

#[test]
fn what_others_added_is_not_lost() {
    let repository = measured();
    let hook = repository.top.join(".git/hooks/prepare-commit-msg");
    let mut text = fs::read(&hook).unwrap();
    text.extend_from_slice(b"echo mine\n");
    fs::write(&hook, &text).unwrap();
    for action in ["install", "uninstall"] {
        let output = repository.compare(&["hook", action]);
        assert_eq!(output.status.code(), Some(1));
        assert!(stderr(&output).contains("something added"), "{}", stderr(&output));
    }
    assert_eq!(fs::read(&hook).unwrap(), text);
    fs::write(&hook, "#!/bin/sh\n").unwrap();
    fs::write(repository.top.join(".git/hooks/prepare-commit-msg.before-compare"), "#!/bin/sh\n").unwrap();
    let output = repository.compare(&["hook", "install"]);
    assert!(stderr(&output).contains("two hooks already"), "{}", stderr(&output));
    fs::remove_file(&hook).unwrap();
    let output = repository.compare(&["hook", "install"]);
    assert!(stderr(&output).contains("left from before"), "{}", stderr(&output));
}

#[test]
fn hooks_may_be_elsewhere() {
    let repository = measured();
    repository.compare(&["hook", "uninstall"]);
    repository.git(&["config", "core.hooksPath", "my hooks"]);
    let hook = repository.top.join("my hooks/prepare-commit-msg");
    script(&hook, "echo former >> \"$1\"");
    fs::create_dir(repository.top.join("sub")).unwrap();
    let sub = repository.top.join("sub");
    let output = repository.output(&sub, env!("CARGO_BIN_EXE_compare"), &["hook", "install"], &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    repository.git(&["add", "out"]);
    // From a subfolder, too.
    let output = repository.output(&sub, "git", &["commit", "-qm", "Elsewhere"], &[]);
    assert!(output.status.success());
    let message = repository.message();
    assert!(message.starts_with(&format!("Elsewhere\nformer\n\n{BEGIN}")), "{message}");
    repository.compare(&["hook", "uninstall"]);
    assert_eq!(fs::read_to_string(&hook).unwrap(), "#!/bin/sh\necho former >> \"$1\"\n");
}

#[test]
fn hooks_of_all_repositories_are_left_alone_unless_asked() {
    let repository = Repository::new();
    let (settings, hooks) = (repository.beside("settings"), repository.beside("hooks"));
    fs::write(&settings, format!("[core]\n\thooksPath = {}\n", hooks.display())).unwrap();
    let set = [("GIT_CONFIG_GLOBAL", settings.to_str().unwrap())];
    let compare = |arguments: &[&str]| {
        repository.output(&repository.top, env!("CARGO_BIN_EXE_compare"), arguments, &set)
    };
    let refused = compare(&["hook", "install"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        stderr(&refused).contains("global") && stderr(&refused).contains("--shared"),
        "{}",
        stderr(&refused)
    );
    assert!(!hooks.exists());
    assert_eq!(compare(&["hook", "install", "--shared"]).status.code(), Some(0));
    assert!(hooks.join("prepare-commit-msg").exists());
    assert_eq!(compare(&["hook", "uninstall"]).status.code(), Some(0));
    assert!(!hooks.join("prepare-commit-msg").exists());
}

#[test]
fn all_working_trees_share_the_hook() {
    let repository = measured();
    let other = repository.beside("another tree");
    repository.git(&["worktree", "add", "-q", "-b", "other", other.to_str().unwrap()]);
    let mut record = faster(2, 1.1);
    record.finished = None;
    record.write_atomic(other.join("out/a record.json")).unwrap();
    let commit = repository.output(&other, "git", &["commit", "-qam", "There"], &[]);
    assert!(commit.status.success(), "{}", stderr(&commit));
    let message = repository.output(&other, "git", &["log", "-1", "--format=%B"], &[]);
    told(stdout(&message));
    let output = repository.output(&other, env!("CARGO_BIN_EXE_compare"), &["hook", "uninstall"], &[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(!repository.top.join(".git/hooks/prepare-commit-msg").exists());
}

#[test]
fn a_program_that_is_gone_fails_no_commit() {
    let repository = measured();
    let hook = repository.top.join(".git/hooks/prepare-commit-msg");
    let text = fs::read_to_string(&hook).unwrap().replace(env!("CARGO_BIN_EXE_compare"), "/nowhere/compare");
    fs::write(&hook, text).unwrap();
    repository.record("out/a record.json", 2, &faster(2, 1.1));
    repository.git(&["add", "-A"]);
    let output = repository.output(&repository.top, "git", &["commit", "-qm", "Gone"], &[]);
    assert!(output.status.success());
    assert!(stderr(&output).contains("/nowhere/compare is not there any more"), "{}", stderr(&output));
    assert_eq!(repository.message(), "Gone");
}

#[test]
fn outside_a_repository_an_error_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let output = compare_in(folder.path(), &["hook", "install"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("in the working tree of a git repository"), "{}", stderr(&output));
}
