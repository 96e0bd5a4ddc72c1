//! The descriptors that come with the program, so that it works from any folder.

use std::path::Path;

use super::{Descriptor, SceneError, Source};

/// A descriptor inside the binary.
#[derive(Clone, Copy, Debug)]
pub struct BuiltIn {
    /// The scene's name.
    pub name: &'static str,
    toml: &'static str,
}

impl BuiltIn {
    /// The descriptor as it is written.
    pub(super) fn text(&self) -> &'static str {
        self.toml
    }

    /// The parsed descriptor.
    ///
    /// # Errors
    /// Only if the program was built with a broken descriptor; a test parses them all.
    pub fn descriptor(&self) -> Result<Descriptor, SceneError> {
        Descriptor::parse(Path::new(&format!("scenes/{}.toml", self.name)), self.toml)
    }
}

macro_rules! table {
    ($($name:literal)*) => {
        &[$(BuiltIn { name: $name, toml: include_str!(concat!("../../../../scenes/", $name, ".toml")) }),*]
    };
}

/// One line per file in `scenes/`; generators first, because they need nothing.
const TABLE: &[BuiltIn] = table![
    "cornell" "sphereflake" "hairball" "city" "forest"
    "bistro_exterior" "bistro_interior" "kitchen" "sponza" "breakfast_room" "white_room" "staircase"
    "living_room" "lucy" "bunny" "teapot"
];

/// Every descriptor that comes with the program.
pub fn built_in() -> &'static [BuiltIn] {
    TABLE
}

/// The built-in scene whose file has that hash.
pub(super) fn by_hash(sha256: &str) -> Option<(&'static str, Descriptor)> {
    TABLE.iter().find_map(|entry| {
        let descriptor = entry.descriptor().ok()?;
        let same = matches!(&descriptor.source, Source::File { sha256: Some(hash), .. } if hash == sha256);
        same.then_some((entry.name, descriptor))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_descriptor_is_complete() {
        for entry in built_in() {
            let d = entry.descriptor().unwrap();
            assert!(d.views.len() >= 8, "{}", entry.name);
            assert!(!d.title.is_empty() && !d.licence.is_empty() && !d.credit.is_empty(), "{}", entry.name);
            assert!(d.sky.is_some(), "{}", entry.name);
            let mut names: Vec<_> = d.views.iter().map(|view| &view.name).collect();
            names.sort();
            names.dedup();
            assert_eq!(names.len(), d.views.len(), "{}: view names repeat", entry.name);
            match d.source {
                Source::File { sha256, triangles, .. } => {
                    assert_eq!(sha256.unwrap().len(), 64, "{}", entry.name);
                    assert!(triangles.is_some(), "{}", entry.name);
                    assert!(d.get.contains("http"), "{}: where does a user get it?", entry.name);
                }
                Source::Generator { generator, .. } => assert_eq!(generator.name(), entry.name),
                Source::Models(_) => panic!("{}: a scene that comes along is one file", entry.name),
            }
        }
    }

    #[test]
    fn the_table_names_every_file_in_the_folder() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let mut files: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|e| e == "toml"))
            .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
            .collect();
        files.sort();
        let mut table: Vec<&str> = built_in().iter().map(|entry| entry.name).collect();
        table.sort_unstable();
        assert_eq!(files, table);
    }

    #[test]
    fn a_file_is_recognised_by_its_hash() {
        let (name, _) = by_hash("428e7f634ce1e5dda00e4ddc05be6b92ddf80b791532ae8fc1aa4e6eb826f5db").unwrap();
        assert_eq!(name, "sponza");
        assert!(by_hash("00").is_none());
    }
}
