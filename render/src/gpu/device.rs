//! Which graphics device draws, and what is known of it.

use super::ShadeBy;
use crate::RenderError;
use std::sync::{Arc, Mutex};
use wgpu::{Backends, DownlevelFlags, Features, Limits};

/// Tighter limits than a device's own, for devices that are shared and for tests: pictures do
/// not depend on them. `None` leaves the device's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceLimits {
    /// Layers of a texture array.
    pub array_layers: Option<u32>,
    /// Texels along a texture's side.
    pub texture_side: Option<u32>,
    /// Bytes of a buffer.
    pub buffer_bytes: Option<u64>,
    /// Bytes of a texture array of photos; making a larger one fails as if memory had run out.
    pub array_bytes: Option<u64>,
    /// By what colours are computed; `None` for what is faster there.
    pub shade_by: Option<ShadeBy>,
}

impl DeviceLimits {
    /// What a device with these limits may be asked for.
    fn within(&self, own: Limits) -> Limits {
        let lower = |limit: u32, asked: Option<u32>| asked.map_or(limit, |asked| asked.min(limit));
        let bytes = self.buffer_bytes.unwrap_or(u64::MAX);
        Limits {
            max_texture_array_layers: lower(own.max_texture_array_layers, self.array_layers),
            max_texture_dimension_2d: lower(own.max_texture_dimension_2d, self.texture_side),
            max_buffer_size: own.max_buffer_size.min(bytes),
            max_storage_buffer_binding_size: own.max_storage_buffer_binding_size.min(bytes),
            max_uniform_buffer_binding_size: own.max_uniform_buffer_binding_size.min(bytes),
            ..own
        }
    }
}

/// A device that answers.
#[derive(Clone)]
pub(super) struct Opened {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub info: wgpu::AdapterInfo,
    pub limits: Limits,
    /// Whether passes tell how long they took.
    pub timestamps: bool,
    pub trouble: Trouble,
}

/// What a device said that no call returned.
#[derive(Clone, Debug, Default)]
pub(super) struct Trouble {
    said: Arc<Mutex<Said>>,
}

#[derive(Debug, Default)]
struct Said {
    error: Option<RenderError>,
    lost: Option<String>,
}

impl Trouble {
    fn note(&self, change: impl FnOnce(&mut Said)) {
        if let Ok(mut said) = self.said.lock() {
            change(&mut said);
        }
    }

    /// As if the device had said so.
    #[cfg(test)]
    pub(super) fn say(&self, error: RenderError) {
        self.note(|said| said.error = Some(error));
    }

    /// Whether the device is gone for good, and why.
    pub(super) fn lost(&self) -> Option<String> {
        self.said.lock().ok().and_then(|said| said.lost.clone())
    }

    /// The first error since this was asked last; of a device that is lost always that it is.
    pub(super) fn take(&self) -> Result<(), RenderError> {
        let Ok(mut said) = self.said.lock() else {
            return Ok(());
        };
        let error = said.error.take();
        match (&said.lost, error) {
            (Some(why), _) => Err(RenderError::DeviceLost(why.clone())),
            (None, Some(error)) => Err(error),
            (None, None) => Ok(()),
        }
    }
}

/// Opens the best device: a real one before a software driver, then Vulkan, Metal and Direct3D
/// before OpenGL. One that lacks something is passed over for the next; software drivers are not
/// tried where only a `real` one is of use.
///
/// # Errors
/// None will do; the message says of each why.
pub(super) fn open(asked: &DeviceLimits, real: bool) -> Result<Opened, RenderError> {
    let mut refused = Vec::new();
    for adapter in adapters() {
        let info = adapter.get_info();
        if real && info.device_type == wgpu::DeviceType::Cpu {
            continue;
        }
        let name = describe(&info);
        let missing = missing(&adapter);
        if !missing.is_empty() {
            refused.push(format!("{name} lacks {}", missing.join(", ")));
            continue;
        }
        let limits = asked.within(adapter.limits());
        let timestamps = adapter.features().contains(Features::TIMESTAMP_QUERY);
        let requested = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("lumigraph"),
            required_features: if timestamps {
                Features::TIMESTAMP_QUERY
            } else {
                Features::empty()
            },
            required_limits: limits.clone(),
            ..Default::default()
        }));
        let (device, queue) = match requested {
            Ok(opened) => opened,
            Err(error) => {
                refused.push(format!("{name}: {error}"));
                continue;
            }
        };
        return Ok(Opened {
            trouble: listen(&device),
            device,
            queue,
            info,
            limits,
            timestamps,
        });
    }
    Err(RenderError::Gpu(if refused.is_empty() {
        "no graphics driver answers; install one, or use --device cpu".to_owned()
    } else {
        format!("none will do: {}; use --device cpu", refused.join("; "))
    }))
}

/// For people.
pub(super) fn describe(info: &wgpu::AdapterInfo) -> String {
    format!("{} ({:?})", info.name, info.backend)
}

/// All devices, the best first. OpenGL is only asked where nothing else drives a real device:
/// its libraries take their time and have things to say.
fn adapters() -> Vec<wgpu::Adapter> {
    let from_environment = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    let backends = from_environment.backends;
    let of = |backends: Backends| {
        if backends.is_empty() {
            return Vec::new();
        }
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        descriptor.backends = backends;
        pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(backends))
    };
    let is_real = |adapter: &wgpu::Adapter| adapter.get_info().device_type != wgpu::DeviceType::Cpu;
    let mut all = of(backends - Backends::GL);
    if !all
        .iter()
        .any(|adapter| is_real(adapter) && missing(adapter).is_empty())
    {
        all.extend(of(backends & Backends::GL));
    }
    // As they come where that says nothing.
    all.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    all
}

/// What a device would need and has not.
fn missing(adapter: &wgpu::Adapter) -> Vec<String> {
    let mut missing = missing_of(
        &adapter.limits(),
        adapter.get_downlevel_capabilities().flags,
    );
    use wgpu::TextureFormat as Format;
    let filtered = wgpu::TextureFormatFeatureFlags::FILTERABLE;
    for (format, what) in [
        (Format::Rgba8Unorm, "filtered photos"),
        (Format::R8Unorm, "filtered masks"),
        (Format::R16Float, "filtered half floats"),
    ] {
        if !adapter
            .get_texture_format_features(format)
            .flags
            .contains(filtered)
        {
            missing.push(what.to_owned());
        }
    }
    missing
}

fn missing_of(limits: &Limits, flags: DownlevelFlags) -> Vec<String> {
    let mut missing = Vec::new();
    if !flags.contains(DownlevelFlags::COMPUTE_SHADERS) {
        missing.push("compute shaders".to_owned());
    }
    for (has, needed, what) in [
        (
            limits.max_texture_dimension_2d,
            2048,
            "texels along a texture's side",
        ),
        (
            limits.max_texture_array_layers,
            32,
            "layers of a texture array",
        ),
        (
            limits.max_sampled_textures_per_shader_stage,
            10,
            "textures at once",
        ),
        (
            limits.max_storage_textures_per_shader_stage,
            1,
            "textures written at once",
        ),
        (limits.max_samplers_per_shader_stage, 2, "samplers at once"),
        (
            limits.max_storage_buffers_per_shader_stage,
            2,
            "storage buffers at once",
        ),
        (
            limits.max_compute_invocations_per_workgroup,
            64,
            "threads of a workgroup",
        ),
        (limits.max_bind_groups, 3, "bind groups"),
    ] {
        if has < needed {
            missing.push(format!("{what} ({has} of {needed})"));
        }
    }
    missing
}

/// What a device says, for callers.
pub(super) fn error_of(error: &wgpu::Error) -> RenderError {
    let message = error.to_string();
    match error {
        wgpu::Error::OutOfMemory { .. } => RenderError::DeviceFull(message),
        _ => RenderError::Gpu(message),
    }
}

/// Errors that no call returns are kept for the next one that can.
fn listen(device: &wgpu::Device) -> Trouble {
    let trouble = Trouble::default();
    let of_errors = trouble.clone();
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        let error = error_of(&error);
        of_errors.note(|said| {
            said.error.get_or_insert(error);
        });
    }));
    let of_loss = trouble.clone();
    device.set_device_lost_callback(move |reason, message| {
        of_loss.note(|said| {
            said.lost.get_or_insert_with(|| match message.is_empty() {
                true => format!("{reason:?}"),
                false => message,
            });
        });
    });
    trouble
}

#[cfg(test)]
mod tests {
    use super::super::pipelines::SHADERS;
    use super::*;
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use naga::{AddressSpace, ImageClass, ShaderStage, TypeInner};

    /// Some devices have none for them, and none is asked of any.
    #[test]
    fn pixels_and_corners_have_no_storage() {
        let own = SHADERS.map(|(_, parts)| parts.concat());
        let raster = include_str!("raster/raster.wgsl").to_owned();
        for source in own.into_iter().chain([raster]) {
            let module = naga::front::wgsl::parse_str(&source).unwrap();
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
            let info = validator.validate(&module).unwrap();
            for (i, entry) in module.entry_points.iter().enumerate() {
                if entry.stage == ShaderStage::Compute {
                    continue;
                }
                for (handle, global) in module.global_variables.iter() {
                    let class = match module.types[global.ty].inner {
                        TypeInner::Image { class, .. } => Some(class),
                        _ => None,
                    };
                    let is_stored = matches!(global.space, AddressSpace::Storage { .. })
                        || matches!(class, Some(ImageClass::Storage { .. }));
                    let is_used = !info.get_entry_point(i)[handle].is_empty();
                    assert!(!(is_stored && is_used), "{}: {:?}", entry.name, global.name);
                }
            }
        }
    }

    #[test]
    fn what_is_missing_is_named_with_what_there_is() {
        assert!(missing_of(&Limits::default(), DownlevelFlags::all()).is_empty());
        // What WebGPU asks of every device, also of the oldest with compute shaders.
        assert!(missing_of(&Limits::downlevel_defaults(), DownlevelFlags::all()).is_empty());
        // Only workgroups read and write buffers.
        let flags = DownlevelFlags::COMPUTE_SHADERS;
        assert!(missing_of(&Limits::default(), flags).is_empty());
        let poor = Limits {
            max_texture_array_layers: 8,
            ..Limits::downlevel_webgl2_defaults()
        };
        let flags = DownlevelFlags::all() - DownlevelFlags::COMPUTE_SHADERS;
        let missing = missing_of(&poor, flags).join(", ");
        for what in [
            "compute shaders",
            "layers of a texture array (8 of 32)",
            "storage buffers at once (0 of 2)",
            "threads of a workgroup (0 of 64)",
        ] {
            assert!(missing.contains(what), "{missing}");
        }
    }

    #[test]
    fn limits_only_ever_get_tighter() {
        let asked = DeviceLimits {
            array_layers: Some(1000),
            texture_side: Some(4096),
            buffer_bytes: Some(1 << 20),
            array_bytes: None,
            shade_by: None,
        };
        let limits = asked.within(Limits::default());
        assert_eq!(limits.max_texture_array_layers, 256);
        assert_eq!(limits.max_texture_dimension_2d, 4096);
        assert_eq!(limits.max_buffer_size, 1 << 20);
        assert_eq!(limits.max_storage_buffer_binding_size, 1 << 20);
        assert_eq!(
            DeviceLimits::default().within(Limits::default()),
            Limits::default()
        );
    }
}
