//! Plants as engineers have them: continuous, with a direct feedthrough, in another tool's file.
//!
//! promise: plants-as-they-are
#![allow(missing_docs)]

mod common;

use common::{Bench, FILE};
use std::fs;

const CONTINUOUS: &str = r#"
name = "lag"
sample_time = 0.5
continuous = true

[[mode]]
A = [[-0.5, 0.0], [0.2, -0.4]]
B = [[0.5], [0.0]]
C = [[0.0, 1.0]]
E = [[0.1], [0.0]]

[controller]
decay = 0.95

[scenario]
noise = 0.001
"#;

fn run(design: &str, arguments: &[&str]) -> (i32, String, String) {
    let bench = Bench::new(design);
    let run = bench.run(arguments);
    (run.code(), run.stdout(), run.stderr())
}

fn design(text: &str) -> (i32, String, String) {
    run(text, &["design", FILE])
}

/// The matrix exponential of the first mode, in closed form: A is lower triangular.
#[test]
fn continuous_matrices_are_sampled_exactly() {
    let te: f64 = 0.5;
    let (fast, slow) = ((-0.5 * te).exp(), (-0.4 * te).exp());
    // x1' = -0.5 x1 + 0.5 u, x2' = 0.2 x1 - 0.4 x2.
    let coupling = 0.2 * (slow - fast) / 0.1;
    let (b1, b2) = (1.0 - fast, 0.5 - 2.5 * slow + 2.0 * fast);
    let sampled = CONTINUOUS
        .replace("continuous = true\n", "")
        .replace(
            "[[-0.5, 0.0], [0.2, -0.4]]",
            &format!("[[{fast:?}, 0.0], [{coupling:?}, {slow:?}]]"),
        )
        .replace("[[0.5], [0.0]]", &format!("[[{b1:?}], [{b2:?}]]"))
        .replace(
            "E = [[0.1], [0.0]]",
            &format!("E = [[{:?}], [{:?}]]", 0.2 * b1, 0.2 * b2),
        );
    let gamma = |text: &str| {
        let (code, out, error) = run(text, &["design", FILE, "--json"]);
        assert_eq!(code, 0, "{error}");
        let report: serde_json::Value = serde_json::from_str(&out).unwrap();
        report["gamma"][0].as_f64().unwrap()
    };
    let (given, found) = (gamma(&sampled), gamma(CONTINUOUS));
    assert!((given / found - 1.0).abs() < 1e-6, "{given} {found}");
}

#[test]
fn continuous_matrices_given_as_discrete_are_noticed() {
    let (code, out, error) = design(&CONTINUOUS.replace("continuous = true\n", ""));
    assert_eq!(code, 0, "{error}");
    assert!(
        out.contains("warning: every eigenvalue of A has a negative real part"),
        "{out}"
    );
    assert!(out.contains("set continuous = true"), "{out}");
    let (code, out, error) = design(CONTINUOUS);
    assert_eq!(code, 0, "{error}");
    assert!(!out.contains("eigenvalue of A"), "{out}");
    // Where there is no design for want of it, the word stands beside the error.
    let fast = CONTINUOUS
        .replace("continuous = true\n", "")
        .replace("-0.5, 0.0", "-5.0, 0.0");
    let (code, out, error) = design(&fast);
    assert_eq!(code, 0, "{error}");
    assert!(out.contains("set continuous = true"), "{out}");
    let (code, _, error) = design(&(fast + "[estimator]\nmethod = \"reference\"\n"));
    assert_eq!(code, 2, "{error}");
    assert!(error.contains("set continuous = true"), "{error}");
    let (code, _, error) = design(&CONTINUOUS.replace("-0.5, 0.0", "900.0, 0.0"));
    assert_eq!(code, 2, "{error}");
    assert!(
        error.contains("mode 1: A grows beyond all bounds within sample_time"),
        "{error}"
    );
}

const FEEDTHROUGH: &str = r#"
name = "d"
sample_time = 0.1

[[mode]]
A = [[0.9]]
B = [[1.0]]
C = [[1.0]]
D = [[0.5]]
operating_point = { x = [2.0], u = [0.2], y = [2.1] }

[signals]
inputs = [{ name = "valve", unit = "l/min" }]

[controller]
latency = 1

[scenario]
noise = 0.001
"#;

/// `y(k) = C x(k) + D u(k-1)`, seen in the trajectories, and the fault-tolerant loop settles.
#[test]
fn a_direct_feedthrough_is_served_with_latency() {
    let bench = Bench::new(FEEDTHROUGH);
    let run = bench.run(&["simulate", FILE, "--out", "out"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let mut reader = csv::Reader::from_path(bench.path("out/trajectories.csv")).unwrap();
    let header = reader.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|found| found == name).unwrap();
    let [x, held, y_true, reference] =
        ["ftc.x[1]", "ftc.x[2]", "ftc.y_true[1]", "y_ref[1]"].map(column);
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let number = |row: usize, at: usize| rows[row][at].parse::<f64>().unwrap();
    // A command acts one sample late, and shows in the reading at the end of the sample it is held.
    let command = column("ftc.u[1]");
    for k in 2..rows.len() {
        assert_eq!(number(k, held), number(k - 2, command), "{k}");
        let expected = 2.1 + (number(k, x) - 2.0) + 0.5 * (number(k, held) - 0.2);
        assert!((number(k, y_true) - expected).abs() < 1e-12, "{k}");
    }
    let last = rows.len() - 1;
    assert!((number(last, y_true) - number(last, reference)).abs() < 0.01);
    let run = bench.run(&["export", FILE, "--out", "fmu"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
}

#[test]
fn a_direct_feedthrough_without_latency_is_explained() {
    let (code, _, error) = design(&FEEDTHROUGH.replace("latency = 1", "latency = 0"));
    assert_eq!(code, 2, "{error}");
    for word in [
        "mode 1: D is not zero",
        "latency = 0",
        "set controller.latency = 1",
    ] {
        assert!(error.contains(word), "{word}: {error}");
    }
    let zero = FEEDTHROUGH
        .replace("latency = 1", "latency = 0")
        .replace("[[0.5]]", "[[0.0]]");
    assert_eq!(design(&zero).0, 0);
    let (code, _, error) = design(&FEEDTHROUGH.replace("[[0.5]]", "[[0.5, 1.0]]"));
    assert_eq!(code, 2, "{error}");
    assert!(
        error.contains("mode 1: D is 1 x 2") && error.contains("1 x 1"),
        "{error}"
    );
}

/// Names and units go into XML: what cannot stand there is refused where it is read.
#[test]
fn control_characters_are_refused_by_key() {
    for (from, to, key) in [
        ("l/min", "l\\u0001/min", "signals.inputs[1].unit"),
        ("\"valve\"", "\"val\\u0007ve\"", "signals.inputs[1].name"),
        ("l/min", "l\\uffff", "signals.inputs[1].unit"),
        ("[[mode]]", "[[mode]]\nname = \"a\\u0000\"", "mode 1: name"),
    ] {
        let (code, _, error) = design(&FEEDTHROUGH.replace(from, to));
        assert_eq!(code, 2, "{key}: {error}");
        assert!(
            error.contains(key) && error.contains("not printable"),
            "{error}"
        );
    }
}

/// A double integrator has no fault estimator, but no advice that leads nowhere either.
#[test]
fn no_observer_decay_above_one_is_asked_for() {
    let text = r#"
name = "mass"
sample_time = 0.1

[[mode]]
A = [[1.0, 0.1], [0.0, 1.0]]
B = [[0.005], [0.1]]
C = [[1.0, 0.0]]
E = [[0.005], [0.1]]

[estimator]
method = "none"
"#;
    let (code, out, error) = design(text);
    assert_eq!(code, 0, "{error}");
    assert!(!out.contains("observer decay above"), "{out}");
}

/// A table with a time column keeps its own times.
#[test]
fn a_table_is_resampled_to_the_sample_time() {
    let text = |extra: &str| {
        CONTINUOUS.replace("sample_time = 0.5", "sample_time = 1.0")
            + &format!(
                "steps = 60\nreference = [{{ kind = \"table\", file = \"ref.csv\", column = \"r\"{extra} }}]\n"
            )
    };
    let reference = |table: &str, extra: &str| -> Result<Vec<f64>, String> {
        let bench = Bench::new(text(extra));
        fs::write(bench.path("ref.csv"), table).unwrap();
        let run = bench.run(&["simulate", FILE, "--out", "out"]);
        if run.code() != 0 {
            return Err(run.stderr());
        }
        let mut reader = csv::Reader::from_path(bench.path("out/trajectories.csv")).unwrap();
        let at = reader
            .headers()
            .unwrap()
            .iter()
            .position(|name| name == "y_ref[1]")
            .unwrap();
        Ok(reader
            .records()
            .map(|row| row.unwrap()[at].parse().unwrap())
            .collect())
    };
    let fine: String = (0..600).fold("t;r\n".into(), |text, k| {
        text + &format!(
            "{:.1};{}\n",
            0.1 * f64::from(k),
            if k < 300 { "0,5" } else { "-0,25" }
        )
        .replace('.', ",")
    });
    let values = reference(&fine, "").unwrap();
    assert_eq!((values[29], values[30], values[59]), (0.5, -0.25, -0.25));
    let coarse = "Time [min],r\n0,0\n0.5,3\n1,6\n";
    let held = reference(coarse, "").unwrap();
    assert_eq!((held[29], held[30]), (0.0, 3.0));
    let linear = reference(coarse, ", interpolation = \"linear\"").unwrap();
    assert!((linear[29] - 2.9).abs() < 1e-9 && (linear[45] - 4.5).abs() < 1e-9);
    let by_row = reference("r\n1\n2\n", "").unwrap();
    assert_eq!(by_row[..3], [1.0, 2.0, 2.0]);
    for (table, extra, words) in [
        (
            "t,r\n0,1\n2,1\n1,1\n",
            "",
            ["row 3 (line 4)", "from 2 to 1"],
        ),
        (
            "t,r\n0,1\n2,1\n2,1\n",
            "",
            ["row 3 (line 4)", "from 2 to 2"],
        ),
        ("s,r\n0,1\n", ", time = \"z\"", ["no column 'z'", "s, r"]),
        ("t,q\n0,1\n", "", ["no column r", "ref.csv"]),
        ("t,r\n0,x\n", "", ["row 1 (line 2)", "column r"]),
    ] {
        let error = reference(table, extra).unwrap_err();
        assert!(
            words.iter().all(|word| error.contains(word)),
            "{words:?}: {error}"
        );
    }
}
