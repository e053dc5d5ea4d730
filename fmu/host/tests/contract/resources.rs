//! Resources that are not those of the FMU: one sentence in the log, and no instance.
//!
//! promise: damaged-resources

use crate::Pair;
use fmu_host::model::location;
use fmu_host::{Instance, Model, NotInstantiated};
use ftc_record::DesignRecord;
use model_description::{DESIGN_FILE, read_design, write_design};
use std::fs;

/// What the log says when the resource of binary 0 or 1 is `bytes`, under the model's own guid.
fn refusal(pair: &Pair, which: usize, bytes: Option<&[u8]>) -> String {
    let folder = tempfile::tempdir().unwrap();
    if let Some(bytes) = bytes {
        fs::write(folder.path().join(DESIGN_FILE), bytes).unwrap();
    }
    let model = &pair.models[which];
    sentence(Instance::made(
        pair.functions()[which],
        model,
        &model.guid,
        &location(folder.path()),
    ))
}

fn sentence(made: Result<Instance, NotInstantiated>) -> String {
    let Err(refused) = made else {
        panic!("an instance was made");
    };
    let message = refused.to_string();
    assert!(message.starts_with("fmi2Instantiate: "), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    message
}

fn design(model: &Model) -> Vec<u8> {
    fs::read(model.folder.path().join(DESIGN_FILE)).unwrap()
}

#[test]
fn missing_empty_truncated_and_damaged_designs_are_refused() {
    let pair = Pair::load();
    for which in [0, 1] {
        let good = design(&pair.models[which]);
        assert!(refusal(&pair, which, None).contains("cannot read"));
        for length in [0, 1, good.len() / 2, good.len() - 1] {
            let message = refusal(&pair, which, Some(&good[..length]));
            assert!(message.contains("does not belong to this FMU"), "{message}");
        }
        for bit in (0..8 * good.len()).step_by(good.len() / 4) {
            let mut damaged = good.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let message = refusal(&pair, which, Some(&damaged));
            assert!(message.contains("does not belong to this FMU"), "{message}");
        }
    }
}

/// A design that fits its guid, as somebody who forges both could make it.
#[test]
fn designs_of_another_layout_or_of_other_sizes_are_refused() {
    let pair = Pair::load();
    let bytes = design(&pair.models[0]);
    let exported = read_design(&bytes).unwrap();
    let altered = |change: &dyn Fn(&mut DesignRecord)| {
        let mut altered = exported.clone();
        change(&mut altered);
        write_design(&altered).unwrap()
    };
    // The last five: an empty map, nested lists, bytes and a map that announce more than there is, a list
    // that does not say its length.
    let alterations = [
        altered(&|design| design.format = 0),
        altered(&|design| design.controller.feedback.tracked = vec![0, 7]),
        altered(&|design| design.controller.estimator.response_length = 1_000_000_000_000_000),
        altered(&|design| design.controller.estimator.window = 1_000_000_000_000_000),
        bytes[..bytes.len() / 2].to_vec(),
        vec![0xA0],
        vec![0x81; 1_000_000],
        vec![0x5A, 0xFF, 0xFF, 0xFF, 0xFF],
        vec![0xBA, 0xFF, 0xFF, 0xFF, 0xFF],
        vec![0x9F; 1_000_000],
    ];
    for altered in alterations {
        assert!(altered != bytes);
        for which in [0, 1] {
            assert!(sentence(forged(&pair, which, &altered)).contains("design"));
        }
    }
}

/// What binary 0 or 1 makes of a design that fits its guid.
fn forged(pair: &Pair, which: usize, design: &[u8]) -> Result<Instance, NotInstantiated> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(DESIGN_FILE), design).unwrap();
    let guid = model_description::guid(["ftc_controller", "ftc_plant"][which], design);
    let location = location(folder.path());
    Instance::made(
        pair.functions()[which],
        &pair.models[which],
        &guid,
        &location,
    )
}

/// What happens to the plant is read by the plant alone.
#[test]
fn an_experiment_of_other_sizes_is_refused_by_the_plant() {
    let pair = Pair::load();
    let mut design = read_design(&design(&pair.models[0])).unwrap();
    design.scenario.noise.truncate(1);
    let bytes = write_design(&design).unwrap();
    assert!(forged(&pair, 0, &bytes).is_ok());
    assert!(sentence(forged(&pair, 1, &bytes)).contains("noise levels"));
}

/// A zip made by hand: the XML of one FMU, the binary of the other, one design.
#[test]
fn the_binary_of_another_fmu_is_refused() {
    let pair = Pair::load();
    let [controller, plant] = pair.functions();
    for (functions, model) in [(plant, &pair.models[0]), (controller, &pair.models[1])] {
        let message = sentence(Instance::new(functions, model));
        assert!(message.contains("does not belong to this FMU"), "{message}");
    }
}
