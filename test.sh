#!/usr/bin/env bash
# Everything that must hold before a change goes in: formatting, lints, documentation and
# all tests, those on the graphics device, by Vulkan and by OpenGL, with COLMAP and ffmpeg, and in
# a window on a virtual screen included. On Debian and Ubuntu it installs what is missing of these
# programs and of the software drivers.
set -euo pipefail
cd "$(dirname "$0")"

step() { printf '\n== %s (after %d s)\n' "$*" "$SECONDS"; }

has_vulkan_driver() {
    local folder
    for folder in /usr/share/vulkan/icd.d /etc/vulkan/icd.d /usr/local/share/vulkan/icd.d; do
        # Drivers for absent hardware do not count: the software one, or NVIDIA's, which is
        # only installed where its hardware is.
        compgen -G "$folder/lvp_icd*.json" >/dev/null && return
        compgen -G "$folder/nvidia_icd*.json" >/dev/null && return
    done
    return 1
}

has_vulkan_loader() {
    # Read to the end: under pipefail, stopping early would look like a failure.
    { ldconfig -p 2>/dev/null || /sbin/ldconfig -p; } | grep 'libvulkan\.so\.1' >/dev/null
}

has_opengl() {
    local libraries
    libraries=$(ldconfig -p 2>/dev/null || /sbin/ldconfig -p)
    # The dispatcher, and someone's driver behind it.
    grep 'libEGL\.so\.1' <<<"$libraries" >/dev/null &&
        grep -E 'libEGL_(mesa|nvidia)\.so\.0' <<<"$libraries" >/dev/null
}

has_x11() {
    # What the window looks for when it is opened.
    local libraries name
    libraries=$(ldconfig -p 2>/dev/null || /sbin/ldconfig -p)
    for name in libX11 libX11-xcb libXcursor libXi libxkbcommon libxkbcommon-x11; do
        grep "$name\.so" <<<"$libraries" >/dev/null || return
    done
}

install_missing() {
    local missing=() as_root=()
    has_vulkan_driver && has_vulkan_loader || missing+=(mesa-vulkan-drivers libvulkan1)
    has_opengl || missing+=(libegl1 libegl-mesa0 libgl1-mesa-dri)
    command -v colmap >/dev/null || missing+=(colmap)
    command -v ffmpeg >/dev/null || missing+=(ffmpeg)
    command -v Xvfb >/dev/null || missing+=(xvfb)
    command -v xdotool >/dev/null || missing+=(xdotool)
    command -v xprop >/dev/null || missing+=(x11-utils)
    has_x11 || missing+=(libx11-6 libx11-xcb1 libxcursor1 libxi6 libxkbcommon0 libxkbcommon-x11-0)
    if [ ${#missing[@]} -eq 0 ]; then return; fi
    step "installing ${missing[*]}"
    if [ "$(id -u)" -ne 0 ]; then as_root=(sudo); fi
    "${as_root[@]}" apt-get update
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y --no-install-recommends "${missing[@]}"
}

if [ "$(uname -s)" = Linux ]; then install_missing; fi

step "formatting"
cargo fmt --all --check

step "lints"
# Of the fuzz targets, too: fuzz/README.md says how to run them.
cargo clippy --workspace --all-targets --features lumigraph-fuzz/targets -- -D warnings

step "without the window"
# Beside the window's own crate, so that what all have in common is as it was built before.
cargo clippy --workspace --no-default-features -- -D warnings
without=$(cargo tree --no-default-features -e normal --prefix none)
if grep -E '^(winit|egui)' <<<"$without"; then exit 1; fi

step "documentation"
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

step "tests"
LUMIGRAPH_REQUIRE_GPU=1 LUMIGRAPH_REQUIRE_TOOLS=1 cargo test --workspace

step "planted faults"
tests/planted.sh

if [ "$(uname -s)" = Linux ]; then
    step "tests on the graphics device, by OpenGL"
    export WGPU_BACKEND=gl LUMIGRAPH_REQUIRE_GPU=1
    cargo test --workspace --lib gpu::
    # Of these, what a device draws.
    cargo test --workspace --test pictures -- edges::every_engine engines lens_edge:: limits:: residency:: exposure:: ldi::device:: \
        invariance::moving invariance::a_batch \
        masks::at masks::masked masks::triangulated masks::what_every mattes::mattes mattes::soft \
        mesh::every_engine mesh::a_view points::every_engine points::a_view \
        time::engines time::triangulated time::a_whole_period
    cargo test --workspace --test cli -- gpu:: a_graphics_device
fi

step "all is well"
