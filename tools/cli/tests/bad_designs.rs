//! Whatever is wrong with a design file: one sentence that names file, key and remedy, exit code
//! 2, and nothing written.
//!
//! promise: one-sentence
#![allow(missing_docs)]

mod common;

use common::{Bench, FILE, SOUND, damaged};

/// What a damaged file is refused with: every one of these words.
fn refused(case: &str, design: impl AsRef<[u8]>, words: &[&str]) {
    let bench = Bench::new(design);
    let before = bench.files();
    for arguments in [
        &["design", FILE][..],
        &["simulate", FILE, "--out", "out/deep"],
    ] {
        let run = bench.run(arguments);
        let message = run.stderr();
        assert_eq!(run.code(), 2, "{case}: {message}{}", run.stdout());
        assert_one_sentence(case, &message);
        for word in words.iter().chain(&[FILE]) {
            assert!(message.contains(word), "{case}: no '{word}' in: {message}");
        }
        assert_eq!(run.stdout(), "", "{case}");
        assert_eq!(bench.files(), before, "{case}: something was left behind");
    }
}

fn assert_one_sentence(case: &str, message: &str) {
    assert!(message.starts_with("error: "), "{case}: {message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{case}: {message}");
    assert!(message.len() < 700, "{case}: {message}");
    assert!(!message.contains("panicked"), "{case}: {message}");
}

/// A case: what it is, what is replaced by what, words of the message.
type Case = (
    &'static str,
    &'static str,
    &'static str,
    &'static [&'static str],
);

fn all_refused(cases: &[Case]) {
    for (case, from, to, words) in cases {
        refused(case, damaged(from, to), words);
    }
}

#[test]
fn the_sound_design_is_accepted() {
    let run = Bench::new(SOUND).run(&["design", FILE]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    assert_eq!(run.stderr(), "");
}

#[test]
fn keys() {
    all_refused(&[
        (
            "no name",
            "name = \"sound\"\n",
            "",
            &["name is missing", "add it"],
        ),
        (
            "no sample_time",
            "sample_time = 1.0\n",
            "",
            &["sample_time is missing"],
        ),
        (
            "no A",
            "A = [[0.6, 0.45], [-0.2, 0.3]]\n",
            "",
            &["mode 1: A is missing"],
        ),
        (
            "no period",
            "period = 314.0\n",
            "",
            &["disturbance.period is missing"],
        ),
        (
            "unknown key at the top",
            "sample_time = 1.0",
            "sampletime = 1.0",
            &["sampletime is not a known key", "did you mean sample_time?"],
        ),
        (
            "unknown table",
            "[observer]",
            "[observr]",
            &["observr is not a known key", "did you mean observer?"],
        ),
        (
            "unknown key",
            "decay = 0.7\noutput",
            "decy = 0.7\noutput",
            &["controller.decy is not a known key", "did you mean decay?"],
        ),
        (
            "unknown key in a mode",
            "E = [[1.0], [1.0]]\noperating",
            "Q = [[1.0], [1.0]]\noperating",
            &["mode 1: Q is not a known key", "use one of"],
        ),
        (
            "unknown key of a signal",
            "unit = \"V\"",
            "units = \"V\"",
            &[
                "signals.outputs[1].units is not a known key",
                "did you mean unit?",
            ],
        ),
        (
            "unknown key of a waveform",
            "amplitude = 1, period = 20",
            "amplitud = 1, period = 20",
            &["amplitud is not a known key", "did you mean amplitude?"],
        ),
        (
            "no key of a waveform",
            "amplitude = 1, period = 20",
            "amplitude = 1",
            &["scenario.reference[2]", "period is missing"],
        ),
        (
            "key given twice",
            "sample_time = 1.0",
            "sample_time = 1.0\nsample_time = 2.0",
            &["line 3", "stands here again: give it once"],
        ),
    ]);
}

#[test]
fn values() {
    all_refused(&[
        (
            "unknown value",
            "\"common\"",
            "\"comon\"",
            &["controller.lyapunov = \"comon\"", "did you mean common?"],
        ),
        (
            "unknown observer",
            "\"uio\"",
            "\"unheard-of\"",
            &["observer.kind", "use one of uio, luenberger, kalman, auto"],
        ),
        (
            "unknown method",
            "\"reference\"",
            "\"referense\"",
            &["estimator.method", "did you mean reference?"],
        ),
        (
            "unknown compensation",
            "\"virtual-sensor\"",
            "\"virtual\"",
            &["compensation.method", "did you mean virtual-sensor?"],
        ),
        (
            "unknown database",
            "\"commission\"",
            "\"modell\"",
            &["estimator.database", "did you mean model?"],
        ),
        (
            "unknown waveform",
            "\"square\"",
            "\"sqare\"",
            &["scenario.reference[2]", "did you mean square?"],
        ),
        (
            "unknown event",
            "\"stuck\"",
            "\"stock\"",
            &["scenario.events[1]", "did you mean stuck?"],
        ),
        (
            "text for a number",
            "sample_time = 1.0",
            "sample_time = \"1 s\"",
            &["line 2", "sample_time", "expected a number"],
        ),
        (
            "number for a text",
            "name = \"sound\"",
            "name = 7",
            &["name", "expected a string"],
        ),
        (
            "text in a matrix",
            "[[0.6, 0.45]",
            "[[0.6, \"x\"]",
            &["mode 1: A[1][2]", "expected a number"],
        ),
        (
            "number for a list",
            "tracked = [1, 2]",
            "tracked = 1",
            &["controller.tracked", "expected a list"],
        ),
        (
            "fraction for a count",
            "steps = 60",
            "steps = 60.5",
            &["scenario.steps", "expected"],
        ),
        (
            "table for a number",
            "decay = 0.7\noutput",
            "decay = {}\noutput",
            &["controller.decay", "table", "expected a number"],
        ),
        (
            "text for a weight",
            "output_weight = 1.0",
            "output_weight = \"1\"",
            &["controller.output_weight", "a number or a list of numbers"],
        ),
        (
            "list for a signal",
            "fault = [0.0,",
            "fault = [[0.0],",
            &["scenario.fault[1]", "a number or a table with a kind"],
        ),
    ]);
}

#[test]
fn the_plant() {
    all_refused(&[
        (
            "no states",
            "A = [[0.6, 0.45], [-0.2, 0.3]]\nB = [[0.0, 1.0], [1.0, 0.0]]\nC = [[1.0, 0.0], [0.0, 1.0]]",
            "A = []\nB = []\nC = []",
            &["mode 1", "states"],
        ),
        (
            "ragged matrix",
            "A = [[0.6, 0.45], [-0.2, 0.3]]",
            "A = [[0.6, 0.45], [-0.2]]",
            &["mode 1: A: row 2 has the length 1"],
        ),
        (
            "A not square",
            "A = [[0.6, 0.45], [-0.2, 0.3]]",
            "A = [[0.6, 0.45, 0.1], [-0.2, 0.3, 0.1]]",
            &["mode 1: A is 2 x 3", "square"],
        ),
        (
            "A larger than B",
            "A = [[0.6, 0.45], [-0.2, 0.3]]",
            "A = [[0.6, 0.45, 0], [-0.2, 0.3, 0], [0, 0, 0.1]]",
            &["mode 1: B is 2 x 2, but with A of 3 x 3 it has to be 3 x 2"],
        ),
        (
            "B of another size",
            "B = [[1.0, 0.0], [0.0, 1.0]]",
            "B = [[1.0], [0.0]]",
            &["mode 2: B is 2 x 1"],
        ),
        (
            "C of another size",
            "C = [[1.0, 0.0], [0.0, 1.0]]\nE = [[1.0], [1.0]]\noper",
            "C = [[1.0, 0.0, 0.0]]\nE = [[1.0], [1.0]]\noper",
            &["mode 1: C is 1 x 3"],
        ),
        (
            "E of another size",
            "E = [[1.0], [1.0]]\n\n[signals]",
            "E = [[1.0]]\n\n[signals]",
            &["mode 2: E is 1 x 1"],
        ),
        (
            "F of another size",
            "E = [[1.0], [1.0]]\n\n[signals]",
            "F = [[1.0, 1.0], [1.0, 1.0]]\n\n[signals]",
            &["mode 2: F is 2 x 2"],
        ),
        (
            "operating point of another size",
            "u = [0, 0]",
            "u = [0]",
            &["mode 1: operating_point.u has 1 entry"],
        ),
        (
            "an operating point beyond the limits of an input",
            "[signals]",
            "[signals]\ninputs = [{ min = 1.0 }, {}]",
            &[
                "mode 1",
                "0 at input 1",
                "1 or more",
                "operating_point.u",
                "signals.inputs",
            ],
        ),
        (
            "half an operating point",
            "u = [0, 0], y = [0, 0]",
            "y = [0, 0]",
            &["mode 1: operating_point.u is missing"],
        ),
        (
            "not a number",
            "[[0.6, 0.45]",
            "[[nan, 0.45]",
            &["mode 1: A", "row 1, column 1", "finite"],
        ),
        (
            "infinite",
            "B = [[1.0, 0.0]",
            "B = [[1.0, inf]",
            &["mode 2: B", "row 1, column 2", "finite"],
        ),
        (
            "huge number",
            "C = [[1.0, 0.0]",
            "C = [[1e300, 0.0]",
            &["mode 1: C", "1e300", "1e15"],
        ),
        (
            "infinite operating point",
            "x = [0, 0]",
            "x = [-inf, 0]",
            &["mode 1: operating_point.x", "finite"],
        ),
        (
            "sample time 0",
            "sample_time = 1.0",
            "sample_time = 0",
            &["sample_time is 0", "positive"],
        ),
        (
            "negative sample time",
            "sample_time = 1.0",
            "sample_time = -1",
            &["sample_time is -1", "positive"],
        ),
        (
            "sample time not a number",
            "sample_time = 1.0",
            "sample_time = nan",
            &["sample_time", "finite"],
        ),
        (
            "unstable mode",
            "[[0.4, -0.3], [0.11, 0.0]]",
            "[[1.4, -0.3], [0.11, 0.0]]",
            &["mode 2", "spectral radius", "stable mode"],
        ),
        (
            "uncontrollable pair",
            "A = [[0.6, 0.45], [-0.2, 0.3]]\nB = [[0.0, 1.0], [1.0, 0.0]]",
            "A = [[0.9, 0.0], [0.0, 0.3]]\nB = [[0.0, 0.0], [1.0, 1.0]]",
            &["mode 1", "uncontrollable", "0.9000"],
        ),
        (
            "inputs that act alike",
            "B = [[0.0, 1.0], [1.0, 0.0]]",
            "B = [[1.0, 1.0], [1.0, 1.0]]",
            &["mode 1", "uncontrollable", "track fewer outputs"],
        ),
    ]);
}

#[test]
fn a_disturbance_hidden_from_the_sensors() {
    let hidden = SOUND
        .replace(
            "C = [[1.0, 0.0], [0.0, 1.0]]",
            "C = [[1.0, -1.0], [2.0, -2.0]]",
        )
        .replace("tracked = [1, 2]", "tracked = [1]")
        .replace(", { kind = \"square\", amplitude = 1, period = 20 }", "");
    refused("rank(CE) < rank(E)", hidden, &["mode 1", "rank"]);
}

#[test]
fn no_mode_at_all() {
    let start = SOUND.find("[[mode]]").unwrap();
    let end = SOUND.find("[signals]").unwrap();
    let without = format!("{}{}", &SOUND[..start], &SOUND[end..]);
    refused("no mode", &without, &["mode is missing"]);
    let empty = format!("mode = []\n{without}");
    refused("empty list of modes", empty, &["[[mode]]", "at least one"]);
}

/// The example of a named model, damaged.
#[test]
fn a_named_model() {
    let converter = include_str!("../../../examples/converter.toml");
    for (what, from, to, words) in [
        (
            "unknown model",
            "\"rectifier\"",
            "\"inverter\"",
            &["plant", "rectifier"][..],
        ),
        (
            "missing parameter",
            "resistance = 0.3",
            "",
            &["plant", "resistance"],
        ),
        (
            "negative capacitance",
            "capacitance = 2e-3",
            "capacitance = -2e-3",
            &["plant.capacitance", "positive"],
        ),
        (
            "no load",
            "loads = [80.0, 40.0]",
            "loads = []",
            &["plant.loads", "one per mode"],
        ),
        (
            "a load the grid cannot supply",
            "loads = [80.0, 40.0]",
            "loads = [80.0, 0.1]",
            &["plant", "mode 2", "load resistance"],
        ),
        (
            "modes as well",
            "[plant]",
            "[[mode]]\nA = [[0.5]]\nB = [[1.0]]\nC = [[1.0]]\n[plant]",
            &["[plant]", "[[mode]]", "exclude"],
        ),
    ] {
        assert!(converter.contains(from), "{what}");
        refused(what, converter.replacen(from, to, 1), words);
    }
}

#[test]
fn signals_and_disturbance() {
    all_refused(&[
        (
            "too few outputs",
            "min = -5.0, max = 5.0 }, { name = \"b\" }",
            "min = -5.0, max = 5.0 }",
            &["signals.outputs has 1 entry", "2"],
        ),
        (
            "nominal 0",
            "nominal = 1.0",
            "nominal = 0.0",
            &["signals.outputs[1].nominal is 0", "positive"],
        ),
        (
            "negative nominal",
            "nominal = 1.0",
            "nominal = -1.0",
            &["signals.outputs[1].nominal is -1"],
        ),
        (
            "min above max",
            "min = -5.0, max = 5.0",
            "min = 5.0, max = -5.0",
            &["signals.outputs[1]", "min below max"],
        ),
        (
            "min not a number",
            "min = -5.0",
            "min = nan",
            &["signals.outputs[1].min", "finite"],
        ),
        (
            "name used twice",
            "name = \"b\"",
            "name = \"a\"",
            &["signals.outputs[2].name = \"a\" is used twice"],
        ),
        (
            "empty name",
            "name = \"b\"",
            "name = \"\"",
            &["signals.outputs[2].name", "give a name"],
        ),
        (
            "period 0",
            "period = 314.0",
            "period = 0",
            &["disturbance.period is 0", "positive"],
        ),
        (
            "negative period",
            "period = 314.0",
            "period = -314.0",
            &["disturbance.period is -314"],
        ),
        (
            "infinite period",
            "period = 314.0",
            "period = inf",
            &["disturbance.period", "finite"],
        ),
        (
            "period of one sample",
            "period = 314.0",
            "period = 1.0",
            &["disturbance.period is 1", "sample_time"],
        ),
        (
            "no harmonics",
            "harmonics = 1",
            "harmonics = 0",
            &["disturbance.harmonics is 0"],
        ),
        (
            "negative harmonics",
            "harmonics = 1",
            "harmonics = -1",
            &["disturbance.harmonics"],
        ),
        (
            "a period as short as two samples",
            "period = 314.0",
            "period = 2.0",
            &[
                "disturbance.period is 2",
                "above 2 seconds",
                "give a longer period",
            ],
        ),
        (
            "a period too short for its harmonics",
            "period = 314.0\nharmonics = 1",
            "period = 6.0\nharmonics = 3",
            &[
                "disturbance.period is 6",
                "with 3 harmonics",
                "above 6 seconds",
                "fewer disturbance.harmonics",
            ],
        ),
        (
            "amplitudes of another count",
            "harmonics = 1",
            "amplitude = [1, 2]",
            &["disturbance.amplitude has 2 entries"],
        ),
        (
            "negative amplitude",
            "harmonics = 1",
            "amplitude = -1",
            &["disturbance.amplitude is -1"],
        ),
    ]);
}

#[test]
fn controller_and_observer() {
    all_refused(&[
        (
            "nothing tracked",
            "tracked = [1, 2]",
            "tracked = []",
            &["controller.tracked is empty"],
        ),
        (
            "tracked 0",
            "tracked = [1, 2]",
            "tracked = [0, 2]",
            &["controller.tracked", "0", "from 1 to 2"],
        ),
        (
            "tracked too large",
            "tracked = [1, 2]",
            "tracked = [1, 3]",
            &["controller.tracked", "3", "from 1 to 2"],
        ),
        (
            "tracked negative",
            "tracked = [1, 2]",
            "tracked = [-1]",
            &["controller.tracked", "-1"],
        ),
        (
            "tracked twice",
            "tracked = [1, 2]",
            "tracked = [2, 2]",
            &["controller.tracked names output 2 twice"],
        ),
        (
            "decay 0",
            "decay = 0.7\noutput",
            "decay = 0\noutput",
            &["controller.decay is 0", "at most 1"],
        ),
        (
            "decay above 1",
            "decay = 0.7\noutput",
            "decay = 1.5\noutput",
            &["controller.decay is 1.5", "at most 1"],
        ),
        (
            "decay 1 without a dwell time",
            "lyapunov = \"common\"\ndecay = 0.7\noutput",
            "lyapunov = \"dwell\"\ndecay = 1\noutput",
            &["controller.decay = 1 gives no finite dwell time", "below 1"],
        ),
        (
            "decay not a number",
            "decay = 0.7\noutput",
            "decay = nan\noutput",
            &["controller.decay is NaN"],
        ),
        (
            "latency 2",
            "latency = 0",
            "latency = 2",
            &["controller.latency is 2", "from 0 to 1"],
        ),
        (
            "negative weight",
            "output_weight = 1.0",
            "output_weight = -1.0",
            &["controller.output_weight has the value -1", "give 0 or"],
        ),
        (
            "weights of another count",
            "input_weight = [0.1, 0.1]",
            "input_weight = [0.1]",
            &["controller.input_weight has 1 entry"],
        ),
        (
            "internal model of an unknown disturbance",
            "[disturbance]\nperiod = 314.0\nharmonics = 1\n\n[controller]\n",
            "[controller]\ninternal_model = true\n",
            &["controller.internal_model", "[disturbance]"],
        ),
        (
            "internal model of a disturbance that hardly moves",
            "period = 314.0\nharmonics = 1\n\n[controller]\n",
            "period = 31400.0\nharmonics = 1\n\n[controller]\ninternal_model = true\n",
            &[
                "harmonic 1",
                "31400",
                "sample_time",
                "internal_model = false",
            ],
        ),
        (
            "observer decay above 1",
            "decay = 0.7\n\n[estimator]",
            "decay = 1.7\n\n[estimator]",
            &["observer.decay is 1.7"],
        ),
    ]);
}

#[test]
fn more_tracked_outputs_than_inputs() {
    let one_input = SOUND
        .replace("B = [[0.0, 1.0], [1.0, 0.0]]", "B = [[0.0], [1.0]]")
        .replace("B = [[1.0, 0.0], [0.0, 1.0]]", "B = [[1.0], [0.0]]")
        .replace("u = [0, 0]", "u = [0]")
        .replace("input_weight = [0.1, 0.1]", "input_weight = 0.1");
    refused(
        "r > m",
        one_input,
        &["controller.tracked names 2 outputs", "1 input:"],
    );
}

#[test]
fn the_estimator() {
    all_refused(&[
        (
            "threshold and sigmas",
            "sigmas = 6.0",
            "sigmas = 6.0\nthreshold = 0.1",
            &["estimator.threshold and estimator.sigmas"],
        ),
        (
            "threshold 0",
            "sigmas = 6.0",
            "threshold = 0.0",
            &["estimator.threshold is 0", "positive"],
        ),
        (
            "thresholds of another count",
            "sigmas = 6.0",
            "threshold = [0.1]",
            &["estimator.threshold has 1 entry"],
        ),
        (
            "negative sigmas",
            "sigmas = 6.0",
            "sigmas = -6.0",
            &["estimator.sigmas is -6"],
        ),
        (
            "debounce 0",
            "debounce = 1",
            "debounce = 0",
            &["estimator.debounce is 0"],
        ),
        (
            "stuck_after negative",
            "debounce = 1",
            "stuck_after = -1",
            &["estimator.stuck_after is -1"],
        ),
        (
            "response length 0",
            "debounce = 1",
            "response_length = 0",
            &["estimator.response_length is 0"],
        ),
        (
            "response length too large",
            "debounce = 1",
            "response_length = 1000000",
            &["estimator.response_length is 1000000"],
        ),
        (
            "response with too many coefficients",
            "debounce = 1",
            "response_length = 1500",
            &["estimator.response_length is 1500", "from 1 to 1000"],
        ),
        (
            "database from a log that is not there",
            "\"commission\"",
            "\"healthy.csv\"",
            &["estimator.database", "healthy.csv", "cannot be opened"],
        ),
    ]);
}

#[test]
fn the_scenario() {
    all_refused(&[
        (
            "no steps",
            "steps = 60",
            "steps = 0",
            &["scenario.steps is 0"],
        ),
        (
            "negative steps",
            "steps = 60",
            "steps = -5",
            &["scenario.steps is -5"],
        ),
        (
            "absurdly many steps",
            "steps = 60",
            "steps = 9000000000000000000",
            &["scenario.steps is 9000000000000000000", "1000000"],
        ),
        (
            "more than a computer can count",
            "steps = 60",
            "steps = 90000000000000000000000",
            &["line 49", "scenario.steps"],
        ),
        (
            "negative noise",
            "noise = 0.005",
            "noise = -0.005",
            &["scenario.noise is -0.005"],
        ),
        (
            "noise not a number",
            "noise = 0.005",
            "noise = [0.1, nan]",
            &["scenario.noise", "finite"],
        ),
        (
            "noise of another count",
            "noise = 0.005",
            "noise = [0.1, 0.1, 0.1]",
            &["scenario.noise has 3 entries"],
        ),
        (
            "negative seed",
            "seed = 3",
            "seed = -3",
            &["scenario.seed is -3"],
        ),
        (
            "mode 0",
            "from = 30, mode = 2",
            "from = 30, mode = 0",
            &["scenario.schedule[2].mode is 0", "from 1 to 2"],
        ),
        (
            "mode too large",
            "from = 30, mode = 2",
            "from = 30, mode = 3",
            &["scenario.schedule[2].mode is 3", "from 1 to 2"],
        ),
        (
            "schedule starts late",
            "from = 0, mode = 1",
            "from = 1, mode = 1",
            &["scenario.schedule", "start at time 0"],
        ),
        (
            "empty schedule",
            "[{ from = 0, mode = 1 }, { from = 30, mode = 2 }]",
            "[]",
            &["scenario.schedule", "start at time 0"],
        ),
        (
            "schedule goes back",
            "{ from = 30, mode = 2 }",
            "{ from = 30, mode = 2 }, { from = 20, mode = 1 }",
            &["scenario.schedule", "ascending"],
        ),
        (
            "schedule at no time",
            "from = 30, mode = 2",
            "from = nan, mode = 2",
            &["scenario.schedule", "ascending"],
        ),
        (
            "a point of three numbers",
            "[20, -0.3]",
            "[20, -0.3, 1]",
            &[
                "scenario.reference[1].points[2] has 3 numbers",
                "[time, value]",
            ],
        ),
        (
            "too few references",
            "reference = [{ kind = \"steps\", points = [[0, 0.6], [20, -0.3]] }, ",
            "reference = [",
            &["scenario.reference has 1 signal:", "give 2"],
        ),
        (
            "too many faults",
            "fault = [0.0, ",
            "fault = [0.0, 0.0, ",
            &["scenario.fault has 3 signals", "give 2"],
        ),
        (
            "too many disturbances",
            "disturbance = [{",
            "disturbance = [1, {",
            &["scenario.disturbance has 2 signals"],
        ),
        (
            "steps go back",
            "[20, -0.3]",
            "[-20, -0.3]",
            &["scenario.reference[1]", "points"],
        ),
        (
            "no points",
            "points = [[28, 0.5]]",
            "points = []",
            &["scenario.fault[2]", "points is empty"],
        ),
        (
            "infinite level",
            "[20, -0.3]",
            "[20, inf]",
            &["scenario.reference[1]", "points", "finite"],
        ),
        (
            "square of period 0",
            "amplitude = 1, period = 20",
            "amplitude = 1, period = 0",
            &["scenario.reference[2].period is 0"],
        ),
        (
            "fault of no sensor",
            "sensor = 1",
            "sensor = 0",
            &["scenario.events[1].sensor is 0", "from 1 to 2"],
        ),
        (
            "fault of an unknown sensor",
            "sensor = 1",
            "sensor = 3",
            &["scenario.events[1].sensor is 3"],
        ),
        (
            "more than the whole gain lost",
            "kind = \"stuck\", sensor = 1",
            "kind = \"gain-loss\", loss = 3, sensor = 1",
            &["scenario.events[1].loss is 3", "from 0 to 1"],
        ),
        (
            "a sample time of many digits",
            "sample_time = 1.0",
            "sample_time = 1e-300",
            &["sample_time is 1e-300: give a number of at least 1e-15"],
        ),
        (
            "fault that ends before it starts",
            "from = 50",
            "from = 50, until = 40",
            &["scenario.events[1].until is 40"],
        ),
        (
            "no such table",
            "amplitude = 1, period = 20",
            "file = \"none.csv\", column = \"y\"",
            &["scenario.reference[2]"],
        ),
    ]);
}

#[test]
fn tables_from_csv() {
    let design = damaged(
        "{ kind = \"square\", amplitude = 1, period = 20 }",
        "{ kind = \"table\", file = \"t.csv\", column = \"level\" }",
    );
    let cases: [(&str, &[u8], &[&str]); 6] = [
        (
            "no such column",
            b"t,levle\n0,1\n",
            &["no column level", "did you mean levle?"],
        ),
        ("no rows", b"t,level\n", &["no rows"]),
        (
            "not a number",
            b"t,level\n0,1\n1,oops\n",
            &["'oops'", "row 2"],
        ),
        ("not finite", b"t,level\n0,nan\n", &["'nan'", "row 1"]),
        ("ragged", b"t,level\n0,1,2\n", &["line 2", "3 cells"]),
        ("not text", b"t,level\n0,\xff\xfe\n", &["t.csv"]),
    ];
    for (case, table, words) in cases {
        let bench = Bench::new(&design);
        std::fs::write(bench.path("t.csv"), table).unwrap();
        let run = bench.run(&["simulate", FILE, "--out", "out"]);
        assert_eq!(run.code(), 2, "{case}: {}", run.stderr());
        assert_one_sentence(case, &run.stderr());
        for word in words.iter().chain(&["scenario.reference[2]", "t.csv"]) {
            assert!(
                run.stderr().contains(word),
                "{case}: no '{word}' in: {}",
                run.stderr()
            );
        }
        assert_eq!(bench.files(), ["design.toml", "t.csv"], "{case}");
    }
}

#[test]
fn names_that_name_no_file() {
    for name in [
        "",
        "a b",
        "../up",
        "1st",
        "a/b",
        "naïve",
        "con.troller",
        "tab\\t",
        "nul\\u0000",
    ] {
        let design = damaged("name = \"sound\"", &format!("name = \"{name}\""));
        refused(
            name,
            design,
            &["name is", "letters, digits and underscores"],
        );
    }
    let long = damaged(
        "name = \"sound\"",
        &format!("name = \"{}\"", "x".repeat(5000)),
    );
    refused("a long name", long, &["name is", "at most 64"]);
}

#[test]
fn syntax_errors_keep_line_and_column() {
    refused(
        "unclosed list",
        damaged("tracked = [1, 2]", "tracked = [1, 2"),
        &["line ", "column ", "correct the syntax"],
    );
    refused(
        "no value",
        damaged("seed = 3", "seed ="),
        &["line 51", "seed has no value", "leave the key out"],
    );
    refused(
        "unclosed text",
        damaged("name = \"sound\"", "name = \"sound"),
        &["line 1", "column"],
    );
    refused(
        "a table header torn open",
        damaged("[observer]", "[observer"),
        &["line 35", "correct the syntax"],
    );
}

#[test]
fn empty_and_blank_files() {
    refused("empty", "", &["empty", "examples/"]);
    refused("blank", " \n\t\n", &["empty"]);
    refused("a comment alone", "# nothing\n", &["name is missing"]);
}

/// Bytes from a small linear congruence: noise that is the same in every run.
fn noise(size: usize) -> Vec<u8> {
    let mut state = 1u64;
    let mut byte = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    (0..size).map(|_| byte()).collect()
}

#[test]
fn ten_megabytes_of_noise() {
    let binary = noise(10 << 20);
    let text: Vec<u8> = binary.iter().map(|byte| b' ' + byte % 95).collect();
    let lines: Vec<u8> = binary
        .iter()
        .map(|byte| {
            if byte % 16 == 0 {
                b'\n'
            } else {
                b'a' + byte % 26
            }
        })
        .collect();
    for (case, bytes) in [("binary", &binary), ("text", &text), ("lines", &lines)] {
        refused(case, bytes, &["larger than 4 MB"]);
    }
    for (case, bytes) in [("a little text", &text), ("a few lines", &lines)] {
        refused(case, &bytes[..1 << 20], &["line 1,", "correct the syntax"]);
    }
    refused("a little binary", &binary[..1 << 20], &["is not UTF-8"]);
}

#[test]
fn not_utf8() {
    let latin = SOUND.replace("\"first\"", "\"pr\u{e9}mier\"");
    let bytes: Vec<u8> = latin.chars().map(|c| c as u32 as u8).collect();
    refused("Latin-1", bytes, &["is not UTF-8", "byte 54"]);
    let utf16: Vec<u8> = SOUND.encode_utf16().flat_map(u16::to_le_bytes).collect();
    refused("UTF-16", utf16, &["line 1"]);
}

#[test]
fn a_deeply_nested_list_does_not_overflow_the_stack() {
    let nested = format!("A = {}{}", "[".repeat(100_000), "]".repeat(100_000));
    refused("deep", nested, &["line 1"]);
}

#[test]
fn absurdly_large_matrices() {
    let row = vec!["0.0"; 300].join(", ");
    let matrix = vec![format!("[{row}]"); 300].join(", ");
    let design = format!(
        "name = \"large\"\nsample_time = 1.0\n[[mode]]\nA = [{matrix}]\nB = [{matrix}]\nC = [{matrix}]\n"
    );
    refused("large", design, &["300 states", "at most 64"]);
}

#[test]
fn paths_that_are_no_design_file() {
    let bench = Bench::new(SOUND);
    for (case, path, words) in [
        (
            "missing",
            "none.toml",
            &["none.toml", "cannot be opened"][..],
        ),
        ("directory", ".", &["directory", "name a design file"]),
        (
            "below a file",
            "design.toml/x",
            &["design.toml/x", "cannot be opened"],
        ),
    ] {
        let run = bench.run(&["design", path]);
        assert_eq!(run.code(), 2, "{case}");
        assert_one_sentence(case, &run.stderr());
        for word in words {
            assert!(run.stderr().contains(word), "{case}: {}", run.stderr());
        }
    }
}

#[test]
fn output_directories_that_cannot_be_written_to() {
    let bench = Bench::new(SOUND);
    for (case, out, words) in [
        ("a file", FILE, "this is a file"),
        ("below a file", "design.toml/out", "cannot be written to"),
        (
            "below what the system does not let anyone make",
            "/proc/out",
            "cannot be written to",
        ),
    ] {
        for command in ["simulate", "export"] {
            let run = bench.run(&[command, FILE, "--out", out]);
            assert_eq!(run.code(), 2, "{case}: {}", run.stderr());
            assert_one_sentence(case, &run.stderr());
            assert!(run.stderr().contains(words), "{case}: {}", run.stderr());
            assert!(run.stderr().contains(out), "{case}: {}", run.stderr());
            assert_eq!(bench.files(), [FILE], "{case}");
        }
    }
}

#[test]
fn a_command_line_without_sense() {
    let bench = Bench::new(SOUND);
    for arguments in [
        &[][..],
        &["desing", FILE],
        &["design"],
        &["export", FILE],
        &["design", FILE, "--jsn"],
    ] {
        assert_eq!(bench.run(arguments).code(), 2, "{arguments:?}");
    }
}

#[test]
fn a_command_line_that_does_not_fit_is_refused_in_one_line() {
    let bench = Bench::new(SOUND);
    let cases: [(&[&str], &str); 9] = [
        (
            &[
                "campaign", FILE, "--out", "x", "--merge", "a", "--seed", "7",
            ],
            "'--merge <FILE>...' cannot be used with '--seed <SEED>'",
        ),
        (
            &["campaign", FILE, "--out", "x", "--most-faults", "-1"],
            "'-1' for '--most-faults <MOST_FAULTS>': give a whole number from 0",
        ),
        (&["design"], "were not provided: <DESIGN>; see --help"),
        (
            &["desing", FILE],
            "; tip: a similar subcommand exists: 'design'",
        ),
        (
            &["design", FILE, "--out", "x"],
            "unexpected argument '--out' found",
        ),
        (&["design", FILE, FILE], "unexpected argument"),
        (
            &["design", FILE, "--solver", "x"],
            "[possible values: structured, clarabel]",
        ),
        (
            &["simulate", FILE],
            "were not provided: --out <DIR>; see --help",
        ),
        (
            &["campaign", FILE, "--out", "x", "--rows", "--resume"],
            "cannot be used with",
        ),
    ];
    for (given, words) in cases {
        let run = bench.run(given);
        let said = run.stderr();
        assert_eq!(run.code(), 2, "{given:?}: {said}");
        assert_eq!(said.lines().count(), 1, "{given:?}: {said}");
        assert!(
            said.starts_with("error: ") && said.contains(words),
            "{given:?}: {said}"
        );
    }
    assert_eq!(bench.files(), [FILE]);
}

/// A number of the command line is told with its option and what to give.
#[test]
fn numbers_of_the_command_line() {
    let bench = Bench::new(SOUND);
    let campaign = ["campaign", FILE, "--out", "out"];
    let identify = ["identify", "log.csv", "--out", "found.toml"];
    let cases: [(&[&str], &[&str], &str); 12] = [
        (&["design", FILE], &["--threads", "0"], "from 1 to 1024"),
        (&["design", FILE], &["--threads", "x"], "from 1 to 1024"),
        (&campaign, &["--runs", "0"], "from 1 to 1000000000"),
        (&campaign, &["--jobs", "-1"], "from 1 to 1024"),
        (&campaign, &["--replay", "-1"], "a whole number, 0 or more"),
        (&campaign, &["--model-error", "x"], "give a number"),
        (
            &campaign,
            &["--model-error", "nan"],
            "a fraction from 0 to 1",
        ),
        (&campaign, &["--resume"], "leave it out"),
        (&campaign, &["--merge", "none.json"], "check the path"),
        (&identify, &["--order", "0"], "a whole number, 1 or more"),
        (&identify, &["--sample-time", "-1"], "a positive number"),
        (&identify, &["--period", "0"], "a positive number"),
    ];
    for (command, given, advice) in cases {
        let run = bench.run(&[command, given].concat());
        let said = run.stderr();
        assert_eq!(run.code(), 2, "{given:?}: {said}");
        assert!(said.contains(given[0]), "{given:?}: {said}");
        assert!(said.contains(advice), "{given:?}: {said}");
    }
}

/// A key file is told with the option that names it.
#[test]
fn keys_of_the_command_line() {
    let bench = Bench::new(SOUND);
    let sign = bench.run(&["export", FILE, "--out", "out", "--sign", "no.key"]);
    assert_eq!(sign.code(), 2);
    assert!(
        sign.stderr().starts_with("error: --sign no.key: "),
        "{}",
        sign.stderr()
    );
    let verify = bench.run(&["verify", "x.fmu", "--key", FILE]);
    assert_eq!(verify.code(), 2);
    let said = verify.stderr();
    assert!(
        said.starts_with(&format!("error: --key {FILE}: ")),
        "{said}"
    );
}

/// What is wrong inside a table with a kind is told by its key, and no type of this program is named.
#[test]
fn keys_inside_kinds() {
    let event = "kind = \"stuck\", sensor = 1, from = 50";
    let square = "kind = \"square\", amplitude = 1, period = 20";
    all_refused(&[
        (
            "an event that is a number",
            "events = [{ kind = \"stuck\", sensor = 1, from = 50 }]",
            "events = [3]",
            &[
                "line",
                "scenario.events[1]",
                "a number, but must be a table",
            ],
        ),
        (
            "a size that is a text",
            event,
            "kind = \"bias\", sensor = 1, from = 50, size = \"x\"",
            &["line", "scenario.events[1].size", "expected a number"],
        ),
        (
            "a bias without size",
            event,
            "kind = \"bias\", sensor = 1, from = 50",
            &["scenario.events[1].size is missing: add it"],
        ),
        (
            "a size of what has none",
            event,
            "kind = \"stuck\", sensor = 1, from = 50, size = 2",
            &["scenario.events[1].size says nothing about kind = \"stuck\""],
        ),
        (
            "a fault of a sensor that is not there",
            event,
            "kind = \"stuck\", sensor = \"c\", from = 50",
            &["scenario.events[1].sensor is \"c\"", "use one of a, b"],
        ),
        (
            "a fault of nothing",
            event,
            "kind = \"stuck\", from = 50",
            &["scenario.events[1].sensor is missing: add its number or its name"],
        ),
        (
            "a fault of a sensor and an input",
            event,
            "kind = \"stuck\", from = 50, sensor = 1, input = 1",
            &["scenario.events[1].input does not say where this fault is: give sensor alone"],
        ),
        (
            "a period that is a text",
            square,
            "kind = \"square\", amplitude = 1, period = \"x\"",
            &["line", "scenario.reference[2].period", "expected a number"],
        ),
        (
            "a square with points",
            square,
            "kind = \"square\", amplitude = 1, period = 20, points = [[0, 1]]",
            &["scenario.reference[2].points says nothing about kind = \"square\""],
        ),
        (
            "tracked by an unknown name",
            "tracked = [1, 2]",
            "tracked = [\"a\", \"bb\"]",
            &["controller.tracked[2] is \"bb\"", "did you mean b?"],
        ),
        (
            "tracked twice by number and name",
            "tracked = [1, 2]",
            "tracked = [1, \"a\"]",
            &["controller.tracked names output 1 twice"],
        ),
        (
            "a mode of an unknown name",
            "mode = 2 }",
            "mode = \"third\" }",
            &[
                "scenario.schedule[2].mode is \"third\"",
                "use one of first, second",
            ],
        ),
        (
            "a table where a text belongs",
            "kind = \"uio\"",
            "kind = 3",
            &["observer.kind", "expected a text"],
        ),
        (
            "a scenario that is a number",
            "steps = 60",
            "steps = 60\nplant = 3",
            &["scenario.plant is a number", "write [scenario.plant]"],
        ),
        (
            "an actuator's fault of nothing",
            "steps = 60",
            "steps = 60\nplant = { actuator = [{ kind = \"stuck\", from = 5 }] }",
            &["scenario.plant.actuator[1].input is missing"],
        ),
        (
            "B transposed",
            "B = [[0.0, 1.0], [1.0, 0.0]]",
            "B = [[0.0, 1.0]]",
            &["mode 1: B is 1 x 2", "2 x 1: it seems to be transposed"],
        ),
    ]);
}

/// Names stand wherever numbers do, and mean the same.
#[test]
fn names_mean_the_same_as_numbers() {
    let named = SOUND
        .replace("tracked = [1, 2]", "tracked = [\"a\", \"b\"]")
        .replace("mode = 1 }", "mode = \"first\" }")
        .replace("mode = 2 }", "mode = \"second\" }")
        .replace("sensor = 1", "sensor = \"a\"");
    let truth = |input: &str, load: &str, state: &str, told: &str| {
        format!(
            "[scenario.plant]\nactuator = [{{ kind = \"stuck\", input = {input}, from = 9, until = 12 }}]\n\
             loads = [{{ disturbance = {load}, from = 3, size = 0.1 }}, {{ state = {state}, from = 5, size = 0.1 }}]\n\
             told = [{{ mode = {told}, from = 40, until = 42 }}]\n"
        )
    };
    let trajectories = |design: String| {
        let bench = Bench::new(design);
        let run = bench.run(&["simulate", FILE, "--out", "out"]);
        assert_eq!(run.code(), 0, "{}", run.stderr());
        std::fs::read(bench.path("out/trajectories.csv")).unwrap()
    };
    let numbered = trajectories(SOUND.to_string() + &truth("2", "1", "2", "1"));
    let named = trajectories(named + &truth("\"u[2]\"", "\"w[1]\"", "\"x[2]\"", "\"first\""));
    assert!(numbered == named);
}

/// A mode that grows and is not shown has no observer, of whatever kind: no other kind is advised.
#[test]
fn an_unstable_mode_that_no_sensor_shows() {
    for kind in ["uio", "luenberger", "kalman", "auto"] {
        let design = format!(
            "name = \"grows\"\nsample_time = 1.0\n[[mode]]\nA = [[0.6, 0.0], [0.1, 1.2]]\n\
             B = [[1.0, 0.0], [0.0, 1.0]]\nC = [[1.0, 0.0]]\nE = [[1.0], [0.0]]\n\
             [observer]\nkind = \"{kind}\"\n"
        );
        let run = Bench::new(design).run(&["design", FILE]);
        let message = run.stderr();
        assert_ne!(run.code(), 0, "{kind}");
        assert!(
            message.contains("add a sensor that shows it"),
            "{kind}: {message}"
        );
        assert!(!message.contains("use a luenberger"), "{kind}: {message}");
    }
}

#[test]
fn one_table_where_there_are_several_and_several_where_there_is_one() {
    let cases: [(&str, &str, &str); 6] = [
        (
            "steps = 60",
            "steps = 60\nsteps = 70",
            "steps stands here again",
        ),
        (
            "[compensation]",
            "[observer]",
            "observer stands here again: give it once",
        ),
        ("[[mode]]", "[mode]", "write [[mode]]"),
        ("[controller]", "[[controller]]", "write [controller]"),
        ("[scenario]", "[[scenario]]", "write [scenario]"),
        (
            "[controller]",
            "[signals.inputs]\nname = \"a\"\n[controller]",
            "write [[signals.inputs]]",
        ),
    ];
    for (from, to, word) in cases {
        refused(to, damaged(from, to), &["line ", "column ", word]);
    }
}
