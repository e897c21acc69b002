//! Decimal numbers: a listing has several per line, and `write!` takes longer than a frame.

/// Writes `number` right-aligned; returns whether it fits.
pub(super) fn right(columns: &mut [u8], number: u64) -> bool {
    let mut rest = number;
    for column in columns.iter_mut().rev() {
        *column = b'0' + (rest % 10) as u8;
        rest /= 10;
        if rest == 0 {
            return true;
        }
    }
    false
}

/// Appends `number`.
pub(super) fn append(out: &mut Vec<u8>, number: u64) {
    let mut columns = [b' '; 20];
    right(&mut columns, number);
    out.extend_from_slice(columns.trim_ascii_start());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_text_that_core_gives_them() {
        let powers = (0..64).flat_map(|power| [(1 << power) - 1, 1 << power]);
        for number in powers.chain([9, 10, 99, 100, 9_999_999_999, 10_000_000_000, u64::MAX]) {
            let mut columns = [b' '; 10];
            let fits = right(&mut columns, number);
            assert_eq!(fits, number < 10_000_000_000, "{number}");
            if fits {
                assert_eq!(columns, format!("{number:>10}").as_bytes());
            }
            let mut text = Vec::new();
            append(&mut text, number);
            assert_eq!(text, number.to_string().as_bytes());
        }
    }
}
