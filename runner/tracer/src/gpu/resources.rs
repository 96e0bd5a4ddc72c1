//! What a kernel takes from a multiprocessor, read from what drivers say about it under names of their own.

use super::{
    DeviceInfo, MultiprocessorLimits, Occupancy, Statistic,
    device::{AMD, INTEL, NVIDIA},
};

/// What one kernel takes (a row of the thesis's table 2). What the driver does not tell is `None`, never 0.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Resources {
    /// Invocations a workgroup.
    pub workgroup_size: u32,
    /// Invocations a subgroup.
    pub subgroup_size: u32,
    /// Registers of 32 bits an invocation; on AMD the vector registers.
    pub registers: Option<u32>,
    /// Bytes of local memory an invocation: stacks, and what was spilled there.
    pub local_bytes: Option<u64>,
    /// Bytes of shared memory a workgroup, and what was spilled there.
    pub shared_bytes: Option<u64>,
    /// What the compiler had no registers for, as its driver counts it: registers on AMD, instructions that
    /// write one to memory elsewhere. NVIDIA's own driver has no such figure.
    pub spills: Option<u64>,
    /// Bytes of machine code.
    pub code_bytes: Option<u64>,
    /// How full of it a multiprocessor can be, where its registers and the multiprocessor's limits are known.
    pub occupancy: Option<Occupancy>,
}

/// What a statistic is about.
#[derive(Clone, Copy)]
enum Figure {
    Registers,
    /// In the lower 32 bits: above them, NVIDIA's driver 580 has another 16, so that a stack of 64 words is
    /// 68,719,476,992 bytes.
    LocalBytes,
    /// For all invocations of a subgroup.
    SubgroupLocalBytes,
    SharedBytes,
    Spills,
    CodeBytes,
}

/// The names by which drivers call our figures, by the device's vendor: another vendor's driver may mean
/// something else by the same name (words instead of bytes, or a workgroup instead of an invocation). Case is
/// ignored, because Mesa changes it from release to release.
const NAMES: &[(u32, &str, Figure)] = &[
    // NVIDIA's own driver. Its `Stack Size` is 0 for a kernel whose stack is an array: that is local memory.
    (NVIDIA, "Register Count", Figure::Registers),
    (NVIDIA, "Local Memory Size", Figure::LocalBytes),
    (NVIDIA, "Shared Memory Size", Figure::SharedBytes),
    (NVIDIA, "Binary Size", Figure::CodeBytes),
    // Mesa's NVK.
    (NVIDIA, "Number of GPRs", Figure::Registers),
    (NVIDIA, "SLM size", Figure::LocalBytes),
    (NVIDIA, "Spills to memory", Figure::Spills),
    (NVIDIA, "Code size", Figure::CodeBytes),
    // Mesa's RADV.
    (AMD, "VGPRs", Figure::Registers),
    (AMD, "Scratch size", Figure::SubgroupLocalBytes),
    (AMD, "LDS size", Figure::SharedBytes),
    (AMD, "Spilled VGPRs", Figure::Spills),
    (AMD, "Spilled SGPRs", Figure::Spills),
    (AMD, "Code size", Figure::CodeBytes),
    // AMD's own driver. It does not say whose its `scratchMemUsageInBytes` are.
    (AMD, "numUsedVgprs", Figure::Registers),
    (AMD, "ldsUsageSizeInBytes", Figure::SharedBytes),
    // Mesa's ANV. Its registers are those of a whole subgroup, and of a fixed number.
    (INTEL, "Scratch Memory Size", Figure::SubgroupLocalBytes),
    (INTEL, "Workgroup Memory Size", Figure::SharedBytes),
    (INTEL, "Spill count", Figure::Spills),
    (INTEL, "Spills", Figure::Spills),
    (INTEL, "Code size", Figure::CodeBytes),
];

impl Resources {
    /// Reads what the driver of a device says about a kernel. `told` is the subgroup size that it says the kernel
    /// runs with, if it says so.
    pub(super) fn new(
        info: &DeviceInfo,
        workgroup_size: u32,
        told: Option<u32>,
        statistics: &[Statistic],
    ) -> Self {
        // AMD's own driver gives the workgroup's size here. Where a kernel can ask for a size, ours ask for the
        // device's.
        let [least, most] = info.subgroup_size_range;
        let told = told.filter(|size| (least..=most).contains(size));
        let mut resources = Self {
            workgroup_size,
            subgroup_size: told.unwrap_or(info.subgroup_size),
            registers: None,
            local_bytes: None,
            shared_bytes: None,
            spills: None,
            code_bytes: None,
            occupancy: None,
        };
        let lanes = u64::from(resources.subgroup_size);
        for statistic in statistics {
            let Some(figure) = figure(info.vendor_id, &statistic.name) else { continue };
            let value = statistic.value as u64;
            match figure {
                Figure::Registers => resources.registers = u32::try_from(value).ok(),
                Figure::LocalBytes => resources.local_bytes = Some(value & u64::from(u32::MAX)),
                Figure::SubgroupLocalBytes => resources.local_bytes = Some(value.div_ceil(lanes)),
                Figure::SharedBytes => resources.shared_bytes = Some(value),
                Figure::Spills => *resources.spills.get_or_insert(0) += value,
                Figure::CodeBytes => resources.code_bytes = Some(value),
            }
        }
        if let (Ok(limits), Some(registers)) = (MultiprocessorLimits::of(info), resources.registers) {
            let shared_bytes = resources.shared_bytes.unwrap_or(0);
            resources.occupancy = limits.occupancy(registers, shared_bytes, workgroup_size);
        }
        resources
    }
}

fn figure(vendor: u32, name: &str) -> Option<Figure> {
    let called = |(v, n, _): &&(u32, &str, Figure)| *v == vendor && n.eq_ignore_ascii_case(name);
    NAMES.iter().find(called).map(|(_, _, figure)| *figure)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{Limit, device::unknown};

    fn statistics<const N: usize>(told: [(&str, f64); N]) -> Vec<Statistic> {
        told.map(|(name, value)| Statistic { name: name.into(), value }).to_vec()
    }

    fn vendor(vendor_id: u32, subgroup_size: u32) -> DeviceInfo {
        DeviceInfo { vendor_id, subgroup_size, subgroup_size_range: [subgroup_size; 2], ..unknown() }
    }

    #[test]
    fn a_driver_that_tells_nothing_leaves_everything_open() {
        let info = vendor(0x10005, 8);
        let resources = Resources::new(&info, 64, None, &[]);
        let nothing = Resources {
            workgroup_size: 64,
            subgroup_size: 8,
            registers: None,
            local_bytes: None,
            shared_bytes: None,
            spills: None,
            code_bytes: None,
            occupancy: None,
        };
        assert_eq!(resources, nothing);
        // Names that mean something elsewhere mean nothing here.
        let told = statistics([("Register Count", 40.0), ("VGPRs", 40.0), ("Code size", 40.0)]);
        assert_eq!(Resources::new(&info, 64, Some(8), &told), nothing);
    }

    #[test]
    fn mesas_driver_for_amd_counts_local_memory_by_subgroups() {
        // In the order of RADV; each name contains another one's.
        let told = statistics([
            ("Driver pipeline hash", 1e18),
            ("SGPRs", 108.0),
            ("VGPRs", 96.0),
            ("Spilled SGPRs", 3.0),
            ("Spilled VGPRs", 4.0),
            ("Code size", 5000.0),
            ("LDS size", 512.0),
            ("Scratch size", 16_384.0),
            ("Subgroups per SIMD", 10.0),
            ("Pre-Sched VGPRs", 77.0),
        ]);
        let resources = Resources::new(&vendor(AMD, 64), 256, Some(64), &told);
        assert_eq!((resources.registers, resources.spills), (Some(96), Some(7)));
        assert_eq!((resources.local_bytes, resources.shared_bytes), (Some(256), Some(512)));
        assert_eq!((resources.code_bytes, resources.occupancy), (Some(5000), None));
    }

    #[test]
    fn mesas_driver_for_intel_has_two_spellings() {
        let old = statistics([("Spill Count", 2.0), ("Fill Count", 5.0), ("Scratch Memory Size", 4096.0)]);
        let new = statistics([("Spills", 2.0), ("Fills", 5.0), ("Scratch Memory Size", 4096.0)]);
        for told in [old, new] {
            let resources = Resources::new(&vendor(INTEL, 16), 64, Some(16), &told);
            assert_eq!((resources.spills, resources.local_bytes), (Some(2), Some(256)));
            assert_eq!((resources.registers, resources.shared_bytes), (None, None));
        }
    }

    #[test]
    fn a_subgroup_size_that_cannot_be_is_not_believed() {
        let info = DeviceInfo { subgroup_size_range: [32, 64], ..vendor(AMD, 64) };
        let size = |told| Resources::new(&info, 256, told, &[]).subgroup_size;
        assert_eq!([size(Some(32)), size(Some(256)), size(Some(0)), size(None)], [32, 64, 64, 64]);
    }

    fn nvidia(device_id: u32, subgroups: u32) -> DeviceInfo {
        DeviceInfo {
            device_id,
            subgroups_per_multiprocessor: subgroups,
            shared_memory_bytes: 49_152,
            ..vendor(NVIDIA, 32)
        }
    }

    #[test]
    fn nvidias_driver_is_understood() {
        // Driver 580.159 on an H100 about the binary traversal kernel with a stack of 64 entries, in workgroups
        // of 32 × 8 and of 32 × 12, where it spills to shared memory and four words to local memory.
        let eight = statistics([
            ("Register Count", 48.0),
            ("Binary Size", 11_776.0),
            ("Stack Size", 0.0),
            ("Local Memory Size", 68_719_476_992.0),
            ("Shared Memory Size", 0.0),
        ]);
        let resources = Resources::new(&nvidia(0x2330, 64), 256, Some(32), &eight);
        let occupancy = Occupancy { subgroups: 40, of: 64, workgroups: 5, limited_by: Limit::Registers };
        let expected = Resources {
            workgroup_size: 256,
            subgroup_size: 32,
            registers: Some(48),
            local_bytes: Some(256),
            shared_bytes: Some(0),
            spills: None,
            code_bytes: Some(11_776),
            occupancy: Some(occupancy),
        };
        assert_eq!(resources, expected);

        let twelve = statistics([
            ("Register Count", 40.0),
            ("Local Memory Size", 68_719_477_008.0),
            ("Shared Memory Size", 10_752.0),
        ]);
        let resources = Resources::new(&nvidia(0x2330, 64), 384, Some(32), &twelve);
        assert_eq!((resources.local_bytes, resources.shared_bytes), (Some(272), Some(10_752)));
        assert_eq!(resources.occupancy.unwrap().subgroups, 48);
    }

    #[test]
    fn occupancy_follows_from_what_is_told() {
        let told = statistics([("Register Count", 48.0), ("Shared Memory Size", 3344.0)]);
        let of = |told: &[Statistic]| Resources::new(&nvidia(0x2782, 48), 64, Some(32), told).occupancy;
        let occupancy = of(&told).unwrap();
        assert_eq!((occupancy.subgroups, occupancy.limited_by), (28, Limit::SharedMemory));
        assert_eq!(of(&statistics([("Binary Size", 5000.0)])), None, "without registers");
    }
}
