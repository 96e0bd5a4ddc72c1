//! Pictures in a window: a Vulkan surface, its swapchain, and copies of finished frames into it.
//!
//! Frames are made by the host, so a frame is one copy from mapped memory to an image of the swapchain. Every frame is
//! waited for before the next one is drawn: the window shows what is measured, and must not run beside it.

use super::{Error, Gpu, buffer::Staging, error::Context};
use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle, RawDisplayHandle};
use std::{ffi::CStr, slice, sync::Arc};

/// The orders of channels that frames can be written in, and whether red comes first.
const FORMATS: [(vk::Format, bool); 6] = [
    (vk::Format::B8G8R8A8_UNORM, false),
    (vk::Format::R8G8B8A8_UNORM, true),
    (vk::Format::A8B8G8R8_UNORM_PACK32, true),
    // Copies change no values: the eight bits arrive as they are, and are taken for sRGB in either case.
    (vk::Format::B8G8R8A8_SRGB, false),
    (vk::Format::R8G8B8A8_SRGB, true),
    (vk::Format::A8B8G8R8_SRGB_PACK32, true),
];

/// The instance extensions without which no window of that display can be drawn to.
///
/// # Errors
/// The loader has none for such a display.
pub(super) fn instance_extensions(
    entry: &ash::Entry,
    display: RawDisplayHandle,
) -> Result<Vec<&'static CStr>, Error> {
    let wanted = ash_window::enumerate_required_extensions(display).context("looking for a display")?;
    // SAFETY: these are pointers to the names of extensions, which are static and end with a zero.
    let wanted: Vec<&CStr> = wanted.iter().map(|name| unsafe { CStr::from_ptr(*name) }).collect();
    // SAFETY: `entry` is loaded.
    let there =
        unsafe { entry.enumerate_instance_extension_properties(None) }.context("listing extensions")?;
    let has = |name: &CStr| there.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    match wanted.iter().find(|name| !has(name)) {
        Some(name) => Err(Error::NoPresentation {
            device: "the Vulkan loader".into(),
            reason: format!("it has no {}", name.to_string_lossy()),
        }),
        None => Ok(wanted),
    }
}

/// Shows pictures in a window, which it keeps alive.
pub struct Presenter {
    gpu: Gpu,
    surface: vk::SurfaceKHR,
    surfaces: khr::surface::Instance,
    swapchains: khr::swapchain::Device,
    format: vk::SurfaceFormatKHR,
    red_first: bool,
    mode: vk::PresentModeKHR,
    /// Of the window, as its owner told last.
    size: (u32, u32),
    /// Nothing while the window has no area, or when it has changed.
    chain: Option<Chain>,
    pool: vk::CommandPool,
    fence: vk::Fence,
    acquired: vk::Semaphore,
    /// Dropped last: the surface belongs to it.
    _window: Arc<dyn Keep>,
}

/// Anything that can be kept.
trait Keep {}
impl<T> Keep for T {}

/// The swapchain for one size of the window.
struct Chain {
    handle: vk::SwapchainKHR,
    size: (u32, u32),
    images: Vec<vk::Image>,
    /// One an image: signalled when the copy into it is done.
    copied: Vec<vk::Semaphore>,
    staging: Staging,
}

impl Presenter {
    /// Shows pictures in `window`, whose size in pixels is `size`, on a device that was opened for its display
    /// ([`Gpu::open_for_display`]).
    ///
    /// # Errors
    /// The device cannot draw to this window.
    pub fn new<W>(gpu: &Gpu, window: Arc<W>, size: (u32, u32)) -> Result<Self, Error>
    where
        W: HasDisplayHandle + HasWindowHandle + 'static,
    {
        let inner = &gpu.inner;
        let no =
            |reason: &str| Error::NoPresentation { device: gpu.info().name.clone(), reason: reason.into() };
        let gone = |_| no("the window is gone");
        let display = window.display_handle().map_err(gone)?.as_raw();
        let handle = window.window_handle().map_err(gone)?.as_raw();
        if !inner.presents {
            return Err(no("it was not opened for a display"));
        }
        let (entry, instance) = inner.vulkan();
        let surfaces = khr::surface::Instance::new(entry, instance);
        // SAFETY: the handles are those of a live window, which is kept until the surface is destroyed, and the
        // instance has the extensions for such a display.
        let surface = unsafe { ash_window::create_surface(entry, instance, display, handle, None) }
            .context("making a surface of the window")?;
        let mut presenter = Self {
            swapchains: khr::swapchain::Device::new(instance, &inner.device),
            gpu: gpu.clone(),
            surface,
            surfaces,
            format: vk::SurfaceFormatKHR::default(),
            red_first: false,
            mode: vk::PresentModeKHR::FIFO,
            size,
            chain: None,
            pool: vk::CommandPool::null(),
            fence: vk::Fence::null(),
            acquired: vk::Semaphore::null(),
            _window: window,
        };
        // SAFETY: the surface and the physical device belong to the same live instance.
        let (shows, formats, modes) = unsafe {
            let surfaces = &presenter.surfaces;
            let of = inner.physical;
            (
                surfaces
                    .get_physical_device_surface_support(of, inner.family, surface)
                    .context("asking for surfaces")?,
                surfaces.get_physical_device_surface_formats(of, surface).context("asking for formats")?,
                surfaces
                    .get_physical_device_surface_present_modes(of, surface)
                    .context("asking for ways to show")?,
            )
        };
        if !shows {
            return Err(no("its compute queue does not reach the screen"));
        }
        let fits = |(wanted, red_first): (vk::Format, bool)| {
            let fits = |f: &&vk::SurfaceFormatKHR| {
                f.format == wanted && f.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR
            };
            formats.iter().find(fits).map(|format| (*format, red_first))
        };
        (presenter.format, presenter.red_first) = FORMATS
            .into_iter()
            .find_map(fits)
            .ok_or_else(|| no("it has no format of eight bits a channel"))?;
        // The newest frame as soon as the screen can take it, without waiting for those before it.
        if modes.contains(&vk::PresentModeKHR::MAILBOX) {
            presenter.mode = vk::PresentModeKHR::MAILBOX;
        }
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(inner.family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the device is alive; what is made is stored at once, so `Drop` frees it on any error.
        unsafe {
            let device = &inner.device;
            presenter.pool = device.create_command_pool(&pool, None).context("creating a command pool")?;
            presenter.fence =
                device.create_fence(&vk::FenceCreateInfo::default(), None).context("creating a fence")?;
            presenter.acquired = device
                .create_semaphore(&vk::SemaphoreCreateInfo::default(), None)
                .context("creating a semaphore")?;
        }
        Ok(presenter)
    }

    /// The window has another size now.
    pub fn resize(&mut self, size: (u32, u32)) {
        if self.size != size {
            self.size = size;
            self.drop_chain();
        }
    }

    /// Width and height of the next frame; nothing while the window has no area.
    ///
    /// # Errors
    /// The swapchain cannot be made.
    pub fn frame(&mut self) -> Result<Option<(u32, u32)>, Error> {
        if self.chain.is_none() {
            self.chain = self.make_chain()?;
        }
        Ok(self.chain.as_ref().map(|chain| chain.size))
    }

    /// Shows a frame of the size that [`Presenter::frame`] gave, eight-bit sRGB, row by row from the top. Where the
    /// window has changed since, nothing may be seen until the next one.
    ///
    /// # Errors
    /// The device or the window was lost.
    ///
    /// # Panics
    /// The frame has another number of pixels.
    pub fn show(&mut self, pixels: &[[u8; 3]]) -> Result<(), Error> {
        let Some(chain) = &self.chain else { return Ok(()) };
        assert_eq!(pixels.len(), chain.size.0 as usize * chain.size.1 as usize, "a frame fills the window");
        // SAFETY: the mapping has four bytes a pixel, lives as long as the chain, and no work on the device reads it:
        // each frame is waited for below.
        let mapped =
            unsafe { slice::from_raw_parts_mut(chain.staging.mapped().cast::<[u8; 4]>(), pixels.len()) };
        for (to, &[red, green, blue]) in mapped.iter_mut().zip(pixels) {
            *to = if self.red_first { [red, green, blue, 255] } else { [blue, green, red, 255] };
        }
        // SAFETY: the swapchain is alive, and the semaphore is not signalled: the last frame has waited for it.
        let acquired = unsafe {
            self.swapchains.acquire_next_image(chain.handle, u64::MAX, self.acquired, vk::Fence::null())
        };
        let (index, mut stale) = match acquired {
            Ok(image) => image,
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                self.drop_chain();
                return Ok(());
            }
            Err(result) => return Err(Error::from_vk("acquiring an image of the window", result)),
        };
        self.copy(chain, index as usize)?;
        let (waits, chains, indices) = ([chain.copied[index as usize]], [chain.handle], [index]);
        let info =
            vk::PresentInfoKHR::default().wait_semaphores(&waits).swapchains(&chains).image_indices(&indices);
        let inner = &self.gpu.inner;
        let shown = {
            let queue = inner.queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            // SAFETY: the image was acquired, its copy signals the semaphore, and the lock is held.
            unsafe { self.swapchains.queue_present(*queue, &info) }
        };
        match shown {
            Ok(suboptimal) => stale |= suboptimal,
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => stale = true,
            Err(result) => return Err(Error::from_vk("showing a frame", result)),
        }
        if stale {
            self.drop_chain();
        }
        Ok(())
    }

    /// Copies the mapped frame into an image of the swapchain and waits for it.
    fn copy(&self, chain: &Chain, index: usize) -> Result<(), Error> {
        let inner = &self.gpu.inner;
        let device = &inner.device;
        let image = chain.images[index];
        let colour = vk::ImageAspectFlags::COLOR;
        let whole = vk::ImageSubresourceRange::default().aspect_mask(colour).level_count(1).layer_count(1);
        // What was in the image before does not matter. The acquisition is waited for in the copying stage.
        let to_write = vk::ImageMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)
            .dst_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image)
            .subresource_range(whole);
        let to_show = vk::ImageMemoryBarrier2 {
            src_access_mask: vk::AccessFlags2::TRANSFER_WRITE,
            dst_access_mask: vk::AccessFlags2::NONE,
            old_layout: vk::ImageLayout::TRANSFER_DST_OPTIMAL,
            new_layout: vk::ImageLayout::PRESENT_SRC_KHR,
            ..to_write
        };
        let region = vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers::default().aspect_mask(colour).layer_count(1))
            .image_extent(vk::Extent3D { width: chain.size.0, height: chain.size.1, depth: 1 });
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let allocate =
            vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        // SAFETY: the pool's last command buffer has ended (its fence was waited for), and everything recorded is alive
        // until this one has: the fence is waited for before the call returns.
        unsafe {
            device
                .reset_command_pool(self.pool, vk::CommandPoolResetFlags::RELEASE_RESOURCES)
                .context("resetting a command pool")?;
            let commands =
                device.allocate_command_buffers(&allocate).context("allocating a command buffer")?[0];
            device.begin_command_buffer(commands, &begin).context("beginning a command buffer")?;
            let barrier = |barrier| {
                let barriers = [barrier];
                let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
                device.cmd_pipeline_barrier2(commands, &info);
            };
            barrier(to_write);
            let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
            device.cmd_copy_buffer_to_image(commands, chain.staging.handle(), image, layout, &[region]);
            barrier(to_show);
            device.end_command_buffer(commands).context("ending a command buffer")?;
            let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
            let waits = [vk::SemaphoreSubmitInfo::default()
                .semaphore(self.acquired)
                .stage_mask(vk::PipelineStageFlags2::ALL_TRANSFER)];
            let signals = [vk::SemaphoreSubmitInfo::default()
                .semaphore(chain.copied[index])
                .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)];
            let submits = [vk::SubmitInfo2::default()
                .command_buffer_infos(&commands)
                .wait_semaphore_infos(&waits)
                .signal_semaphore_infos(&signals)];
            {
                let queue = inner.queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                device.queue_submit2(*queue, &submits, self.fence).context("submitting a frame")?;
            }
            device.wait_for_fences(&[self.fence], true, u64::MAX).context("waiting for a frame")?;
            device.reset_fences(&[self.fence]).context("resetting a fence")
        }
    }

    /// A swapchain of the window's size, or nothing where that has no area.
    fn make_chain(&self) -> Result<Option<Chain>, Error> {
        let inner = &self.gpu.inner;
        // SAFETY: the surface and the physical device belong to the same live instance.
        let able =
            unsafe { self.surfaces.get_physical_device_surface_capabilities(inner.physical, self.surface) }
                .context("asking for the window's size")?;
        let (width, height) = match able.current_extent {
            // The window takes the swapchain's size.
            vk::Extent2D { width: u32::MAX, height: u32::MAX } => (
                self.size.0.clamp(able.min_image_extent.width, able.max_image_extent.width),
                self.size.1.clamp(able.min_image_extent.height, able.max_image_extent.height),
            ),
            extent => (extent.width, extent.height),
        };
        if width == 0 || height == 0 {
            return Ok(None);
        }
        let usage = vk::ImageUsageFlags::TRANSFER_DST;
        let no = |reason: &str| Error::NoPresentation {
            device: self.gpu.info().name.clone(),
            reason: reason.into(),
        };
        if !able.supported_usage_flags.contains(usage) {
            return Err(no("its windows take no copies"));
        }
        let most = if able.max_image_count == 0 { u32::MAX } else { able.max_image_count };
        let opaque = vk::CompositeAlphaFlagsKHR::OPAQUE;
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(self.surface)
            .min_image_count((able.min_image_count + 1).min(most))
            .image_format(self.format.format)
            .image_color_space(self.format.color_space)
            .image_extent(vk::Extent2D { width, height })
            .image_array_layers(1)
            .image_usage(usage)
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(able.current_transform)
            .composite_alpha(if able.supported_composite_alpha.contains(opaque) {
                opaque
            } else {
                vk::CompositeAlphaFlagsKHR::INHERIT
            })
            .present_mode(self.mode)
            .clipped(true);
        let staging = Staging::new(&self.gpu, u64::from(width) * u64::from(height) * 4)?;
        // SAFETY: the surface is alive and has no other swapchain; each thing made is destroyed by `drop_chain`, or below
        // where the next one fails.
        unsafe {
            let handle = self.swapchains.create_swapchain(&info, None).context("making a swapchain")?;
            let mut chain = Chain { handle, size: (width, height), images: vec![], copied: vec![], staging };
            let filled = self.swapchains.get_swapchain_images(handle).and_then(|images| {
                for _ in &images {
                    let semaphore =
                        inner.device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None)?;
                    chain.copied.push(semaphore);
                }
                chain.images = images;
                Ok(())
            });
            if let Err(result) = filled {
                self.destroy(chain);
                return Err(Error::from_vk("making a swapchain", result));
            }
            Ok(Some(chain))
        }
    }

    fn drop_chain(&mut self) {
        if let Some(chain) = self.chain.take() {
            // SAFETY: `destroy` waits until nothing of the chain is in use.
            unsafe { self.destroy(chain) };
        }
    }

    /// Destroys a swapchain that nobody will draw to any more.
    ///
    /// # Safety
    /// Nothing else may refer to it.
    unsafe fn destroy(&self, chain: Chain) {
        let device = &self.gpu.inner.device;
        // SAFETY: the device is idle afterwards, so neither copies nor the screen's engine use these any more.
        unsafe {
            let _ = device.device_wait_idle();
            for semaphore in &chain.copied {
                device.destroy_semaphore(*semaphore, None);
            }
            self.swapchains.destroy_swapchain(chain.handle, None);
        }
    }
}

impl Drop for Presenter {
    fn drop(&mut self) {
        self.drop_chain();
        let device = &self.gpu.inner.device;
        // SAFETY: the last frame was waited for, and the swapchain is gone; null handles are ignored. The window, and
        // with it the connection to its display, is dropped after this.
        unsafe {
            let _ = device.device_wait_idle();
            device.destroy_semaphore(self.acquired, None);
            device.destroy_fence(self.fence, None);
            device.destroy_command_pool(self.pool, None);
            self.surfaces.destroy_surface(self.surface, None);
        }
    }
}
