//! Messages and progress on stderr.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::{fmt, time::Duration};

/// Says something on stderr unless the user wants quiet.
pub fn remark(quiet: bool, text: fmt::Arguments<'_>) {
    if !quiet {
        eprintln!("{text}");
    }
}

/// A bar over `length` steps with the time left; nothing where stderr is no terminal.
pub fn bar(length: u64, quiet: bool) -> ProgressBar {
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let bar = ProgressBar::with_draw_target(Some(length), target);
    let style = ProgressStyle::with_template("{bar:24} {percent:>3}% {eta:>4} left  {wide_msg}");
    bar.set_style(style.expect("the template is sound"));
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}
