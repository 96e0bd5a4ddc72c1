//! Reads files and options, one on top of the other.

use super::{
    Config, Samples,
    axis::{self, Axis},
    check,
    document::{AxisEntry, Document, SamplesEntry, SamplesTable},
    schema::SCHEMA,
    set::Set,
    source::{Mistake, Mistakes, Place, Source, instead, report},
    value, views, when,
};
use crate::params::{self, Params};
use crate::variant::Variant;
use anyhow::{Context, anyhow, bail};
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};
use toml::{
    Spanned,
    de::{DeTable, DeValue, Deserializer},
};
use tracer::scene::{self, SceneError, SearchPath};

/// A config under construction.
pub struct Reader<'s> {
    search: &'s SearchPath,
    config: Config,
    /// Where the condition of each set is.
    conditions: Vec<Place>,
    /// Files that are being read, each included by the one before.
    open: Vec<PathBuf>,
}

impl<'s> Reader<'s> {
    /// Nothing is read.
    pub fn new(search: &'s SearchPath) -> Self {
        Self { search, config: Config::default(), conditions: Vec::new(), open: Vec::new() }
    }

    /// Reads the experiment's own file, under which `includes` come last.
    pub fn main_file(&mut self, path: &Path, includes: &[PathBuf]) -> anyhow::Result<()> {
        let place =
            |file: &Path| Mistakes::new(Source::Option(format!("--include {}", file.display()))).place(0..0);
        let includes = includes.iter().map(|file| (file.clone(), place(file))).collect();
        self.file(path, includes).with_context(|| format!("cannot read {}", path.display()))?
    }

    /// Reads a file after what it includes. The outer error is that it cannot be read at all.
    fn file(
        &mut self,
        path: &Path,
        includes: Vec<(PathBuf, Place)>,
    ) -> Result<anyhow::Result<()>, std::io::Error> {
        let text = std::fs::read_to_string(path)?;
        self.open.push(path.canonicalize()?);
        let read = self.text(path, text, includes);
        self.open.pop();
        Ok(read)
    }

    fn text(&mut self, path: &Path, text: String, includes: Vec<(PathBuf, Place)>) -> anyhow::Result<()> {
        let mut mistakes = Mistakes::new(Source::File { path: path.to_owned(), text });
        let source = mistakes.source.clone();
        let Source::File { text, .. } = &*source else { unreachable!("made so above") };
        let Some(document) = parse(text, &mut mistakes) else { return mistakes.none() };
        let folder = path.parent().unwrap_or(Path::new(""));
        let own = document.include.iter().flatten();
        let own = own.map(|file| (folder.join(file.get_ref()), mistakes.place(file.span())));
        for (file, place) in own.chain(includes) {
            if file.canonicalize().is_ok_and(|file| self.open.contains(&file)) {
                bail!("{place}: {} includes itself", file.display());
            }
            self.file(&file, Vec::new())
                .map_err(|error| anyhow!("{place}: cannot read {}: {error}", file.display()))??;
        }
        self.apply(document, &mut mistakes);
        mistakes.none()
    }

    /// Reads what stands behind `--set`.
    pub fn option(&mut self, option: &str) -> anyhow::Result<()> {
        let mut mistakes = Mistakes::new(Source::Option(format!("--set {option}")));
        let Some((name, text)) = option.split_once('=').map(|(name, text)| (name.trim(), text.trim())) else {
            bail!("--set {option}: write NAME=VALUE");
        };
        let settings = settings();
        let parameters = Params::default().by_name().0;
        if let Some((_, schema)) = settings.iter().find(|(setting, _)| setting == name) {
            if let Some(document) = parse(&format!("{name} = {}", toml_of(text, schema)), &mut mistakes) {
                self.apply(document, &mut mistakes);
            }
        } else if !parameters.contains_key(name) {
            let known = settings.iter().map(|(name, _)| name).chain(parameters.keys());
            let instead = instead(name, known.map(String::as_str));
            mistakes.add(0..0, format_args!("there is no {name}{instead}"));
        } else if self.config.axes.iter().any(|axis| axis.parameter == name) {
            let message = format!("{name} is an axis here; write --only {name}={text}");
            mistakes.add(0..0, message);
        } else {
            match value::of(name, &params::value(text)) {
                Ok(value) => {
                    let mut set = Set::default();
                    set.parameters.set(name, value);
                    self.config.sets.push(set);
                    self.conditions.push(mistakes.place(0..0));
                }
                Err(error) => mistakes.add(0..0, error),
            }
        }
        mistakes.none()
    }

    /// What was read, after checks of what sources say about each other.
    pub fn finish(self) -> anyhow::Result<Config> {
        let mut wrong = Vec::new();
        for (set, place) in self.config.sets.iter().zip(&self.conditions) {
            for message in set.when.never(&self.config.axes) {
                wrong.push(Mistake { place: place.clone(), message });
            }
        }
        report(&wrong)?;
        Ok(self.config)
    }

    /// Puts a document on top of what was read before.
    fn apply(&mut self, document: Document, mistakes: &mut Mistakes) {
        let config = &mut self.config;
        // Named one by one, so that a new key cannot be forgotten here.
        let Document {
            title,
            include: _,
            scenes,
            variants,
            views,
            size,
            method,
            depth,
            seed,
            builds,
            warm_up,
            samples,
            order,
            set,
            axis,
        } = document;
        replace(&mut config.title, title);
        if let Some(scenes) = scenes {
            config.scenes =
                each_once(scenes.iter().filter_map(|scene| self::scene(scene, self.search, mistakes)));
        }
        if let Some(patterns) = variants {
            let mut known = true;
            for pattern in &patterns {
                known &= !when::variants(pattern.get_ref(), pattern.span(), mistakes).is_empty();
            }
            let place = patterns.first().map_or(0..0, Spanned::span);
            let patterns: Vec<String> = patterns.iter().map(|pattern| pattern.get_ref().clone()).collect();
            match Variant::select(&patterns) {
                Ok(variants) => config.variants = variants,
                Err(error) if known => mistakes.add(place, error),
                Err(_) => {}
            }
        }
        if let Some(views) = views {
            if let Err(error) = views::each(views.get_ref()) {
                mistakes.add(views.span(), error);
            }
            config.views = Some(views.into_inner());
        }
        config.size = size.or(config.size);
        replace(&mut config.method, method);
        config.depth = depth.or(config.depth);
        replace(&mut config.seed, seed);
        config.builds = builds.or(config.builds);
        replace(&mut config.warm_up, warm_up);
        if let Some(samples) = samples {
            let span = samples.span();
            config.samples.apply(samples.into_inner());
            if let Samples { least: Some(least), most: Some(most), .. } = config.samples
                && least > most
            {
                mistakes.add(span, format_args!("`least` ({least}) is more than `most` ({most})"));
            }
        }
        if let Some(order) = order {
            replace(&mut config.order.seed, order.seed);
            replace(&mut config.order.reference_every, order.reference_every);
        }
        for entry in set.iter().flatten() {
            config.sets.push(Set::read(entry, mistakes));
            self.conditions.push(mistakes.place(entry.when.as_ref().map_or(0..0, Spanned::span)));
        }
        if let Some(entries) = axis {
            config.axes = entries.iter().map(|entry| Axis::read(entry, mistakes)).collect();
            check_together(&entries, &config.axes, mistakes);
        }
    }
}

impl Samples {
    fn apply(&mut self, entry: SamplesEntry) {
        match entry {
            SamplesEntry::Exactly(count) => (self.least, self.most) = (Some(count), Some(count)),
            SamplesEntry::Until(SamplesTable { least, most, half_width, time, least_clock }) => {
                self.least = least.or(self.least);
                self.most = most.or(self.most);
                replace(&mut self.half_width, half_width.map(|share| share.0));
                replace(&mut self.time, time.map(|time| time.0));
                replace(&mut self.least_clock, least_clock.map(|share| share.0));
            }
        }
    }
}

/// Text to a document that agrees with the schema. Nothing where something is wrong, which is noted.
fn parse(text: &str, mistakes: &mut Mistakes) -> Option<Document> {
    let read = DeTable::parse(text).and_then(|table| {
        check::check(&table, &SCHEMA, mistakes);
        // What is left are texts that are not what they should be, such as sizes: the first is named.
        if mistakes.is_empty() {
            Document::deserialize(Deserializer::from(table)).map(Some)
        } else {
            Ok(None)
        }
    });
    read.unwrap_or_else(|error| {
        mistakes.add(error.span().unwrap_or_default(), error.message());
        None
    })
}

/// What `--set` can change besides parameters, and its schema: `depth`, `samples`, `samples.most` and so on.
fn settings() -> Vec<(String, &'static Value)> {
    let of = |schema: &'static Value| schema["properties"].as_object().into_iter().flatten();
    let mut settings = Vec::new();
    for (name, schema) in of(&SCHEMA).filter(|(name, _)| !["include", "set", "axis"].contains(&name.as_str()))
    {
        if check::kinds(schema) != ["object"] {
            settings.push((name.clone(), schema));
        }
        settings.extend(of(schema).map(|(inner, schema)| (format!("{name}.{inner}"), schema)));
    }
    settings
}

/// The value of an option as TOML: texts go without quotes there, and one of a list without brackets.
fn toml_of(text: &str, schema: &Value) -> String {
    let quoted = || toml::Value::from(text).to_string();
    match check::kinds(schema).as_slice() {
        ["string"] => quoted(),
        ["array"] if !text.starts_with('[') => format!("[{}]", quoted()),
        _ if DeValue::parse(text).is_ok() => text.to_owned(),
        _ => quoted(),
    }
}

/// A scene that could be loaded if its file were there; what is wrong with it is noted.
fn scene(spec: &Spanned<String>, search: &SearchPath, mistakes: &mut Mistakes) -> Option<String> {
    let (span, spec) = (spec.span(), spec.get_ref());
    match scene::check(spec, search) {
        Ok(()) => return Some(spec.clone()),
        Err(SceneError::UnknownScene { name, .. }) => {
            let instead = instead(&name, scene::built_in().iter().map(|known| known.name));
            mistakes.add(span, format_args!("no scene is called {name:?}{instead}"));
        }
        Err(error) => mistakes.add(span, error),
    }
    None
}

/// What axes must be to each other.
fn check_together(entries: &[Spanned<AxisEntry>], axes: &[Axis], mistakes: &mut Mistakes) {
    for (i, (entry, axis)) in entries.iter().map(Spanned::get_ref).zip(axes).enumerate() {
        let parameter = &axis.parameter;
        if axes[..i].iter().any(|other| other.parameter == *parameter) {
            mistakes.add(entry.parameter.span(), format_args!("{parameter} is an axis already"));
        }
        if let Some(zip) = &entry.zip {
            let word = zip.get_ref();
            let same = |other: &&Axis| other.zip.as_ref() == Some(word);
            let first = axes.iter().find(same).expect("at least this one");
            let (count, other) = (axis.values.len(), first.values.len());
            if count != other {
                let other = format!("{} has {other} values and {parameter} has {count}", first.parameter);
                mistakes.add(zip.span(), format_args!("axes zipped as {word:?} differ in length: {other}"));
            } else if axes.iter().filter(same).count() == 1 {
                let others = axes.iter().filter_map(|axis| axis.zip.as_deref()).filter(|other| other != word);
                let instead = instead(word, others);
                mistakes.add(zip.span(), format_args!("no other axis is zipped as {word:?}{instead}"));
            }
        }
        if let Some(when) = &entry.when {
            for message in axis.when.never(axes) {
                mistakes.add(when.span(), message);
            }
        }
    }
    if let Err(waiting) = axis::groups(axes) {
        let place = entries[waiting].get_ref().parameter.span();
        mistakes.add(place, format_args!("the condition of {} is about itself", axes[waiting].parameter));
    }
}

fn replace<T>(old: &mut T, new: Option<T>) {
    if let Some(new) = new {
        *old = new;
    }
}

fn each_once<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    let mut once = Vec::new();
    for one in all {
        if !once.contains(&one) {
            once.push(one);
        }
    }
    once
}
