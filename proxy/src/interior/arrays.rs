//! Lists of so many values in files, with an error that says how many there are where there are more.
//!
//! Where a list is longer than an array, the JSON reader itself only knows of "trailing characters".

use serde::de::Error;
use serde::{Deserialize, Deserializer};

/// Of a list of N values.
struct Exactly<T, const N: usize>([T; N]);

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Exactly<T, N> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let all = Vec::<T>::deserialize(from)?;
        let found = all.len();
        <[T; N]>::try_from(all).map(Self).map_err(|_| {
            let expected = format!("an array of length {N}");
            D::Error::invalid_length(found, &expected.as_str())
        })
    }
}

/// N values.
pub(super) fn exactly<'de, D, T, const N: usize>(from: D) -> Result<[T; N], D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    Exactly::<T, N>::deserialize(from).map(|Exactly(all)| all)
}

/// Points, of three numbers each.
pub(super) fn points<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<[f64; 3]>, D::Error> {
    let all = Vec::<Exactly<f64, 3>>::deserialize(from)?;
    Ok(all.into_iter().map(|Exactly(point)| point).collect())
}

/// Points, or null.
pub(super) fn points_or_none<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<Vec<[f64; 3]>>, D::Error> {
    let all = Option::<Vec<Exactly<f64, 3>>>::deserialize(from)?;
    Ok(all.map(|all| all.into_iter().map(|Exactly(point)| point).collect()))
}
