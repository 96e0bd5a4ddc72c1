use super::{Error, Gpu, Pass, error::Context};
use ash::vk;
use bytemuck::{AnyBitPattern, NoUninit};
use std::fmt;

/// Bytes that one transfer between host and device moves at a time.
const STAGING_BYTES: u64 = 64 << 20;

/// Device memory, reached by kernels through its address.
///
/// Contents start undefined.
pub struct Buffer {
    gpu: Gpu,
    name: String,
    bytes: u64,
    address: u64,
    memory: vk::DeviceMemory,
    pub(super) handle: vk::Buffer,
}

impl fmt::Debug for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Buffer({}, {} bytes)", self.name, self.bytes)
    }
}

impl Buffer {
    /// Device address of the first byte, aligned to 16 or better.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// Usable bytes, a multiple of 16.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Overwrites the buffer from its start.
    ///
    /// # Errors
    /// A transfer failed.
    ///
    /// # Panics
    /// `data` is larger than the buffer.
    pub fn write<T: NoUninit>(&self, data: &[T]) -> Result<(), Error> {
        let data: &[u8] = bytemuck::cast_slice(data);
        assert!(data.len() as u64 <= self.bytes, "{}: {} bytes into {}", self.name, data.len(), self.bytes);
        if data.is_empty() {
            return Ok(());
        }
        let staging = Staging::new(&self.gpu, (data.len() as u64).min(STAGING_BYTES))?;
        for (i, chunk) in data.chunks(STAGING_BYTES as usize).enumerate() {
            // SAFETY: the mapping is at least `chunk.len()` bytes and no work on the device uses it now.
            unsafe { staging.mapped.copy_from_nonoverlapping(chunk.as_ptr(), chunk.len()) };
            let region =
                vk::BufferCopy::default().dst_offset(i as u64 * STAGING_BYTES).size(chunk.len() as u64);
            let mut pass = Pass::new(&self.gpu)?;
            pass.copy_raw(staging.handle, self.handle, region);
            pass.submit()?;
        }
        Ok(())
    }

    /// Reads `count` items from the item `first` on.
    ///
    /// # Errors
    /// A transfer failed.
    ///
    /// # Panics
    /// The range exceeds the buffer.
    pub fn read<T: AnyBitPattern + NoUninit>(&self, first: usize, count: usize) -> Result<Vec<T>, Error> {
        let size = size_of::<T>();
        let (from, len) = (first as u64 * size as u64, (count * size) as u64);
        assert!(from + len <= self.bytes, "{}: reading {from}+{len} of {} bytes", self.name, self.bytes);
        let mut out = vec![T::zeroed(); count];
        if count == 0 {
            return Ok(out);
        }
        let staging = Staging::new(&self.gpu, len.min(STAGING_BYTES))?;
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut out);
        for (i, chunk) in bytes.chunks_mut(STAGING_BYTES as usize).enumerate() {
            let region = vk::BufferCopy::default()
                .src_offset(from + i as u64 * STAGING_BYTES)
                .size(chunk.len() as u64);
            let mut pass = Pass::new(&self.gpu)?;
            pass.copy_raw(self.handle, staging.handle, region);
            pass.submit()?;
            // SAFETY: the copy has ended, and the mapping is coherent and at least this long.
            unsafe { staging.mapped.copy_to_nonoverlapping(chunk.as_mut_ptr(), chunk.len()) };
        }
        Ok(out)
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: every submission is waited for before `submit` returns, so nothing uses the buffer.
        unsafe {
            self.gpu.inner.device.destroy_buffer(self.handle, None);
            self.gpu.inner.device.free_memory(self.memory, None);
        }
    }
}

impl Gpu {
    /// Allocates `bytes` of device memory, rounded up to 16.
    ///
    /// # Errors
    /// Too little memory.
    pub fn buffer(&self, name: &str, bytes: u64) -> Result<Buffer, Error> {
        // Structures are built over buffers that were made for anything, such as the scene's triangles.
        let usage = match self.inner.ray_tracing {
            Some(_) => vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR,
            None => vk::BufferUsageFlags::empty(),
        };
        self.buffer_for(name, bytes, usage)
    }

    /// The same for a usage beside the usual ones.
    pub(super) fn buffer_for(
        &self,
        name: &str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
    ) -> Result<Buffer, Error> {
        let bytes = bytes.max(1).next_multiple_of(16);
        let usage = usage
            | vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        let (handle, memory) = self.allocate(name, bytes, usage, vk::MemoryPropertyFlags::DEVICE_LOCAL)?;
        let info = vk::BufferDeviceAddressInfo::default().buffer(handle);
        // SAFETY: the buffer was made with SHADER_DEVICE_ADDRESS and is bound to memory.
        let address = unsafe { self.inner.device.get_buffer_device_address(&info) };
        Ok(Buffer { gpu: self.clone(), name: name.into(), bytes, address, memory, handle })
    }

    /// Allocates a buffer and fills it with `data`.
    ///
    /// # Errors
    /// Too little memory, or a transfer failed.
    pub fn upload<T: NoUninit>(&self, name: &str, data: &[T]) -> Result<Buffer, Error> {
        let buffer = self.buffer(name, size_of_val(data) as u64)?;
        buffer.write(data)?;
        Ok(buffer)
    }

    fn allocate(
        &self,
        name: &str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        wanted: vk::MemoryPropertyFlags,
    ) -> Result<(vk::Buffer, vk::DeviceMemory), Error> {
        let device = &self.inner.device;
        let memory = &self.inner.memory;
        let heap = self.info().memory_bytes;
        let too_large = |free_hint| Error::OutOfMemory {
            what: name.into(),
            bytes,
            device: self.info().name.clone(),
            heap,
            free_hint,
        };
        if bytes > heap || bytes > self.info().max_allocation_bytes {
            return Err(too_large(false));
        }
        let out_of_memory = |result| match result {
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => too_large(true),
            other => Error::from_vk("allocating a buffer", other),
        };
        let create = vk::BufferCreateInfo::default().size(bytes).usage(usage);
        // SAFETY: `create` is valid for this live device.
        let handle = unsafe { device.create_buffer(&create, None) }.map_err(out_of_memory)?;
        // SAFETY: the buffer belongs to this device.
        let requirements = unsafe { device.get_buffer_memory_requirements(handle) };
        let types = &memory.memory_types[..memory.memory_type_count as usize];
        let kind = types.iter().enumerate().position(|(i, t)| {
            requirements.memory_type_bits & (1 << i) != 0 && t.property_flags.contains(wanted)
        });
        let mut flags = vk::MemoryAllocateFlagsInfo::default().flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
        let mut info = vk::MemoryAllocateInfo::default()
            .allocation_size(requirements.size)
            .memory_type_index(u32::try_from(kind.unwrap_or(0)).expect("few types"));
        if usage.contains(vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS) {
            info = info.push_next(&mut flags);
        }
        // SAFETY: `info` is valid; the buffer is not yet bound.
        let result = unsafe {
            device.allocate_memory(&info, None).and_then(|memory| {
                device.bind_buffer_memory(handle, memory, 0).map(|()| memory).inspect_err(|_| {
                    device.free_memory(memory, None);
                })
            })
        };
        match result {
            Ok(memory) => Ok((handle, memory)),
            Err(result) => {
                // SAFETY: the buffer was made above and nothing uses it.
                unsafe { device.destroy_buffer(handle, None) };
                Err(out_of_memory(result))
            }
        }
    }
}

/// A mapped, coherent buffer that the host reads and writes.
pub(super) struct Staging {
    gpu: Gpu,
    handle: vk::Buffer,
    memory: vk::DeviceMemory,
    mapped: *mut u8,
}

impl Staging {
    /// Vulkan's handle.
    pub(super) fn handle(&self) -> vk::Buffer {
        self.handle
    }

    /// Its first byte; it stays where it is until it is dropped.
    pub(super) fn mapped(&self) -> *mut u8 {
        self.mapped
    }

    pub(super) fn new(gpu: &Gpu, bytes: u64) -> Result<Self, Error> {
        let usage = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        let coherent = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        // Cached memory makes reading back many times faster; Vulkan promises only the coherent kind.
        let (handle, memory) = gpu
            .allocate("staging", bytes, usage, coherent | vk::MemoryPropertyFlags::HOST_CACHED)
            .or_else(|_| gpu.allocate("staging", bytes, usage, coherent))?;
        // SAFETY: the memory is host visible and not mapped yet; it stays mapped until it is freed.
        let mapped =
            unsafe { gpu.inner.device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()) };
        match mapped.context("mapping staging memory") {
            Ok(pointer) => Ok(Self { gpu: gpu.clone(), handle, memory, mapped: pointer.cast() }),
            Err(error) => {
                // SAFETY: both were made above and nothing uses them.
                unsafe {
                    gpu.inner.device.destroy_buffer(handle, None);
                    gpu.inner.device.free_memory(memory, None);
                }
                Err(error)
            }
        }
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // SAFETY: every transfer was waited for; freeing the memory unmaps it.
        unsafe {
            self.gpu.inner.device.destroy_buffer(self.handle, None);
            self.gpu.inner.device.free_memory(self.memory, None);
        }
    }
}
