//! Forged certificates beside forged designs, as `verify` proves them: refused, or proved.

use crate::design::{Edit, edited_text};
use crate::package_certificate::Certificate;
use ftc_design::assembly::{Request, assemble};
use ftc_design::{Design, Proof, Signals};
use ftc_plant::scenario::{Scenario, Waveform};
use ftc_plant::{Mode, SwitchedPlant};
use libfuzzer_sys::arbitrary::{self, Arbitrary};
use nalgebra::dmatrix;
use std::sync::LazyLock;

/// What is changed in the two texts.
#[derive(Arbitrary, Clone, Debug)]
pub struct Forged {
    certificate: Vec<Edit>,
    design: Vec<Edit>,
    /// Whether the fingerprint is made to fit.
    fits: bool,
}

/// A small design with as much to prove as there is: two modes, bumpless, each sensor may be lost.
fn proved() -> Design {
    let mode = |pole: f64| {
        Mode::new(
            dmatrix![pole, 0.1; 0.0, 0.5],
            dmatrix![0.2; 1.0],
            dmatrix![1.0, 0.0; 0.0, 1.0],
        )
        .with_disturbance(dmatrix![0.1; 0.05], dmatrix![0.0; 0.0])
    };
    let plant = SwitchedPlant::new(1.0, vec![mode(0.9), mode(0.8)]);
    let signals = Signals::numbered(plant.dimensions());
    let mut scenario = Scenario::new(100, vec![Waveform::ZERO], plant.dimensions());
    scenario.noise.fill(0.01);
    let mut request = Request::new("fuzz", plant, signals, scenario);
    request.control.tracked = vec![0];
    request.bumpless = true;
    assemble(request).unwrap()
}

static SOUND: LazyLock<(String, String)> = LazyLock::new(|| {
    let mut design = proved();
    let proof = design.proof.take().unwrap();
    let resource = model_description::write_design(&design).unwrap();
    let certificate = serde_json::to_string(&Certificate::new(proof, &resource)).unwrap();
    (serde_json::to_string(&design).unwrap(), certificate)
});

/// Proves an unchanged pair once, then the forged one: whatever comes of it is an answer.
pub fn prove_forged(forged: &Forged) {
    static ONCE: LazyLock<()> =
        LazyLock::new(|| prove(&SOUND.0, &SOUND.1, false).unwrap().unwrap());
    LazyLock::force(&ONCE);
    let few = |edits: &[Edit]| edits[..edits.len().min(8)].to_vec();
    let design = edited_text(&SOUND.0, &few(&forged.design));
    let certificate = edited_text(&SOUND.1, &few(&forged.certificate));
    if let Some(Err(what)) = prove(&design, &certificate, forged.fits) {
        assert!(!what.is_empty() && !what.contains(['\n', '\0']), "{what:?}");
    }
}

/// What `verify` does once the files of an FMU are read. None where the texts are none of ours.
fn prove(design: &str, certificate: &str, fits: bool) -> Option<Result<(), String>> {
    let design: Design = serde_json::from_str(design).ok()?;
    let resource = model_description::write_design(&design).ok()?;
    let mut design = Design::from(model_description::read_design(&resource).ok()?);
    let shipped: Certificate = serde_json::from_slice(certificate.as_bytes()).ok()?;
    let shipped = match fits {
        true => Certificate::new(shipped.proof, &resource),
        false => shipped,
    };
    let proof: Result<Proof, String> = shipped.proof_of(&resource).map_err(|why| why.to_string());
    Some(proof.and_then(|proof| {
        design.proof = Some(proof);
        ftc_design::coverage::prove(&design).map_err(|why| why.to_string())
    }))
}
