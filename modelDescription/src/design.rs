//! The design as an FMU carries it, and what the tables need of it.

use crate::{Interface, SignalInfo};
use ftc_plant::scenario::{ModeInterval, Waveform};
use ftc_plant::{Dimensions, Scenario, SwitchedPlant};
use ftc_record::{ControllerDesign, DesignRecord, RecordError, Signal, Signals};
use minicbor::Decoder;
use minicbor::data::Type;
use serde::Deserialize;

/// Name of the design in an FMU's `resources` folder: CBOR (RFC 8949), the record as a map of its fields.
pub const DESIGN_FILE: &str = "design.cbor";

/// In how many others a list or map of the record may stand: twice as many as one does.
const MOST_NESTED: usize = 32;

/// Why the bytes of [`DESIGN_FILE`] cannot be written, or hold no design.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DesignFileError {
    /// The writer fails.
    #[cfg(feature = "write")]
    #[error(transparent)]
    Write(#[from] minicbor_serde::error::EncodeError<core::convert::Infallible>),
    /// Lists within lists, or of unknown length, as no design has them.
    #[error(
        "{DESIGN_FILE}: lists and maps are nested deeper than a design's, or do not say their length"
    )]
    Nesting,
    /// The bytes are no record of a design.
    #[error("{DESIGN_FILE}: {0}")]
    Read(#[from] minicbor_serde::error::DecodeError),
    /// The bytes are no CBOR.
    #[error("{DESIGN_FILE}: {0}")]
    Cbor(#[from] minicbor::decode::Error),
    /// Sizes do not agree, or a value is out of its range.
    #[error("{DESIGN_FILE}: {0}")]
    Check(#[from] RecordError),
}

/// The bytes of [`DESIGN_FILE`].
///
/// # Errors
/// What the writer says.
#[cfg(feature = "write")]
pub fn write_design(record: &DesignRecord) -> Result<Vec<u8>, DesignFileError> {
    Ok(minicbor_serde::to_vec(record)?)
}

/// What a controller needs of a [`DesignRecord`].
#[derive(Deserialize)]
struct Running {
    format: u32,
    name: String,
    signals: Signals,
    plant: SwitchedPlant,
    controller: ControllerDesign,
    scenario: Course,
}

/// The course of an experiment: all of it that a controller needs.
#[derive(Deserialize)]
struct Course {
    steps: u64,
    schedule: Vec<ModeInterval>,
}

/// Whether no list or map stands in more than [`MOST_NESTED`] others: the reader calls itself for each.
///
/// # Errors
/// Bytes that are no CBOR, lists that are nested deeper or of unknown length.
fn check_nesting(bytes: &[u8]) -> Result<(), DesignFileError> {
    let mut decoder = Decoder::new(bytes);
    // Of each list that is not at its end the values that are still to come.
    let mut open = vec![1];
    while let Some(left) = open.last_mut() {
        if *left == 0 {
            open.pop();
            continue;
        }
        *left -= 1;
        let at = decoder.position();
        if let Some(length) = bytes.get(at..).and_then(plain_length) {
            decoder.set_position(at + length);
            continue;
        }
        let values = match decoder.datatype()? {
            Type::Array => decoder.array()?,
            Type::Map => decoder.map()?.map(|entries| entries.saturating_mul(2)),
            Type::ArrayIndef | Type::MapIndef => None,
            _ => {
                decoder.skip()?;
                continue;
            }
        };
        match values {
            Some(values) if open.len() <= MOST_NESTED => open.push(values),
            _ => return Err(DesignFileError::Nesting),
        }
    }
    Ok(())
}

/// How many bytes a number, a text or a string of bytes takes at the beginning of these, which are not read
/// here; none where something else begins, or less is there.
fn plain_length(bytes: &[u8]) -> Option<usize> {
    let (&first, rest) = bytes.split_first()?;
    let width = match first & 0x1f {
        0..=23 => 0,
        24 => 1,
        25 => 2,
        26 => 4,
        27 => 8,
        _ => return None,
    };
    let content = match (first >> 5, width) {
        (0 | 1 | 7, _) => 0,
        (2 | 3, 0) => usize::from(first & 0x1f),
        (2 | 3, _) => {
            let bytes = rest.get(..width)?.iter();
            let count = bytes.fold(0, |count: u64, &byte| count << 8 | u64::from(byte));
            usize::try_from(count).ok()?
        }
        _ => return None,
    };
    let length = content.checked_add(1 + width)?;
    (length <= bytes.len()).then_some(length)
}

fn decode<'a, R: Deserialize<'a>>(bytes: &'a [u8]) -> Result<R, DesignFileError> {
    check_nesting(bytes)?;
    Ok(minicbor_serde::from_slice(bytes)?)
}

/// Reads the bytes of [`DESIGN_FILE`] and checks that all sizes agree.
///
/// # Errors
/// Bytes that hold no design, or one whose sizes do not agree.
pub fn read_design(bytes: &[u8]) -> Result<DesignRecord, DesignFileError> {
    let record: DesignRecord = decode(bytes)?;
    record.check()?;
    Ok(record)
}

/// The same without what only the simulated plant needs: it is as designed, and nothing happens to it but
/// the switches.
///
/// # Errors
/// As [`read_design`].
pub fn read_controller(bytes: &[u8]) -> Result<DesignRecord, DesignFileError> {
    let read: Running = decode(bytes)?;
    let dims = Dimensions::check(&read.plant).map_err(RecordError::from)?;
    let reference = vec![Waveform::ZERO; read.controller.feedback.tracked.len()];
    let mut scenario = Scenario::new(read.scenario.steps, reference, dims);
    scenario.schedule = read.scenario.schedule;
    let mut record = DesignRecord::new(
        &read.name,
        read.plant,
        read.signals,
        read.controller,
        scenario,
    );
    record.format = read.format;
    record.check()?;
    Ok(record)
}

/// The disturbances as described, or else by their number alone.
fn disturbances(design: &DesignRecord, count: usize) -> Vec<SignalInfo> {
    let described = &design.signals.disturbances;
    (0..count)
        .map(|at| match described.get(at) {
            Some(signal) => SignalInfo {
                name: signal.name.clone(),
                unit: signal.unit.clone().unwrap_or_default(),
                nominal: Some(signal.nominal),
                ..SignalInfo::default()
            },
            None => SignalInfo {
                nominal: Some(1.0),
                ..SignalInfo::default()
            },
        })
        .collect()
}

impl Interface {
    /// That of a design.
    pub fn of(design: &DesignRecord) -> Self {
        let plant = &design.plant;
        let sample_time = plant.sample_time;
        let first = design.scenario.mode(0, sample_time);
        let point = plant.modes.get(first).map(|mode| &mode.operating_point);
        let describe = |signals: &[Signal], start: Option<&Vec<f64>>| {
            signals
                .iter()
                .enumerate()
                .map(|(at, signal)| SignalInfo {
                    name: signal.name.clone(),
                    unit: signal.unit.clone().unwrap_or_default(),
                    nominal: Some(signal.nominal),
                    min: signal.min,
                    max: signal.max,
                    start: start
                        .and_then(|values| values.get(at))
                        .copied()
                        .unwrap_or(0.0),
                })
                .collect()
        };
        Self {
            sample_time,
            stop_time: design.scenario.steps as f64 * sample_time,
            inputs: describe(&design.signals.inputs, point.map(|p| &p.u)),
            outputs: describe(&design.signals.outputs, point.map(|p| &p.y)),
            states: describe(&design.signals.states, point.map(|p| &p.x)),
            tracked: design.controller.feedback.tracked.clone(),
            disturbances: disturbances(design, plant.dimensions().disturbances),
            modes: plant.modes.len(),
            finds_the_mode: design.controller.estimator.finds_the_mode(),
            thresholds: design.controller.estimator.thresholds.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The depth of the lists and maps as the decoder alone finds it, text by text.
    fn depth(decoder: &mut Decoder<'_>, within: usize) -> Option<usize> {
        let values = match decoder.datatype().ok()? {
            Type::Array => decoder.array().ok()??,
            Type::Map => decoder.map().ok()??.checked_mul(2)?,
            Type::ArrayIndef | Type::MapIndef => return None,
            _ => return decoder.skip().ok().map(|()| within),
        };
        let mut deepest = within + 1;
        for _ in 0..values {
            deepest = deepest.max(depth(decoder, within + 1)?);
        }
        Some(deepest)
    }

    /// A value of CBOR in lists and maps, and now and then a byte of it changed.
    fn bytes() -> impl Strategy<Value = Vec<u8>> {
        let leaf = prop_oneof![
            Just(vec![0x17]),
            Just(vec![0x19, 1, 2]),
            Just(vec![0x3b, 1, 2, 3, 4, 5, 6, 7, 8]),
            Just(vec![0xfb, 1, 2, 3, 4, 5, 6, 7, 8]),
            Just(vec![0xf5]),
            Just(vec![0x62, b'o', b'k']),
            Just(vec![0x58, 3, 0x81, 0x81, 0x81]),
        ];
        let value = leaf.prop_recursive(40, 200, 3, |inner| {
            prop::collection::vec(inner, 0..4).prop_map(|values| {
                let mut bytes = vec![0x80 | values.len() as u8];
                bytes.extend(values.into_iter().flatten());
                bytes
            })
        });
        let wrapped = (value, 0_usize..40).prop_map(|(value, lists)| {
            let mut bytes = vec![0x81; lists];
            bytes.extend(value);
            bytes
        });
        let changed = prop::option::weighted(0.3, any::<(prop::sample::Index, u8)>());
        (wrapped, changed).prop_map(|(mut bytes, changed)| {
            if let Some((at, byte)) = changed {
                let at = at.index(bytes.len());
                bytes[at] = byte;
            }
            bytes
        })
    }

    proptest! {
        /// Values are passed over without being read, and the lists are found as deep as they are.
        #[test]
        fn nesting_is_what_the_decoder_finds(bytes in bytes()) {
            if let Some(depth) = depth(&mut Decoder::new(&bytes), 0) {
                prop_assert_eq!(check_nesting(&bytes).is_ok(), depth <= MOST_NESTED);
            }
        }
    }
}
