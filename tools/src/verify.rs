//! `verify`: proves again, from the doubles an FMU ships, what it promises. Nothing is solved.

use crate::certificate::{self, Certificate, Promise};
use crate::failure::Failure;
use crate::summary;
use ftc::design::Design;
use roxmltree::Document;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;
use zip::ZipArchive;

const DESIGN: &str = "resources/design.json";
const DESCRIPTION: &str = "modelDescription.xml";

/// No entry of an FMU of ours is larger.
const LARGEST_ENTRY: u64 = 256 << 20;

/// Why an FMU is not verified.
enum Refusal {
    /// It cannot be read, or is none of ours.
    Unreadable(String),
    /// It does not hold what it promises.
    Unproved(String),
}

use Refusal::{Unproved, Unreadable};

/// Reads an FMU, proves its certificate and says what is proved.
///
/// # Errors
/// [`Failure::Input`] for what is no FMU of ours or is damaged, [`Failure::Refused`] where its
/// parts do not agree or a promise cannot be proved.
pub fn run(path: &Path, as_json: bool) -> Result<String, Failure> {
    let result = contents(path).and_then(|files| Fmu { files }.verify());
    match result {
        Ok(certified) if as_json => Ok(certified.json()),
        Ok(certified) => Ok(certified.text()),
        Err(Unreadable(what)) => Err(Failure::Input(format!("{}: {what}", path.display()))),
        Err(Unproved(what)) => Err(Failure::Refused {
            output: as_json.then(|| summary::pretty(&json!({ "verified": false, "reason": what }))),
            file: path.display().to_string(),
            what,
        }),
    }
}

/// Every file of the archive; reading one checks its checksum.
fn contents(path: &Path) -> Result<BTreeMap<String, Vec<u8>>, Refusal> {
    let file = File::open(path)
        .map_err(|error| Unreadable(format!("cannot be opened ({error}): name an FMU")))?;
    if fs::metadata(path).is_ok_and(|about| about.is_dir()) {
        return Err(Unreadable("this is a directory: name an FMU in it".into()));
    }
    let damaged =
        |what: String| Unreadable(format!("the archive is damaged ({what}): export it again"));
    let mut archive = ZipArchive::new(file).map_err(|error| damaged(error.to_string()))?;
    let mut files = BTreeMap::new();
    for index in 0..archive.len() {
        let mut entry = archive
            .by_index(index)
            .map_err(|error| damaged(error.to_string()))?;
        let name = entry
            .name()
            .map_err(|error| damaged(error.to_string()))?
            .into_owned();
        let mut bytes = Vec::new();
        (&mut entry)
            .take(LARGEST_ENTRY)
            .read_to_end(&mut bytes)
            .map_err(|error| damaged(format!("{name}: {error}")))?;
        if bytes.len() as u64 == LARGEST_ENTRY || files.insert(name.clone(), bytes).is_some() {
            return Err(damaged(format!("{name} is too large or stands twice")));
        }
    }
    Ok(files)
}

/// An unpacked FMU.
struct Fmu {
    files: BTreeMap<String, Vec<u8>>,
}

impl Fmu {
    fn verify(&self) -> Result<Certified, Refusal> {
        let bytes = self.file(DESIGN)?;
        self.check_guid(bytes)?;
        let design: Design = parse(DESIGN, bytes)?;
        design.check().map_err(Unproved)?;
        let shipped: Certificate = parse(certificate::PATH, self.file(certificate::PATH)?)?;
        certificate::covers_what_runs(&design).map_err(Unproved)?;
        let expected = Certificate::of(&design, bytes)
            .ok_or_else(|| Unproved(format!("{DESIGN} holds no proof: export it again")))?;
        shipped.agree(&expected).map_err(Unproved)?;
        if let Some(synthesis) = &design.synthesis {
            synthesis
                .verify(&design.controller.plant)
                .map_err(|error| Unproved(format!("{error}: export the design again")))?;
        }
        Ok(Certified {
            design,
            certificate: shipped,
        })
    }

    fn file(&self, name: &str) -> Result<&Vec<u8>, Refusal> {
        self.files.get(name).ok_or_else(|| {
            Unreadable(format!(
                "there is no {name} in it: name an FMU that ftc-fmu export wrote"
            ))
        })
    }

    /// The description, the kind of FMU and the design belong together.
    fn check_guid(&self, design: &[u8]) -> Result<(), Refusal> {
        let text = std::str::from_utf8(self.file(DESCRIPTION)?)
            .map_err(|_| Unreadable(format!("{DESCRIPTION} is not UTF-8: export it again")))?;
        let document = Document::parse(text)
            .map_err(|error| Unreadable(format!("{DESCRIPTION}: {error}: export it again")))?;
        let guid = document.root_element().attribute("guid");
        let kinds = [model_description::CONTROLLER, model_description::PLANT];
        match kinds
            .iter()
            .any(|kind| guid == Some(&model_description::guid(kind, design)))
        {
            true => Ok(()),
            false => Err(Unproved(format!(
                "the guid in {DESCRIPTION} does not belong to {DESIGN}: one of them was changed, export it again"
            ))),
        }
    }
}

fn parse<'a, T: serde::Deserialize<'a>>(name: &str, bytes: &'a [u8]) -> Result<T, Refusal> {
    serde_json::from_slice(bytes)
        .map_err(|error| Unreadable(format!("{name} cannot be read ({error}): export it again")))
}

/// A design whose promises are proved.
struct Certified {
    design: Design,
    certificate: Certificate,
}

impl Certified {
    fn text(&self) -> String {
        let claims = &self.certificate.claims;
        let modes = &self.design.controller.plant.modes;
        let mut text = format!("{}: proved\n", self.design.name);
        let mut line = |name: &str, value: String| {
            let _ = writeln!(text, "  {name:<22}{value}");
        };
        line("state feedback", promise(&claims.state_feedback));
        for (index, mode) in modes.iter().enumerate() {
            let gamma = claims.gamma.as_ref().map_or_else(
                || "no attenuation is claimed".into(),
                |gamma| format!("l2 gain from the disturbance at most {}", gamma[index]),
            );
            line(&format!("mode {} ({})", index + 1, mode.name), gamma);
        }
        line("observer", promise(&claims.observer));
        line(
            "scope",
            format!("the linear loop of {DESIGN}, while no input is at a limit"),
        );
        line(
            "how",
            "every inequality of the shipped doubles, rounding included; nothing was solved".into(),
        );
        text
    }

    fn json(&self) -> String {
        let claims = &self.certificate.claims;
        let of = |promise: &Promise| {
            json!({
                "lyapunov": promise.lyapunov,
                "arbitrary_switching": promise.dwell.is_none(),
                "decay": promise.decay,
                "dwell_time_samples": promise.dwell.map(|dwell| dwell.samples),
                "dwell_time_seconds": promise.dwell.map(|dwell| dwell.seconds),
            })
        };
        summary::pretty(&json!({
            "verified": true,
            "name": self.design.name,
            "state_feedback": of(&claims.state_feedback),
            "gamma": claims.gamma,
            "observer": of(&claims.observer),
        }))
    }
}

fn promise(promise: &Promise) -> String {
    let decay = promise.decay;
    match &promise.dwell {
        None => format!("stable under arbitrary switching, decay {decay} per sample"),
        Some(dwell) => format!(
            "stable when modes last on average longer than {:.2} samples ({:.4} s), decay {decay} per sample within a mode",
            dwell.samples, dwell.seconds
        ),
    }
}
