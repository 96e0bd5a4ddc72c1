//! One section a scene: what it is, its pictures, and every sample of its points.

use super::chapter::Chapter;
use super::number::{count, gap, grouped, short};
use super::origin::fact;
use super::{picture, samples};
use crate::select::{self, Entry};
use maud::{Markup, html};
use record::{Scene, Source};

/// The pictures of a record together are not larger than this, in bytes of the page.
const TOGETHER: usize = 24 << 20;

/// The scenes of a chapter.
pub fn markup(chapter: &Chapter) -> Markup {
    let mut left = TOGETHER;
    let budget = samples::Budget::new(&chapter.selection);
    html! {
        p.remark { (budget.remark()) }
        @for (index, scene) in chapter.selection.scenes().into_iter().enumerate() {
            section id=(chapter.id(&format!("s{index}"))) {
                h4 { (scene) }
                (of_scene(chapter, scene, &mut left, budget))
            }
        }
    }
}

fn of_scene(chapter: &Chapter, name: &str, left: &mut usize, budget: samples::Budget) -> Markup {
    let entries: Vec<&Entry> =
        chapter.selection.entries.iter().filter(|entry| entry.scene() == name).collect();
    // A generated scene may be there in several sizes.
    let scenes = select::in_order(entries.iter().map(|entry| &entry.point.scene).map(identity));
    let shown: Vec<&Scene> = scenes
        .iter()
        .filter_map(|of| entries.iter().map(|entry| &entry.point.scene).find(|scene| identity(scene) == *of))
        .collect();
    html! {
        @for scene in shown { (facts(scene)) }
        (pictures(chapter, &entries, left))
        @for entry in &entries { (samples::markup(chapter, entry, budget)) }
    }
}

/// What makes two scenes one, however long they took to load.
fn identity(scene: &Scene) -> (&Source, u64) {
    (&scene.source, scene.triangles)
}

fn facts(scene: &Scene) -> Markup {
    html! {
        dl.facts {
            (fact("Triangles", html! { (grouped(scene.triangles)) }))
            @match &scene.source {
                Source::File { name, sha256 } => {
                    (fact("File", html! { code { (name) } }))
                    (fact("SHA-256", html! { code { (sha256) } }))
                }
                Source::Generator { name, parameters, sha256 } => {
                    (fact("Generator", html! {
                        (name)
                        @for (index, (name, value)) in parameters.0.iter().enumerate() {
                            @if index == 0 { ": " } @else { ", " } (name) "=" (select::text(value))
                        }
                    }))
                    @if let Some(sha256) = sha256 { (fact("SHA-256", html! { code { (sha256) } })) }
                }
            }
            (fact("Left out", html! {
                @if scene.skipped.is_empty() { "no triangle" }
                @for (index, (reason, number)) in scene.skipped.iter().enumerate() {
                    @if index > 0 { ", " } (grouped(*number)) " " (reason)
                }
            }))
            (fact("Loaded in", if scene.load_milliseconds > 0.0 {
                html! { (short(scene.load_milliseconds)) " ms" }
            } else {
                gap("not recorded")
            }))
        }
    }
}

/// Each picture once, with the view that it is from.
fn pictures(chapter: &Chapter, entries: &[&Entry], left: &mut usize) -> Markup {
    let mut named: Vec<(&str, String)> = Vec::new();
    for entry in entries {
        for view in &entry.point.views {
            for name in &view.pictures {
                if named.iter().all(|(other, _)| other != name) {
                    named.push((name, format!("{}, view {}", entry.variant(), view.name)));
                }
            }
        }
    }
    let mut shown = Vec::new();
    let mut missing = Vec::new();
    for (name, about) in &named {
        let mut picture = picture::find(chapter.source.folder.as_deref(), name);
        if let picture::Picture::Inside(url) = &picture {
            if url.len() > *left {
                picture = picture::Picture::Named("there are too many pictures for one page".into());
            } else {
                *left -= url.len();
            }
        }
        let figure = picture::figure(&picture, name, about);
        if matches!(picture, picture::Picture::Inside(_)) { shown.push(figure) } else { missing.push(figure) }
    }
    html! {
        @if !shown.is_empty() { div.pictures { @for one in &shown { (one) } } }
        @if missing.len() > 3 {
            details { summary { (count(missing.len(), "picture")) " named and not shown" } @for one in &missing { (one) } }
        } @else { @for one in &missing { (one) } }
    }
}
