//! What a device can do at best: copy memory, read nodes at random, compute. The roofs below which every traversal
//! stays (after Williams, Waterman, Patterson 2009, "Roofline").
//!
//! Each kernel does one thing, and leaves a sum that the CPU comes to as well ([`cpu`]), so that a compiler cannot drop
//! the work and a wrong index does not go unnoticed. It is launched again and again, and the median time counts.

pub mod cpu;

use crate::{
    Error,
    gpu::{Buffer, DeviceInfo, DeviceKind, Gpu, Kernel, Pass, groups, shaders},
};
use bytemuck::{NoUninit, Pod, Zeroable};
use std::time::{Duration, Instant};

/// Bytes that kernels load at a time.
const PIECE: u64 = 16;
/// Turns of the loop of `rates.comp` at most: sums of floats stay below 2^24, and exact.
const MOST_TURNS: u32 = 8192;
/// Before a kernel's time is known it takes so many.
const FEW_TURNS: u32 = 16;
/// Workgroups whose sums are held against the CPU's.
const CHECKED: usize = 3;

/// A sort of arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Operation {
    /// A fused multiply-add of 32-bit floats.
    FusedMultiplyAdd,
    /// A minimum or maximum of two 32-bit floats.
    MinMax,
    /// A minimum or maximum of three 32-bit integers, as nested calls.
    MinMaxOfThree,
    /// An addition of 32-bit integers.
    Add,
    /// A bitwise function of three 32-bit integers.
    Logic,
    /// A byte of a word to a 32-bit float; an addition of each, and a multiply-add of integers for four, come with it.
    ByteToFloat,
    /// One axis of a ray's test against a box: two fused multiply-adds, a minimum and a maximum.
    SlabAxis,
}

impl Operation {
    /// All of them, in the shader's order.
    pub const ALL: [Self; 7] = [
        Self::FusedMultiplyAdd,
        Self::MinMax,
        Self::MinMaxOfThree,
        Self::Add,
        Self::Logic,
        Self::ByteToFloat,
        Self::SlabAxis,
    ];

    /// How many an invocation does in a turn.
    fn in_a_turn(self) -> u64 {
        let at_once = match self {
            Self::MinMax => 2,
            Self::ByteToFloat => 4,
            _ => 1,
        };
        at_once * u64::from(cpu::WIDTH as u32 * cpu::STEPS)
    }
}

/// What is measured, and how long.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Bytes that are copied.
    pub copied: u64,
    /// Sizes of tables that nodes are read from, in bytes.
    pub tables: Vec<u64>,
    /// Sizes of nodes, in bytes: multiples of 16.
    pub nodes: Vec<u32>,
    /// Invocations of each launch, or a few more.
    pub invocations: u32,
    /// What a launch is to take.
    pub milliseconds: f64,
    /// Launches of which the median counts.
    pub repetitions: u32,
    /// The device is kept busy for so long before, so that its clocks have risen.
    pub warm_up: Duration,
}

impl Plan {
    /// For a device: all that is worth knowing, or `quick`, a glimpse of it.
    pub fn of(info: &DeviceInfo, quick: bool) -> Self {
        let cpu = info.kind == DeviceKind::Cpu;
        let mib = |sizes: &[u64]| -> Vec<u64> {
            // No more than a quarter of the memory, and of what one allocation may have.
            let most = (info.memory_bytes / 4).min(info.max_allocation_bytes);
            sizes.iter().map(|mib| mib << 20).filter(|bytes| *bytes <= most).collect()
        };
        Self {
            copied: if cpu { 64 << 20 } else { (1 << 30).min(info.memory_bytes / 8) / PIECE * PIECE },
            tables: match (cpu, quick) {
                (true, true) => mib(&[4, 32]),
                (false, true) => mib(&[4, 128]),
                _ => mib(&[4, 32, 128, 512]),
            },
            nodes: if quick { vec![48, 64, 80] } else { vec![48, 64, 80, 128, 176, 240] },
            invocations: match info.multiprocessors {
                _ if cpu => 4096,
                0 => 1 << 18,
                // Twice as many as it holds at once.
                n => 2 * n * info.subgroups_per_multiprocessor.max(32) * info.subgroup_size,
            },
            milliseconds: if cpu { 4.0 } else { 2.0 },
            repetitions: if quick { 3 } else { 9 },
            warm_up: if cpu { Duration::ZERO } else { Duration::from_millis(400) },
        }
    }
}

/// How fast nodes of one size are read from a table of one size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reads {
    /// Bytes of the table.
    pub table_bytes: u64,
    /// Bytes of a node.
    pub node_bytes: u32,
    /// Whether the lanes of a subgroup read nodes together, in pieces of 16 bytes, or each its own.
    pub together: bool,
    /// Nodes a second.
    pub per_second: f64,
}

/// What a device can do at best.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Roofs {
    /// Bytes a second that are read and written, both counted, while memory is copied.
    pub copy: f64,
    /// Of each table and node.
    pub reads: Vec<Reads>,
    /// Operations a second.
    pub rates: Vec<(Operation, f64)>,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct FillArguments {
    pieces: u64,
    count: u32,
    invocations: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CopyArguments {
    from: u64,
    to: u64,
    count: u32,
    invocations: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct NodesArguments {
    pieces: u64,
    sums: u64,
    nodes: u32,
    turns: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RatesArguments {
    sums: u64,
    turns: u32,
    factor: f32,
    summand: f32,
    unused: u32,
}

/// Measures a device; `done` is told of each step that has ended.
///
/// # Errors
/// The device was lost, has too little memory, or came to other results than the CPU.
pub fn measure(gpu: &Gpu, plan: &Plan, mut done: impl FnMut(&str)) -> Result<Roofs, Error> {
    let bench = Bench::new(gpu, plan)?;
    bench.warm_up()?;
    let mut roofs = Roofs { copy: bench.copy()?, ..Roofs::default() };
    done("copy");
    let largest = plan.tables.iter().copied().max().unwrap_or(0);
    if largest > 0 {
        let table = bench.table(largest)?;
        for &table_bytes in &plan.tables {
            for &node_bytes in &plan.nodes {
                for together in [false, true] {
                    let per_second = bench.reads(&table, table_bytes, node_bytes, together)?;
                    roofs.reads.push(Reads { table_bytes, node_bytes, together, per_second });
                }
                done("reads");
            }
        }
    }
    for operation in Operation::ALL {
        roofs.rates.push((operation, bench.rate(operation)?));
        done("rates");
    }
    Ok(roofs)
}

/// What all kernels share.
struct Bench<'a> {
    gpu: &'a Gpu,
    plan: &'a Plan,
    /// Of a workgroup.
    size: u32,
    groups: u32,
    sums: Buffer,
}

impl<'a> Bench<'a> {
    fn new(gpu: &'a Gpu, plan: &'a Plan) -> Result<Self, Error> {
        // Eight subgroups, as most traversals have.
        let size = (8 * gpu.info().subgroup_size).min(gpu.info().max_workgroup_size);
        let groups = groups(plan.invocations as usize, size).min(gpu.info().max_workgroups[0]);
        let sums = gpu.buffer("sums", 4 * u64::from(groups * size))?;
        Ok(Self { gpu, plan, size, groups, sums })
    }

    fn invocations(&self) -> u32 {
        self.groups * self.size
    }

    /// Milliseconds of one launch.
    fn launch<P: NoUninit>(&self, kernel: &Kernel, arguments: &P) -> Result<f64, Error> {
        let mut pass = Pass::new(self.gpu)?;
        pass.dispatch("launch", kernel, arguments, self.groups);
        Ok(pass.submit()?.milliseconds("launch"))
    }

    /// The median over the repetitions, in seconds.
    fn median<P: NoUninit>(&self, kernel: &Kernel, arguments: &P) -> Result<f64, Error> {
        self.median_of(|| self.launch(kernel, arguments))
    }

    /// The same of anything that says how many milliseconds it took.
    fn median_of(&self, once: impl Fn() -> Result<f64, Error>) -> Result<f64, Error> {
        // The first may include compilation.
        once()?;
        let mut times = Vec::new();
        for _ in 0..self.plan.repetitions.max(1) {
            times.push(once()?);
        }
        times.sort_by(f64::total_cmp);
        Ok(times[times.len() / 2] * 1e-3)
    }

    /// So many turns that a launch takes as long as it should.
    fn turns<P: NoUninit>(&self, kernel: &Kernel, arguments: impl Fn(u32) -> P) -> Result<u32, Error> {
        self.launch(kernel, &arguments(FEW_TURNS))?;
        let milliseconds = self.launch(kernel, &arguments(FEW_TURNS))?.max(1e-4);
        let wanted = f64::from(FEW_TURNS) * self.plan.milliseconds / milliseconds;
        Ok((wanted as u32).clamp(FEW_TURNS, MOST_TURNS))
    }

    fn warm_up(&self) -> Result<(), Error> {
        let started = Instant::now();
        while started.elapsed() < self.plan.warm_up {
            self.rate(Operation::FusedMultiplyAdd)?;
        }
        Ok(())
    }

    fn refused(&self, what: String) -> Error {
        Error::Roofline { what, device: self.gpu.info().name.clone() }
    }

    /// The workgroups that are checked: the first, one in the middle, the last.
    fn checked(&self) -> [usize; CHECKED] {
        [0, self.groups as usize / 2, self.groups as usize - 1]
    }

    /// A table of `bytes`, filled.
    fn table(&self, bytes: u64) -> Result<Buffer, Error> {
        let table = self.gpu.buffer("table of nodes", bytes)?;
        let kernel = Kernel::new(self.gpu, &shaders::ROOFLINE_FILL, self.size, &[])?;
        let (count, invocations) = ((bytes / PIECE) as u32, self.invocations());
        self.launch(&kernel, &FillArguments { pieces: table.address(), count, invocations })?;
        Ok(table)
    }

    /// By a kernel or by the driver's command for it, whichever is faster.
    fn copy(&self) -> Result<f64, Error> {
        let bytes = self.plan.copied;
        let from = self.table(bytes)?;
        let to = self.gpu.buffer("copy of a table", bytes)?;
        let command = || {
            let mut pass = Pass::new(self.gpu)?;
            pass.scope("copy", |pass| pass.copy(&from, 0, &to, 0, bytes));
            Ok(pass.submit()?.milliseconds("copy"))
        };
        let by_command = self.median_of(command)?;
        self.check_copy(&to)?;
        // What the command has copied must not stand in for what the kernel does not.
        let mut pass = Pass::new(self.gpu)?;
        pass.fill(&to, 0);
        pass.submit()?;
        let kernel = Kernel::new(self.gpu, &shaders::ROOFLINE_COPY, self.size, &[])?;
        let (count, invocations) = ((bytes / PIECE) as u32, self.invocations());
        let arguments = CopyArguments { from: from.address(), to: to.address(), count, invocations };
        let by_kernel = self.median(&kernel, &arguments)?;
        self.check_copy(&to)?;
        Ok(2.0 * bytes as f64 / by_kernel.min(by_command))
    }

    /// Looks at words at the beginning, in the middle and at the end.
    fn check_copy(&self, to: &Buffer) -> Result<(), Error> {
        let words = (self.plan.copied / 4) as usize;
        let look = words.min(1 << 16);
        for first in [0, (words - look) / 2, words - look] {
            let found: Vec<u32> = to.read(first, look)?;
            if found.iter().zip(first as u32..).any(|(word, place)| *word != cpu::word(place)) {
                return Err(self.refused("copying memory".into()));
            }
        }
        Ok(())
    }

    fn reads(&self, table: &Buffer, bytes: u64, node_bytes: u32, together: bool) -> Result<f64, Error> {
        let pieces = node_bytes / PIECE as u32;
        let constants = [pieces, u32::from(together)];
        let kernel = Kernel::new(self.gpu, &shaders::ROOFLINE_NODES, self.size, &constants)?;
        let nodes = (bytes / u64::from(node_bytes)) as u32;
        let arguments =
            |turns| NodesArguments { pieces: table.address(), sums: self.sums.address(), nodes, turns };
        let turns = self.turns(&kernel, arguments)?;
        let seconds = self.median(&kernel, &arguments(turns))?;
        for group in self.checked() {
            let (first, size) = (group * self.size as usize, self.size);
            // Together, lanes add up pieces of each other's nodes: of a workgroup the sum is the same.
            let found: Vec<u32> = self.sums.read(first, size as usize)?;
            let found = found.iter().fold(0u32, |sum, own| sum.wrapping_add(*own));
            let lanes = first as u32..first as u32 + size;
            let expected =
                lanes.fold(0u32, |sum, own| sum.wrapping_add(cpu::nodes(own, nodes, pieces, turns)));
            if found != expected {
                return Err(self.refused(format!("reading nodes of {node_bytes} bytes at random")));
            }
        }
        Ok(f64::from(self.invocations()) * f64::from(turns) / seconds)
    }

    fn rate(&self, operation: Operation) -> Result<f64, Error> {
        let kernel = Kernel::new(self.gpu, &shaders::ROOFLINE_RATES, self.size, &[operation as u32])?;
        let arguments =
            |turns| RatesArguments { sums: self.sums.address(), turns, factor: 1.0, summand: 1.0, unused: 0 };
        let turns = self.turns(&kernel, arguments)?;
        let seconds = self.median(&kernel, &arguments(turns))?;
        for group in self.checked() {
            // A subgroup of each will do: the CPU takes its time.
            let (first, lanes) = (group * self.size as usize, self.gpu.info().subgroup_size as usize);
            let found: Vec<u32> = self.sums.read(first, lanes)?;
            let same = |(own, sum): (u32, &u32)| cpu::rates(own, operation, turns) == *sum;
            if !(first as u32..).zip(&found).all(same) {
                return Err(self.refused(format!("{operation:?}")));
            }
        }
        let operations = operation.in_a_turn() as f64 * f64::from(turns);
        Ok(f64::from(self.invocations()) * operations / seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{
        Options,
        interface::{Module, fields},
    };

    #[test]
    fn shaders_see_memory_as_the_host_does() {
        let fill = fields!(FillArguments: pieces, count, invocations);
        Module::read(&shaders::ROOFLINE_FILL).assert_push_constants(size_of::<FillArguments>(), &fill);
        let copy = fields!(CopyArguments: from, to, count, invocations);
        Module::read(&shaders::ROOFLINE_COPY).assert_push_constants(size_of::<CopyArguments>(), &copy);
        let nodes = fields!(NodesArguments: pieces, sums, nodes, turns);
        Module::read(&shaders::ROOFLINE_NODES)
            .assert_push_constants(size_of::<NodesArguments>(), &nodes)
            .assert_items("Pieces", 16, None);
        let rates = fields!(RatesArguments: sums, turns, factor, summand, unused);
        Module::read(&shaders::ROOFLINE_RATES).assert_push_constants(size_of::<RatesArguments>(), &rates);
    }

    /// Everything at its smallest: what is measured is checked on the way.
    #[test]
    fn every_kernel_comes_to_what_the_cpu_does() {
        let gpu = Gpu::open(&Options { validate: true, ..Options::default() }).unwrap();
        let plan = Plan {
            copied: 16 * 1000,
            tables: vec![1 << 16, 1 << 20],
            nodes: vec![16, 48, 80, 240],
            invocations: 1,
            milliseconds: 0.0,
            repetitions: 1,
            warm_up: Duration::ZERO,
        };
        let mut steps = 0;
        let roofs = measure(&gpu, &plan, |_| steps += 1).unwrap();
        assert_eq!((roofs.reads.len(), roofs.rates.len(), steps), (16, Operation::ALL.len(), 1 + 8 + 7));
        assert!(roofs.copy > 0.0);
        assert!(roofs.reads.iter().all(|reads| reads.per_second > 0.0));
        assert!(roofs.rates.iter().all(|(_, rate)| *rate > 0.0));
        assert_eq!(gpu.validation_messages(), Vec::<String>::new());
    }

    #[test]
    fn another_table_is_noticed() {
        let gpu = Gpu::open(&Options::default()).unwrap();
        let plan = Plan { invocations: 64, milliseconds: 0.0, repetitions: 1, ..Plan::of(gpu.info(), true) };
        let bench = Bench::new(&gpu, &plan).unwrap();
        let table = bench.table(1 << 16).unwrap();
        assert!(bench.reads(&table, 1 << 16, 64, true).is_ok());
        let mut words: Vec<u32> = table.read(0, 1 << 14).unwrap();
        words.rotate_left(1);
        table.write(&words).unwrap();
        for together in [false, true] {
            let error = bench.reads(&table, 1 << 16, 64, together).unwrap_err().to_string();
            assert!(error.contains("64 bytes") && error.contains(&gpu.info().name), "{error}");
        }
    }
}
