//! What each command writes and prints, and its exit codes.
#![allow(missing_docs)]

mod common;

use common::{Bench, FILE, SOUND, damaged, export, installed, unzip};
use serde_json::Value;
use std::fs;
use std::path::Path;

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap().iter();
    list.map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn design_reports_the_papers_example_in_json() {
    for (example, gamma) in [("paper", 2.1146), ("paper_output", 1.7630)] {
        let path = format!(
            "{}/../../examples/{example}.toml",
            env!("CARGO_MANIFEST_DIR")
        );
        let run = Bench::empty().run(&["design", &path, "--json"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        let report = run.json();
        for found in numbers(&report["gamma"]) {
            assert!((found - gamma).abs() < 1e-3, "{example}: {found}");
        }
        assert!(numbers(&report["spectral_radius"]).iter().all(|&r| r < 0.7));
        assert_eq!(report["certified"], true);
        assert_eq!(report["feasible"], true);
        assert_eq!(report["decay"], 0.7);
        assert_eq!(report["lyapunov"], "common");
        assert_eq!(report["dwell_time_samples"], Value::Null);
    }
}

#[test]
fn every_example_is_designed_and_simulated() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let mut examples = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        examples += 1;
        let bench = Bench::empty();
        let run = bench.run(&["simulate", path.to_str().unwrap(), "--out", "out"]);
        assert_eq!(run.code(), 0, "{}: {}", path.display(), run.stderr());
        let metrics = bench.metrics();
        let mse = |variant: &str| numbers(&metrics[variant]["mse"]["true"]);
        // On a nonlinear plant an estimate carries what the linearisation misses, for which the
        // example's thresholds of 7 V and 0.6 A leave room; its faults last half of the time.
        let nonlinear = path.ends_with("converter.toml");
        let missed = if nonlinear { [7.0, 0.6] } else { [0.0; 2] };
        for (((ftc, without), told), missed) in mse("ftc")
            .iter()
            .zip(mse("no_ftc"))
            .zip(mse("told_the_fault"))
            .zip(missed)
        {
            assert!(
                *ftc <= 1.05 * told + 0.5 * missed * missed,
                "{}: {ftc} against {told}",
                path.display()
            );
            assert!(
                without >= 10.0 * ftc,
                "{}: {without} against {ftc}",
                path.display()
            );
        }
    }
    assert!(examples >= 3);
}

#[test]
fn the_text_report_names_what_an_engineer_looks_for() {
    let run = Bench::new(SOUND).run(&["design", FILE]);
    for word in [
        "gamma",
        "spectral radius",
        "decay asked",
        "observer",
        "response length",
        "residual deviation",
        "thresholds",
        "arbitrary switching",
        "proved",
    ] {
        assert!(
            run.stdout().contains(word),
            "no '{word}' in\n{}",
            run.stdout()
        );
    }
}

#[test]
fn an_infeasible_design_says_what_conflicts_and_what_to_try() {
    let bench = Bench::new(
        damaged("decay = 0.7\noutput", "decay = 0.001\noutput")
            .replace("latency = 0", "latency = 1"),
    );
    let run = bench.run(&["design", FILE, "--json"]);
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let report = run.json();
    assert_eq!(report["feasible"], false);
    assert_eq!(report["certified"], false);
    assert_eq!(report["decay"], 0.001);
    assert!(!report["blocks"].as_array().unwrap().is_empty());
    assert!(report["advice"].is_array());
    assert!(run.stderr().contains("infeasible"), "{}", run.stderr());
    let run = bench.run(&["export", FILE, "--out", "out"]);
    assert_eq!(run.code(), 1, "{}", run.stderr());
    assert_eq!(bench.files(), [FILE]);
}

#[test]
fn advice_is_worth_following() {
    let latency = damaged("latency = 0", "latency = 1");
    let run = Bench::new(&latency).run(&["design", FILE, "--json"]);
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let advice = run.json()["advice"].to_string();
    assert!(advice.contains("dwell"), "{advice}");
    let followed = latency
        .replace("\"common\"", "\"dwell\"")
        .replace("decay = 0.7\noutput", "decay = 0.9\noutput");
    let run = Bench::new(followed).run(&["design", FILE, "--json"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    assert!(run.json()["dwell_time_samples"].as_f64().unwrap() > 0.0);
}

#[test]
fn quiet_prints_nothing() {
    let run = Bench::new(SOUND).run(&["--quiet", "simulate", FILE, "--out", "out"]);
    assert_eq!(
        (run.code(), run.stdout(), run.stderr()),
        (0, String::new(), String::new())
    );
}

#[test]
fn defaults_make_a_complete_design() {
    let end = SOUND.find("[signals]").unwrap();
    let run = Bench::new(&SOUND[..end]).run(&["simulate", FILE, "--out", "out"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
}

#[test]
fn methods_kept_for_comparison_run() {
    for (from, to) in [
        ("\"reference\"", "\"sliding\""),
        ("\"reference\"", "\"none\""),
        ("\"virtual-sensor\"", "\"additive\""),
        ("\"virtual-sensor\"", "\"none\""),
        ("\"commission\"", "\"model\""),
        ("latency = 0", "bumpless = true"),
    ] {
        let run = Bench::new(damaged(from, to)).run(&["simulate", FILE, "--out", "out"]);
        assert_eq!(run.code(), 0, "{to}: {}", run.stderr());
    }
}

#[test]
fn the_table_of_trajectories_is_complete_and_reads_back_exactly() {
    let bench = Bench::new(SOUND);
    assert_eq!(bench.run(&["simulate", FILE, "--out", "out"]).code(), 0);
    let mut reader = csv::Reader::from_path(bench.path("out/trajectories.csv")).unwrap();
    let header: Vec<String> = reader.headers().unwrap().iter().map(String::from).collect();
    for name in ["t", "mode", "y_ref[2]", "w[1]", "f[2]", "noise[2]"] {
        assert!(header.contains(&name.to_string()), "{name}");
    }
    for variant in ["ftc", "no_ftc", "told_the_fault"] {
        for signal in [
            "y", "y_true", "x", "u", "x_hat", "f_hat", "residual", "fault",
        ] {
            assert!(
                header.contains(&format!("{variant}.{signal}[2]")),
                "{variant}.{signal}"
            );
        }
    }
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 60);
    for cell in rows.iter().flatten() {
        let value: f64 = cell.parse().unwrap();
        let again: f64 = format!("{value:?}").parse().unwrap();
        assert_eq!(value.to_bits(), again.to_bits());
    }
    let at = |name: &str| header.iter().position(|h| h == name).unwrap();
    let cell = |row: usize, name: &str| rows[row][at(name)].parse::<f64>().unwrap();
    for row in 0..60 {
        assert_eq!(cell(row, "t"), row as f64);
        assert_eq!(cell(row, "mode"), if row < 30 { 1.0 } else { 2.0 });
        // A healthy sensor reads the truth, its noise and nothing else.
        if cell(row, "f[1]") == 0.0 && row < 50 {
            assert_eq!(
                cell(row, "ftc.y[1]"),
                cell(row, "ftc.y_true[1]") + cell(row, "noise[1]")
            );
        }
    }
}

#[test]
fn a_table_from_csv_drives_the_reference() {
    let bench = Bench::new(damaged(
        "{ kind = \"square\", amplitude = 1, period = 20 }",
        "{ kind = \"table\", file = \"t.csv\", column = \"level\" }",
    ));
    fs::write(bench.path("t.csv"), "t, level\n0, 0.25\n1, -0.5\n").unwrap();
    let run = bench.run(&["simulate", FILE, "--out", "out"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let text = fs::read_to_string(bench.path("out/trajectories.csv")).unwrap();
    let references: Vec<&str> = text
        .lines()
        .skip(1)
        .map(|row| row.split(',').nth(3).unwrap())
        .collect();
    assert_eq!(references[..3], ["0.25", "-0.5", "-0.5"]);
}

#[test]
fn a_second_run_replaces_the_first() {
    let bench = Bench::new(SOUND);
    bench.run(&["simulate", FILE, "--out", "out"]);
    let first = bench.files();
    fs::write(bench.path("out/metrics.json"), "old").unwrap();
    fs::write(bench.path("out/mine.txt"), "kept").unwrap();
    assert_eq!(bench.run(&["simulate", FILE, "--out", "out"]).code(), 0);
    assert_ne!(
        fs::read_to_string(bench.path("out/metrics.json")).unwrap(),
        "old"
    );
    assert_eq!(
        fs::read_to_string(bench.path("out/mine.txt")).unwrap(),
        "kept"
    );
    assert_eq!(bench.files().len(), first.len() + 1);
}

/// A directory that has the name of a file to be written is named, and no file is left behind.
#[test]
fn all_files_or_none() {
    let bench = Bench::new(SOUND);
    fs::create_dir_all(bench.path("out/report.html")).unwrap();
    fs::write(bench.path("out/metrics.json"), "old").unwrap();
    let before = bench.files();
    let run = bench.run(&["simulate", FILE, "--out", "out"]);
    assert_eq!(run.code(), 2);
    assert!(
        run.stderr().contains("report.html is a directory there"),
        "{}",
        run.stderr()
    );
    assert_eq!(bench.files(), before);
    assert_eq!(
        fs::read_to_string(bench.path("out/metrics.json")).unwrap(),
        "old"
    );

    let program = installed(
        &bench,
        &[
            "fmu-binaries/linux64/ftc_controller.so",
            "fmu-binaries/linux64/ftc_plant.so",
        ],
    );
    fs::create_dir_all(bench.path("out/sound_plant.fmu")).unwrap();
    let before = bench.files();
    let output = export(&bench, &program, "out");
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(
        message.contains("sound_plant.fmu is a directory there"),
        "{message}"
    );
    assert_eq!(bench.files(), before);
}

/// What cannot be printed was asked for in vain; a reader that has read enough is no error.
#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error_and_a_closed_one_is_not() {
    use std::process::{Command, Stdio};
    let bench = Bench::new(SOUND);
    let design = |stdout: Stdio| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ftc-fmu"));
        command
            .args(["design", FILE])
            .current_dir(bench.path("."))
            .stdout(stdout);
        command.stderr(Stdio::piped()).output().unwrap()
    };
    let full = fs::OpenOptions::new()
        .write(true)
        .open("/dev/full")
        .unwrap();
    let output = design(full.into());
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(
        message.contains("standard output cannot be written to"),
        "{message}"
    );
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = design(writer.into());
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stderr.is_empty());
}

/// Rust opens /dev/null in place of a closed standard output, and what is printed is lost without a word.
#[cfg(target_os = "linux")]
#[test]
fn a_standard_output_that_is_closed_from_the_start_is_an_error() {
    let bench = Bench::new(SOUND);
    let shell = |line: &str| {
        let mut command = std::process::Command::new("sh");
        command.args(["-c", line, env!("CARGO_BIN_EXE_ftc-fmu"), FILE]);
        command.current_dir(bench.path(".")).output().unwrap()
    };
    let before = bench.files();
    for line in [
        "exec \"$0\" design \"$1\" >&-",
        "exec \"$0\" export \"$1\" --out out >&-",
    ] {
        let output = shell(line);
        assert_eq!(output.status.code(), Some(2));
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains("standard output is closed"), "{message}");
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
        assert_eq!(bench.files(), before);
    }
    let unread = shell("exec \"$0\" design \"$1\" > /dev/null <&-");
    assert_eq!(unread.status.code(), Some(0));
}

/// 64 states, 32 inputs and outputs, 64 modes under one Lyapunov function: 25 GB, if anybody tried.
#[test]
fn what_would_exhaust_memory_is_refused_with_an_estimate() {
    let (n, half, modes) = (64, 32, 64);
    let matrix = |rows: usize, columns: usize, value: f64| {
        let row = |i: usize| {
            (0..columns)
                .map(|j| if i == j { value } else { 0.0 })
                .collect()
        };
        let rows: Vec<Vec<f64>> = (0..rows).map(row).collect();
        format!("{rows:?}")
    };
    let mode = format!(
        "[[mode]]\nA = {}\nB = {}\nC = {}\n",
        matrix(n, n, 0.5),
        matrix(n, half, 1.0),
        matrix(half, n, 1.0)
    );
    let text = format!(
        "name = \"large\"\nsample_time = 1.0\n{}",
        mode.repeat(modes)
    );
    let run = Bench::new(&text).run(&["design", FILE]);
    assert_eq!(run.code(), 2, "{}", run.stderr());
    for word in ["GB of memory", "hours", "dwell"] {
        assert!(run.stderr().contains(word), "{}", run.stderr());
    }
    assert_eq!(
        run.stderr().trim_end().lines().count(),
        1,
        "{}",
        run.stderr()
    );
}

#[test]
fn export_without_binaries_says_what_to_run() {
    let bench = Bench::new(SOUND);
    let program = installed(&bench, &[]);
    let before = bench.files();
    let output = export(&bench, &program, "out");
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("make build"), "{message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    assert_eq!(bench.files(), before);
}

#[test]
fn an_fmu_holds_every_platform_that_is_there_and_belongs_to_its_design() {
    let bench = Bench::new(SOUND);
    let program = installed(
        &bench,
        &[
            "fmu-binaries/linux64/ftc_controller.so",
            "fmu-binaries/linux64/ftc_plant.so",
            "fmu-binaries/win64/ftc_controller.dll",
            "fmu-binaries/win64/ftc_plant.dll",
        ],
    );
    let output = export(&bench, &program, "out");
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(
        said.contains("platforms: linux64, win64"),
        "{said}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    for (kind, binary) in [
        ("controller", model_description::CONTROLLER),
        ("plant", model_description::PLANT),
    ] {
        let files = unzip(&bench.path(&format!("out/sound_{kind}.fmu")));
        let names: Vec<&str> = files.keys().map(String::as_str).collect();
        assert_eq!(
            names,
            [
                &format!("binaries/linux64/sound_{kind}.so"),
                &format!("binaries/win64/sound_{kind}.dll"),
                "documentation/index.html",
                "documentation/licenses/license.txt",
                "documentation/licenses/rust-standard-library.html",
                "model.png",
                "modelDescription.xml",
                "resources/certificate.json",
                "resources/design.cbor",
            ]
        );
        let design = &files["resources/design.cbor"];
        let xml = String::from_utf8(files["modelDescription.xml"].clone()).unwrap();
        assert!(
            xml.contains(&model_description::guid(binary, design)),
            "{xml}"
        );
        assert!(xml.contains(&format!("modelIdentifier=\"sound_{kind}\"")));
        let record = model_description::read_design(design).unwrap();
        assert_eq!(record.name, "sound");
    }
}

/// Disturbances may be named as the other signals are; the plant FMU's inputs and outputs tell them.
#[test]
fn a_disturbance_has_the_name_and_unit_it_was_given() {
    let named = |list: &str| {
        SOUND.replacen(
            "[signals]\n",
            &format!("[signals]\ndisturbances = {list}\n"),
            1,
        )
    };
    let bench = Bench::new(named(
        "[{ name = \"load torque\", unit = \"N.m\", nominal = 2.0 }]",
    ));
    let binaries = [
        "fmu-binaries/linux64/ftc_controller.so",
        "fmu-binaries/linux64/ftc_plant.so",
    ];
    let output = export(&bench, &installed(&bench, &binaries), "out");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let files = unzip(&bench.path("out/sound_plant.fmu"));
    let xml = String::from_utf8(files["modelDescription.xml"].clone()).unwrap();
    assert!(xml.contains("load torque"), "{xml}");
    assert!(
        xml.contains("unit=\"N.m\" relativeQuantity=\"true\" nominal=\"2.0\""),
        "{xml}"
    );
    for (list, key) in [
        ("[{}, {}]", "signals.disturbances"),
        ("[{ name = \"a\\u0001\" }]", "signals.disturbances[1].name"),
        ("[{ unit = \"\\uffff\" }]", "signals.disturbances[1].unit"),
    ] {
        let run = Bench::new(named(list)).run(&["design", FILE]);
        assert_eq!(run.code(), 2, "{}", run.stderr());
        assert!(run.stderr().contains(key), "{}", run.stderr());
    }
}

/// Binaries of another platform that are older than those of this machine were made from other sources.
#[cfg(target_os = "linux")]
#[test]
fn binaries_older_than_those_of_this_machine_are_left_out() {
    use std::time::{Duration, SystemTime};
    let bench = Bench::new(SOUND);
    let others = [
        "fmu-binaries/win64/ftc_controller.dll",
        "fmu-binaries/win64/ftc_plant.dll",
    ];
    let own = ["libftc_controller_fmu.so", "libftc_plant_fmu.so"];
    let program = installed(&bench, &[own, others].concat());
    for library in others {
        let path = bench.path("bin").join(library);
        let file = fs::File::options().write(true).open(path).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_secs(60))
            .unwrap();
    }
    let output = export(&bench, &program, "out");
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("(built for this machine)"), "{said}");
    assert!(said.contains("left out win64"), "{said}");
    let files = unzip(&bench.path("out/sound_plant.fmu"));
    assert!(!files.keys().any(|name| name.contains("win64")));
}

#[test]
fn the_same_design_gives_the_same_bytes() {
    let bench = Bench::new(SOUND);
    let program = installed(
        &bench,
        &[
            "fmu-binaries/linux64/ftc_controller.so",
            "fmu-binaries/linux64/ftc_plant.so",
        ],
    );
    for out in ["one", "two"] {
        assert!(export(&bench, &program, out).status.success());
    }
    for name in ["sound_controller.fmu", "sound_plant.fmu"] {
        let bytes = |out: &str| fs::read(bench.path(out).join(name)).unwrap();
        assert!(bytes("one") == bytes("two"), "{name}");
    }
}

#[test]
fn the_printed_theorems_are_reported_infeasible_with_margin_and_reason() {
    let bench = Bench::new(SOUND);
    let run = bench.run(&["design", FILE, "--as-printed", "--json"]);
    assert_eq!(run.code(), 1, "{}", run.stderr());
    assert!(run.stderr().contains("infeasible"), "{}", run.stderr());
    let report = run.json();
    assert_eq!(report["feasible"], false);
    let theorems = report["theorems"].as_array().unwrap();
    let margins = [(-1e-8, 1e-8), (-2.0, -0.1)];
    assert_eq!(theorems.len(), margins.len());
    for (theorem, (least, most)) in theorems.iter().zip(margins) {
        let verdict = &theorem["verdict"];
        assert_eq!(verdict["feasible"], false);
        let margin = verdict["margin"].as_f64().unwrap();
        assert!((least..=most).contains(&margin), "{theorem}");
        assert!(verdict["reason"].as_str().unwrap().len() > 40);
    }
    let run = bench.run(&["design", FILE, "--as-printed"]);
    for word in ["(10)", "(36)", "best margin", "reason"] {
        assert!(run.stdout().contains(word), "{}", run.stdout());
    }
}

#[test]
fn the_printed_theorems_need_as_many_outputs_as_states() {
    let tank = format!("{}/../../examples/tank.toml", env!("CARGO_MANIFEST_DIR"));
    let run = Bench::empty().run(&["design", &tank, "--as-printed"]);
    assert_eq!(run.code(), 2, "{}", run.stdout());
    assert!(run.stderr().contains("(10)"), "{}", run.stderr());
}

/// T1 asks for decay only: it promises no gamma, and its gains are others than those of T2.
#[test]
fn the_objective_chooses_the_theorem() {
    let report = |objective: &str| {
        let design = damaged("latency = 0", &format!("objective = \"{objective}\""));
        let run = Bench::new(design).run(&["design", FILE, "--json"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        run.json()
    };
    let (attenuation, decay) = (report("attenuation"), report("decay"));
    assert_eq!(numbers(&attenuation["gamma"]).len(), 2);
    assert_eq!(decay["gamma"], Value::Null);
    assert_eq!(decay["certified"], true);
    assert!(numbers(&decay["spectral_radius"]).iter().all(|&r| r < 0.7));
    assert_ne!(attenuation["spectral_radius"], decay["spectral_radius"]);
}

#[test]
fn baselines_are_written_beside_the_variants() {
    for latency in ["latency = 0", "latency = 1\nlyapunov = \"dwell\""] {
        let design = damaged("latency = 0\nlyapunov = \"common\"", latency)
            .replace("decay = 0.7\noutput", "decay = 0.9\noutput")
            // The bound is that of a plant that is left alone: what disturbs it may help by chance.
            .replace("noise = 0.005", "noise = 0.0")
            .replace("[28, 0.5]", "[28, 0.0]")
            .replace("kind = \"stuck\"", "kind = \"bias\", size = 0.0")
            .replace("amplitude = 0.04", "amplitude = 0.0");
        let bench = Bench::new(design);
        let run = bench.run(&["simulate", FILE, "--baselines", "--out", "out"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        let text = fs::read_to_string(bench.path("out/trajectories.csv")).unwrap();
        let header = text.lines().next().unwrap();
        for name in ["additive.y_true[1]", "mpc.u[2]", "ftc.y[1]"] {
            assert!(header.split(',').any(|column| column == name), "{name}");
        }
        let metrics = bench.metrics();
        let mse = |key: &str| numbers(&metrics[key]["mse"]["true"]);
        let bound = mse("deadbeat_bound");
        assert_eq!(bound.len(), 2);
        assert!(bound.iter().all(|&bound| bound > 0.0));
        // No controller follows faster than the plant allows. Between jumps 10 samples apart, an output that
        // never quite arrives may save a tenth: min over e of (1 - e)^2 + 9 e^2 is 0.9.
        for key in ["ftc", "told_the_fault", "additive", "mpc"] {
            for (found, least) in mse(key).iter().zip(&bound) {
                assert!(*found >= 0.9 * least, "{key}: {found} below {least}");
            }
            let baseline = key == "additive" || key == "mpc";
            assert!(!baseline || mse(key) != mse("ftc"), "{key}");
        }
        let page = fs::read_to_string(bench.path("out/report.html")).unwrap();
        for name in ["additive FTC", "predictive control"] {
            assert!(page.contains(name), "{name}");
        }
    }
}
