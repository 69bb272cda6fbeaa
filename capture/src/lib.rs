//! Photo sets: finding, ordering and decoding photos.
