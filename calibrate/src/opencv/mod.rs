//! OpenCV calibrations: what `cv::FileStorage` writes, and the cameras and poses in it.

mod error;
mod json;
mod lens;
mod scalar;
mod storage;
mod xml;
mod yaml;

pub use error::OpenCvError;
pub use lens::{OpenCvDistortion, OpenCvLens, UnsupportedLens};
pub use storage::{DataType, Entries, FileStorage, Matrix, Node, Value};
