//! `resources/certificate.json`: what an FMU's design promises, and what proves it.

use ftc_design::Proof;
use serde::{Deserialize, Serialize};

/// Where it stands in an FMU.
pub const PATH: &str = "resources/certificate.json";

/// Version of its layout.
const FORMAT: u32 = 3;

/// Identifier under which the design's fingerprint is taken.
const IDENTIFIER: &str = "certificate";

/// The certificate of the design beside which it lies. Plant, gains and observer stand in the design alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// Layout version.
    pub format: u32,
    /// Fingerprint of the bytes of the design.
    pub design: String,
    /// Claims, and what proves them together with the design.
    pub proof: Proof,
}

impl Certificate {
    /// The certificate of a design whose record has these bytes.
    pub fn new(proof: Proof, resource: &[u8]) -> Self {
        Self {
            format: FORMAT,
            design: model_description::guid(IDENTIFIER, resource),
            proof,
        }
    }

    /// The proof, if this is the certificate of a design whose record has these bytes.
    ///
    /// # Errors
    /// One sentence that says why it is not.
    pub fn proof_of(self, resource: &[u8]) -> Result<Proof, String> {
        let what = if self.format != FORMAT {
            "is of another layout"
        } else if self.design != model_description::guid(IDENTIFIER, resource) {
            "belongs to another design"
        } else {
            return Ok(self.proof);
        };
        Err(format!("{PATH} {what}: export the design again"))
    }
}
