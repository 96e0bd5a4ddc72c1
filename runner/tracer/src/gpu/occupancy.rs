//! How many subgroups a multiprocessor holds at once, and which of its limits says so (thesis 5.1).

use super::{DeviceInfo, device::NVIDIA};
use std::fmt;

/// What one multiprocessor has for the kernels that run on it at the same time (the thesis's table 1).
///
/// Vulkan tells the subgroup size, the size of a workgroup and of its shared memory, and
/// `VK_NV_shader_sm_builtins` the number of subgroups. It has no words for registers, granularities and the
/// number of workgroups. These are constants of a generation of chips: they stand in the table *Technical
/// Specifications per Compute Capability* of the CUDA C++ Programming Guide, and granularities in
/// `cuda_occupancy.h` of the CUDA toolkit and in Nsight Compute's occupancy calculator.
///
/// As in the thesis, the pool of shared memory is what Vulkan lets one workgroup use. The chip has more (100 KiB
/// instead of 48 on an RTX 4070 Ti), but what a driver for graphics sets aside of it is not told, and CUDA takes
/// another KiB from it for every workgroup. So a kernel whose occupancy shared memory limits may do better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct MultiprocessorLimits {
    /// Registers of 32 bits.
    pub registers: u32,
    /// Registers that one invocation can use.
    pub invocation_registers: u32,
    /// The registers of an invocation are rounded up to a multiple of this.
    pub register_granularity: u32,
    /// Invocations a subgroup.
    pub subgroup_size: u32,
    /// Subgroups it holds at once.
    pub subgroups: u32,
    /// Where registers run out, the subgroups it holds are rounded down to a multiple of this: registers belong
    /// to as many partitions.
    pub subgroup_granularity: u32,
    /// Workgroups it holds at once.
    pub workgroups: u32,
    /// Invocations in the largest workgroup.
    pub workgroup_size: u32,
    /// Bytes of shared memory, for all workgroups together.
    pub shared_bytes: u32,
    /// The shared memory of a workgroup is rounded up to a multiple of this.
    pub shared_granularity: u32,
}

/// Why the limits of a multiprocessor are not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnknownLimits {
    /// No table of its limits is here.
    #[error("Vulkan does not tell what a multiprocessor has, and only NVIDIA's are known here")]
    Vendor,
    /// The driver is NVIDIA's or Mesa's, and too old.
    #[error("the driver does not tell how many subgroups one holds (VK_NV_shader_sm_builtins)")]
    Subgroups,
    /// A chip from before or after those in the table.
    #[error("device {0:#06x} is none of the chips that are known here, Turing to Blackwell")]
    Chip(u32),
}

/// What keeps a multiprocessor from holding more workgroups of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Its subgroups: it is full, or has too few left for another workgroup.
    Subgroups,
    /// Its workgroups, which are small here.
    Workgroups,
    /// Its registers.
    Registers,
    /// Its shared memory.
    SharedMemory,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Subgroups => "subgroups",
            Self::Workgroups => "workgroups",
            Self::Registers => "registers",
            Self::SharedMemory => "shared memory",
        })
    }
}

/// How full of one kernel a multiprocessor can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Occupancy {
    /// Subgroups at once.
    pub subgroups: u32,
    /// Subgroups at once of a kernel that takes next to nothing.
    pub of: u32,
    /// Workgroups at once.
    pub workgroups: u32,
    /// What keeps it from holding more.
    pub limited_by: Limit,
}

impl Occupancy {
    /// The subgroups it holds as a share of those it could hold: above 0, at most 1.
    pub fn share(&self) -> f64 {
        f64::from(self.subgroups) / f64::from(self.of)
    }
}

impl MultiprocessorLimits {
    /// The limits of a device's multiprocessors.
    ///
    /// # Errors
    /// They are not known, and why.
    pub fn of(info: &DeviceInfo) -> Result<Self, UnknownLimits> {
        if info.vendor_id != NVIDIA {
            return Err(UnknownLimits::Vendor);
        }
        let (workgroups, shared_granularity) = match (info.subgroups_per_multiprocessor, info.device_id) {
            (0, _) => return Err(UnknownLimits::Subgroups),
            // Compute capability 7.5, Turing: TU102 to TU117.
            (32, 0x1E00..=0x21FF) => (16, 256),
            // 8.6, the smaller Ampere chips: GA102 to GA107. GH100 lies between them and holds 64.
            (48, 0x2200..=0x25FF) => (16, 128),
            // 8.9 and 12.0, Ada and the smaller Blackwell chips: AD102 to AD107, GB202 to GB207.
            (48, 0x2600..=0x2FFF) => (24, 128),
            // 8.0, 9.0 and 10.0, the chips of data centres: GA100, GH100, GB100.
            (64, 0x2000..=0x29FF) => (32, 128),
            (_, device) => return Err(UnknownLimits::Chip(device)),
        };
        Ok(Self {
            registers: 65_536,
            invocation_registers: 255,
            register_granularity: 8,
            subgroup_size: info.subgroup_size,
            subgroups: info.subgroups_per_multiprocessor,
            subgroup_granularity: 4,
            workgroups,
            workgroup_size: info.max_workgroup_size,
            shared_bytes: info.shared_memory_bytes,
            shared_granularity,
        })
    }

    /// Invocations it holds at once.
    pub fn invocations(&self) -> u32 {
        self.subgroups * self.subgroup_size
    }

    /// Most registers an invocation can take while a multiprocessor can be full: the thesis's *l_reg*.
    pub fn full_registers(&self) -> u32 {
        let all = self.registers / self.invocations();
        all - all % self.register_granularity
    }

    /// Most bytes of shared memory an invocation can take, on average over its workgroup, while a multiprocessor
    /// can be full: the thesis's *l_shared*.
    pub fn full_shared_bytes(&self) -> u32 {
        self.shared_bytes / self.invocations()
    }

    /// The occupancy of a kernel that takes `registers` an invocation and `shared_bytes` a workgroup of
    /// `workgroup_size` invocations. `None` where not even one workgroup would fit, which cannot be true of a
    /// kernel that runs.
    pub fn occupancy(&self, registers: u32, shared_bytes: u64, workgroup_size: u32) -> Option<Occupancy> {
        let size = workgroup_size.div_ceil(self.subgroup_size).max(1);
        let mut limits =
            vec![(self.subgroups / size, Limit::Subgroups), (self.workgroups, Limit::Workgroups)];
        if registers > 0 {
            let taken = registers.next_multiple_of(self.register_granularity) * self.subgroup_size;
            let subgroups = self.registers / taken;
            limits.push(((subgroups - subgroups % self.subgroup_granularity) / size, Limit::Registers));
        }
        if shared_bytes > 0 {
            let taken = shared_bytes.next_multiple_of(self.shared_granularity.into());
            let workgroups = u64::from(self.shared_bytes) / taken;
            limits.push((u32::try_from(workgroups).expect("at most the pool"), Limit::SharedMemory));
        }
        // The first of several that say the same: a kernel that fills the multiprocessor is limited by its
        // subgroups, whatever else would run out with them.
        let (workgroups, limited_by) =
            limits.into_iter().min_by_key(|(workgroups, _)| *workgroups).expect("four limits at most");
        let subgroups = workgroups * size;
        (subgroups > 0).then_some(Occupancy { subgroups, of: self.subgroups, workgroups, limited_by })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::device::unknown;

    fn nvidia(device_id: u32, subgroups: u32) -> DeviceInfo {
        DeviceInfo {
            vendor_id: NVIDIA,
            device_id,
            subgroups_per_multiprocessor: subgroups,
            shared_memory_bytes: 49_152,
            ..unknown()
        }
    }

    /// The GPU of the thesis, an RTX 4070 Ti.
    fn thesis() -> MultiprocessorLimits {
        MultiprocessorLimits::of(&nvidia(0x2782, 48)).unwrap()
    }

    #[test]
    fn the_limits_are_those_of_the_thesis() {
        let limits = MultiprocessorLimits {
            registers: 65_536,
            invocation_registers: 255,
            register_granularity: 8,
            subgroup_size: 32,
            subgroups: 48,
            subgroup_granularity: 4,
            workgroups: 24,
            workgroup_size: 1024,
            shared_bytes: 49_152,
            shared_granularity: 128,
        };
        assert_eq!(thesis(), limits);
        assert_eq!(limits.invocations(), 1536);
        assert_eq!(limits.full_registers(), 40);
        assert_eq!(limits.full_shared_bytes(), 32);
    }

    #[test]
    fn occupancy_is_that_of_the_thesis() {
        // Registers, shared bytes, workgroup; percent, and what the thesis says limits it (5.1 to 5.1.2).
        for (registers, shared, workgroup, percent, limited_by) in [
            (40, 20, 64, 100, Limit::Subgroups),
            (48, 12, 64, 83, Limit::Registers),
            (48, 3344, 64, 58, Limit::SharedMemory),
            (48, 1808, 64, 83, Limit::Registers),
            (156, 4, 64, 25, Limit::Registers),
            (56, 12, 384, 75, Limit::Registers),
            (56, 12, 64, 75, Limit::Registers),
            (72, 12, 64, 58, Limit::Registers),
        ] {
            let occupancy = thesis().occupancy(registers, shared, workgroup).unwrap();
            assert_eq!((occupancy.share() * 100.0).round(), f64::from(percent), "{registers} {shared}");
            assert_eq!(occupancy.limited_by, limited_by, "{registers} {shared}");
        }
    }

    #[test]
    fn each_limit_can_be_the_one() {
        let of = |registers, shared, workgroup| thesis().occupancy(registers, shared, workgroup).unwrap();
        let full = Occupancy { subgroups: 48, of: 48, workgroups: 24, limited_by: Limit::Subgroups };
        assert_eq!(of(40, 2048, 64), full);
        assert_eq!(of(0, 0, 64), full, "a kernel without registers has no figure, and no limit by them");
        // 48 subgroups hold two workgroups of 20, and 8 subgroups stay empty.
        let twenty = Occupancy { subgroups: 40, of: 48, workgroups: 2, limited_by: Limit::Subgroups };
        assert_eq!(of(32, 0, 640), twenty);
        let small = Occupancy { subgroups: 24, of: 48, workgroups: 24, limited_by: Limit::Workgroups };
        assert_eq!(of(32, 0, 32), small);
        // 41 registers are 48, and 42 subgroups that would fit are 40 in four partitions.
        let registers = Occupancy { subgroups: 40, of: 48, workgroups: 20, limited_by: Limit::Registers };
        assert_eq!(of(41, 0, 64), registers);
        // 2049 bytes are 2176.
        let shared = Occupancy { subgroups: 44, of: 48, workgroups: 22, limited_by: Limit::SharedMemory };
        assert_eq!(of(40, 2049, 64), shared);
    }

    #[test]
    fn what_cannot_fit_has_no_occupancy() {
        assert_eq!(thesis().occupancy(72, 0, 1024), None);
        assert_eq!(thesis().occupancy(32, 49_153, 64), None);
        assert_eq!(thesis().occupancy(32, 0, 2048), None);
    }

    #[test]
    fn an_h100_is_five_eighths_full_of_the_binary_kernel() {
        let limits = MultiprocessorLimits::of(&nvidia(0x2330, 64)).unwrap();
        assert_eq!((limits.invocations(), limits.workgroups, limits.full_registers()), (2048, 32, 32));
        let occupancy = limits.occupancy(48, 0, 256).unwrap();
        assert_eq!((occupancy.subgroups, occupancy.of, occupancy.workgroups), (40, 64, 5));
    }

    #[test]
    fn chips_are_told_apart() {
        let workgroups = |device, subgroups| {
            MultiprocessorLimits::of(&nvidia(device, subgroups)).map(|l| (l.workgroups, l.shared_granularity))
        };
        assert_eq!(workgroups(0x1E04, 32), Ok((16, 256)), "RTX 2080 Ti");
        assert_eq!(workgroups(0x20B5, 64), Ok((32, 128)), "A100");
        assert_eq!(workgroups(0x2204, 48), Ok((16, 128)), "RTX 3090");
        assert_eq!(workgroups(0x2503, 48), Ok((16, 128)), "RTX 3060");
        assert_eq!(workgroups(0x2684, 48), Ok((24, 128)), "RTX 4090");
        assert_eq!(workgroups(0x2B85, 48), Ok((24, 128)), "RTX 5090");
        assert_eq!(workgroups(0x2901, 64), Ok((32, 128)), "B200");
        assert_eq!(workgroups(0x1B80, 64), Err(UnknownLimits::Chip(0x1B80)), "GTX 1080");
        assert_eq!(workgroups(0x3000, 48), Err(UnknownLimits::Chip(0x3000)), "not made yet");
        assert_eq!(workgroups(0x2782, 0), Err(UnknownLimits::Subgroups));
        assert_eq!(MultiprocessorLimits::of(&unknown()), Err(UnknownLimits::Vendor));
    }
}
