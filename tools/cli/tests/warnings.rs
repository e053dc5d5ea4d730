//! Warnings of designs that are sound, one sentence each: in the report, as JSON, on the page.
#![allow(missing_docs)]

mod common;

use common::{Bench, FILE, SOUND, damaged};
use std::fmt::Write;
use std::fs;

/// The warnings of `design --json`, each of which must also stand in the report for people.
fn of_design(bench: &Bench) -> Vec<String> {
    let run = bench.run(&["design", FILE, "--json"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let text = bench.run(&["design", FILE]).stdout();
    sentences(&run.json()["warnings"], &text)
}

/// The warnings of `simulate`, which must stand in its summary and on its page too.
fn of_run(bench: &Bench, more: &[&str]) -> Vec<String> {
    let run = bench.run(&[&["simulate", FILE, "--out", "out"], more].concat());
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let metrics = bench.metrics();
    let tried = fs::read(bench.path("out/robustness.json")).unwrap();
    let tried: serde_json::Value = serde_json::from_slice(&tried).unwrap();
    let listed = |list: &serde_json::Value| list.as_array().unwrap().clone();
    let (ours, others) = (listed(&metrics["warnings"]), listed(&tried["warnings"]));
    let all = serde_json::Value::from([ours.clone(), others].concat());
    let mut warnings = sentences(&all, &run.stdout());
    let page = fs::read_to_string(bench.path("out/report.html")).unwrap();
    assert_eq!(page.contains("<h2>Warnings</h2>"), !warnings.is_empty());
    for warning in &warnings {
        assert!(page.contains(warning.as_str()), "{warning}");
    }
    // Those of plants that are not quite the model come last.
    warnings.truncate(ours.len());
    warnings
}

fn sentences(list: &serde_json::Value, text: &str) -> Vec<String> {
    let warnings: Vec<String> = serde_json::from_value(list.clone()).unwrap();
    for warning in &warnings {
        assert!(text.contains(&format!("warning: {warning}\n")), "{text}");
        assert!(warning.len() < 400 && !warning.contains('\n'), "{warning}");
    }
    assert_eq!(text.matches("warning: ").count(), warnings.len(), "{text}");
    warnings
}

/// Exactly one warning, with these words.
fn one(warnings: &[String], words: &[&str]) {
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    for word in words {
        assert!(
            warnings[0].contains(word),
            "no '{word}' in: {}",
            warnings[0]
        );
    }
}

/// A schedule that changes the mode every `period` samples.
fn switching(every: usize) -> String {
    let mut schedule = String::new();
    for (place, from) in (0..60).step_by(every).enumerate() {
        let _ = write!(schedule, "{{ from = {from}, mode = {} }}, ", place % 2 + 1);
    }
    damaged("{ from = 0, mode = 1 }, { from = 30, mode = 2 }", &schedule)
}

#[test]
fn the_sound_design_needs_no_warning() {
    let bench = Bench::new(damaged(
        "sigmas = 6.0",
        "sigmas = 6.0\nresponse_length = 12",
    ));
    assert_eq!(of_design(&bench), [""; 0]);
}

#[test]
fn a_schedule_that_outruns_the_estimator() {
    let bench =
        Bench::new(switching(5).replace("sigmas = 6.0", "sigmas = 6.0\nresponse_length = 12"));
    one(
        &of_design(&bench),
        &[
            "11 of 11 switches",
            "response_length = 12",
            "no sensor is judged",
        ],
    );
    let run = of_run(&bench, &[]);
    assert_eq!(run.len(), 2, "{run:?}");
    assert!(run[1].contains("ftc: in 100.0 % of the samples"), "{run:?}");
    let quick = switching(5).replace("\"reference\"", "\"none\"");
    assert_eq!(of_design(&Bench::new(quick)), [""; 0], "nothing to judge");
}

#[test]
fn a_schedule_that_breaks_the_proved_dwell_time() {
    let dwelling = |every| {
        switching(every)
            .replace("\"common\"", "\"dwell\"")
            .replace("latency = 0", "latency = 1")
            .replace("decay = 0.7\noutput", "decay = 0.9\noutput")
            .replace("sigmas = 6.0", "sigmas = 6.0\nresponse_length = 2")
    };
    one(
        &of_design(&Bench::new(dwelling(3))),
        &["modes last 3.00 samples", "stability is proved only"],
    );
    assert_eq!(of_design(&Bench::new(dwelling(20))), [""; 0]);
}

/// References of a thousand, where inputs were said to move by one.
#[test]
fn a_reference_far_outside_the_database() {
    let design = |nominal: f64, reference: f64| {
        format!(
            "name = \"far\"\nsample_time = 1.0\n[[mode]]\nA = [[0.8]]\nB = [[0.2]]\nC = [[1.0]]\n\
             [signals]\ninputs = [{{ name = \"valve\", nominal = {nominal} }}]\n\
             [controller]\ndecay = 0.9\n[estimator]\nmethod = \"reference\"\n\
             [scenario]\nsteps = 400\nnoise = 0.005\n\
             reference = [{{ kind = \"steps\", points = [[0, {reference}], [150, 0]] }}]\n"
        )
    };
    let far = Bench::new(design(1.0, 1000.0));
    let words = [
        "mode 1",
        "valve = 1000 in steady state",
        "nominal",
        "times wider there",
    ];
    one(&of_design(&far), &words);
    let run = of_run(&far, &[]);
    assert_eq!(run.len(), 2, "{run:?}");
    assert!(
        run[1].contains("outside what the healthy database spans"),
        "{run:?}"
    );
    for near in [design(1000.0, 1000.0), design(1.0, 1.0)] {
        let bench = Bench::new(near);
        assert_eq!(of_run(&bench, &[]), [""; 0]);
    }
}

#[test]
fn thresholds_that_nothing_was_known_for() {
    let silent = damaged("noise = 0.005\n", "").replace("sigmas = 6.0", "response_length = 12");
    one(
        &of_design(&Bench::new(&silent)),
        &["scenario.noise", "estimator.threshold"],
    );
    for known in [
        silent.replace("response_length", "threshold = 0.1\nresponse_length"),
        silent.replace("steps = 60", "steps = 60\nnoise = 0.0"),
        silent.replace("\"reference\"", "\"none\""),
    ] {
        assert_eq!(of_design(&Bench::new(known)), [""; 0]);
    }
}

/// A key of which the estimator's method knows nothing is not passed over in silence.
#[test]
fn keys_that_the_method_does_not_use() {
    for (method, key) in [
        ("observer", "adapt = true"),
        ("observer", "response_length = 12"),
        ("reference", "fault_rate = 1e-4"),
    ] {
        let asked = damaged("debounce = 1", key).replace("\"reference\"", &format!("\"{method}\""));
        let (name, _) = key.split_once(' ').unwrap();
        one(
            &of_design(&Bench::new(asked)),
            &[
                &format!("estimator.{name}: method = \"{method}\""),
                "leave it out",
            ],
        );
    }
}

/// The example with logs, the first of them changed cell by cell: row, column of the first level.
fn logged(change: impl Fn(usize, f64) -> f64) -> Bench {
    let examples = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let read = |name: &str| fs::read_to_string(examples.join(name)).unwrap();
    let bench = Bench::new(read("logged.toml"));
    let mut text = String::new();
    for (row, line) in read("logged_closed.csv").lines().enumerate() {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        if let Ok(level) = cells[3].parse::<f64>() {
            cells[3] = change(row, level).to_string();
        }
        let _ = writeln!(text, "{}", cells.join(","));
    }
    fs::write(bench.path("logged_closed.csv"), text).unwrap();
    fs::write(bench.path("logged_open.csv"), read("logged_open.csv")).unwrap();
    bench
}

#[test]
fn a_log_that_contradicts_the_model() {
    let place = ["logged_closed.csv", "mode 1 (valve closed)", "level 1"];
    let doubted =
        |bench: &Bench, what: &str| one(&of_design(bench), &[&place[..], &[what]].concat());
    assert_eq!(of_design(&logged(|_, level| level)), [""; 0]);
    doubted(&logged(|_, level| -level), "differs from the model's");
    doubted(
        &logged(|_, level| 80.0 - level),
        "sign seems to be reversed",
    );
    doubted(
        &logged(|_, level| 1000.0 * level),
        "differs from the model's",
    );
    doubted(&logged(|_, level| 40.0 + 1000.0 * (level - 40.0)), "unit");
    let faulty = |row, level| level + if (200..300).contains(&row) { 5.0 } else { 0.0 };
    doubted(&logged(faulty), "do not explain");

    let swapped = logged(|_, level| level);
    fs::copy(
        swapped.path("logged_open.csv"),
        swapped.path("logged_closed.csv"),
    )
    .unwrap();
    let warnings = of_design(&swapped);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(
        warnings
            .iter()
            .all(|w| w.contains("logged_closed.csv: mode 1"))
    );
}

#[test]
fn a_sensor_that_never_changes_is_refused() {
    let run = logged(|_, _| 40.0).run(&["design", FILE]);
    assert_eq!(run.code(), 2);
    for word in [
        "logged_closed.csv",
        "mode 1 (valve closed)",
        "level 1 never changes",
    ] {
        assert!(run.stderr().contains(word), "{}", run.stderr());
    }
}

/// A voltage sensor that sticks makes a controller that uses it empty the DC link. It once went
/// through zero and to hundreds of kilovolts; its diodes hold it up.
#[test]
fn a_link_that_is_emptied_rests_on_its_diodes() {
    let example =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/converter.toml");
    let text = fs::read_to_string(example).unwrap();
    let (before, _) = text.split_once("[scenario]").unwrap();
    let scenario = "[scenario]\nsteps = 2400\nnoise = [0.3, 0.05]\n\
                    schedule = [{ from = 0, mode = 1 }, { from = 11.3, mode = 2 }]\n\
                    reference = [{ kind = \"square\", amplitude = 10, period = 4, offset = 600 }, 0.0]\n\
                    events = [{ kind = \"stuck\", sensor = 1, from = 5 }]\n";
    let bench = Bench::new(format!("{before}{scenario}"));
    let warnings = of_run(&bench, &["--baselines"]);
    for variant in ["no_ftc", "mpc"] {
        let word =
            format!("{variant}: the DC link fell to where its diodes conduct, below 538.7 V");
        assert!(
            warnings.iter().any(|w| w.starts_with(&word)),
            "{warnings:?}"
        );
    }
    let mut table = csv::Reader::from_path(bench.path("out/trajectories.csv")).unwrap();
    let header = table.headers().unwrap().clone();
    let voltages: Vec<usize> = (0..header.len())
        .filter(|&column| header[column].ends_with(".x[3]"))
        .collect();
    assert_eq!(voltages.len(), 5);
    for record in table.records() {
        let record = record.unwrap();
        for &column in &voltages {
            let voltage: f64 = record[column].parse().unwrap();
            assert!(
                (450.0..1000.0).contains(&voltage),
                "{}: {voltage} V",
                &header[column]
            );
        }
    }
}

#[test]
fn a_constant_reference_has_no_vaf() {
    let constant = damaged("{ kind = \"square\", amplitude = 1, period = 20 }", "0.5");
    let row = |design: &str, output: &str| -> Vec<String> {
        let bench = Bench::new(design);
        let text = bench.run(&["simulate", FILE, "--out", "out"]).stdout();
        let line = text
            .lines()
            .find(|line| line.starts_with("ftc") && line.contains(output));
        assert_eq!(
            text.contains("VAF compares variances"),
            design != SOUND,
            "{text}"
        );
        line.unwrap().split_whitespace().map(String::from).collect()
    };
    assert_eq!(row(&constant, " b ")[4..], ["-", "-"]);
    assert!(row(&constant, " a ")[4].parse::<f64>().is_ok());
    assert!(row(SOUND, " b ")[4].parse::<f64>().is_ok());
}

#[test]
fn an_input_at_its_limits_and_a_noisy_command_are_named() {
    let tight = damaged(
        "[signals]\n",
        "[signals]\ninputs = [{ name = \"valve\", min = -0.05, max = 0.05 }, { name = \"pump\", nominal = 0.01 }]\n",
    );
    let warnings = of_run(&Bench::new(tight), &[]);
    let named = |words: &[&str]| {
        let all = |warning: &String| words.iter().all(|word| warning.contains(word));
        assert!(warnings.iter().any(all), "no {words:?} in {warnings:?}");
    };
    named(&["ftc: valve is at a limit in ", "% of the samples"]);
    named(&["noise of the sensors moves pump by "]);
}

#[test]
fn a_fault_beyond_the_authority_is_named() {
    let estimator = SOUND.find("[estimator]").unwrap()..SOUND.find("[compensation]").unwrap();
    let within = |authority: f64| {
        let mut design = SOUND.to_string();
        let keys = format!("[estimator]\nauthority = [5.0, {authority}]\n\n");
        design.replace_range(estimator.clone(), &keys);
        of_run(&Bench::new(design), &[])
    };
    one(
        &within(0.2),
        &[
            "ftc: in ",
            "% of the samples the estimated fault of b stood at its largest size, 0.2",
            "raise estimator.authority",
        ],
    );
    assert!(within(1.0).is_empty());
}

#[test]
fn weights_without_effect_are_named() {
    let decay = damaged("decay = 0.7\n", "decay = 0.7\nobjective = \"decay\"\n");
    one(
        &of_design(&Bench::new(decay)),
        &[
            "controller.output_weight, controller.integral_weight, controller.input_weight have no effect",
            "objective",
        ],
    );
}

/// Without E and F a disturbance at the inputs is assumed and said, and the weights shape the gains.
#[test]
fn weights_act_without_a_known_disturbance() {
    let unknown = SOUND
        .replace("E = [[1.0], [1.0]]\n", "")
        .replace(
            "disturbance = [{ kind = \"sine\", amplitude = 0.04, period = 314 }]\n",
            "",
        )
        .replace("[disturbance]\nperiod = 314.0\nharmonics = 1\n", "")
        .replace("kind = \"uio\"", "kind = \"auto\"");
    let design = |text: &str| {
        let bench = Bench::new(text);
        let run = bench.run(&["design", FILE, "--json"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        let said = bench.run(&["design", FILE]).stdout();
        assert!(
            said.contains("one at the inputs (E = B) is assumed"),
            "{said}"
        );
        run.json()
    };
    let usual = design(&unknown);
    let costly =
        design(&unknown.replace("input_weight = [0.1, 0.1]", "input_weight = [10.0, 10.0]"));
    assert_eq!(usual["disturbance"], "assumed at the inputs (B)");
    let noise = |report: &serde_json::Value| report["noise_gain"][0].as_f64().unwrap();
    assert!(usual["gamma_loop"][0].as_f64().unwrap() > 0.0);
    assert!(
        (noise(&usual) - noise(&costly)).abs() > 1e-3,
        "the weights shape nothing"
    );
}

/// An unstable pitch axis without E: its input's gain alone decides gamma, so no weight moves the gains.
#[test]
fn weights_that_shape_the_gains_hardly_are_named() {
    let pitch = |weights: &str| {
        format!(
            r#"name = "pitch"
sample_time = 0.05
[[mode]]
A = [[0.951, 0.043], [0.039, 0.948]]
B = [[-0.0003], [-0.0086]]
C = [[0.0, 1.0], [1.0, 0.0]]
[signals]
inputs = [{{ name = "elevator", nominal = 2.0, min = -25.0, max = 25.0 }}]
outputs = [{{ name = "q", nominal = 5.0 }}, {{ name = "alpha", nominal = 3.0 }}]
[controller]
tracked = [1]
decay = 0.98
{weights}
[observer]
decay = 0.95
[scenario]
steps = 200
noise = [0.1, 0.1]
reference = [0.0]
"#
        )
    };
    let gamma = |weights: &str| {
        let bench = Bench::new(pitch(weights));
        let run = bench.run(&["design", FILE, "--json"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        run.json()["gamma"][0].as_f64().unwrap()
    };
    let usual = "output_weight = 0.2\nintegral_weight = 0.5\ninput_weight = 0.1";
    let bench = Bench::new(pitch(usual));
    one(
        &of_design(&bench),
        &[
            "controller.output_weight, controller.integral_weight, controller.input_weight have hardly any effect",
            "controller.input_weight alone decides gamma",
            "times smaller",
        ],
    );
    // It is true: gamma follows the weight, with the same gains. The warnings of a run do not ask for more of what does nothing.
    let heavier = gamma("output_weight = 0.2\nintegral_weight = 0.5\ninput_weight = 1.0");
    assert!((heavier / gamma(usual) - 10.0).abs() < 1e-2);
    let run = of_run(&bench, &[]);
    let noisy = run
        .iter()
        .find(|warning| warning.contains("noise of the sensors moves elevator"));
    let noisy = noisy.unwrap_or_else(|| panic!("{run:?}"));
    assert!(noisy.contains("objective = decay"), "{noisy}");
    assert!(!noisy.contains("raise controller.input_weight"), "{noisy}");
    // And what is advised moves the gains.
    let lighter = gamma("output_weight = 20.0\nintegral_weight = 50.0\ninput_weight = 0.1");
    assert!(lighter / gamma(usual) > 1.02);
}

/// A fast Luenberger observer leaves the running loop with a multiple of the gain of a measured state.
#[test]
fn an_observer_that_costs_much_is_named() {
    let unstable = r#"name = "unstable"
sample_time = 1.0
[[mode]]
A = [[1.2]]
B = [[1.0]]
C = [[1.0]]
E = [[1.0]]
[controller]
tracked = [1]
decay = 0.9
[observer]
kind = "luenberger"
decay = 0.6
[estimator]
method = "none"
[scenario]
steps = 50
noise = 0.01
disturbance = [{ kind = "sine", amplitude = 0.01, period = 20 }]
"#;
    one(
        &of_design(&Bench::new(unstable)),
        &[
            "mode 1: with this observer gamma_loop is ",
            "times gamma",
            "observer.kind = auto",
        ],
    );
    // Without noise nothing is known of what it does to the command.
    let noise = |text: &str| {
        let bench = Bench::new(text);
        let known = bench.run(&["design", FILE, "--json"]).json()["command_noise"].is_array();
        let said = bench.run(&["design", FILE]).stdout();
        assert_eq!(
            known,
            !said.contains("noise on the command not known without scenario.noise"),
            "{said}"
        );
        known
    };
    assert!(noise(unstable) && !noise(&unstable.replace("noise = 0.01\n", "")));
    let best = unstable.replace("\"luenberger\"", "\"auto\"");
    assert_eq!(of_design(&Bench::new(best)), Vec::<String>::new());
}

/// What bumpless transfer is proved for is said, and no gain is claimed across its switches.
#[test]
fn bumpless_transfer_says_how_often() {
    let report = |lyapunov: &str, bumpless: bool| {
        let keys = format!("lyapunov = \"{lyapunov}\"\nbumpless = {bumpless}\n");
        let bench = Bench::new(damaged("lyapunov = \"common\"\n", &keys));
        let run = bench.run(&["design", FILE, "--json"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        (run.json(), bench.run(&["design", FILE]).stdout())
    };
    let (json, text) = report("common", false);
    assert!(json["gamma_loop_switching"].is_number() && json["bumpless_samples"].is_null());
    assert!(!text.contains("bumpless"), "{text}");
    for lyapunov in ["common", "switched", "dwell"] {
        let (json, text) = report(lyapunov, true);
        assert!(json["gamma_loop_switching"].is_null());
        let samples = json["bumpless_samples"].as_u64().unwrap();
        let said = match json["bumpless_needs_dwell"].as_bool().unwrap() {
            true => "proved when each mode lasts at least ".to_owned(),
            false => format!(
                "the command is continuous at a switch {samples} samples or more after the last"
            ),
        };
        assert!(text.contains(&said), "{text}");
        assert!(
            text.contains("no gain is claimed across a switch"),
            "{text}"
        );
    }
    let too_soon = damaged(
        "lyapunov = \"common\"\n",
        "lyapunov = \"dwell\"\nbumpless = true\n",
    );
    let too_soon = too_soon.replace(
        "{ from = 30, mode = 2 }]",
        "{ from = 2, mode = 2 }, { from = 50, mode = 1 }]",
    );
    let bench = Bench::new(too_soon);
    let warnings = of_design(&bench);
    let short = |warning: &&String| {
        warning.contains("a mode lasts 2 samples only") && warning.contains("controller.bumpless")
    };
    let warned = warnings.iter().find(short);
    let warned = warned.unwrap_or_else(|| panic!("{warnings:?}"));
    // The length that is warned of is the one that is claimed.
    let report = bench.run(&["design", FILE]).stdout();
    let length = |text: &str, before: &str| -> u64 {
        let (_, after) = text.split_once(before).unwrap();
        after.split([' ', ':']).next().unwrap().parse().unwrap()
    };
    assert_eq!(
        length(warned, "each lasts at least "),
        length(&report, "proved when each mode lasts at least ")
    );
}
