//! What the reader lets through, to everything that shows it: text, tables, pictures and pages come of it, or an
//! error.
#![no_main]

use clap::Parser;
use compare::diff::{Named, Thresholds, commit, compare as compared, markdown, terminal};
use compare::load::parse;
use compare::plot;
use compare::report::{Source, html};
use compare::select::{Filter, REFERENCE, Selection};
use compare::tables::{Input, Kind, latex, markdown as tables_markdown};
use libfuzzer_sys::fuzz_target;
use std::path::Path;
use std::sync::LazyLock;

/// A record to compare with.
static SOUND: LazyLock<record::Record> = LazyLock::new(record::example);

/// The arguments of `compare csv`.
#[derive(Parser)]
struct Csv {
    #[command(flatten)]
    arguments: compare::csv::Arguments,
}

fuzz_target!(|text: &[u8]| {
    let path = Path::new("fuzzed");
    let Ok(record) = parse(text, path) else { return };
    for (old, new) in [(&record, &*SOUND), (&*SOUND, &record), (&record, &record)] {
        let (old, new) = (Named::new(path, old), Named::new(path, new));
        if let Ok(comparison) = compared(old, new, &Filter::default(), Thresholds::default()) {
            let _ = (commit::text(&comparison), terminal::text(&comparison), markdown::text(&comparison));
            serde_json::to_string(&comparison).unwrap();
        }
    }
    for options in [&[][..], &["--wide", "figure"], &["--wide", "scene", "--relative-to", REFERENCE]] {
        let all = ["compare csv", "fuzzed"].iter().chain(options);
        let _ = compare::csv::csv(&record, &Csv::parse_from(all).arguments);
    }
    let records = [record];
    for kind in Kind::ALL {
        if let Ok(input) = Input::new(&records, &Filter::default(), None)
            && let Ok(tables) = kind.tables(&input)
        {
            let _ = (latex::document(&tables), tables_markdown::page(&tables));
        }
    }
    let selection = Selection::new(&records[0]);
    for kind in plot::Kind::ALL {
        for chart in plot::charts(&selection, kind, REFERENCE).charts {
            assert!(plot::svg(&chart).ends_with("</svg>\n"));
        }
    }
    let source = Source { name: "fuzzed".into(), folder: None, record: &records[0] };
    html(&[source], REFERENCE, &Filter::default()).unwrap();
});
