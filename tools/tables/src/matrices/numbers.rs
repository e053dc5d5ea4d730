//! Numbers as they stand in files.

/// What kind of numbers, and how many bytes each has.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    Float(usize),
    Signed(usize),
    Unsigned(usize),
}

/// The numbers of a kind, one behind the other; none of a kind that is not read. Bytes that are too few for
/// one more are left.
pub(super) fn numbers(kind: Kind, bytes: &[u8], big_endian: bool) -> Option<Vec<f64>> {
    fn all<const N: usize>(bytes: &[u8], big_endian: bool, number: fn([u8; N]) -> f64) -> Vec<f64> {
        let numbers = bytes.as_chunks::<N>().0.iter();
        numbers
            .map(|&(mut bytes)| {
                if big_endian {
                    bytes.reverse();
                }
                number(bytes)
            })
            .collect()
    }
    let big = big_endian;
    Some(match kind {
        Kind::Float(8) => all(bytes, big, f64::from_le_bytes),
        Kind::Float(4) => all(bytes, big, |bytes| f64::from(f32::from_le_bytes(bytes))),
        Kind::Signed(8) => all(bytes, big, |bytes| i64::from_le_bytes(bytes) as f64),
        Kind::Signed(4) => all(bytes, big, |bytes| f64::from(i32::from_le_bytes(bytes))),
        Kind::Signed(2) => all(bytes, big, |bytes| f64::from(i16::from_le_bytes(bytes))),
        Kind::Signed(1) => all(bytes, big, |bytes| f64::from(i8::from_le_bytes(bytes))),
        Kind::Unsigned(8) => all(bytes, big, |bytes| u64::from_le_bytes(bytes) as f64),
        Kind::Unsigned(4) => all(bytes, big, |bytes| f64::from(u32::from_le_bytes(bytes))),
        Kind::Unsigned(2) => all(bytes, big, |bytes| f64::from(u16::from_le_bytes(bytes))),
        Kind::Unsigned(1) => all(bytes, big, |[byte]| f64::from(byte)),
        _ => return None,
    })
}
