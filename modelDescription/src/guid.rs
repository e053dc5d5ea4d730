//! The fingerprint that ties a description, a binary and a design together.

use sha2::{Digest, Sha256};

/// Identifier of the controller's binary in [`guid`].
pub const CONTROLLER: &str = "ftc_controller";

/// Identifier of the plant's binary in [`guid`].
pub const PLANT: &str = "ftc_plant";

/// Version of the variable tables: raised whenever a table changes for the same design, so that
/// a description written by one release is refused by the binary of another.
const TABLE_VERSION: u32 = 2;

/// The `guid` of an FMU: a fingerprint of its binary's identifier and of its design's bytes.
///
/// The exporter writes it into the XML; the binary computes it again from the design it finds
/// in `resources/` and compares it with what the importer hands over. A truncated, altered or
/// foreign design, the XML of one FMU beside the binary of another, and a description of
/// another release all differ.
///
/// ```
/// let of = model_description::guid;
/// assert_eq!(of("ftc_plant", b"{}"), of("ftc_plant", b"{}"));
/// assert_ne!(of("ftc_plant", b"{}"), of("ftc_controller", b"{}"));
/// ```
pub fn guid(identifier: &str, design: &[u8]) -> String {
    let mut hash = Sha256::new();
    hash.update(TABLE_VERSION.to_le_bytes());
    hash.update((identifier.len() as u64).to_le_bytes());
    hash.update(identifier);
    hash.update(design);
    let digits: String = hash
        .finalize()
        .iter()
        .take(16)
        .map(|byte| format!("{byte:02x}"))
        .collect();
    let groups = [
        &digits[..8],
        &digits[8..12],
        &digits[12..16],
        &digits[16..20],
        &digits[20..],
    ];
    format!("{{{}}}", groups.join("-"))
}

#[cfg(test)]
mod tests {
    use super::guid;

    #[test]
    fn has_the_shape_of_a_uuid_in_braces() {
        let text = guid("ftc_controller", b"design");
        assert_eq!(text.len(), 38);
        let inner = text.strip_prefix('{').and_then(|t| t.strip_suffix('}'));
        let lengths: Vec<usize> = inner.unwrap().split('-').map(str::len).collect();
        assert_eq!(lengths, [8, 4, 4, 4, 12]);
    }

    #[test]
    fn every_bit_of_the_design_counts() {
        let design = b"{\"sample_time\": 1.0}".to_vec();
        let whole = guid("a", &design);
        for at in 0..design.len() * 8 {
            let mut flipped = design.clone();
            flipped[at / 8] ^= 1 << (at % 8);
            assert_ne!(guid("a", &flipped), whole, "bit {at}");
        }
        for length in 0..design.len() {
            assert_ne!(guid("a", &design[..length]), whole, "length {length}");
        }
    }

    #[test]
    fn identifier_and_design_cannot_be_shifted_into_each_other() {
        assert_ne!(guid("ab", b"c"), guid("a", b"bc"));
    }
}
