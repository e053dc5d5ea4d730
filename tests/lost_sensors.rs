//! Observers without some of their sensors: served, proved, independent of what is lost.
//!
//! promise: lost-sensors

mod plants;

use ftc_design::observer::sets;
use ftc_design::{ControlSpec, Lyapunov, ObserverChoice, ObserverSpec, Synthesis, dense};
use ftc_plant::scaling::Scaling;
use ftc_plant::{SwitchedPlant, spectral_radius};
use plants::{Channel, paper, random_plant};

fn synthesise(
    plant: &SwitchedPlant,
    kind: ObserverChoice,
    lyapunov: Lyapunov,
) -> Option<Synthesis> {
    let dims = plant.dimensions();
    let r = dims.inputs.min(dims.outputs);
    let mut control = ControlSpec::unweighted(dims);
    control.lyapunov = lyapunov;
    control.decay = 0.97;
    control.integral_weight = vec![0.3; r];
    control.input_weight = vec![0.1; dims.inputs];
    let observer = ObserverSpec::new(kind, 0.97, lyapunov);
    ftc_design::synthesise(plant, &control, &observer, &Scaling::automatic(plant)).ok()
}

#[test]
fn sets_are_each_one_each_pair_and_all() {
    assert_eq!(sets(1), [vec![0]]);
    assert_eq!(sets(2), [vec![0], vec![1], vec![0, 1]]);
    let three = [
        vec![0],
        vec![1],
        vec![2],
        vec![0, 1],
        vec![0, 2],
        vec![1, 2],
        vec![0, 1, 2],
    ];
    assert_eq!(sets(3), three);
    assert_eq!(sets(20).len(), 21);
}

#[test]
fn every_set_of_a_stable_plant_is_served_and_proved() {
    let plant = paper(Channel::State);
    let found = synthesise(&plant, ObserverChoice::Kalman, Lyapunov::Common).unwrap();
    let lost = &found.observer.observer.lost;
    let served: Vec<_> = lost.iter().map(|set| set.sensors.clone()).collect();
    assert_eq!(served, sets(2));
    // One function for all modes and sets: sets may change at every sample.
    assert_eq!(found.observer.observer.minimum_dwell, 0);
    for set in lost {
        for (mode, gain) in plant.modes.iter().zip(&set.correction) {
            for &sensor in &set.sensors {
                assert_eq!(dense(gain).column(sensor).amax(), 0.0);
            }
            let error = &mode.a - &mode.a * dense(gain) * &mode.c;
            assert!(spectral_radius(&error) < 1.0);
        }
    }
}

#[test]
fn random_plants_prove_what_they_serve() {
    let mut served = 0;
    for seed in 0..12 {
        let plant = random_plant(seed, 1.0);
        for kind in [ObserverChoice::Kalman, ObserverChoice::Luenberger] {
            let Some(found) = synthesise(&plant, kind, Lyapunov::Common) else {
                continue;
            };
            found.verify(&plant).unwrap();
            served += found.observer.observer.lost.len();
            for set in &found.observer.observer.lost {
                for (mode, gain) in plant.modes.iter().zip(&set.correction) {
                    let error = &mode.a - &mode.a * dense(gain) * &mode.c;
                    assert!(spectral_radius(&error) < 1.0);
                }
            }
        }
    }
    assert!(served > 0);
}

#[test]
fn a_changed_gain_for_lost_sensors_is_refused() {
    let plant = paper(Channel::State);
    let found = synthesise(&plant, ObserverChoice::Kalman, Lyapunov::Common).unwrap();
    let mut blind = found.clone();
    blind.observer.observer.lost[0].correction[0].as_mut_slice()[0] = 0.1;
    assert!(blind.verify(&plant).is_err());
    let mut wild = found.clone();
    let gain = &mut wild.observer.observer.lost[0].correction[0];
    let second_column = gain.nrows();
    gain.as_mut_slice()[second_column] = 1e3;
    assert!(wild.verify(&plant).is_err());
    let mut too_large = found;
    too_large.observer.lost.as_mut().unwrap().mu = 2.0;
    assert!(too_large.verify(&plant).is_err());
}
