use super::{
    Buffer, Error, Gpu, Kernel,
    device::{Inner, PUSH_BYTES},
    error::Context,
};
use ash::vk;
use bytemuck::NoUninit;

/// Timestamps a pass can hold: two a span.
pub(super) const QUERIES: u32 = 8192;
/// Of which so many are reset at a time, because most passes need few.
const QUERIES_RESET: u32 = 128;

/// How ticks become milliseconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timing {
    pub period_ns: f64,
    pub bits: u32,
}

impl Timing {
    /// Milliseconds from one timestamp to a later one, over a wrap of the counter.
    fn milliseconds(self, begin: u64, end: u64) -> f64 {
        let mask = if self.bits >= 64 { u64::MAX } else { (1 << self.bits) - 1 };
        (end.wrapping_sub(begin) & mask) as f64 * self.period_ns * 1e-6
    }
}

/// One timed piece of a pass: a dispatch or a scope around several.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// Its own name, then those of the scopes it lies in, outermost first: `build/ploc/nearest`.
    pub path: String,
    /// From when all earlier work had ended until all of its own had, by the device's clock.
    pub milliseconds: f64,
}

/// What a pass took, in recording order, scopes before what they contain.
#[derive(Clone, Debug, Default)]
pub struct Timings {
    /// All spans.
    pub spans: Vec<Span>,
    /// Kernels launched, fills and copies, whether they had anything to do or not.
    pub launches: u32,
}

impl Timings {
    /// Appends those of a later pass.
    pub fn extend(&mut self, later: Self) {
        self.spans.extend(later.spans);
        self.launches += later.launches;
    }

    /// Milliseconds of all spans with exactly this path.
    pub fn milliseconds(&self, path: &str) -> f64 {
        self.spans.iter().filter(|s| s.path == path).map(|s| s.milliseconds).sum()
    }
}

/// Records kernels and copies, runs them once, and says how long each took.
///
/// Everything recorded sees the results of everything before it: a full memory barrier stands before
/// each dispatch, fill and copy.
pub struct Pass {
    gpu: Gpu,
    pool: vk::CommandPool,
    fence: vk::Fence,
    queries: vk::QueryPool,
    commands: vk::CommandBuffer,
    spans: Vec<(String, u32, u32)>,
    path: Vec<String>,
    used: u32,
    time_dispatches: bool,
    launches: u32,
    /// Whether the driver traces rays or builds structures in it, whose stages barriers have to name as well.
    traces_rays: bool,
    failed: Option<Error>,
}

impl Pass {
    /// An empty pass.
    ///
    /// # Errors
    /// The driver has no memory for it.
    pub fn new(gpu: &Gpu) -> Result<Self, Error> {
        let device = &gpu.inner.device;
        let mut pass = Self {
            gpu: gpu.clone(),
            pool: vk::CommandPool::null(),
            fence: vk::Fence::null(),
            queries: vk::QueryPool::null(),
            commands: vk::CommandBuffer::null(),
            spans: Vec::new(),
            path: Vec::new(),
            used: 0,
            time_dispatches: true,
            launches: 0,
            traces_rays: false,
            failed: None,
        };
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(gpu.inner.family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        let queries =
            vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(QUERIES);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the device is alive; what is made is stored at once, so `Drop` frees it on any error.
        unsafe {
            pass.pool = device.create_command_pool(&pool, None).context("creating a command pool")?;
            pass.fence =
                device.create_fence(&vk::FenceCreateInfo::default(), None).context("creating a fence")?;
            pass.queries = device.create_query_pool(&queries, None).context("creating a query pool")?;
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(pass.pool).command_buffer_count(1);
            pass.commands = device.allocate_command_buffers(&info).context("allocating a command buffer")?[0];
            device.begin_command_buffer(pass.commands, &begin).context("beginning a command buffer")?;
        }
        Ok(pass)
    }

    /// Whether single dispatches get spans of their own (they do at first); scopes always have one.
    ///
    /// A timestamp costs about a microsecond, which counts where hundreds of small kernels follow each
    /// other.
    pub fn time_dispatches(&mut self, yes: bool) {
        self.time_dispatches = yes;
    }

    /// Times all that `record` records as one span, inside which further spans lie.
    pub fn scope<R>(&mut self, name: &str, record: impl FnOnce(&mut Self) -> R) -> R {
        self.path.push(name.into());
        let span = self.begin_span();
        let result = record(self);
        self.end_span(span);
        self.path.pop();
        result
    }

    /// Runs `kernel` in `groups` workgroups.
    pub fn dispatch<P: NoUninit>(&mut self, name: &str, kernel: &Kernel, push: &P, groups: u32) {
        let limit = self.gpu.info().max_workgroups[0];
        if groups > limit {
            self.failed.get_or_insert(Error::TooManyGroups { name: name.into(), groups, limit });
            return;
        }
        self.launch(name, kernel, push, |device, commands| {
            // SAFETY: `launch` has bound a pipeline and its push constants; `groups` is within limits.
            unsafe { device.cmd_dispatch(commands, groups, 1, 1) };
        });
    }

    /// Runs `kernel` in as many workgroups as three u32 at byte `offset` of `arguments` say.
    pub fn dispatch_indirect<P: NoUninit>(
        &mut self,
        name: &str,
        kernel: &Kernel,
        push: &P,
        arguments: &Buffer,
        offset: u64,
    ) {
        assert!(
            offset.is_multiple_of(4) && offset + 12 <= arguments.bytes(),
            "{name}: arguments lie in their buffer"
        );
        let handle = arguments.handle;
        self.launch(name, kernel, push, |device, commands| {
            // SAFETY: as in `dispatch`; the arguments lie inside a buffer with INDIRECT usage.
            unsafe { device.cmd_dispatch_indirect(commands, handle, offset) };
        });
    }

    fn launch<P: NoUninit>(
        &mut self,
        name: &str,
        kernel: &Kernel,
        push: &P,
        run: impl FnOnce(&ash::Device, vk::CommandBuffer),
    ) {
        let push = bytemuck::bytes_of(push);
        assert!(push.len() <= PUSH_BYTES as usize, "{name}: arguments fit the push constants");
        self.timed(name, |inner, commands| {
            // SAFETY: the command buffer is recording; the pipeline was made with this layout.
            unsafe {
                inner.device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, kernel.pipeline);
                let stages = vk::ShaderStageFlags::COMPUTE;
                inner.device.cmd_push_constants(commands, inner.layout, stages, 0, push);
            }
            run(&inner.device, commands);
        });
    }

    /// Records one command after all others, with a span of its own where single dispatches get one.
    pub(super) fn timed(&mut self, name: &str, record: impl FnOnce(&Inner, vk::CommandBuffer)) {
        self.barrier();
        let span = self.time_dispatches.then(|| {
            self.path.push(name.into());
            self.begin_span()
        });
        record(&self.gpu.inner, self.commands);
        if let Some(span) = span {
            self.end_span(span);
            self.path.pop();
        }
    }

    /// From here on barriers are for the driver's ray tracing, too.
    pub(super) fn traces_rays(&mut self) {
        self.traces_rays = true;
    }

    /// Sets every 32-bit word of `buffer` to `value`.
    pub fn fill(&mut self, buffer: &Buffer, value: u32) {
        self.barrier();
        // SAFETY: the command buffer is recording; the buffer has TRANSFER_DST usage.
        unsafe {
            self.gpu.inner.device.cmd_fill_buffer(self.commands, buffer.handle, 0, vk::WHOLE_SIZE, value)
        };
    }

    /// Copies `bytes` between buffers.
    pub fn copy(&mut self, from: &Buffer, from_offset: u64, to: &Buffer, to_offset: u64, bytes: u64) {
        assert!(
            from_offset + bytes <= from.bytes() && to_offset + bytes <= to.bytes(),
            "copies lie in their buffers"
        );
        let region = vk::BufferCopy::default().src_offset(from_offset).dst_offset(to_offset).size(bytes);
        self.copy_raw(from.handle, to.handle, region);
    }

    pub(super) fn copy_raw(&mut self, from: vk::Buffer, to: vk::Buffer, region: vk::BufferCopy) {
        self.barrier();
        // SAFETY: the command buffer is recording, and callers pass regions inside both buffers.
        unsafe { self.gpu.inner.device.cmd_copy_buffer(self.commands, from, to, &[region]) };
    }

    /// Stands before each command that is launched.
    fn barrier(&mut self) {
        self.launches += 1;
        let mut stages = vk::PipelineStageFlags2::COMPUTE_SHADER | vk::PipelineStageFlags2::ALL_TRANSFER;
        let mut written = vk::AccessFlags2::SHADER_WRITE | vk::AccessFlags2::TRANSFER_WRITE;
        let mut read = vk::AccessFlags2::SHADER_READ
            | vk::AccessFlags2::TRANSFER_READ
            | vk::AccessFlags2::INDIRECT_COMMAND_READ;
        if self.traces_rays {
            stages |= vk::PipelineStageFlags2::RAY_TRACING_SHADER_KHR
                | vk::PipelineStageFlags2::ACCELERATION_STRUCTURE_BUILD_KHR;
            written |= vk::AccessFlags2::ACCELERATION_STRUCTURE_WRITE_KHR;
            read |= vk::AccessFlags2::ACCELERATION_STRUCTURE_READ_KHR;
        }
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(stages)
            .src_access_mask(written)
            .dst_stage_mask(stages | vk::PipelineStageFlags2::DRAW_INDIRECT)
            .dst_access_mask(read | written)];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: the command buffer is recording; synchronization2 is enabled.
        unsafe { self.gpu.inner.device.cmd_pipeline_barrier2(self.commands, &info) };
    }

    /// Writes the first of a span's two timestamps. `None` when the pass is full.
    fn begin_span(&mut self) -> Option<usize> {
        if self.used + 2 > QUERIES {
            self.failed.get_or_insert(Error::TooManySpans(QUERIES / 2));
            return None;
        }
        let begin = self.used;
        if begin.is_multiple_of(QUERIES_RESET) {
            // SAFETY: the command buffer is recording, and QUERIES is a multiple of QUERIES_RESET.
            unsafe {
                let device = &self.gpu.inner.device;
                device.cmd_reset_query_pool(self.commands, self.queries, begin, QUERIES_RESET);
            }
        }
        self.used += 2;
        self.spans.push((self.path.join("/"), begin, begin + 1));
        self.timestamp(begin);
        Some(self.spans.len() - 1)
    }

    fn end_span(&mut self, span: Option<usize>) {
        if let Some(span) = span {
            let end = self.spans[span].2;
            self.timestamp(end);
        }
    }

    fn timestamp(&self, query: u32) {
        // SAFETY: the command buffer is recording, the query is in range and `begin_span` reset it.
        unsafe {
            self.gpu.inner.device.cmd_write_timestamp2(
                self.commands,
                vk::PipelineStageFlags2::ALL_COMMANDS,
                self.queries,
                query,
            );
        }
    }

    /// Runs everything recorded, waits for it, and reads the timestamps.
    ///
    /// # Errors
    /// The device was lost, or something could not be recorded.
    pub fn submit(mut self) -> Result<Timings, Error> {
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        let inner = &self.gpu.inner;
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(self.commands)];
        let submits = [vk::SubmitInfo2::default().command_buffer_infos(&commands)];
        let mut ticks = vec![0u64; self.used as usize];
        // SAFETY: the command buffer is complete, the queue is used by one thread at a time (the lock),
        // and the fence is waited for before anything is freed.
        unsafe {
            let device = &inner.device;
            device.end_command_buffer(self.commands).context("ending a command buffer")?;
            {
                let queue = inner.queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                device.queue_submit2(*queue, &submits, self.fence).context("submitting")?;
            }
            device.wait_for_fences(&[self.fence], true, u64::MAX).context("waiting for the device")?;
            if self.used > 0 {
                device
                    .get_query_pool_results(
                        self.queries,
                        0,
                        &mut ticks,
                        vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT,
                    )
                    .context("reading timestamps")?;
            }
        }
        let spans = std::mem::take(&mut self.spans);
        let spans = spans
            .into_iter()
            .map(|(path, begin, end)| Span {
                path,
                milliseconds: inner.tick.milliseconds(ticks[begin as usize], ticks[end as usize]),
            })
            .collect();
        Ok(Timings { spans, launches: self.launches })
    }
}

impl Drop for Pass {
    fn drop(&mut self) {
        // SAFETY: either nothing was submitted or `submit` waited for it (or the device is lost, when
        // freeing is allowed); null handles are ignored.
        unsafe {
            let device = &self.gpu.inner.device;
            device.destroy_query_pool(self.queries, None);
            device.destroy_fence(self.fence, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_become_milliseconds_over_a_wrap_of_the_counter() {
        let timing = Timing { period_ns: 10.0, bits: 36 };
        assert_eq!(timing.milliseconds(100, 100_100), 1.0);
        assert_eq!(timing.milliseconds((1 << 36) - 50, 50), 0.001);
        let timing = Timing { period_ns: 1.0, bits: 64 };
        assert_eq!(timing.milliseconds(u64::MAX, 999_999), 1.0);
    }
}
