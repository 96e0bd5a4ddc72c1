//! Views that a user found are kept where those of the scene stand, so that they are there when it is loaded again.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::catalog::built_in;
use super::descriptor::Descriptor;
use super::load::{describe, is_path};
use super::search::SearchPath;
use super::{SceneError, View, views};

/// Adds a view to the file in which the views of a scene stand, and says which that is:
///
/// - of a model's path, `NAME.views.json` beside it;
/// - of a name, the descriptor `NAME.toml` on the search path. A built-in one gets a copy in `folder`, which should be one
///   of those that are searched.
///
/// `known` are the views that the scene has now. Where they are in no file, because they were placed automatically, they
/// are written as well: a file with views has all of them. Comments in a descriptor stay as they are.
///
/// # Errors
/// The file cannot be read or written, has a view of that name, or has its views in a form to which none can be added.
pub fn keep_view(
    spec: &str,
    search: &SearchPath,
    folder: &Path,
    known: &[View],
    view: &View,
) -> Result<PathBuf, SceneError> {
    if is_path(spec) {
        let path = views::file_beside(Path::new(spec));
        let mut all = views::beside(Path::new(spec))?.unwrap_or_else(|| known.to_vec());
        add(&path, &mut all, view)?;
        let mut text = serde_json::to_string_pretty(&all).expect("views are plain data");
        text.push('\n');
        write(&path, &text)?;
        return Ok(path);
    }
    let name = spec.split(':').next().unwrap_or_default();
    let (descriptor, found) = describe(name, search)?;
    let (path, text) = match found {
        Some(path) => {
            let read = std::fs::read_to_string(&path);
            let text = read.map_err(|source| SceneError::Read { path: path.clone(), source })?;
            (path, text)
        }
        None => {
            let entry = built_in().iter().find(|entry| entry.name == name);
            let text = entry.expect("what is found nowhere else is built in").text();
            (folder.join(format!("{name}.toml")), text.to_owned())
        }
    };
    let mut all = descriptor.views.clone();
    let missing = if all.is_empty() { known } else { &[] };
    all.extend_from_slice(missing);
    add(&path, &mut all, view)?;
    let mut text = text.trim_end().to_owned();
    text.push('\n');
    for view in missing.iter().chain([view]) {
        text += &in_toml(view);
    }
    // Whatever a descriptor looks like, it must read as meant afterwards.
    if Descriptor::parse(&path, &text).ok() != Some(Descriptor { views: all, ..descriptor }) {
        let reason = format!(
            "no view can be added at its end, so its views are probably written as `view = [...]`; add this one by \
             hand:\n{}",
            in_toml(view)
        );
        return Err(SceneError::descriptor(&path, reason));
    }
    write(&path, &text)?;
    Ok(path)
}

fn add(path: &Path, all: &mut Vec<View>, view: &View) -> Result<(), SceneError> {
    if all.iter().any(|there| there.name == view.name) {
        return Err(SceneError::descriptor(path, format!("it has a view '{}' already", view.name)));
    }
    all.push(view.clone());
    views::check(all).map_err(|reason| SceneError::descriptor(path, reason))
}

/// A view as it stands in descriptors. Numbers have as many digits as tell them apart, not those of their doubles.
fn in_toml(view: &View) -> String {
    let name = toml::Value::from(view.name.as_str());
    let View { eye, target, up, vfov_degrees, .. } = view;
    format!(
        "\n[[view]]\nname = {name}\neye = {eye:?}\ntarget = {target:?}\nup = {up:?}\nvfov_degrees = {vfov_degrees:?}\n"
    )
}

/// Writes a file, all of it or nothing.
fn write(path: &Path, text: &str) -> Result<(), SceneError> {
    // A link stays one: what it leads to is replaced.
    let path = &path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let written = std::fs::create_dir_all(folder).and_then(|()| {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".views-");
        // A temporary file is its owner's alone; a scene is as public as any other file.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut temporary = builder.tempfile_in(folder)?;
        temporary.write_all(text.as_bytes())?;
        temporary.as_file().sync_all()?;
        temporary.persist(path).map_err(|error| error.error)?;
        Ok(())
    });
    written.map_err(|source| SceneError::Write { path: path.clone(), source })
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::*;
    use std::fs;

    fn view(name: &str) -> View {
        View {
            name: name.into(),
            eye: [0.1, 1e-9, -3.25],
            target: [1.0, 0.7, 1e7],
            up: [0.0, 1.0, 0.0],
            vfov_degrees: 33.3,
        }
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    #[test]
    fn a_model_gets_its_views_and_the_new_one_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let model = folder.path().join("thing.obj");
        fs::write(&model, TRIANGLE).unwrap();
        let spec = model.to_str().unwrap();
        let search = SearchPath::only([]);
        let placed = load(spec, &search).unwrap().views;
        for (count, name) in [(1, "saved_1"), (2, "a \"b\"")] {
            let path = keep_view(spec, &search, folder.path(), &placed, &view(name)).unwrap();
            assert_eq!(path, folder.path().join("thing.views.json"));
            let views = load(spec, &search).unwrap().views;
            assert_eq!(views[..placed.len()], placed);
            assert_eq!((views.len(), views.last()), (placed.len() + count, Some(&view(name))));
        }
        let error = keep_view(spec, &search, folder.path(), &placed, &view("saved_1")).unwrap_err();
        assert!(error.to_string().contains("already"), "{error}");
        let blind = View { target: view("x").eye, ..view("x") };
        assert!(keep_view(spec, &search, folder.path(), &placed, &blind).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "nothing else is left behind");
    }

    #[test]
    fn a_built_in_scene_gets_a_descriptor_that_is_found_from_then_on() {
        let folder = tempfile::tempdir().unwrap();
        let search = SearchPath::only([folder.path().to_owned()]);
        let before = load("cornell", &search).unwrap().views;
        for name in ["saved_1", "saved_2"] {
            let path =
                keep_view("cornell:triangles=500", &search, folder.path(), &before, &view(name)).unwrap();
            assert_eq!(path, folder.path().join("cornell.toml"));
        }
        let after = load("cornell", &search).unwrap().views;
        assert_eq!(after[..before.len()], before);
        assert_eq!(after[before.len()..], [view("saved_1"), view("saved_2")]);
        let text = fs::read_to_string(folder.path().join("cornell.toml")).unwrap();
        assert!(text.contains("# The room is closed"), "comments stay");
        assert!(text.contains("eye = [0.1, 1e-9, -3.25]"), "{text}");
    }

    #[test]
    fn views_that_were_placed_are_written_too() {
        let folder = tempfile::tempdir().unwrap();
        let search = SearchPath::only([folder.path().to_owned()]);
        let head = "title = 't'\nlicence = 'l'\ncredit = 'c'\n";
        let path = folder.path().join("mine.toml");
        fs::write(&path, format!("{head}[source]\nfile = 'mine.obj'")).unwrap();
        fs::write(folder.path().join("mine.obj"), TRIANGLE).unwrap();
        let placed = load("mine", &search).unwrap().views;
        keep_view("mine", &search, Path::new("/nowhere"), &placed, &view("saved_1")).unwrap();
        let views = load("mine", &search).unwrap().views;
        assert_eq!((views.len(), &views[..placed.len()]), (placed.len() + 1, placed.as_slice()));

        let old = format!(
            "{head}view = [{{ name = 'x', eye = [0, 0, 0], target = [1, 0, 0], vfov_degrees = 40 }}]\n\
                           [source]\nfile = 'mine.obj'\n"
        );
        fs::write(&path, &old).unwrap();
        let error = keep_view("mine", &search, folder.path(), &placed, &view("y")).unwrap_err().to_string();
        assert!(error.contains("by hand") && error.contains("[[view]]"), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), old);
    }
}
