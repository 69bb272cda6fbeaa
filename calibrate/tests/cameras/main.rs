//! Camera models, exposures and what is written of them.

mod export;
mod exposure;
mod lens;
mod opencv_calibration;
mod opencv_find;
mod opencv_projection;
mod opencv_storage;
mod period;
mod undistort;
