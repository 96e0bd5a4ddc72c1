//! Rendered pictures and heat maps that a record names, from files beside it.

use super::number::bytes;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use maud::{Markup, html};
use std::fs;
use std::path::{Component, Path};

/// Larger files are named only.
pub const LARGEST: u64 = 4 << 20;

/// A picture, or why it is not there.
#[derive(Clone, Debug, PartialEq)]
pub enum Picture {
    /// It is in the page, as this URL.
    Inside(String),
    /// It is not, for this reason.
    Named(String),
}

/// Looks for a picture beside the record and takes it in.
///
/// A record may come from anybody, and the page may go to anybody. So only a picture that lies in the record's
/// folder is taken, whatever path the record names.
pub fn find(folder: Option<&Path>, name: &str) -> Picture {
    let named = |why: &str| Picture::Named(why.to_owned());
    let Some(folder) = folder else { return named("the record is in no folder") };
    let inside = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    if !Path::new(name).components().all(inside) {
        return named("not beside the record");
    }
    let path = folder.join(name);
    let (Ok(path), Ok(folder)) = (path.canonicalize(), folder.canonicalize()) else {
        return named("the file is not there");
    };
    if !path.starts_with(folder) {
        return named("not beside the record");
    }
    match fs::metadata(&path) {
        Ok(data) if !data.is_file() => return named("no file"),
        Ok(data) if data.len() > LARGEST => {
            return Picture::Named(format!("{} are too much for a page", bytes(data.len())));
        }
        Ok(_) => {}
        Err(error) => return Picture::Named(error.to_string()),
    }
    match fs::read(&path) {
        Ok(content) => match media_type(&content) {
            Some(kind) => Picture::Inside(format!("data:{kind};base64,{}", BASE64_STANDARD.encode(content))),
            None => named("neither PNG nor JPEG"),
        },
        Err(error) => Picture::Named(error.to_string()),
    }
}

/// By what is in the file: its name may say anything.
fn media_type(content: &[u8]) -> Option<&'static str> {
    match content {
        [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        _ => None,
    }
}

/// The picture with its caption.
pub fn figure(picture: &Picture, name: &str, about: &str) -> Markup {
    html! {
        @match picture {
            Picture::Inside(url) => {
                figure.picture { img src=(url) alt=(format!("{about}: {name}")) loading="lazy"; figcaption { (about) ": " code { (name) } } }
            }
            Picture::Named(why) => { p.remark { (about) ": " code { (name) } " is not shown: " (why) "." } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PNG: &[u8] = b"\x89PNG\r\n\x1a\nrest";

    fn why(folder: &Path, name: &str) -> String {
        match find(Some(folder), name) {
            Picture::Named(why) => why,
            inside => panic!("{inside:?}"),
        }
    }

    #[test]
    fn a_picture_beside_the_record_is_taken_in() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("heat")).unwrap();
        fs::write(folder.path().join("heat/a.png"), PNG).unwrap();
        let expected = Picture::Inside("data:image/png;base64,iVBORw0KGgpyZXN0".into());
        assert_eq!(find(Some(folder.path()), "heat/a.png"), expected);
        assert_eq!(find(Some(folder.path()), "./heat/a.png"), expected);
    }

    #[test]
    fn nothing_else_of_the_computer_gets_into_the_page() {
        let folder = tempfile::tempdir().unwrap();
        let record = folder.path().join("record");
        fs::create_dir(&record).unwrap();
        fs::write(folder.path().join("secret.png"), PNG).unwrap();
        fs::write(record.join("text.png"), "no picture").unwrap();
        fs::write(record.join("huge.png"), vec![0; LARGEST as usize + 1]).unwrap();
        assert_eq!(why(&record, "../secret.png"), "not beside the record");
        let absolute = folder.path().join("secret.png");
        assert_eq!(why(&record, absolute.to_str().unwrap()), "not beside the record");
        assert_eq!(why(&record, "text.png"), "neither PNG nor JPEG");
        assert_eq!(why(&record, "nowhere.png"), "the file is not there");
        assert_eq!(why(&record, "."), "no file");
        assert!(why(&record, "huge.png").contains("too much"));
        assert_eq!(why(&record, "nul\0.png"), "the file is not there");
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(folder.path().join("secret.png"), record.join("link.png")).unwrap();
            assert_eq!(why(&record, "link.png"), "not beside the record");
        }
    }
}
