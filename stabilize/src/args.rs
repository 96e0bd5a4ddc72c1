//! The command line.

use crate::clocks::Wanted;
use crate::hold::RestoreTo;
use clap::{Args, Parser, Subcommand};
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

/// Runs CMD with the GPU's clocks held still and the screen kept awake, puts everything back, and says whether
/// the run can be trusted.
///
/// The graphics clock is locked to 0.98 of what the GPU reaches, the memory clock to its highest, and persistence
/// mode is turned on. When CMD has ended, everything is as it was before, and the driver's counters tell whether
/// heat or power slowed the GPU down meanwhile. What cannot be done is said on stderr, and CMD runs all the same,
/// unless --strict.
#[derive(Debug, Parser)]
#[command(
    version,
    override_usage = "stabilize [OPTIONS] -- CMD [ARG…]\n       stabilize status | restore | doctor",
    args_override_self = true,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_long_help = MORE,
    after_help = "--help tells more: exit status, signals, what sudo changes, examples."
)]
pub struct Cli {
    #[command(subcommand)]
    pub tool: Option<Tool>,
    #[command(flatten)]
    pub options: Options,
}

const MORE: &str = "\
CMD
  keeps its standard streams, folder, environment, terminal and process group. STABILIZE_REPORT in its environment
  is the path of the report, in which it can read how its clocks are held.

Exit status
  CMD's own, or 128+N where signal N killed it. Otherwise:
  124  the run is not trusted (throttled, or nobody knows), with --fail-on-throttle, where CMD's own was 0
  125  stabilize itself failed; also where something could not be put back
  126  CMD is there and cannot be run
  127  there is no CMD
  128+N  signal N came before CMD ran

Signals
  INT, TERM, HUP, QUIT, USR1 and USR2 are passed on to CMD, unless the terminal sent them, which sends them to CMD
  too. stabilize ends when CMD does. A CMD that ignores them keeps running, with its clocks locked; --kill-after
  SECONDS ends it. Ctrl-Z stops both, and the clocks stay locked until they go on or are killed. If stabilize is
  killed (KILL), its watchdog puts everything back, and CMD goes on with free clocks.

Processes that outlive CMD
  such as daemons that it started do not keep the clocks locked: everything is put back when CMD ends, and the
  report says how many there were. --wait-all waits for them too.

sudo
  Locking takes root. Under sudo, CMD runs as the user who called sudo, with that user's groups, home and bus, and
  the report is written as that user; --as-root changes that for CMD. Whoever may run stabilize through sudo may
  thus run anything as root.

Somebody else's locks
  NVIDIA's driver does not tell whether a clock is locked already. Whatever was locked before is free afterwards;
  --restore-to MHZ locks it to that again.

Examples
  sudo stabilize -- runner sweep configs/quick.toml -o out/quick
  sudo stabilize --graphics-clock 1500 --memory-clock keep --report out/s.json -- ./benchmark
  stabilize --observe --fail-on-throttle -- make bench
  stabilize --dry-run -- true
  stabilize doctor";

/// The GPU that is meant where nobody chose.
pub const DEFAULT_GPU: &str = "0";

/// What is not about a command.
#[derive(Debug, Subcommand)]
pub enum Tool {
    /// Show which GPUs are held or were left changed, by whom, and since when
    Status,
    /// Put back what a stabilize left changed that was killed together with its watchdog
    Restore {
        /// Lock clocks to these afterwards instead of leaving them free
        #[arg(long, value_name = "MHZ[,MEMORY]", value_parser = restore_to)]
        restore_to: Option<RestoreTo>,
    },
    /// Tell for each GPU what can be locked, what cannot, why, and what to do about it; and the same for the buses
    Doctor,
    /// Print a script that completes this command line in a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page
    Man,
    /// Put everything back when another process is gone
    #[command(name = crate::watchdog::COMMAND, hide = true)]
    Watchdog {
        /// Open journals
        journals: Vec<i32>,
    },
}

/// How a command is run.
#[derive(Clone, Debug, Args)]
pub struct Options {
    /// Which GPU, by its number or its UUID in `stabilize doctor`, or `all`
    #[arg(long, value_name = "INDEX|UUID|all", default_value = DEFAULT_GPU, help_heading = "Clocks")]
    pub gpu: String,
    /// The clock of the cores: 0.98 of what it reaches, what the driver calls its highest or its base, a number, or
    /// as it is
    #[arg(long, value_name = "auto|max|base|MHZ|keep", default_value = "auto", help_heading = "Clocks")]
    pub graphics_clock: Wanted,
    /// The clock of the memory: its highest unless that changes other clocks, its highest, a number, or as it is
    #[arg(
        long,
        value_name = "auto|max|MHZ|keep",
        default_value = "auto",
        value_parser = memory_clock,
        help_heading = "Clocks"
    )]
    pub memory_clock: Wanted,
    /// How long to wait at most, each time, for a clock to settle
    #[arg(long, value_name = "SECONDS", default_value = "5", value_parser = seconds, help_heading = "Clocks")]
    pub settle: Duration,
    /// Lock clocks to these at the end instead of leaving them free
    #[arg(long, value_name = "MHZ[,MEMORY]", value_parser = restore_to, help_heading = "Clocks")]
    pub restore_to: Option<RestoreTo>,
    /// Do not begin before the GPU is cooler than this
    #[arg(long, value_name = "CELSIUS", help_heading = "Clocks")]
    pub wait_below: Option<u32>,
    /// How long to wait for that at most
    #[arg(long, value_name = "SECONDS", default_value = "300", value_parser = seconds, help_heading = "Clocks")]
    pub wait_limit: Duration,
    /// How long to wait for another stabilize that holds the GPU
    #[arg(long, value_name = "SECONDS", default_value = "0", value_parser = seconds, help_heading = "Clocks")]
    pub queue: Duration,
    /// For which share of the run each reason may slow the GPU down without making it untrusted
    #[arg(long, value_name = "PERCENT", default_value = "0.1%", value_parser = share, help_heading = "Verdict")]
    pub tolerance: f64,
    /// Exit with 124 if the run cannot be trusted
    #[arg(long, help_heading = "Verdict")]
    pub fail_on_throttle: bool,
    /// Read clocks, power and temperature so many times a second while CMD runs; that disturbs what it measures
    #[arg(long, value_name = "HZ", value_parser = hertz, help_heading = "Verdict")]
    pub timeline: Option<f64>,
    /// Write everything as JSON
    #[arg(long, value_name = "FILE", help_heading = "Verdict")]
    pub report: Option<PathBuf>,
    /// Change nothing, only judge
    #[arg(long, conflicts_with = "strict", help_heading = "What is done")]
    pub observe: bool,
    /// Print what would be done, and do none of it
    #[arg(long, help_heading = "What is done")]
    pub dry_run: bool,
    /// Do not run CMD if a clock cannot be locked as asked
    #[arg(long, help_heading = "What is done")]
    pub strict: bool,
    /// Let the screen and the computer sleep
    #[arg(long, help_heading = "What is done")]
    pub may_sleep: bool,
    /// Under sudo, run CMD as root
    #[arg(long, help_heading = "What is done")]
    pub as_root: bool,
    /// Kill CMD if it has not ended so long after it was told to
    #[arg(long, value_name = "SECONDS", value_parser = seconds, help_heading = "What is done")]
    pub kill_after: Option<Duration>,
    /// Wait for processes that CMD leaves behind too
    #[arg(long, help_heading = "What is done")]
    pub wait_all: bool,
    /// Say nothing on stderr but why something failed
    #[arg(short, long, help_heading = "What is done")]
    pub quiet: bool,
    /// The command and its arguments
    #[arg(last = true, required = true, value_name = "CMD")]
    pub command: Vec<OsString>,
}

fn memory_clock(text: &str) -> Result<Wanted, String> {
    match text.parse() {
        Ok(Wanted::Base) | Err(_) => Err("auto, max, keep, or a number of MHz".into()),
        wanted => wanted,
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.strip_suffix('s').unwrap_or(text).trim().parse().ok();
    seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()).ok_or("a number of seconds".into())
}

fn share(text: &str) -> Result<f64, String> {
    let percent: Option<f64> = text.strip_suffix('%').unwrap_or(text).trim().parse().ok();
    percent
        .filter(|percent| (0.0..=100.0).contains(percent))
        .map(|percent| percent / 100.0)
        .ok_or("a percentage from 0% to 100%".into())
}

fn hertz(text: &str) -> Result<f64, String> {
    let hertz: Option<f64> = text.parse().ok();
    hertz.filter(|hertz| (0.001..=100.0).contains(hertz)).ok_or("at most 100 times a second".into())
}

fn restore_to(text: &str) -> Result<RestoreTo, String> {
    let mut parts = text.split(',').map(|part| match part.trim().parse() {
        Ok(mhz) if mhz > 0 => Ok(Some(mhz)),
        _ => Err("a number of MHz, and perhaps a comma and one for the memory".to_owned()),
    });
    let graphics = parts.next().transpose()?.flatten();
    let memory = parts.next().transpose()?.flatten();
    if parts.next().is_some() {
        Err("two numbers at most".into())
    } else {
        Ok(RestoreTo { graphics, memory })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn values_are_understood_with_their_units() {
        assert_eq!(share("0.1%"), Ok(0.001));
        assert_eq!(share("5"), Ok(0.05));
        assert!(share("101%").is_err() && share("NaN").is_err() && share("-1").is_err());
        assert_eq!(seconds("1.5"), Ok(Duration::from_millis(1500)));
        assert!(seconds("-1").is_err() && seconds("inf").is_err() && seconds("soon").is_err());
        assert!(hertz("0").is_err() && hertz("1000").is_err() && hertz("10").is_ok());
        assert_eq!(restore_to("1500"), Ok(RestoreTo { graphics: Some(1500), memory: None }));
        assert_eq!(restore_to("1500,2619"), Ok(RestoreTo { graphics: Some(1500), memory: Some(2619) }));
        assert!(restore_to("0").is_err() && restore_to("1,2,3").is_err());
    }

    #[test]
    fn a_command_needs_two_dashes() {
        let parse = |line: &[&str]| Cli::try_parse_from([&["stabilize"], line].concat());
        assert_eq!(parse(&["--", "doctor", "--x"]).unwrap().options.command, ["doctor", "--x"]);
        assert!(matches!(parse(&["doctor"]).unwrap().tool, Some(Tool::Doctor)));
        assert!(parse(&["true"]).is_err() && parse(&[]).is_err() && parse(&["--"]).is_err());
    }
}
