//! Where the hook goes, and what was there before.

use super::script::{FORMER, Owner, owner, script};
use crate::git::{Git, path};
use crate::say;
use anyhow::{Context, bail};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

const NAME: &str = "prepare-commit-msg";

/// The hook of a repository.
struct Hook {
    path: PathBuf,
    former: PathBuf,
}

impl Hook {
    /// Where git looks for it: `core.hooksPath`, or the folder that all working trees of the repository share.
    fn of(git: &Git) -> anyhow::Result<Hook> {
        let mut folder = git.output(["rev-parse", "--git-path", "hooks"])?;
        if folder.last() == Some(&b'\n') {
            folder.pop();
        }
        let path = git.top.join(path(&folder)).join(NAME);
        let mut former = OsString::from(&path);
        former.push(FORMER);
        Ok(Hook { path, former: former.into() })
    }

    /// Whose the hook is; nothing where there is none.
    fn owner(&self) -> anyhow::Result<Option<Owner>> {
        // A link that leads nowhere is there, too.
        if !is_there(&self.path) {
            return Ok(None);
        }
        match fs::read(&self.path) {
            Ok(text) => Ok(Some(owner(&text))),
            Err(_) if self.path.is_symlink() => Ok(Some(Owner::Other)),
            Err(error) => Err(error).with_context(|| format!("cannot read {}", self.path.display())),
        }
    }

    fn changed(&self) -> anyhow::Error {
        anyhow::anyhow!(
            "{} is compare's with something added to it; move what was added elsewhere and try again",
            self.path.display()
        )
    }
}

/// Puts the hook in place; one that is there already is written anew.
///
/// # Errors
/// The folder serves other repositories too and that is not `shared`, there is a former hook twice, or a file cannot
/// be written.
pub fn install(git: &Git, shared: bool) -> anyhow::Result<()> {
    if !shared {
        refuse_shared(git)?;
    }
    let hook = Hook::of(git)?;
    let program =
        std::env::current_exe().and_then(fs::canonicalize).context("cannot tell where compare is")?;
    let at = hook.path.display();
    let moved = match hook.owner()? {
        None => false,
        Some(Owner::Compare) => {
            write(&hook.path, &script(&program))?;
            say(format_args!("{at} was compare's already; it runs {} now", program.display()));
            return Ok(());
        }
        Some(Owner::Both) => return Err(hook.changed()),
        Some(Owner::Other) if is_there(&hook.former) => bail!(
            "there are two hooks already, {at} and {}; join them into the first, remove the second, and try again",
            hook.former.display()
        ),
        Some(Owner::Other) => true,
    };
    if !moved && is_there(&hook.former) {
        bail!(
            "{} is left from before and would be run; remove it or name it {NAME}, and try again",
            hook.former.display()
        );
    }
    if let Some(folder) = hook.path.parent() {
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    }
    if moved {
        fs::rename(&hook.path, &hook.former).with_context(|| format!("cannot move {at} aside"))?;
    }
    if let Err(error) = write(&hook.path, &script(&program)) {
        if moved {
            let _ = fs::rename(&hook.former, &hook.path);
        }
        return Err(error);
    }
    let first = if moved {
        format!("; the former hook runs first, from {}", hook.former.display())
    } else {
        String::new()
    };
    say(format_args!("installed {at}{first}"));
    Ok(())
}

/// Takes the hook away, and puts the former one back.
///
/// # Errors
/// There is none of compare's, somebody has added to it, or a file cannot be removed.
pub fn uninstall(git: &Git) -> anyhow::Result<()> {
    let hook = Hook::of(git)?;
    let at = hook.path.display();
    match hook.owner()? {
        None => bail!("there is no hook at {at}"),
        Some(Owner::Other) => bail!("{at} is not compare's, so it stays as it is"),
        Some(Owner::Both) => return Err(hook.changed()),
        Some(Owner::Compare) => {}
    }
    if is_there(&hook.former) {
        fs::rename(&hook.former, &hook.path)
            .with_context(|| format!("cannot put {} back", hook.former.display()))?;
        say(format_args!("{at} is the former hook again"));
    } else {
        fs::remove_file(&hook.path).with_context(|| format!("cannot remove {at}"))?;
        say(format_args!("removed {at}"));
    }
    Ok(())
}

/// A `core.hooksPath` outside the repository's own settings is there for others, too.
fn refuse_shared(git: &Git) -> anyhow::Result<()> {
    let Some(set) = git.line(["config", "--show-scope", "--get", "core.hooksPath"])? else { return Ok(()) };
    let (scope, folder) = set.split_once('\t').unwrap_or(("", &set));
    if ["local", "worktree"].contains(&scope) {
        return Ok(());
    }
    bail!(
        "core.hooksPath is {folder}, in the {scope} settings, so other repositories have their hooks there too. \
         `compare hook install --shared` puts the hook there for all of them; \
         `git config core.hooksPath .git/hooks` gives this repository hooks of its own"
    )
}

fn is_there(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}

/// Writes a script that may be run, all of it or nothing.
fn write(path: &Path, script: &[u8]) -> anyhow::Result<()> {
    let context = || format!("cannot write {}", path.display());
    record::replace(path, |out| out.write_all(script)).with_context(context)?;
    #[cfg(unix)]
    fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(0o755)).with_context(context)?;
    Ok(())
}
