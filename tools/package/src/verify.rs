//! Proves again, from the doubles an FMU ships, what it promises. Nothing is solved.

use crate::Error;
use crate::binary::{Ran, Runner};
use crate::certificate::{self, Certificate};
use crate::description::guid;
use crate::export::{KINDS, Kind, RESOURCE};
use crate::platform::{HOST, PLATFORMS};
use crate::reading;
use crate::signature::{self, Origin, VerifyingKey};
use ftc_design::running_loop::TransferCertificate;
use ftc_design::{Design, DwellTime, LostSensors, Lyapunov, Proof};
use report::running_loop;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

const DESCRIPTION: &str = "modelDescription.xml";

/// Why an FMU is not verified.
pub(crate) enum Refusal {
    /// It cannot be read, or is none of ours.
    Unreadable(String),
    /// It does not hold what it promises.
    Unproved(String),
}

use Refusal::{Unproved, Unreadable};

impl Refusal {
    /// The same, of this file.
    pub(crate) fn of(self, fmu: &Path) -> Error {
        let fmu = fmu.to_path_buf();
        match self {
            Unreadable(what) => Error::Unreadable { fmu, what },
            Unproved(what) => Error::Unproved { fmu, what },
        }
    }
}

/// What is looked at beyond the proof.
#[derive(Default)]
#[expect(
    clippy::exhaustive_structs,
    reason = "whoever verifies must choose each of them"
)]
pub struct Checks {
    /// The key that must have signed the FMU.
    pub key: Option<VerifyingKey>,
    /// How to run the binary for this machine; without it no code of the FMU is run.
    pub runner: Option<Runner>,
}

/// Reads an FMU and proves its certificate again; no code of the FMU is run.
///
/// # Errors
/// [`Error::Unreadable`] for a file that is not an FMU of this program or is damaged,
/// [`Error::Unproved`] where its parts do not agree or a promise cannot be proved.
pub fn verify(path: &Path) -> Result<Verification, Error> {
    verify_with(path, &Checks::default())
}

/// [`verify`], and whatever else is asked for.
///
/// # Errors
/// As [`verify`]; [`Error::Unproved`] also where the key that is given has not signed the FMU as it is,
/// and where its binary does something else than the controller of its design.
pub fn verify_with(path: &Path, checks: &Checks) -> Result<Verification, Error> {
    let verified = Fmu::open(path).and_then(|fmu| {
        let origin = signature::check(&fmu.files, checks.key.as_ref()).map_err(Unproved)?;
        let mut found = fmu.verify(origin)?;
        if let Some(runner) = &checks.runner {
            found.ran = match runner.run(path)? {
                Ran::Differs(what) => {
                    return Err(Unproved(format!(
                        "the binary for {HOST} {what}: it is not this design's, export it again"
                    )));
                }
                ran => ran,
            };
        }
        Ok(found)
    });
    verified.map_err(|refusal| refusal.of(path))
}

/// Whether an FMU of ours may have a file of this path; which binaries it has is looked at later.
fn is_known(path: &str) -> bool {
    let folders = ["documentation/", "binaries/"];
    let files = [
        RESOURCE,
        DESCRIPTION,
        certificate::PATH,
        signature::MANIFEST,
        signature::SIGNATURE,
        "model.png",
    ];
    files.contains(&path) || folders.iter().any(|folder| path.starts_with(folder))
}

/// An unpacked FMU.
pub(crate) struct Fmu {
    files: BTreeMap<String, Vec<u8>>,
}

impl Fmu {
    pub(crate) fn open(path: &Path) -> Result<Self, Refusal> {
        let files = reading::files(path, is_known).map_err(Unreadable)?;
        Ok(Self { files })
    }

    /// The bytes of the design.
    pub(crate) fn resource(&self) -> Result<&Vec<u8>, Refusal> {
        self.file(RESOURCE)
    }

    /// Which FMU it is, and its design.
    pub(crate) fn design(&self) -> Result<(&'static Kind, Design), Refusal> {
        let bytes = self.resource()?;
        let kind = self.kind(bytes)?;
        let refused = |what: &str| Unreadable(format!("{RESOURCE} {what}: export it again"));
        let design = model_description::read_design(bytes)
            .map_err(|why| refused(&format!("cannot be read ({why})")))?;
        // Nothing but what is looked at may stand in it.
        match model_description::write_design(&design) {
            Ok(written) if written == *bytes => Ok((kind, design.into())),
            _ => Err(refused("holds more than a design, or is written otherwise")),
        }
    }

    /// The binary for this machine.
    pub(crate) fn binary(&self, identifier: &str) -> Option<&Vec<u8>> {
        let platform = PLATFORMS.iter().find(|platform| platform.name == HOST)?;
        self.files.get(&platform.path(identifier))
    }

    fn verify(&self, origin: Origin) -> Result<Verification, Refusal> {
        let bytes = self.resource()?;
        let (kind, mut design) = self.design()?;
        let shipped: Certificate = parse(certificate::PATH, self.file(certificate::PATH)?)?;
        let proof = shipped
            .proof_of(bytes)
            .map_err(|error| Unproved(error.to_string()))?;
        design.proof = Some(proof.clone());
        ftc_design::coverage::prove(&design).map_err(|error| Unproved(error.to_string()))?;
        self.check_description(kind, &design, bytes)?;
        let platforms = self.check_binaries(&kind.identifier(&design))?;
        Ok(Verification {
            design,
            proof,
            platforms,
            origin,
            ran: Ran::NotRun("nobody asked for it".into()),
        })
    }

    fn file(&self, name: &str) -> Result<&Vec<u8>, Refusal> {
        self.files.get(name).ok_or_else(|| {
            Unreadable(format!(
                "there is no {name} in it: name an FMU that ftc-fmu export wrote"
            ))
        })
    }

    /// Which FMU this is: the one whose guid belongs to the design.
    fn kind(&self, design: &[u8]) -> Result<&'static Kind, Refusal> {
        let text = std::str::from_utf8(self.file(DESCRIPTION)?)
            .map_err(|_| Unreadable(format!("{DESCRIPTION} is not UTF-8: export it again")))?;
        let guid = guid(text)
            .map_err(|error| Unreadable(format!("{DESCRIPTION}: {error}: export it again")))?;
        let belongs =
            |kind: &&Kind| guid.as_ref() == Some(&model_description::guid(kind.binary, design));
        KINDS.iter().find(belongs).ok_or_else(|| {
            Unproved(format!(
                "the guid in {DESCRIPTION} does not belong to {RESOURCE}: one of them was changed, export it again"
            ))
        })
    }

    /// The description is, byte by byte, the one that belongs to the design.
    fn check_description(&self, kind: &Kind, design: &Design, bytes: &[u8]) -> Result<(), Refusal> {
        let expected = kind
            .describe(design, bytes)
            .map_err(|error| Unproved(error.to_string()))?;
        let found = self.file(DESCRIPTION)?;
        if found == expected.as_bytes() {
            return Ok(());
        }
        let pairs = found
            .split(|&b| b == b'\n')
            .zip(expected.as_bytes().split(|&b| b == b'\n'));
        let line = pairs
            .take_while(|(found, expected)| found == expected)
            .count()
            + 1;
        Err(Unproved(format!(
            "{DESCRIPTION} is not the one of {RESOURCE} from line {line} on: it was changed, or another version \
             of ftc-fmu wrote it; export it again"
        )))
    }

    /// There is a binary, and each is one for its platform; returns the platforms.
    fn check_binaries(&self, identifier: &str) -> Result<Vec<&'static str>, Refusal> {
        let mut platforms = Vec::new();
        let files = self.files.iter();
        for (path, bytes) in
            files.filter(|(path, _)| path.starts_with("binaries/") && !path.ends_with('/'))
        {
            let platform = PLATFORMS
                .iter()
                .find(|platform| platform.path(identifier) == *path)
                .ok_or_else(|| {
                    Unproved(format!("{path} is no part of this FMU: export it again"))
                })?;
            platform
                .check(bytes)
                .map_err(|what| Unproved(format!("{path} {what}: export it again")))?;
            platforms.push(platform.name);
        }
        match platforms.is_empty() {
            true => Err(Unproved(
                "there is no binary in it for any platform: export it again".into(),
            )),
            false => Ok(platforms),
        }
    }
}

fn parse<'a, T: serde::Deserialize<'a>>(name: &str, bytes: &'a [u8]) -> Result<T, Refusal> {
    serde_json::from_slice(bytes)
        .map_err(|error| Unreadable(format!("{name} cannot be read ({error}): export it again")))
}

/// A design whose promises are proved. Its `Display` is the report a person reads.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Verification {
    /// The design that the FMU holds.
    pub design: Design,
    /// What is promised, and what proves it.
    pub proof: Proof,
    /// Platforms for which there is a binary.
    pub platforms: Vec<&'static str>,
    /// Who has signed it.
    pub origin: Origin,
    /// What came of running the binary for this machine.
    pub ran: Ran,
}

impl fmt::Display for Verification {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (control, observer) = promises(&self.proof);
        let modes = &self.design.plant.modes;
        writeln!(f, "{}: proved", self.design.name)?;
        let mut line = |name: &str, value: String| writeln!(f, "  {name:<21} {value}");
        line("state feedback", control.to_string())?;
        for (index, mode) in modes.iter().enumerate() {
            let gamma = self.proof.state_feedback.gamma.as_ref().map_or_else(
                || "no attenuation is claimed".into(),
                |gamma| {
                    format!(
                        "l2 gain from the disturbance at most {} with the state known",
                        gamma[index]
                    )
                },
            );
            line(&format!("mode {} ({})", index + 1, mode.name), gamma)?;
        }
        line("observer", observer.to_string())?;
        let running = &self.proof.running_loop;
        for (index, mode) in modes.iter().enumerate() {
            let gamma = running
                .gamma_loop
                .as_ref()
                .map_or_else(String::new, |gamma| {
                    format!("gamma_loop at most {}, ", gamma[index])
                });
            let text = format!(
                "{gamma}noise gain at most {}, gain of an unnoticed fault at most {}, while the mode lasts",
                running.noise_gain[index], running.fault_gain[index]
            );
            line(&format!("loop, mode {} ({})", index + 1, mode.name), text)?;
        }
        line("loop, stability", running_loop::stability(&self.proof))?;
        if let Some(proved) = &running.transfer {
            line("bumpless transfer", running_loop::bumpless(proved))?;
        }
        line(
            "loop, switching",
            match (&running.switching, modes.len()) {
                (Some(switching), _) => {
                    format!(
                        "gamma_loop at most {} under arbitrary switching",
                        switching.gamma
                    )
                }
                (None, 1) => "there is one mode".into(),
                (None, _) => "no gain is claimed across a switch".into(),
            },
        )?;
        for entry in &running.lost {
            line(
                &format!("without {}", lost(&self.design, &entry.sensors)),
                survives(entry),
            )?;
        }
        line(
            "scope",
            format!("the linear loop of {RESOURCE}, while no input is at a limit"),
        )?;
        line(
            "how",
            "every inequality of the shipped doubles, rounding included; nothing was solved".into(),
        )?;
        for (index, what) in ftc_design::coverage::UNCOVERED.iter().enumerate() {
            line(if index == 0 { "not proved" } else { "" }, (*what).into())?;
        }
        line(
            "binaries",
            format!(
                "{}: of the platform, with the functions of an FMU",
                self.platforms.join(", ")
            ),
        )?;
        line(
            "binary, run",
            match &self.ran {
                Ran::Agrees(ticks) => format!(
                    "{HOST}: to the bit what this program's controller gives, over {ticks} ticks of random signals"
                ),
                Ran::NotRun(why) => format!("not run: {why}"),
                Ran::Differs(what) => what.clone(),
            },
        )?;
        line("signed", self.origin.to_string())
    }
}

impl Verification {
    /// The report a program reads.
    pub fn json(&self) -> Value {
        let running = &self.proof.running_loop;
        let of = |promise: &Promise| {
            json!({
                "lyapunov": promise.lyapunov,
                "arbitrary_switching": promise.dwell.is_none(),
                "decay": promise.decay,
                "dwell_time_samples": promise.dwell.map(|dwell| dwell.samples),
                "dwell_time_seconds": promise.dwell.map(|dwell| dwell.seconds),
            })
        };
        let (control, observer) = promises(&self.proof);
        json!({
            "verified": true,
            "name": self.design.name,
            "state_feedback": of(&control),
            "gamma": self.proof.state_feedback.gamma,
            "gamma_loop": running.gamma_loop,
            "gamma_loop_switching": running.switching.as_ref().map(|s| s.gamma),
            "stability": running_loop::stability(&self.proof),
            "bumpless_samples": running.transfer.as_ref().map(TransferCertificate::samples),
            "bumpless_needs_dwell": running.transfer.as_ref().map(TransferCertificate::needs_dwell),
            "noise_gain": running.noise_gain,
            "fault_gain": running.fault_gain,
            "lost_sensors": running.lost,
            "observer": of(&observer),
            "not_proved": ftc_design::coverage::UNCOVERED,
            "platforms": self.platforms,
            "ran": self.ran,
            "signed_by": match &self.origin {
                Origin::Signed(id) => Some(id),
                _ => None,
            },
        })
    }
}

/// The names of lost sensors.
fn lost(design: &Design, sensors: &[usize]) -> String {
    let outputs = &design.signals.outputs;
    let names: Vec<&str> = sensors.iter().map(|&k| outputs[k].name.as_str()).collect();
    names.join(" + ")
}

/// What is proved with some sensors lost.
fn survives(entry: &LostSensors) -> String {
    match (entry.stable, &entry.gamma_loop) {
        (false, _) => "not served".into(),
        (true, None) => "stable".into(),
        (true, Some(gamma)) => {
            let gamma: Vec<String> = gamma.iter().map(f64::to_string).collect();
            format!("stable, gamma_loop at most {} by mode", gamma.join(", "))
        }
    }
}

/// Stability of one of the two loops.
struct Promise {
    lyapunov: Lyapunov,
    decay: f64,
    dwell: Option<DwellTime>,
}

/// Of the state feedback and of the observer.
fn promises(proof: &Proof) -> (Promise, Promise) {
    let (control, observer) = (&proof.state_feedback, &proof.observer);
    let control = Promise {
        lyapunov: control.lyapunov,
        decay: control.decay,
        dwell: control.dwell,
    };
    let observer = Promise {
        lyapunov: observer.spec.lyapunov,
        decay: observer.spec.decay,
        dwell: observer.dwell,
    };
    (control, observer)
}

impl fmt::Display for Promise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decay = self.decay;
        match &self.dwell {
            None => write!(
                f,
                "stable under arbitrary switching, decay {decay} per sample"
            ),
            Some(dwell) => write!(
                f,
                "stable when modes last on average longer than {:.2} samples ({:.4} s), decay {decay} per sample within a mode",
                dwell.samples, dwell.seconds
            ),
        }
    }
}
