//! Finding a graphics adapter and opening it, without a window: for drawing and for computing.

use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{
    Adapter, Backends, Device, DeviceDescriptor, DeviceType, Features, Instance, InstanceDescriptor,
    InstanceFlags, Limits, Queue,
};

/// What an adapter could not do, and what to try. The caller adds how to do without one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct GpuError(String);

/// An open graphics device, with no more than the least limits and features (`Limits::downlevel_defaults`).
#[derive(Debug)]
pub struct Gpu {
    /// The device.
    pub device: Device,
    /// Its one queue.
    pub queue: Queue,
    /// What it was asked for.
    pub limits: Limits,
    /// Whether the adapter is a program and not a device.
    pub software: bool,
    /// Adapter, driver and interface, for people.
    pub info: String,
    /// The first error that the device reported outside a call; later ones follow from it.
    fault: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the best adapter: a discrete GPU before an integrated one before a software one.
    ///
    /// # Errors
    /// When there is no adapter, or none that will do.
    pub fn open() -> Result<Self, GpuError> {
        Self::open_where("graphics adapter", |_| true).map_err(|found| {
            GpuError(format!(
                "{found}; install a Vulkan driver (software is enough: mesa-vulkan-drivers on Debian and Ubuntu)"
            ))
        })
    }

    /// Opens the best adapter that is a device and not a program.
    ///
    /// # Errors
    /// When there is none, or none that will do.
    pub fn open_hardware() -> Result<Self, GpuError> {
        Self::open_where("graphics adapter but software", |kind| kind != DeviceType::Cpu).map_err(GpuError)
    }

    fn open_where(what: &str, wanted: impl Fn(DeviceType) -> bool) -> Result<Self, String> {
        let instance = windowless_instance();
        let mut adapters = pollster::block_on(instance.enumerate_adapters(Backends::PRIMARY));
        adapters.retain(|adapter| wanted(adapter.get_info().device_type));
        adapters.sort_by_key(|adapter| preference(adapter.get_info().device_type));
        let mut refusals = Vec::new();
        for adapter in adapters {
            match Self::open_adapter(&adapter) {
                Ok(gpu) => return Ok(gpu),
                Err(refusal) => refusals.push(format!("{}: {refusal}", adapter.get_info().name)),
            }
        }
        Err(if refusals.is_empty() {
            format!("no {what} found")
        } else {
            format!("no usable {what} ({})", refusals.join("; "))
        })
    }

    fn open_adapter(adapter: &Adapter) -> Result<Self, String> {
        // Little is asked for, so that old devices will do: one more image than the least is drawn at a time.
        let limits = Limits { max_color_attachments: 5, ..Limits::downlevel_defaults() }
            .using_resolution(adapter.limits());
        let (device, queue) = pollster::block_on(adapter.request_device(&DeviceDescriptor {
            label: Some("grip"),
            required_features: Features::empty(),
            required_limits: limits.clone(),
            ..Default::default()
        }))
        .map_err(|error| error.to_string())?;
        let fault = Arc::new(Mutex::new(None));
        // By default wgpu panics on these.
        let slot = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error| record(&slot, error.to_string())));
        let slot = fault.clone();
        device.set_device_lost_callback(move |_, message| {
            record(&slot, format!("device lost: {message}"));
        });
        let info = adapter.get_info();
        Ok(Self {
            device,
            queue,
            limits,
            software: info.device_type == DeviceType::Cpu,
            info: format!(
                "{} ({:?}, {:?}, {} {})",
                info.name, info.device_type, info.backend, info.driver, info.driver_info
            ),
            fault,
        })
    }

    /// An error if the device has reported one since it was opened.
    ///
    /// # Errors
    /// What it reported first: later ones follow from it.
    pub fn check(&self) -> Result<(), GpuError> {
        let fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        fault
            .as_ref()
            .map_or(Ok(()), |message| Err(GpuError(format!("{message}; the driver may be at fault"))))
    }
}

/// An instance that never looks for a window system.
fn windowless_instance() -> Instance {
    #[cfg(target_os = "linux")]
    if let Some(instance) = quiet_vulkan() {
        return instance;
    }
    Instance::new(InstanceDescriptor {
        backends: Backends::PRIMARY,
        // No validation layers and no debug markers: they cost time and some print to stderr.
        flags: InstanceFlags::empty(),
        ..InstanceDescriptor::new_without_display_handle()
    })
}

/// Vulkan without the extensions for X11 and Wayland windows. wgpu asks for them always, and with them Mesa's device
/// selection layer goes looking for a display and complains on stderr where there is none; `None` without Vulkan.
#[cfg(target_os = "linux")]
#[expect(
    unsafe_code,
    reason = "wgpu takes a changed list of Vulkan extensions only through its unsafe interface"
)]
fn quiet_vulkan() -> Option<Instance> {
    const WINDOWS: [&std::ffi::CStr; 3] =
        [c"VK_KHR_xlib_surface", c"VK_KHR_xcb_surface", c"VK_KHR_wayland_surface"];
    let descriptor = wgpu::hal::InstanceDescriptor {
        name: "grip",
        flags: InstanceFlags::empty(),
        memory_budget_thresholds: Default::default(),
        backend_options: Default::default(),
        telemetry: None,
        display: None,
    };
    let without_windows: Box<wgpu::hal::vulkan::CreateInstanceCallback<'_>> = Box::new(|args| {
        args.extensions.retain(|name| !WINDOWS.contains(name));
    });
    // SAFETY: the three extensions serve nothing but surfaces for windows, which this module never makes; no other
    // extension that wgpu enables depends on them, and nothing is added.
    unsafe {
        let instance = wgpu::hal::vulkan::Instance::init_with_callback(&descriptor, Some(without_windows));
        instance.ok().map(|instance| Instance::from_hal::<wgpu::hal::api::Vulkan>(instance))
    }
}

fn record(slot: &Mutex<Option<String>>, message: String) {
    let mut fault = slot.lock().unwrap_or_else(PoisonError::into_inner);
    fault.get_or_insert(message);
}

fn preference(device: DeviceType) -> u8 {
    match device {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    }
}
