//! `resources/certificate.json`: what an FMU's design promises, and what proves it.

use ftc_design::Proof;
use serde::{Deserialize, Serialize};

/// Where it stands in an FMU.
pub const PATH: &str = "resources/certificate.json";

/// Version of its layout.
const FORMAT: u32 = 3;

/// Identifier under which the design's fingerprint is taken.
const IDENTIFIER: &str = "certificate";

/// A certificate that is not that of the design beside which it lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CertificateError {
    /// Written by another version.
    #[error("{PATH} is of another layout: export the design again")]
    Format,
    /// The fingerprint is that of another design.
    #[error("{PATH} belongs to another design: export the design again")]
    Foreign,
}

/// The certificate of the design beside which it lies. Plant, gains and observer stand in the design alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
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
    /// Why it is not.
    pub fn proof_of(self, resource: &[u8]) -> Result<Proof, CertificateError> {
        if self.format != FORMAT {
            Err(CertificateError::Format)
        } else if self.design != model_description::guid(IDENTIFIER, resource) {
            Err(CertificateError::Foreign)
        } else {
            Ok(self.proof)
        }
    }
}
