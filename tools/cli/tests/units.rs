//! Units: plants in units of any size are designed without nominal values, those given are kept, and a
//! verdict names the keys that would change it.
//!
//! promise: any-units

mod common;

use common::{Bench, FILE};

/// A second-order plant whose second state and input are in small units.
fn small_units(first: &str, back: &str, input: &str) -> String {
    format!(
        "name = \"units\"\nsample_time = 0.01\n[[mode]]\nA = [[0.9, {first}], [{back}, 0.8]]\nB = [[0.0], [{input}]]\n\
         C = [[1.0, 0.0]]\nE = [[0.1], [0.0]]\n[controller]\ndecay = 0.95\n[scenario]\nnoise = 0.001\n"
    )
}

/// gamma of a design that must succeed.
fn gamma(design: &str) -> Vec<f64> {
    let run = Bench::new(design).run(&["design", FILE, "--json"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    let report = run.json();
    assert_eq!(report["certified"], true);
    let gamma = report["gamma"].as_array().unwrap();
    gamma.iter().map(|value| value.as_f64().unwrap()).collect()
}

#[test]
fn a_state_in_a_small_unit_is_no_reason_to_refuse() {
    gamma(&small_units("5e4", "-3e-8", "1e-7"));
}

#[test]
fn an_input_in_a_tiny_unit_is_no_reason_to_refuse() {
    gamma(&small_units("0.05", "-0.03", "1e-7"));
}

/// The same plant with the input's unit changed and its nominal value given: the same gamma.
#[test]
fn given_nominal_values_win() {
    let given = |input: &str, nominal: &str| {
        small_units("0.05", "-0.03", input)
            + &format!(
                "[signals]\ninputs = [{{ nominal = {nominal} }}]\noutputs = [{{ nominal = 1.0 }}]\n"
            )
    };
    let (one, other) = (gamma(&given("0.1", "1.0")), gamma(&given("1e-7", "1e6")));
    assert!((one[0] / other[0] - 1.0).abs() < 1e-3, "{one:?} {other:?}");
}

/// Readings far from zero, thresholds beyond any fault, no nominal values: what is designed is proved.
#[test]
fn what_is_designed_is_proved_again_whatever_the_units() {
    let far = "name = \"far\"\nsample_time = 1.0\n[[mode]]\nA = [[0.9, 0.2], [0.1, 0.5]]\nB = [[1.0], [1.0]]\n\
        C = [[0.0, 1.0]]\nE = [[1.0], [0.0]]\noperating_point = { x = [2e9, 1e8], u = [1.0], y = [2e9] }\n\
        [controller]\ndecay = 0.97\n[estimator]\nthreshold = 1e9\n[scenario]\nnoise = 1.0\nreference = [2e9]\n";
    let bench = Bench::new(far);
    for arguments in [
        &["design", FILE, "--save", "solved.json"][..],
        // Refused unless the very proof of `verify` goes through.
        &["simulate", FILE, "--solved", "solved.json", "--out", "out"],
    ] {
        let run = bench.run(arguments);
        assert_eq!(run.code(), 0, "{}", run.stderr());
    }
}

/// Six states whose units lie eight decades apart.
const CHAIN: &str = r#"name = "scaled_1e8"
sample_time = 0.004
[[mode]]
A = [[0.486246733, 0.00476030216, 2.36024619e-05, 7.842485e-08, 1.95950247e-10, 3.90792747e-13], [7.54457049, 0.523654115, 0.00488459717, 2.39130221e-05, 7.90442148e-08, 1.95950247e-10], [59.2867037, 7.74156481, 0.524146319, 0.0048855788, 2.39130221e-05, 7.842485e-08], [312.214952, 60.0667957, 7.74312058, 0.524146319, 0.00488459717, 2.36024619e-05], [1236.36247, 314.680687, 60.0667957, 7.74156481, 0.523654115, 0.00476030216], [3907.92747, 1236.36247, 312.214952, 59.2867037, 7.54457049, 0.486246733]]
B = [[2.81352365e-05], [0.000194879284], [0.000960699415], [0.00365403361], [0.0112835441], [0.0292066165]]
C = [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0001]]
E = [[2.81352365e-05], [0.000194879284], [0.000960699415], [0.00365403361], [0.0112835441], [0.0292066165]]
[controller]
decay=0.99
[scenario]
noise = 0.001
"#;

#[test]
fn a_chain_of_states_in_unlike_units_is_designed() {
    gamma(CHAIN);
}

/// Three modes in SI units, switched.
const THREE_OUTPUTS: &str = r#"name = "r14_si"
sample_time = 1.0

[[mode]]
A = [[-0.343455199, -6.84952506e-06, 2.04510871e-06], [45629.5865, -0.265677891, -1.19900737], [40547.9199, -0.762815827, 0.0510963753]]
B = [[-24.3985311, 0.000537160817, 0.0381042221], [2821370.93, 152.183427, 1174.7988], [19716042.3, -105.570503, -10193.7643]]
C = [[-0.00329286865, 7.90598722e-08, -3.12708495e-09], [-0.0625616398, -9.77674188e-06, 1.34954158e-05], [-213707.942, 0.229743624, -0.153275492]]
E = [[-0.109988086, 0.00674858772], [-1905.31141, -16246.7832], [-23549.2227, -8154.55388]]
F = [[0.000149599627, -0.000176841203], [0.0122487916, 0.0149953368], [1957.72682, 2845.56706]]

[[mode]]
A = [[-0.382207721, -5.67498221e-06, 1.40874893e-06], [35685.0743, -0.166636108, -1.17017274], [41133.7235, -0.685698182, 0.0533867618]]
B = [[-20.2283551, 0.000546388031, 0.017809897], [3159631.64, 150.509737, 2043.22275], [19363946.2, -114.21812, -9717.73713]]
C = [[-0.00284733783, 8.31003316e-08, -1.33495441e-08], [-0.0570541612, -1.07514072e-05, 1.37280517e-05], [-211339.542, 0.219531651, -0.169282429]]
E = [[0.0444065622, -0.0190574191], [-6768.2814, 4893.59314], [5746.48362, -8530.48911]]
F = [[0.000127991819, -0.0001947401], [0.0323418446, 0.0155416865], [-3518.72526, 4579.53484]]

[[mode]]
A = [[-0.391635283, -6.75152139e-06, -3.52687631e-07], [40397.0638, -0.27828809, -1.22074476], [42406.788, -0.686246637, 0.0609308223]]
B = [[-31.4655015, 0.00044703598, 0.0376193654], [4092452.38, 117.861264, 407.326596], [19047697, -101.265439, -8375.19323]]
C = [[-0.00252287027, 9.96771294e-08, 3.48219718e-09], [-0.0641283787, -1.11403234e-05, 1.29249947e-05], [-226910.61, 0.260586147, -0.140505555]]
E = [[-0.0352594452, -0.00317077965], [-2975.61149, 2728.26539], [4253.00726, 4088.06423]]
F = [[2.71299261e-05, -0.000270653691], [-0.0541849916, 0.0364698244], [6003.31235, -787.332605]]

[disturbance]
period = 30.0
harmonics = 1

[controller]
tracked = [2, 3]
latency = 0
lyapunov = "switched"
decay = 0.95
output_weight = [10.0, 0.0001]
integral_weight = [0.9, 9e-06]
input_weight = [200.0, 0.002, 0.2]

[observer]
kind = "luenberger"
decay = 0.9995

[estimator]
method = "none"

[compensation]
method = "none"
"#;

/// Three modes in SI units, common, with latency.
const ONE_INPUT: &str = r#"name = "r16_si"
sample_time = 0.0001

[[mode]]
A = [[0.455644886, -3.29958703e-09, 0.0661210345, 0.0002758164, 0.0113181129], [4666889.15, 0.309080736, 126858.737, -2871.63534, -421304.604], [4.91948153, -6.23321096e-07, 0.465939308, -0.000369438257, 0.355177414], [-287.722528, 1.97981187e-05, -51.0172904, -0.628984768, 4.21588797], [-5.2622771, 7.68834725e-07, 0.362864319, -0.00404238908, 0.299618621]]
B = [[5.60585187e-05], [595.990371], [0.000783712702], [-0.00242887567], [-0.00114399678]]
C = [[2158922.87, -0.644869832, -897948.461, -7244.05355, 2113018.2], [-378668116, -88.3040264, -58605088.8, -1047388.49, -183145042], [156101955, 17.2090226, 8504072.87, -20431.8978, -6409045.69]]
E = [[-8.21234785e-06], [167.75525], [-0.000157960132], [-0.000580826393], [-2.62806005e-05]]
F = [[-66.4247134], [2155.91003], [-292.380438]]

[[mode]]
A = [[0.360829994, -6.63818468e-09, 0.0634098515, 0.000250318122, 0.0125836097], [4343738.39, 0.352805346, 108233.736, -2469.4814, -361144.701], [4.95854707, -5.98069813e-07, 0.54789954, -1.13326627e-06, 0.376182359], [-350.822457, 1.52295878e-05, -49.1936934, -0.678969223, -1.28309565], [-5.05784446, 6.25590404e-07, 0.368164367, -0.00377580681, 0.248341416]]
B = [[5.49158102e-05], [483.692608], [0.00105130517], [-0.0134449268], [-0.00137184049]]
C = [[1581697.75, -0.631098363, -937284.209, -7740.35803, 2071363.15], [-314735820, -82.5533791, -61428547, -975187.548, -186142637], [151329417, 15.8934391, 7947417.77, -22280.9767, -5002099.26]]
E = [[1.07051406e-06], [-93.6920442], [-0.00025718731], [0.0137863856], [-0.000143288149]]
F = [[39.748018], [-3262.90445], [-556.156374]]

[[mode]]
A = [[0.311268438, -3.97172717e-09, 0.0547582243, 0.000226982342, 0.0139524427], [4475294.35, 0.386952327, 87727.1421, -1890.3739, -437907.939], [5.2858723, -4.44886738e-07, 0.386939956, -0.00065167194, 0.331108497], [-228.356078, 5.09973516e-06, -50.6325314, -0.686462731, 0.0641585313], [-4.21011208, 6.27581186e-07, 0.345272016, -0.00353707358, 0.284590239]]
B = [[4.48744242e-05], [383.623824], [0.000999852513], [-0.0104142362], [-0.00126264544]]
C = [[1263994.99, -0.641324899, -883741.254, -6724.45882, 2081713.1], [-456361073, -81.2007851, -62766074, -1081670.89, -182499785], [143528311, 16.8683187, 8060837.29, -24931.3796, -5677607.81]]
E = [[-1.89418769e-06], [33.4866136], [-5.43623218e-05], [0.00181581103], [7.01610105e-06]]
F = [[7.54141407], [-602.29337], [87.2478419]]

[disturbance]
period = 0.003
harmonics = 1

[controller]
tracked = [3]
latency = 1
lyapunov = "common"
decay = 0.95
output_weight = [0.001]
integral_weight = [0.9]
input_weight = [2.0]

[observer]
kind = "luenberger"
decay = 0.9995

[estimator]
method = "none"

[compensation]
method = "none"
"#;

#[test]
fn plants_in_si_units_are_designed() {
    gamma(THREE_OUTPUTS);
    gamma(ONE_INPUT);
}

/// Four modes whose observer cannot be as fast as asked, though the controller can.
const FAST_OBSERVER: &str = r#"name = "h3"
sample_time = 0.1

[[mode]]
A = [[-0.7593, -0.436], [-0.0991, 0.2616]]
B = [[0.5725], [-0.7777]]
C = [[-0.5118, 1.2591]]
E = [[1.4583], [0.8467]]
F = [[0.3467]]

[[mode]]
A = [[0.9156, 1.2324], [-0.9576, -0.59]]
B = [[-0.3204], [0.6847]]
C = [[-0.5118, 1.2591]]
E = [[-1.4636], [-0.0646]]
F = [[0.1387]]

[[mode]]
A = [[0.8506, -0.0753], [0.2787, 0.3857]]
B = [[0.0206], [-0.7429]]
C = [[-0.5118, 1.2591]]
E = [[-0.5687], [1.43]]
F = [[0.0593]]

[[mode]]
A = [[-0.5971, -0.2099], [-0.6456, -0.1322]]
B = [[-0.2618], [-0.2106]]
C = [[-0.5118, 1.2591]]
E = [[0.2876], [-0.1806]]
F = [[-0.0068]]

[disturbance]
period = 3.0
harmonics = 1

[controller]
tracked = [1]
latency = 0
lyapunov = "switched"
decay = 0.95
output_weight = 1.0
integral_weight = 0.5
input_weight = 0.2

[observer]
kind = "luenberger"
decay = 0.6

[estimator]
method = "none"

[compensation]
method = "none"
"#;

#[test]
fn advice_names_the_section_and_what_was_found_is_kept() {
    let run = Bench::new(FAST_OBSERVER).run(&["design", FILE, "--json"]);
    assert_eq!(run.code(), 1, "{}", run.stderr());
    let report = run.json();
    let advice = report["advice"].as_array().unwrap();
    assert!(!advice.is_empty());
    let slower = advice
        .iter()
        .find_map(|one| one.as_str()?.split("observer.decay = ").nth(1));
    let slower: f64 = slower.unwrap().parse().unwrap();
    assert!(
        !report["advice"].to_string().contains("controller.decay"),
        "{}",
        report["advice"]
    );
    let gamma = report["gamma"].as_array().unwrap();
    assert!(gamma.len() == 4 && gamma.iter().all(|value| value.as_f64().unwrap() > 0.0));
    assert!(report["spectral_radius"].is_array());
    let followed = FAST_OBSERVER.replace("decay = 0.6", &format!("decay = {slower}"));
    let run = Bench::new(followed).run(&["design", FILE, "--json"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
}

/// A mass of which the position is measured: no advice that no one can follow.
#[test]
fn no_decay_above_one_is_advised() {
    let mass = "name = \"mass\"\nsample_time = 0.1\n[[mode]]\nA = [[1.0, 0.1], [0.0, 1.0]]\nB = [[0.005], [0.1]]\n\
        C = [[1.0, 0.0]]\nE = [[0.005], [0.1]]\n[estimator]\nmethod = \"none\"\n[controller]\ndecay = 0.95\n[scenario]\nnoise = 0.001\n";
    let run = Bench::new(mass).run(&["design", FILE, "--json"]);
    assert_eq!(run.code(), 0, "{}", run.stderr());
    assert!(!run.stdout().contains("decay above 1"), "{}", run.stdout());
}
