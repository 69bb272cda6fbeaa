//! The approximate surface that carries rays to the photos.
