//! The controller's and the plant's tables, for designs of many sizes.

use model_description::*;
use proptest::prelude::*;

fn signal(name: &str, unit: &str, range: Option<(f64, f64)>) -> SignalInfo {
    SignalInfo {
        name: name.into(),
        unit: unit.into(),
        nominal: Some(10.0),
        min: range.map(|(min, _)| min),
        max: range.map(|(_, max)| max),
        start: 0.0,
    }
}

/// A design of n states, m inputs, p outputs, r tracked, s disturbances and some modes.
fn sized([n, m, p, r, s, modes]: [usize; 6]) -> Interface {
    let anonymous = |count| vec![SignalInfo::default(); count];
    Interface {
        sample_time: 0.1,
        stop_time: 10.0,
        inputs: anonymous(m),
        outputs: anonymous(p),
        states: anonymous(n),
        tracked: (0..r).collect(),
        disturbances: anonymous(s),
        modes,
        finds_the_mode: false,
        thresholds: vec![0.5; p],
    }
}

/// A rectifier whose signals the user has named.
fn named() -> Interface {
    Interface {
        inputs: vec![signal("current \"d\" & <q>", "A", Some((-20.0, 20.0)))],
        outputs: vec![
            signal("DC voltage", "V", Some((500.0, 700.0))),
            signal("angle", "rad", None),
        ],
        states: vec![signal("", "", None), signal("energy", "furlong", None)],
        tracked: vec![0],
        ..sized([2, 1, 2, 1, 1, 2])
    }
}

fn designs() -> Vec<Interface> {
    let mut designs = vec![named()];
    designs.extend(
        [
            [1, 1, 1, 1, 0, 1],
            [2, 2, 2, 2, 1, 2],
            [12, 3, 4, 2, 2, 4],
            [3, 1, 5, 1, 0, 3],
        ]
        .map(sized),
    );
    designs
}

#[test]
fn every_table_makes_sense() {
    for design in designs() {
        assert_eq!(controller(&design).check(), Ok(()));
        assert_eq!(plant(&design).check(), Ok(()));
    }
}

proptest! {
    #[test]
    fn tables_of_any_size_make_sense(
        sizes in (1..15usize, 1..6usize, 1..6usize, 0..6usize, 0..4usize, 1..9usize),
        bounds in prop::collection::vec((-1e6..1e6f64, 0.0..1e6f64, -1e9..1e9f64), 6),
    ) {
        let (n, m, p, r, s, modes) = sizes;
        let mut design = sized([n, m, p, r.min(p), s, modes]);
        let signals = design.inputs.iter_mut().chain(&mut design.outputs);
        for (signal, (min, width, start)) in signals.zip(bounds) {
            (signal.min, signal.max, signal.start) = (Some(min), Some(min + width), start);
        }
        for table in [controller(&design), plant(&design)] {
            prop_assert_eq!(table.check(), Ok(()));
            let vectors: u32 = ["u", "y", "y_ref"].map(|base| table.vector(base).len).iter().sum();
            prop_assert_eq!(vectors as usize, m + p + r.min(p));
        }
    }
}

#[test]
fn names_are_the_contract() {
    let names = |table: VariableTable| -> Vec<String> {
        table.iter().map(|(_, v)| v.name.clone()).collect()
    };
    let design = sized([1, 2, 2, 1, 1, 2]);
    let expected = "y[1] y[2] y_ref[1] mode mode_real u[1] u[2] x_hat[1] f_hat[1] f_hat[2] \
                    residual[1] residual[2] fault[1] fault[2] fault_real[1] fault_real[2] ftc_enabled threshold[1] threshold[2] \
                    suspect[1] suspect[2] model_valid load_hat[1] load_hat[2] actuator_fault[1] actuator_fault[2]";
    assert_eq!(names(controller(&design)).join(" "), expected);
    let expected = "u[1] u[2] f_ext[1] f_ext[2] w_ext[1] mode_ext mode_ext_real y[1] y[2] \
                    y_true[1] y_true[2] x[1] y_ref[1] mode mode_real f[1] f[2] w[1] \
                    scenario_enabled noise_enabled inject_kind[1] inject_kind[2] inject_size[1] inject_size[2] \
                    inject_from[1] inject_from[2] inject_until[1] inject_until[2]";
    assert_eq!(names(plant(&design)).join(" "), expected);
}

#[test]
fn the_loop_closes_by_names_and_types() {
    for design in designs() {
        let (controller, plant) = (controller(&design), plant(&design));
        for (from, to, names) in [
            (
                &plant,
                &controller,
                &["y", "y_ref", "mode", "mode_real"][..],
            ),
            (&controller, &plant, &["u"][..]),
        ] {
            for name in names {
                let (source, target) = (from.vector(name), to.vector(name));
                assert_eq!(source.len, target.len, "{name}");
                for (out, into) in source.range().zip(target.range()) {
                    let out = from.get(out as u32).unwrap();
                    let into = to.get(into as u32).unwrap();
                    assert_eq!(out.name, into.name);
                    assert_eq!(out.causality, Causality::Output);
                    assert_eq!(into.causality, Causality::Input);
                    assert_eq!(out.role, into.role);
                    assert_eq!(
                        std::mem::discriminant(&out.kind),
                        std::mem::discriminant(&into.kind)
                    );
                }
            }
        }
    }
}

#[test]
fn spans_by_role_and_by_name_agree() {
    for design in designs() {
        for table in [controller(&design), plant(&design)] {
            for (reference, variable) in table.iter() {
                let span = table.span(variable.role);
                assert!(span.range().contains(&(reference as usize)));
                let base = variable.name.split('[').next().unwrap();
                assert_eq!(table.vector(base), span, "{}", variable.name);
            }
            assert!(table.vector("nothing").is_empty());
        }
    }
}

#[test]
fn the_users_words_go_into_description_and_attributes() {
    let table = controller(&named());
    let u = table.get(table.vector("u").first).unwrap();
    assert!(u.description.contains("current \"d\" & <q>"));
    let Kind::Real {
        unit,
        min,
        max,
        nominal,
        ..
    } = &u.kind
    else {
        panic!("u is a Real");
    };
    assert_eq!(unit.as_deref(), Some("A"));
    assert_eq!(
        (*min, *max, *nominal),
        (Some(-20.0), Some(20.0), Some(10.0))
    );
    let reference = table.get(table.vector("y_ref").first).unwrap();
    assert!(reference.description.contains("DC voltage"));
    assert_eq!(reference.start, 500.0, "0 lies outside the range");
}

/// Builds one Real variable that is right, for a test to spoil.
fn good() -> Variable {
    Variable {
        name: "v".into(),
        description: String::new(),
        kind: Kind::Real {
            unit: None,
            display_unit: None,
            nominal: None,
            min: Some(-1.0),
            max: Some(1.0),
            relative: false,
        },
        causality: Causality::Input,
        variability: Variability::Discrete,
        start: 0.0,
        role: Role::Measurement,
        dependencies: Vec::new(),
        initial_dependencies: Vec::new(),
    }
}

fn problems(variables: impl IntoIterator<Item = Variable>) -> String {
    let mut table = VariableTable::new();
    table.extend(variables);
    let error = table.check().err();
    error.map_or_else(String::new, |error| error.to_string())
}

#[test]
fn each_kind_of_nonsense_is_named() {
    type Spoil = fn(&mut Variable);
    let cases: [(&str, Spoil); 14] = [
        ("start is not within", |v| v.start = 1.5),
        ("finite", |v| v.start = f64::NAN),
        ("structured naming", |v| v.name = "a b".into()),
        ("structured naming", |v| v.name = "y[0]".into()),
        ("structured naming", |v| v.name = "y[1".into()),
        ("structured naming", |v| v.name = "1y".into()),
        ("structured naming", |v| v.name = String::new()),
        ("do not go together", |v| v.variability = Variability::Fixed),
        ("do not go together", |v| v.causality = Causality::Parameter),
        ("only outputs", |v| v.dependencies = vec![0]),
        ("whole number", |v| {
            v.kind = Kind::Integer {
                min: None,
                max: None,
            };
            v.start = 0.5;
        }),
        ("min is greater", |v| {
            v.kind = Kind::Integer {
                min: Some(1),
                max: Some(0),
            }
        }),
        ("only a Real", |v| {
            v.kind = Kind::Boolean;
            v.variability = Variability::Continuous;
        }),
        ("nominal", |v| {
            v.kind = Kind::Real {
                unit: None,
                display_unit: None,
                nominal: Some(0.0),
                min: None,
                max: None,
                relative: false,
            }
        }),
    ];
    assert_eq!(problems([good()]), "");
    for (expected, spoil) in cases {
        let mut variable = good();
        spoil(&mut variable);
        let found = problems([variable]);
        assert!(found.contains(expected), "{expected}: {found}");
    }
    assert!(problems([good(), good()]).contains("used twice"));
}

#[test]
fn dependencies_must_be_known_and_ascending() {
    let output = |running: &[u32], starting: &[u32]| Variable {
        name: "out".into(),
        causality: Causality::Output,
        role: Role::Command,
        dependencies: running.into(),
        initial_dependencies: starting.into(),
        ..good()
    };
    assert_eq!(problems([good(), output(&[0], &[0])]), "");
    assert!(problems([good(), output(&[1], &[])]).contains("no input"));
    assert!(problems([good(), output(&[], &[7])]).contains("not known"));
    assert!(problems([good(), output(&[], &[0, 0])]).contains("ascending"));
}
