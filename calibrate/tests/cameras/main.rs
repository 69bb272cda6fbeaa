//! Camera models, exposures and what is written of them.

mod export;
mod exposure;
mod lens;
mod lens_any;
mod lens_range;
mod opencv_bad;
mod opencv_calibration;
mod opencv_find;
mod opencv_kinds;
mod opencv_projection;
mod opencv_storage;
mod period;
mod resized;
mod undistort;
