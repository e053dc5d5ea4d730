//! Databases of healthy operation from CSV files: what is read, and what is refused in one sentence.
#![allow(missing_docs)]

mod common;

use common::{Bench, FILE, damaged};
use std::fmt::Write;
use std::fs;

/// Rows of a log of one mode of the sound design: `t`, two inputs, two outputs.
fn rows(mode: usize, samples: usize, from: usize) -> Vec<[f64; 5]> {
    let a = [[[0.6, 0.45], [-0.2, 0.3]], [[0.4, -0.3], [0.11, 0.0]]][mode];
    let b = [[[0.0, 1.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 1.0]]][mode];
    let mut x = [0.0, 0.0];
    let mut state = 17 + mode as u64;
    let mut sign = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        if state >> 63 == 0 { 1.0 } else { -1.0 }
    };
    (from..from + samples)
        .map(|k| {
            let u = [sign(), sign()];
            let row = [k as f64, u[0], u[1], x[0], x[1]];
            let next = |i: usize| -> f64 { (0..2).map(|j| a[i][j] * x[j] + b[i][j] * u[j]).sum() };
            x = [next(0), next(1)];
            row
        })
        .collect()
}

/// A log as text; the outputs have the names of the sound design.
fn log(rows: &[[f64; 5]]) -> String {
    let mut text = "t,u[1],u[2],a,b\n".to_string();
    for [t, u1, u2, y1, y2] in rows {
        let _ = writeln!(text, "{t},{u1},{u2},{y1},{y2}");
    }
    text
}

/// The two modes in one file, in stretches of a hundred samples.
fn mixed() -> String {
    let mut text = "t,mode,u[1],u[2],a,b\n".to_string();
    for stretch in 0..6 {
        for [t, u1, u2, y1, y2] in rows(stretch % 2, 100, 100 * stretch) {
            let _ = writeln!(text, "{t},{},{u1},{u2},{y1},{y2}", stretch % 2 + 1);
        }
    }
    text
}

/// The sound design with this database, and these files beside it.
fn bench(database: &str, files: &[(&str, &str)]) -> Bench {
    let bench = Bench::new(damaged(
        "database = \"commission\"",
        &format!("response_length = 15\ndatabase = {database}"),
    ));
    for (name, text) in files {
        fs::write(bench.path(name), text).unwrap();
    }
    bench
}

const PAIR: &str = "[\"one.csv\", \"two.csv\"]";

#[test]
fn a_log_per_mode_and_one_with_a_mode_column_are_read() {
    let (one, two) = (log(&rows(0, 200, 0)), log(&rows(1, 200, 0)));
    // Other columns, spaces and names by number do no harm.
    let other = one.replace("a,b\n", "y[1] , y[2]\n").replace("t,", "t, ");
    for (database, files) in [
        (PAIR, vec![("one.csv", one.as_str()), ("two.csv", &two)]),
        (PAIR, vec![("one.csv", other.as_str()), ("two.csv", &two)]),
        ("\"both.csv\"", vec![("both.csv", mixed().as_str())]),
    ] {
        let bench = bench(database, &files);
        let run = bench.run(&["design", FILE, "--json"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        let report = run.json();
        for deviation in report["estimator"]["residual_deviation"]
            .as_array()
            .unwrap()
        {
            for value in deviation.as_array().unwrap() {
                assert!(value.as_f64().unwrap() < 1e-2, "{report}");
            }
        }
        let run = bench.run(&["simulate", FILE, "--out", "out"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
    }
}

/// The log is in physical units: the operating point of its mode is taken out.
#[test]
fn a_log_is_taken_about_the_operating_point() {
    let shifted = |mode: usize| {
        let mut rows = rows(mode, 200, 0);
        for row in &mut rows {
            for (value, shift) in row.iter_mut().zip([0.0, 3.0, -2.0, 5.0, 7.0]) {
                *value += shift;
            }
        }
        log(&rows)
    };
    let bench = bench(PAIR, &[("one.csv", &shifted(0)), ("two.csv", &shifted(1))]);
    let deviation = || {
        let report = bench.run(&["design", FILE, "--json"]).json();
        let modes = &report["estimator"]["residual_deviation"];
        modes[0][0].as_f64().unwrap()
    };
    assert!(deviation() > 0.1);
    let design = fs::read_to_string(bench.path(FILE)).unwrap();
    let point = "{ x = [5, 7], u = [3, -2], y = [5, 7] }";
    let design = design.replace("{ x = [0, 0], u = [0, 0], y = [0, 0] }", point);
    fs::write(bench.path(FILE), design).unwrap();
    assert!(deviation() < 1e-2);
}

#[test]
fn the_examples_logs_are_what_its_script_writes() {
    let examples = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let bench = Bench::empty();
    fs::copy(examples.join("logged.toml"), bench.path("logged.toml")).unwrap();
    let status = std::process::Command::new("python3")
        .arg(examples.join("record.py"))
        .arg(bench.path("logged.toml"))
        .status()
        .unwrap();
    assert!(status.success());
    for name in ["logged_closed.csv", "logged_open.csv"] {
        let (new, kept) = (bench.path(name), examples.join(name));
        assert_eq!(
            fs::read_to_string(new).unwrap(),
            fs::read_to_string(kept).unwrap(),
            "{name}"
        );
    }
}

/// The dialects in which spreadsheets, loggers and simulation tools write the same log.
///
/// promise: any-dialect
#[test]
fn a_log_is_read_in_every_dialect() {
    let (one, two) = (log(&rows(0, 200, 0)), log(&rows(1, 200, 0)));
    let point_to_comma = |text: &str| text.replace(',', ";").replace('.', ",");
    let stamped = |text: &str, stamp: &dyn Fn(usize) -> String| -> String {
        let mut lines = text.lines();
        let header = lines.next().unwrap().replacen("t,", "Timestamp,", 1);
        let rest = lines.enumerate().map(|(k, line)| {
            let (_, cells) = line.split_once(',').unwrap();
            format!("\n{},{cells}", stamp(k))
        });
        header + &rest.collect::<String>() + "\n"
    };
    let scaled = |text: &str, name: &str| {
        stamped(text, &|k| (1000 * k).to_string()).replacen("Timestamp", name, 1)
    };
    let utf16 = |text: &str| -> Vec<u8> {
        let units = std::iter::once(0xfeff).chain(text.encode_utf16());
        units.flat_map(u16::to_le_bytes).collect()
    };
    let quoted = |text: &str| -> String {
        text.lines()
            .map(|line| format!("\"{}\"\r\n", line.replace(',', "\",\"")))
            .collect()
    };
    let clock = |k: usize| format!("2026-03-28T23:{:02}:{:02}", 55 + k / 60, k % 60);
    let dialects: Vec<(&str, Vec<u8>)> = vec![
        (
            "semicolons and decimal commas",
            point_to_comma(&one).into_bytes(),
        ),
        ("tabs", one.replace(',', "\t").into_bytes()),
        (
            "tabs and decimal commas",
            point_to_comma(&one).replace(';', "\t").into_bytes(),
        ),
        ("a byte order mark", format!("\u{feff}{one}").into_bytes()),
        ("UTF-16", utf16(&one.replace(',', "\t"))),
        ("carriage returns", one.replace('\n', "\r\n").into_bytes()),
        ("quotes", quoted(&one).into_bytes()),
        ("a sep line", format!("sep=,\r\n{one}").into_bytes()),
        (
            "a sep line with a semicolon",
            format!("\u{feff}sep=;\n{}", point_to_comma(&one)).into_bytes(),
        ),
        (
            "empty rows at the end",
            format!("{one},,,,\n,,,,\n\n,\n").into_bytes(),
        ),
        (
            "a delimiter at the end of each row",
            one.replace('\n', ",\n").into_bytes(),
        ),
        ("another case", one.replacen("t,", "TIME,", 1).into_bytes()),
        ("milliseconds", scaled(&one, "Time (ms)").into_bytes()),
        ("time stamps", stamped(&one, &clock).into_bytes()),
        (
            "time stamps with a zone",
            stamped(&one, &|k| clock(k) + ".000+01:00").into_bytes(),
        ),
        (
            "time stamps with a space",
            stamped(&one, &|k| clock(k).replace('T', " ")).into_bytes(),
        ),
    ];
    let report = |first: &[u8]| {
        let bench = bench(PAIR, &[("two.csv", &two)]);
        fs::write(bench.path("one.csv"), first).unwrap();
        let run = bench.run(&["design", FILE, "--json"]);
        (run.code(), run.stdout(), run.stderr())
    };
    let expected = report(one.as_bytes());
    assert_eq!(expected.0, 0, "{}", expected.2);
    for (dialect, bytes) in dialects {
        let found = report(&bytes);
        assert_eq!(found.0, 0, "{dialect}: {}", found.2);
        assert_eq!(found.1, expected.1, "{dialect}");
    }
}

/// Rounded times are no gaps, and a time column may be named.
///
/// promise: any-dialect
#[test]
fn rounded_times_and_named_columns_are_read() {
    let (one, two) = (rows(0, 200, 0), log(&rows(1, 200, 0)));
    let jittering: Vec<[f64; 5]> = one
        .iter()
        .enumerate()
        .map(|(k, row)| {
            [
                row[0] + [0.0, 0.02, -0.02][k % 3],
                row[1],
                row[2],
                row[3],
                row[4],
            ]
        })
        .collect();
    let named = log(&one).replacen("t,", "elapsed,", 1);
    let run =
        bench(PAIR, &[("one.csv", &log(&jittering)), ("two.csv", &two)]).run(&["design", FILE]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let run = bench(PAIR, &[("one.csv", &named), ("two.csv", &two)]).run(&["design", FILE]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    assert!(
        run.stdout()
            .contains("one.csv: no column is called t or time"),
        "{}",
        run.stdout()
    );
    assert!(
        !run.stdout().contains("two.csv: no column"),
        "{}",
        run.stdout()
    );
    let both = [("one.csv", named.as_str()), ("two.csv", &named)];
    let gap = named.replacen("\n60,", "\n61,", 1);
    for (first, code) in [(named.as_str(), 0), (gap.as_str(), 2)] {
        let database = format!("{PAIR}\ntime = \"elapsed\"");
        let bench = bench(&database, &[("one.csv", first), both[1]]);
        let run = bench.run(&["design", FILE]);
        assert_eq!(run.code(), code, "{}", run.stderr());
    }
    let run = bench(&format!("{PAIR}\ntime = \"clock\""), &both).run(&["design", FILE]);
    assert!(
        run.stderr().contains("'clock'") && run.stderr().contains("elapsed"),
        "{}",
        run.stderr()
    );
}

/// What is no regular file is not opened: a pipe would be waited for.
#[test]
#[cfg(unix)]
fn only_regular_files_are_read() {
    let bench = bench(PAIR, &[("two.csv", "t\n")]);
    for name in ["one.csv", "pipe.toml"] {
        let made = std::process::Command::new("mkfifo")
            .arg(bench.path(name))
            .status();
        assert!(made.unwrap().success());
    }
    for (file, word) in [
        (FILE, "one.csv"),
        ("pipe.toml", "pipe.toml"),
        ("/dev/zero", "/dev/zero"),
    ] {
        let run = bench.run(&["design", file]);
        assert_eq!(run.code(), 2, "{}", run.stdout());
        let message = run.stderr();
        assert!(
            message.contains(word) && message.contains("no regular file"),
            "{message}"
        );
    }
}

/// Nor are keys, solved designs, results of campaigns and FMUs.
#[test]
#[cfg(unix)]
fn other_files_must_be_regular_too() {
    let bench = Bench::new(common::SOUND);
    std::fs::create_dir(bench.path("out")).unwrap();
    for name in ["pipe", "out/campaign.json"] {
        let made = std::process::Command::new("mkfifo")
            .arg(bench.path(name))
            .status();
        assert!(made.unwrap().success());
    }
    for file in ["pipe", "/dev/zero"] {
        let cases: [&[&str]; 5] = [
            &["verify", file],
            &["verify", "x.fmu", "--key", file],
            &["export", FILE, "--out", "to", "--sign", file],
            &["simulate", FILE, "--out", "to", "--solved", file],
            &["campaign", FILE, "--out", "to", "--merge", file],
        ];
        for arguments in cases {
            not_regular(&bench, arguments, file);
        }
    }
    let resume = ["campaign", FILE, "--runs", "4", "--out", "out", "--resume"];
    not_regular(&bench, &resume, "campaign.json");
}

#[cfg(unix)]
fn not_regular(bench: &Bench, arguments: &[&str], file: &str) {
    let run = bench.run(arguments);
    let message = run.stderr();
    assert_eq!(run.code(), 2, "{arguments:?}: {message}");
    assert!(
        message.contains(file) && message.contains("no regular file"),
        "{arguments:?}: {message}"
    );
}

/// One damaged log: what is wrong, the first file, and words the sentence must have.
type Case = (&'static str, String, &'static [&'static str]);

/// promise: checked-logs
#[test]
fn damaged_logs_are_refused_in_one_sentence() {
    let good = rows(0, 200, 0);
    let text = log(&good);
    let line = |row: usize| text.lines().nth(row).unwrap().to_string();
    let with = |row: usize, new: &str| text.replacen(&line(row), new, 1);
    let without = |row: usize| text.replacen(&format!("{}\n", line(row)), "", 1);
    let cell = |row: usize, column: usize, new: &str| {
        let mut cells: Vec<String> = line(row).split(',').map(String::from).collect();
        cells[column] = new.into();
        with(row, &cells.join(","))
    };
    let still = |column: usize| {
        let mut rows = good.clone();
        for row in &mut rows {
            row[column] = 0.0;
        }
        log(&rows)
    };
    let slow: Vec<[f64; 5]> = good
        .iter()
        .map(|row| [row[0], 1.0, row[2], row[3], row[4]])
        .collect();
    let twins: Vec<[f64; 5]> = good
        .iter()
        .map(|row| [row[0], row[1], row[1], row[3], row[4]])
        .collect();
    let cases: Vec<Case> = vec![
        ("empty file", String::new(), &["is empty"]),
        (
            "a comment above the header",
            format!("# logged in hall 3\n{text}"),
            &["line 1 is a comment", "'# logged in hall 3'"],
        ),
        (
            "no header",
            text.replacen("t,u[1],u[2],a,b\n", "", 1),
            &["line 1 holds numbers", "add a header"],
        ),
        (
            "a line of units",
            text.replacen("a,b\n", "a,b\ns,V,V,m,m\n", 1),
            &["line 2 holds no number", "delete it"],
        ),
        (
            "bars between columns",
            text.replace(',', "|"),
            &["has columns that neither"],
        ),
        (
            "spaces between columns",
            text.replace(',', " "),
            &["has columns that neither"],
        ),
        (
            "a web page",
            "<!DOCTYPE html><html><body>404</body></html>".into(),
            &["is a web page or XML"],
        ),
        (
            "decimal commas between commas",
            text.replace('.', ","),
            &["cells, but the header has 5", "by semicolons"],
        ),
        (
            "milliseconds",
            text.lines()
                .enumerate()
                .map(|(at, row)| match (at, row.split_once(',')) {
                    (1.., Some((time, rest))) => format!("{time}000,{rest}\n"),
                    _ => format!("{row}\n"),
                })
                .collect(),
            &[
                "row 2 (line 3)",
                "if its times are in ms, name the column t [ms]",
            ],
        ),
        (
            "a time that lost a row",
            without(50).replacen("t,", "Time [s],", 1),
            &["row 50 (line 51)", "Time [s] goes from 48 to 50"],
        ),
        ("header only", "t,u[1],u[2],a,b\n".into(), &["has no rows"]),
        (
            "missing output",
            text.replacen(",b\n", ",c\n", 1),
            &["no column b or y[2]", "add it, or name", "[signals]"],
        ),
        (
            "an output less, next to its like",
            text.replacen(",a,b\n", ",b,other\n", 1),
            &["no column a or y[1]", "add it, or name", "one of t, other"],
        ),
        (
            "misspelt input",
            text.replacen("u[2]", "u2]", 1),
            &["no column u[2]", "did you mean u2]?"],
        ),
        (
            "column twice",
            text.replacen(",b\n", ",a\n", 1),
            &["two columns a"],
        ),
        (
            "a decimal comma between commas",
            text.replacen("t,u[1],u[2],a,b\n0,", "t,u[1],u[2],a,b\n\"0,0\",", 1),
            &["row 1 (line 2)", "column t", "'0,0'"],
        ),
        (
            "a doubled row",
            text.replacen(&line(9), &format!("{}\n{}", line(9), line(9)), 1),
            &["row 10 (line 11)", "from 8 to 8"],
        ),
        (
            "a hole of empty cells",
            with(20, ",,,,"),
            &["line 21 is empty", "line 22"],
        ),
        (
            "a clock five percent off",
            {
                let mut rows = good.clone();
                for row in &mut rows {
                    row[0] *= 1.048;
                }
                log(&rows)
            },
            &["row 4 (line 5)", "sample_time 1", "1.048000 s apart"],
        ),
        (
            "a clock that is off in the first half only",
            {
                let mut rows = good.clone();
                for row in &mut rows {
                    row[0] += 0.03 * row[0].min(100.0) - 0.03 * (row[0] - 100.0).max(0.0);
                }
                log(&rows)
            },
            &["sample_time 1", "apart"],
        ),
        (
            "thousands",
            cell(30, 2, "1,234.5").replace("1,234.5", "\"1,234.5\""),
            &["row 30", "column u[2]", "'1,234.5'"],
        ),
        (
            "a workbook",
            format!("PK\u{3}\u{4}{text}"),
            &["an Excel workbook", "save the table as CSV"],
        ),
        (
            "two times",
            text.replacen("t,u[1],u[2],a,b", "t,u[1],u[2],a,b,Time [s]", 1)
                .lines()
                .enumerate()
                .map(|(at, row)| {
                    if at == 0 {
                        format!("{row}\n")
                    } else {
                        format!("{row},0\n")
                    }
                })
                .collect(),
            &["two columns that may be the time", "Time [s]", "time ="],
        ),
        (
            "NaN",
            cell(7, 3, "NaN"),
            &["row 7 (line 8)", "column a", "'NaN'"],
        ),
        (
            "infinity",
            cell(7, 1, "inf"),
            &["row 7 (line 8)", "column u[1]", "'inf'"],
        ),
        (
            "empty cell",
            cell(30, 4, ""),
            &["row 30 (line 31)", "column b", "is empty"],
        ),
        (
            "a word",
            cell(30, 2, "off"),
            &["row 30", "column u[2]", "'off'"],
        ),
        (
            "too large",
            cell(30, 2, "1e300"),
            &["row 30", "column u[2]"],
        ),
        (
            "time is no number",
            cell(4, 0, "noon"),
            &["row 4", "column t", "'noon'"],
        ),
        (
            "a row lost",
            without(50),
            &["row 50 (line 51)", "from 48 to 50", "gaps"],
        ),
        (
            "another rate",
            {
                let mut rows = good.clone();
                for row in &mut rows {
                    row[0] *= 2.0;
                }
                log(&rows)
            },
            &["row 2", "from 0 to 2", "set sample_time to that of the log"],
        ),
        (
            "time stands still",
            cell(9, 0, "7"),
            &["row 9", "from 7 to 7", "sample_time is 1"],
        ),
        ("time goes back", cell(9, 0, "3"), &["row 9", "from 7 to 3"]),
        ("jitter", cell(9, 0, "8.2"), &["row 9", "from 7 to 8.2"]),
        (
            "short row",
            with(12, "11,1,1"),
            &["line 13", "3 cells", "5"],
        ),
        (
            "long row",
            with(12, "11,1,1,0,0,0"),
            &["line 13", "6 cells"],
        ),
        (
            "no text",
            "\0\u{1}\u{2}".repeat(99),
            &["is a binary file", "CSV text"],
        ),
        (
            "too few samples",
            log(&good[..40]),
            &[
                "mode 1",
                "40 samples are too few",
                "record at least",
                "estimator.response_length",
            ],
        ),
        (
            "nothing moves",
            {
                let mut rows = good.clone();
                for row in &mut rows {
                    (row[1], row[2]) = (0.0, 0.0);
                }
                log(&rows)
            },
            &["mode 1", "excites nothing", "record a run"],
        ),
        (
            "one input never moves",
            still(1),
            &["mode 1", "input 1 (u[1])", "samples back", "too little"],
        ),
        (
            "one input constant",
            log(&slow),
            &["mode 1", "input 1 (u[1])", "too little"],
        ),
        (
            "inputs move together",
            log(&twins),
            &["mode 1", "input", "too little", "on its own"],
        ),
        (
            "of another mode",
            text.replace("t,", "mode,t,").replace('\n', "\n2,"),
            &["row 1", "mode is 2", "log of mode 1"],
        ),
    ];
    assert!(cases.len() >= 12);
    let two = log(&rows(1, 200, 0));
    for (case, one, words) in cases {
        let words = [words, &["one.csv: "]].concat();
        refused(case, PAIR, &[("one.csv", &one), ("two.csv", &two)], &words);
    }
}

/// promise: checked-logs
#[test]
fn files_that_do_not_fit_the_modes() {
    let (one, two) = (log(&rows(0, 200, 0)), log(&rows(1, 200, 0)));
    let pair = [("one.csv", one.as_str()), ("two.csv", two.as_str())];
    refused(
        "missing file",
        PAIR,
        &pair[..1],
        &["two.csv", "cannot be opened"],
    );
    refused(
        "one of two",
        "[\"one.csv\"]",
        &pair,
        &["lists 1 log:", "one per mode, 2"],
    );
    refused("no list", "[]", &pair, &["lists 0 logs"]);
    refused(
        "no mode column",
        "\"one.csv\"",
        &pair,
        &["2 modes", "no column mode"],
    );
    refused(
        "not only logs",
        "[\"one.csv\", \"model\"]",
        &pair,
        &["\"model\"", "CSV files only"],
    );
    let mixed = mixed();
    let only_first: String = mixed
        .lines()
        .take(101)
        .map(|line| format!("{line}\n"))
        .collect();
    let third = mixed.replacen("0,1,", "0,3,", 1);
    let half = mixed.replacen("0,1,", "0,1.5,", 1);
    let both = "\"both.csv\"";
    refused(
        "a mode is missing",
        both,
        &[("both.csv", &only_first)],
        &["no sample of mode 2 (second)"],
    );
    refused(
        "mode 3 of 2",
        both,
        &[("both.csv", &third)],
        &["row 1 (line 2)", "mode is 3", "1 to 2"],
    );
    refused(
        "mode 1.5",
        both,
        &[("both.csv", &half)],
        &["row 1", "mode is 1.5"],
    );
    fs_refused_method(&pair);
}

/// The state-based estimator fits its model to the log, and says how well.
///
/// promise: fitted-model
#[test]
fn the_state_based_estimator_fits_its_model_to_the_log() {
    let example = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples"));
    let text = fs::read_to_string(example.join("logged.toml")).unwrap();
    let text = text
        .replace(
            "method = \"reference\"",
            "method = \"observer\"\nmodel_error = 0.1",
        )
        .replace("0.60, 0.0", "0.65, 0.0");
    let logs = ["logged_closed.csv", "logged_open.csv"]
        .map(|name| (name, fs::read_to_string(example.join(name)).unwrap()));
    let files: Vec<(&str, &str)> = logs.iter().map(|(name, log)| (*name, &**log)).collect();
    let bench = Bench::new(&text);
    for (name, log) in &files {
        fs::write(bench.path(name), log).unwrap();
    }
    let run = bench.run(&["design", FILE]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let said = run.stdout();
    assert!(said.contains("left after the fit to the log"), "{said}");
    assert!(said.contains("fit in mode valve closed"), "{said}");
    // Commands that act a sample later are no inputs of the rows they stand in.
    let (head, rows) = logs[0].1.split_once('\n').unwrap();
    let rows: Vec<Vec<&str>> = rows.lines().map(|row| row.split(',').collect()).collect();
    let names: Vec<&str> = head.split(',').collect();
    let early: Vec<String> = rows
        .windows(2)
        .map(|pair| {
            let cell = |at: usize| match names[at].trim_matches('"').starts_with("pump") {
                true => pair[1][at],
                false => pair[0][at],
            };
            (0..names.len()).map(cell).collect::<Vec<_>>().join(",")
        })
        .collect();
    let early = format!("{head}\n{}\n", early.join("\n"));
    fs::write(bench.path("logged_closed.csv"), early).unwrap();
    let run = bench.run(&["design", FILE]);
    assert_eq!(run.code(), 2, "{}", run.stdout());
    let said = run.stderr();
    let begins = "error: design.toml: estimator.database: logged_closed.csv: mode 1: ";
    assert!(said.contains(begins), "{said}");
    assert!(said.contains("one sample after the row"), "{said}");
}

/// A log that no estimator uses is refused rather than ignored.
fn fs_refused_method(pair: &[(&str, &str)]) {
    let bench = bench(PAIR, pair);
    let design = fs::read_to_string(bench.path(FILE)).unwrap();
    let sliding = design.replace("method = \"reference\"", "method = \"sliding\"");
    fs::write(bench.path(FILE), sliding).unwrap();
    let run = bench.run(&["design", FILE]);
    assert_eq!(run.code(), 2, "{}", run.stdout());
    assert!(
        run.stderr()
            .contains("methods \"observer\" and \"reference\""),
        "{}",
        run.stderr()
    );
}

fn refused(case: &str, database: &str, files: &[(&str, &str)], words: &[&str]) {
    let run = bench(database, files).run(&["design", FILE]);
    let message = run.stderr();
    assert_eq!(run.code(), 2, "{case}: {message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{case}: {message}");
    for word in words.iter().chain(&[FILE, "estimator.database"]) {
        assert!(message.contains(word), "{case}: no '{word}' in {message}");
    }
}
