//! Puts the shared library where a program finds it.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// The name under which the driver's own library is loaded.
const INSTALLED: &str = "libnvidia-ml.so.1";

/// The stand-in's shared library, from the build that the running test belongs to: beside the test, in
/// `target/<profile>/deps`, or for a program that lies elsewhere in `target/<profile>` there.
///
/// # Panics
///
/// The library is not there: what calls this was not built by cargo, or was moved.
pub fn library() -> PathBuf {
    let name = format!("{DLL_PREFIX}nvml_stand_in{DLL_SUFFIX}");
    let test = env::current_exe().expect("a running program has a path");
    // Not `target/<profile>` itself: the copy there is as old as the last `cargo build`.
    let folders =
        test.ancestors().skip(1).take(2).flat_map(|folder| [folder.to_owned(), folder.join("deps")]);
    let mut found = folders.filter(|folder| folder.ends_with("deps")).map(|folder| folder.join(&name));
    found.find(|path| path.is_file()).unwrap_or_else(|| panic!("no {name} near {}", test.display()))
}

/// Copies the library into `folder` as `libnvidia-ml.so.1`, for a program that has `folder` in its
/// `LD_LIBRARY_PATH`. Gives the copy's path.
///
/// # Panics
///
/// There is no library, or it cannot be copied.
pub fn install(folder: &Path) -> PathBuf {
    install_without(folder, &[])
}

/// The same, but the functions with these names in C, as `nvmlDeviceGetViolationStatus`, cannot be
/// found in the copy: as with a driver that is older than they are.
///
/// # Panics
///
/// As in [`install`], or there is no function of that name.
pub fn install_without(folder: &Path, functions: &[&str]) -> PathBuf {
    let mut bytes = fs::read(library()).expect("the library can be read");
    for function in functions {
        rename(&mut bytes, function);
    }
    fs::create_dir_all(folder).expect("the folder can be made");
    let path = folder.join(INSTALLED);
    // A copy that is loaded somewhere must not change.
    let new = folder.join(format!("{INSTALLED}.new"));
    fs::write(&new, bytes).and_then(|()| fs::rename(new, &path)).expect("the library can be written");
    path
}

/// Gives a symbol another name wherever its own stands as a whole string. Nothing has to move for that;
/// the symbol keeps its old place in the hash table, where nobody looks for the new name.
fn rename(bytes: &mut [u8], symbol: &str) {
    let whole = [b"\0", symbol.as_bytes(), b"\0"].concat();
    let places: Vec<usize> =
        bytes.windows(whole.len()).enumerate().filter(|(_, text)| *text == whole).map(|(at, _)| at).collect();
    assert!(!places.is_empty(), "the stand-in has no {symbol}");
    for at in places {
        bytes[at + 1] = b'x';
    }
}
