//! Which clock to lock to, and whether the GPU then delivers it (thesis, section 4.5.1).

use crate::gpu::{Change, Domain, Gpu, Trouble};
use crate::hold::Held;
use crate::signals::Signals;
use record::{Hold, Policy};
use std::fmt;
use std::str::FromStr;
use std::time::{Duration, Instant};

/// What a clock is locked to: what the GPU ran at when it was asked for its highest, times this. The highest that
/// the driver names is often out of reach, and right at the limit the clock wavers.
const SHARE: f64 = 0.98;

/// A delivered clock that differs by less than this share from what was locked is as good as locked: drivers round
/// to steps of 15 MHz.
const DELIVERED_WITHIN: f64 = 0.01;

/// What a clock is to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// Graphics: 0.98 of what the GPU reaches. Memory: the highest, if that holds everything else still.
    Auto,
    /// The highest that the driver names.
    Max,
    /// What the GPU is sold to run at; graphics only.
    Base,
    /// A number of MHz.
    Mhz(u32),
    /// Whatever it is: not locked.
    Keep,
}

impl FromStr for Wanted {
    type Err = String;

    fn from_str(text: &str) -> Result<Wanted, String> {
        Ok(match text {
            "auto" => Wanted::Auto,
            "max" => Wanted::Max,
            "base" => Wanted::Base,
            "keep" => Wanted::Keep,
            mhz => match mhz.parse() {
                Ok(mhz) if mhz > 0 => Wanted::Mhz(mhz),
                _ => return Err("auto, max, base, keep, or a number of MHz".into()),
            },
        })
    }
}

impl fmt::Display for Wanted {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Wanted::Auto => out.write_str("auto"),
            Wanted::Max => out.write_str("max"),
            Wanted::Base => out.write_str("base"),
            Wanted::Mhz(mhz) => write!(out, "{mhz}"),
            Wanted::Keep => out.write_str("keep"),
        }
    }
}

/// A policy that leaves everything as it is, because nothing else was asked for or is possible.
pub fn free(gpu: &dyn Gpu, graphics: Wanted, memory: Wanted, why: Option<&str>) -> Policy {
    let hold = |wanted: Wanted| Hold {
        asked: wanted.to_string(),
        locked_mhz: None,
        delivered_mhz: None,
        remark: why.filter(|_| wanted != Wanted::Keep).map(String::from),
    };
    Policy {
        graphics: hold(graphics),
        memory: hold(memory),
        persistence: gpu.persistence().unwrap_or_default(),
    }
}

/// How a GPU's clocks are locked.
pub struct Locking<'a> {
    /// What the graphics clock is to be.
    pub graphics: Wanted,
    /// What the memory clock is to be.
    pub memory: Wanted,
    /// How long to wait for a clock to settle.
    pub settle: Duration,
    /// Where somebody may ask for an end meanwhile.
    pub signals: &'a Signals,
}

impl Locking<'_> {
    /// Locks a GPU's clocks as far as it goes; the policy says how far that was, and why no further.
    ///
    /// # Errors
    /// Somebody asked for an end.
    pub fn apply(&self, held: &mut Held) -> anyhow::Result<Policy> {
        let gpu = held.gpu();
        let mut policy = free(gpu, self.graphics, self.memory, None);
        let prepared =
            gpu.preparations().and_then(|changes| changes.iter().try_for_each(|change| held.change(change)));
        policy.persistence = gpu.persistence().unwrap_or_default();
        if let Err(trouble) = prepared {
            let why = trouble.to_string();
            return Ok(free(gpu, self.graphics, self.memory, Some(&why)));
        }
        policy.graphics = self.lock(held, Domain::Graphics, self.graphics)?;
        policy.memory = self.lock(held, Domain::Memory, self.memory)?;
        if policy.memory.locked_mhz.is_some() {
            self.check_graphics(held, &mut policy);
        }
        Ok(policy)
    }

    /// Locks one clock.
    fn lock(&self, held: &mut Held, domain: Domain, wanted: Wanted) -> anyhow::Result<Hold> {
        let mut hold =
            Hold { asked: wanted.to_string(), locked_mhz: None, delivered_mhz: None, remark: None };
        if wanted == Wanted::Keep {
            return Ok(hold);
        }
        let target = match self.target(held, domain, wanted)? {
            Ok((mhz, remark)) => {
                hold.remark = remark;
                mhz
            }
            Err(why) => {
                hold.remark = Some(why);
                return Ok(hold);
            }
        };
        if let Err(trouble) = held.change(&Change::Lock { domain, mhz: target }) {
            hold.remark = Some(trouble.to_string());
            // The lock that found the clock out may still be there.
            if let Err(trouble) = held.release(domain) {
                hold.remark = Some(format!("{trouble}; it may be locked all the same"));
            }
            return Ok(hold);
        }
        hold.locked_mhz = Some(target);
        hold.delivered_mhz = self.settled(held.gpu(), domain)?;
        if let Some(delivered) = hold.delivered_mhz.filter(|&delivered| !within(delivered, target)) {
            let remark = format!("the driver accepted {target} MHz but delivers {delivered} MHz");
            hold.remark = Some(match hold.remark {
                Some(before) => format!("{before}; {remark}"),
                None => remark,
            });
            // Holding still is all that was asked for.
            if (domain, wanted) == (Domain::Memory, Wanted::Auto) {
                self.give_up_memory(held, &mut hold);
            }
        }
        Ok(hold)
    }

    /// What to lock a clock to in MHz, and what is odd about it; or why it cannot be locked.
    fn target(
        &self,
        held: &mut Held,
        domain: Domain,
        wanted: Wanted,
    ) -> anyhow::Result<Result<(u32, Option<String>), String>> {
        let gpu = held.gpu();
        let steps = match gpu.steps(domain) {
            Ok(steps) => steps,
            Err(trouble) => return Ok(Err(trouble.to_string())),
        };
        let highest = match (steps.last(), gpu.highest(domain)) {
            (_, Ok(highest)) => highest,
            (Some(&step), Err(_)) => step,
            (None, Err(trouble)) => return Ok(Err(trouble.to_string())),
        };
        Ok(match (wanted, domain) {
            (Wanted::Keep, _) => Err("nobody asked".into()),
            (Wanted::Max, _) | (Wanted::Auto, Domain::Memory) => Ok((highest, None)),
            (Wanted::Mhz(mhz), _) => {
                let nearest = nearest(&steps, mhz).unwrap_or(mhz);
                let odd = (nearest != mhz).then(|| format!("{mhz} MHz is no step; the nearest is {nearest}"));
                Ok((nearest, odd))
            }
            (Wanted::Base, _) => match gpu.base(domain) {
                Ok(base) => Ok((nearest(&steps, base).unwrap_or(base), None)),
                Err(trouble) => {
                    Err(format!("the driver does not tell its base ({trouble}); give a number of MHz"))
                }
            },
            (Wanted::Auto, Domain::Graphics) => {
                if let Err(trouble) = held.change(&Change::Lock { domain, mhz: highest }) {
                    return Ok(Err(trouble.to_string()));
                }
                let reached = self.settled(gpu, domain)?.unwrap_or(0);
                // An idle GPU that does not heed the lock says nothing about what it reaches.
                let heeded = reached > highest / 2;
                let reached = if heeded { reached } else { highest };
                let odd =
                    (!heeded).then(|| "the clock did not rise, so what it reaches is a guess".to_owned());
                Ok((below(&steps, f64::from(reached) * SHARE, reached), odd))
            }
        })
    }

    /// Once the memory is locked: whether the graphics clock is still what it was.
    fn check_graphics(&self, held: &mut Held, policy: &mut Policy) {
        let (Some(before), Ok(now)) = (policy.graphics.delivered_mhz, held.gpu().clock(Domain::Graphics))
        else {
            return;
        };
        if within(now, before) {
            return;
        }
        let remark = format!("with it locked, the graphics clock went from {before} to {now} MHz");
        policy.memory.remark = Some(remark);
        if self.memory == Wanted::Auto {
            self.give_up_memory(held, &mut policy.memory);
        } else {
            policy.graphics.delivered_mhz = Some(now);
        }
    }

    fn give_up_memory(&self, held: &mut Held, hold: &mut Hold) {
        let why = hold.remark.take().unwrap_or_default();
        match held.release(Domain::Memory) {
            Ok(()) => {
                hold.locked_mhz = None;
                hold.delivered_mhz = None;
                hold.remark = Some(format!("{why}; so it is left free"));
            }
            Err(trouble) => hold.remark = Some(format!("{why}; it cannot be unlocked: {trouble}")),
        }
    }

    /// Waits until a clock holds still, and says where; nothing where it cannot be read.
    fn settled(&self, gpu: &dyn Gpu, domain: Domain) -> anyhow::Result<Option<u32>> {
        let started = Instant::now();
        let (least, still) = (self.settle / 5, self.settle / 10);
        let pause = (self.settle / 100).clamp(Duration::from_millis(1), Duration::from_millis(50));
        let Ok(mut clock) = gpu.clock(domain) else { return Ok(None) };
        let mut since = Instant::now();
        while started.elapsed() < self.settle {
            if started.elapsed() >= least && since.elapsed() >= still {
                break;
            }
            self.signals.pause(pause)?;
            match gpu.clock(domain) {
                Ok(now) if now != clock => (clock, since) = (now, Instant::now()),
                Ok(_) => {}
                Err(_) => return Ok(None),
            }
        }
        Ok(Some(clock))
    }
}

/// Whether a clock is as good as another.
pub fn within(mhz: u32, of: u32) -> bool {
    f64::from(mhz.abs_diff(of)) <= DELIVERED_WITHIN * f64::from(of)
}

fn nearest(steps: &[u32], mhz: u32) -> Option<u32> {
    steps.iter().copied().min_by_key(|step| step.abs_diff(mhz))
}

/// The step nearest to a clock, of those that the GPU reaches: some have a step every 15 MHz, others three in all,
/// of which the next one down would be far too low.
fn below(steps: &[u32], mhz: f64, reached: u32) -> u32 {
    let reachable: Vec<u32> = steps.iter().copied().filter(|&step| step <= reached).collect();
    nearest(&reachable, mhz.round() as u32).unwrap_or(mhz.round() as u32)
}

/// What the driver says when it has no rights.
pub fn lacks_rights(policy: &Policy) -> bool {
    let lacks = |hold: &Hold| hold.remark.as_deref() == Some(&*Trouble::NoPermission.to_string());
    lacks(&policy.graphics) || lacks(&policy.memory)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_numbers_are_understood() {
        for text in ["auto", "max", "base", "keep", "1500"] {
            assert_eq!(text.parse::<Wanted>().unwrap().to_string(), text);
        }
        for text in ["", "0", "-3", "fast", "1.5"] {
            assert!(text.parse::<Wanted>().is_err(), "{text}");
        }
    }

    #[test]
    fn the_lock_is_a_step_just_below_what_is_reached() {
        let fine: Vec<u32> = (14..=132).map(|step| 15 * step).collect();
        // 0.98 · 1935 = 1896.3
        assert_eq!(below(&fine, SHARE * 1935.0, 1935), 1890);
        // 0.98 · 1980 = 1940.4; steps above what is reached do not count.
        assert_eq!(below(&fine, SHARE * 1980.0, 1980), 1935);
        assert_eq!(below(&[500, 1900, 2500], SHARE * 2500.0, 2500), 2500);
        assert_eq!(below(&[500, 1900, 2500], SHARE * 2400.0, 2400), 1900);
        assert_eq!(below(&[], SHARE * 2000.0, 2000), 1960);
    }

    #[test]
    fn a_step_beside_is_as_good() {
        assert!(within(1935, 1935) && within(1920, 1935) && !within(1905, 1935));
    }
}
