//! Names and numbers as messages show them.

/// A name out of a file as messages show it: characters that end a line, or command a terminal, are spelled out
/// (`\n`, `\u{1b}`).
pub fn shown_name(name: &str) -> String {
    let mut shown = String::with_capacity(name.len());
    for c in name.chars() {
        match c.is_control() {
            true => shown.extend(c.escape_default()),
            false => shown.push(c),
        }
    }
    shown
}

/// Digits of numbers in messages.
const DIGITS: i32 = 4;
/// Numbers from ten to the power of the first, up to that of the second, are written out.
const WRITTEN_OUT: [i32; 2] = [-4, 9];

/// A length as messages show it, or another number: four digits, whatever its unit, in powers of ten where it is very
/// small or large.
pub fn shown_number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let power = value.abs().log10().floor() as i32;
    if !(WRITTEN_OUT[0]..WRITTEN_OUT[1]).contains(&power) {
        let text = format!("{value:.*e}", DIGITS as usize - 1);
        return match text.split_once('e') {
            Some((number, power)) => format!("{}e{power}", without_end(number)),
            None => text,
        };
    }
    let decimals = (DIGITS - 1 - power).max(0);
    without_end(&format!("{value:.*}", decimals as usize)).to_owned()
}

/// A number without zeros at the end of its fraction.
fn without_end(number: &str) -> &str {
    match number.contains('.') {
        true => number.trim_end_matches('0').trim_end_matches('.'),
        false => number,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits_in_every_unit() {
        for (value, shown) in [
            (0.0, "0"),
            (3.400_000_000_000_000_4, "3.4"),
            (160.0, "160"),
            (8.546_538_830_874_404, "8.547"),
            (-12.344, "-12.34"),
            (99.996, "100"),
            (1_234.6, "1235"),
            (123_456.7, "123457"),
            (0.000_123_456, "0.0001235"),
            (1.234_56e-6, "1.235e-6"),
            (2e-10, "2e-10"),
            (-1e300, "-1e300"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(shown_number(value), shown);
        }
    }
}
