//! OpenCV calibrations: what `cv::FileStorage` writes, and the cameras and poses in it.
//!
//! OpenCV puts the first pixel's centre at (0, 0): principal points and corners are half a
//! pixel more here.
//!
//! ```no_run
//! use calibrate::opencv::{Keys, read_calibration};
//! use std::path::Path;
//!
//! let calibration = read_calibration(Path::new("out_camera_data.yml"), &Keys::default())?;
//! println!("{} poses", calibration.poses.len());
//! # Ok::<(), calibrate::opencv::OpenCvError>(())
//! ```

mod board;
mod calibration;
mod cameras;
mod coefficients;
mod error;
mod find;
mod flat;
mod json;
mod matrix;
mod poses;
mod storage;
mod values;
mod xml;
mod yaml;

pub use board::Board;
pub use calibration::{OpenCvCalibration, calibration, is_storage_name, read_calibration};
pub use cameras::{Keys, OpenCvCamera};
pub use error::OpenCvError;
pub use find::{FoundCalibrations, find_calibrations, is_calibration, may_be_calibration};
pub use storage::{DataType, Entries, FileStorage, Matrix, Node, Value};
