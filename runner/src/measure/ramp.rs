//! Waits for a device's clock that is still rising.

use std::time::{Duration, Instant};

/// How long the clock may stand still below its goal before it is taken to stay there.
const STILL: Duration = Duration::from_secs(2);
/// How long it is waited for at most.
const LONGEST: Duration = Duration::from_secs(12);

/// The clock of a device that is kept busy, on its way to where samples count.
pub struct Ramp {
    goal: Option<f64>,
    begun: Instant,
    highest: u32,
    risen: Instant,
}

impl Ramp {
    /// How long to keep the device busy from one look at its clock to the next. Asking takes so long that a device which
    /// is asked after each of a few short launches is idle half of the time, and its clock stays where it is.
    pub const BETWEEN: Duration = Duration::from_millis(100);

    /// Of a device that begins to work now. Without a clock that samples are held against there is nothing to wait for.
    pub fn new(clock: Option<&record::Clock>, now: Instant) -> Self {
        let goal = clock.map(|clock| clock.least_share * f64::from(clock.mhz));
        Self { goal, begun: now, highest: 0, risen: now }
    }

    /// Whether the clock, which is read as `mhz`, is below its goal and may still get there.
    pub fn rises(&mut self, mhz: Option<u32>, now: Instant) -> bool {
        let (Some(goal), Some(mhz)) = (self.goal, mhz) else { return false };
        if mhz > self.highest {
            self.highest = mhz;
            self.risen = now;
        }
        f64::from(mhz) < goal && now - self.risen < STILL && now - self.begun < LONGEST
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::{Clock, ClockKind};

    fn after(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn a_rising_clock_is_waited_for_until_it_is_there_or_stays() {
        let clock = Clock { kind: ClockKind::Base, mhz: 2000, least_share: 0.95 };
        let start = Instant::now();
        let mut ramp = Ramp::new(Some(&clock), start);
        assert!(ramp.rises(Some(345), start));
        assert!(ramp.rises(Some(345), start + after(1900)));
        assert!(ramp.rises(Some(360), start + after(1950)));
        assert!(ramp.rises(Some(360), start + after(3900)), "it has risen not long ago");
        assert!(!ramp.rises(Some(360), start + after(4000)), "it stays where it is");
        assert!(!ramp.rises(Some(1900), start + after(3950)), "it is there");

        let mut ramp = Ramp::new(Some(&clock), start);
        for turn in 0..120 {
            assert!(ramp.rises(Some(300 + turn), start + after(100 * u64::from(turn))));
        }
        assert!(!ramp.rises(Some(500), start + LONGEST), "nobody waits for ever");
    }

    #[test]
    fn without_clocks_nothing_is_waited_for() {
        let clock = Clock { kind: ClockKind::Base, mhz: 2000, least_share: 0.95 };
        let now = Instant::now();
        assert!(!Ramp::new(None, now).rises(Some(300), now));
        assert!(!Ramp::new(Some(&clock), now).rises(None, now));
    }
}
