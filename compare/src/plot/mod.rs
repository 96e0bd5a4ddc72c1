//! `compare plot`: records as pictures, for print and for pages.
//!
//! ```text
//!   Selection ─► one file a kind ─► Chart: plain data ─► draw: Sketch ─► SVG or PNG
//! ```
//!
//! A [`Chart`] has values and names and no places; [`draw`] gives them places, in units of the picture; only the
//! last step knows the kind of file, so both kinds show the same. [`theme`] has every colour and size.

pub mod build;
pub mod chart;
pub mod cost;
pub mod draw;
pub mod frames;
pub mod join;
pub mod names;
pub mod notes;
pub mod overall;
pub mod pairs;
pub mod ratios;
pub mod records;
pub mod roofline;
pub mod samples;
pub mod scenes;
pub mod sweep;
pub mod theme;

pub use chart::Chart;

use crate::diff::Named;
use crate::load::load;
use crate::select::{Filter, REFERENCE, Selection};
use crate::{Exit, say};
use anyhow::Context;
use notes::Found;
use record::Record;
use std::fmt;
use std::path::{Path, PathBuf};

/// What `compare plot` takes.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Records; what they have of one run, such as other scenes, is drawn together.
    #[arg(required = true, value_name = "RECORD")]
    pub records: Vec<PathBuf>,
    /// Folder for the pictures; files of the same names are replaced.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// What kind of files.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Only pictures of this kind [may be given several times]
    #[arg(long, value_enum, value_name = "KIND")]
    pub only: Vec<Kind>,
    /// Draw records of different devices, drivers, clocks, methods or sizes together too, and say so below each picture
    #[arg(long)]
    pub anyway: bool,
    /// The variant that others are relative to.
    #[arg(long, value_name = "VARIANT", default_value = REFERENCE)]
    pub reference: String,
    /// What the device can do at best, as `runner roofline -o FILE` has measured it; adds pictures of that kind.
    #[arg(long, value_name = "FILE")]
    pub roofline: Option<PathBuf>,
    /// Which points.
    #[command(flatten)]
    pub filter: Filter,
}

/// What kind of files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// SVG, which stays sharp and can be edited.
    Svg,
    /// PNG, 1920 pixels across.
    Png,
    /// Both.
    #[default]
    Both,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// All variants over all scenes, relative to one.
    Overall,
    /// The variants on each scene, relative to one.
    Scenes,
    /// What a word of a name changes, such as Quantized.
    Pairs,
    /// What changed from the first record to the second.
    Records,
    /// What the value of a parameter does, with the time of sampling.
    Sweep,
    /// Where the time of builds goes.
    Build,
    /// Cost by the number of triangles.
    Cost,
    /// Samples one after another, with the clock.
    Samples,
    /// The time of frames as a camera goes around a scene.
    Frames,
    /// How near the kernels come to what the device can do at best; takes --roofline.
    Roofline,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 10] = [
        Kind::Overall,
        Kind::Scenes,
        Kind::Pairs,
        Kind::Records,
        Kind::Sweep,
        Kind::Build,
        Kind::Cost,
        Kind::Samples,
        Kind::Frames,
        Kind::Roofline,
    ];
}

impl fmt::Display for Kind {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.pad(match self {
            Kind::Overall => "overall",
            Kind::Scenes => "scenes",
            Kind::Pairs => "pairs",
            Kind::Records => "records",
            Kind::Sweep => "sweep",
            Kind::Build => "build",
            Kind::Cost => "cost",
            Kind::Samples => "samples",
            Kind::Frames => "frames",
            Kind::Roofline => "roofline",
        })
    }
}

/// The charts of one kind that a selection has. `Kind::Records` needs two records, see [`records::charts`], and
/// `Kind::Roofline` what the device can do, see [`roofline::charts`].
pub fn charts(selection: &Selection, kind: Kind, reference: &str) -> Found {
    match kind {
        Kind::Overall => overall::charts(selection, reference),
        Kind::Scenes => scenes::charts(selection, reference),
        Kind::Pairs => pairs::charts(selection),
        Kind::Records => Found::nothing("it takes two records that have points in common"),
        Kind::Sweep => sweep::charts(selection),
        Kind::Build => build::charts(selection),
        Kind::Cost => cost::charts(selection, reference),
        Kind::Samples => samples::charts(selection),
        Kind::Frames => frames::charts(selection),
        Kind::Roofline => {
            Found::nothing("it takes what `runner roofline -o FILE` measures, as --roofline FILE")
        }
    }
}

/// A chart as SVG, for a file or for a page; [`theme::dark_css`] makes it fit for dark pages.
pub fn svg(chart: &Chart) -> String {
    draw::svg(&draw::draw(chart))
}

/// A chart as PNG, on white.
///
/// # Errors
/// The font cannot be drawn, or the picture cannot be encoded.
pub fn png(chart: &Chart) -> anyhow::Result<Vec<u8>> {
    draw::png(&draw::draw(chart)).with_context(|| format!("cannot make the picture {}", chart.name))
}

/// `compare plot`.
///
/// # Errors
/// A record cannot be read, several do not belong together, nothing of what was asked for can be drawn, or a file cannot be written.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let records: Vec<Record> = arguments.records.iter().map(load).collect::<Result<_, _>>()?;
    let named: Vec<Named> =
        arguments.records.iter().zip(&records).map(|(path, record)| Named::new(path, record)).collect();
    let obstacles = join::obstacles(&named, &arguments.filter);
    anyhow::ensure!(
        obstacles.is_empty() || arguments.anyway,
        "not comparable:\n  {}\nDraw them one by one, or with --anyway all the same.",
        obstacles.join("\n  ")
    );
    let roofline =
        arguments.roofline.as_ref().map(|path| crate::roofline::load(path, &records)).transpose()?;
    let joined = join::join(&records)?;
    let selection = Selection::filtered(&joined, &arguments.filter)?;
    let unvaried = ratios::unvaried(&selection);
    let several: Vec<&str> =
        selection.variants().into_iter().filter(|variant| !unvaried.contains(variant)).collect();
    if !several.is_empty() {
        say(format_args!(
            "only in sweep, because measured with several sets of parameters: {}",
            several.join(", ")
        ));
    }
    let kinds = if arguments.only.is_empty() { &Kind::ALL[..] } else { &arguments.only };
    let mut charts = Vec::new();
    for &kind in kinds {
        let mut found = match (kind, &records[..]) {
            (Kind::Roofline, _) if roofline.is_some() => {
                roofline.as_ref().map(|roofline| roofline::charts(&selection, roofline)).unwrap_or_default()
            }
            (Kind::Records, [old, new]) => records::charts(
                &Selection::filtered(old, &arguments.filter)?,
                &Selection::filtered(new, &arguments.filter)?,
            ),
            _ => self::charts(&selection, kind, &arguments.reference),
        };
        if kind != Kind::Records {
            found.charts.iter_mut().for_each(|chart| notes::mark(chart, &obstacles));
        }
        // That records have no points in common, or that there is no orbit or roofline, is no news unless somebody asked.
        let asked = !arguments.only.is_empty();
        let expected = ![Kind::Records, Kind::Frames].contains(&kind);
        if asked || (expected && (kind != Kind::Roofline || roofline.is_some())) {
            found.remarks.iter().for_each(|remark| say(format_args!("left out of {kind}: {remark}")));
        }
        charts.extend(found.charts);
    }
    anyhow::ensure!(
        !charts.is_empty(),
        "nothing of that can be drawn from {}; the lines above say why",
        arguments.records.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
    );
    write(&charts, &arguments.output, arguments.format)?;
    Ok(Exit::Done)
}

/// Writes the charts into a folder, and says how many files there are.
///
/// # Errors
/// A picture cannot be made, or its file not written.
pub fn write(charts: &[Chart], folder: &Path, format: Format) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let mut files = 0;
    for chart in charts {
        let sketch = draw::draw(chart);
        let mut put = |ending: &str, bytes: &[u8]| {
            let path = folder.join(format!("{}.{ending}", chart.name));
            files += 1;
            std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
        };
        if format != Format::Png {
            put("svg", draw::svg(&sketch).as_bytes())?;
        }
        if format != Format::Svg {
            put("png", &draw::png(&sketch)?)?;
        }
    }
    say(format_args!("{files} files in {}", folder.display()));
    Ok(())
}
