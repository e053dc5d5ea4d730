//! Plants the tests share.
#![allow(dead_code)] // each test file uses its own part

use ftc_design::{ControlSpec, Lyapunov};
use ftc_plant::scaling::Scaling;
use ftc_plant::{Dimensions, Mode, SwitchedPlant};
use nalgebra::DMatrix;

/// Where the paper's disturbance enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Channel {
    State,
    Output,
}

/// A matrix from its rows.
pub fn rows<const R: usize, const C: usize>(rows: [[f64; C]; R]) -> DMatrix<f64> {
    DMatrix::from_fn(R, C, |r, c| rows[r][c])
}

/// A mode around the origin.
pub fn mode(
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    e: DMatrix<f64>,
    f: DMatrix<f64>,
) -> Mode {
    Mode::new(a, b, c).with_disturbance(e, f)
}

/// The plant of the paper's section VII-A.
pub fn paper(channel: Channel) -> SwitchedPlant {
    let (e, f) = match channel {
        Channel::State => (rows([[1.0], [1.0]]), rows([[0.0], [0.0]])),
        Channel::Output => (rows([[0.0], [0.0]]), rows([[1.0], [1.0]])),
    };
    let c = DMatrix::identity(2, 2);
    let first = mode(
        rows([[0.6, 0.45], [-0.2, 0.3]]),
        rows([[0.0, 1.0], [1.0, 0.0]]),
        c.clone(),
        e.clone(),
        f.clone(),
    );
    let second = mode(
        rows([[0.4, -0.3], [0.11, 0.0]]),
        rows([[1.0, 0.0], [0.0, 1.0]]),
        c,
        e,
        f,
    );
    SwitchedPlant::new(1.0, vec![first, second])
}

/// The weights of the reference table: 1 on the output, 0.3 on the integral, 0.1 on the input.
pub fn paper_spec(latency: usize, decay: f64, lyapunov: Lyapunov) -> ControlSpec {
    let dims = paper(Channel::State).dimensions();
    let mut spec = ControlSpec::unweighted(dims);
    spec.latency = latency;
    spec.decay = decay;
    spec.lyapunov = lyapunov;
    spec.output_weight = vec![1.0; 2];
    spec.integral_weight = vec![0.3; 2];
    spec.input_weight = vec![0.1; 2];
    spec
}

/// A linear congruential generator: reproducible anywhere, good enough for matrices.
pub struct RandomNumbers(pub u64);

impl RandomNumbers {
    /// A number in [-1, 1).
    pub fn number(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// A whole number in `low..=high`.
    pub fn between(&mut self, low: usize, high: usize) -> usize {
        low + ((self.number() + 1.0) / 2.0 * (high - low + 1) as f64) as usize
    }

    /// A matrix of numbers in [-1, 1).
    pub fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.number())
    }
}

/// A plant of one to three similar modes, sampled from continuous time: `A = I + Te Ac`, where `Ac`
/// has its spectrum around -2 and may reach into the right half plane.
pub fn random_plant(seed: u64, sample_time: f64) -> SwitchedPlant {
    let mut random = RandomNumbers(seed.wrapping_mul(0x9E3779B97F4A7C15) + 1);
    let n = random.between(2, 4);
    let m = random.between(1, 3);
    let p = random.between(1, 3);
    let s = random.between(1, p);
    let modes = random.between(1, 3);
    let (a, b, c) = (
        2.0 * random.matrix(n, n) - 1.5 * DMatrix::identity(n, n),
        random.matrix(n, m),
        random.matrix(p, n),
    );
    let e = random.matrix(n, s);
    let modes = (0..modes)
        .map(|_| {
            mode(
                DMatrix::identity(n, n) + sample_time * (&a + 0.2 * random.matrix(n, n)),
                sample_time * (&b + 0.1 * random.matrix(n, m)),
                c.clone(),
                sample_time * &e,
                DMatrix::zeros(p, s),
            )
        })
        .collect();
    SwitchedPlant::new(sample_time, modes)
}

/// Three modes, two inputs, three outputs, drawn at random: a plant on which the solver used to stop on
/// its way to the optimum.
pub fn three_modes() -> SwitchedPlant {
    let c = rows([
        [
            -0.1828389745977349,
            0.5405251317548021,
            1.9350880340988528,
            -0.2696203273419135,
        ],
        [
            -0.24355867907910456,
            1.0023136012756912,
            -0.8864599431605871,
            -0.291720232439864,
        ],
        [
            0.8825389674564839,
            0.5803500161908991,
            0.09151670328235219,
            0.6701043548284794,
        ],
    ]);
    let e = rows([
        [-2.8281623068437627],
        [1.02130681750008],
        [-0.9596447598081417],
        [-1.6686198426559695],
    ]);
    let modes = [
        (
            rows([
                [
                    0.7125116285160216,
                    -0.8922161757038342,
                    0.14596379005899493,
                    -0.1982158148479428,
                ],
                [
                    -0.15802580361408125,
                    -0.07526779683080423,
                    -0.7052036464245808,
                    -0.08097063444076864,
                ],
                [
                    -0.30205723074984525,
                    1.1601027068410452,
                    0.07882506749162922,
                    -0.12310803446767714,
                ],
                [
                    -0.09820112629061915,
                    -0.23322373973703003,
                    -0.36836689396024835,
                    -0.13643374585374596,
                ],
            ]),
            rows([
                [0.48194538850678587, -0.2385536065733667],
                [0.9577587029597641, -0.19980212906658],
                [0.024259565076664623, 1.545820851212812],
                [0.5451055226876446, -0.505228735614018],
            ]),
        ),
        (
            rows([
                [
                    0.12683369859759633,
                    0.32141096682563763,
                    -0.20405992668447798,
                    -0.4938564951352328,
                ],
                [
                    0.011986109926624841,
                    -0.024200538315740216,
                    0.6448903916883212,
                    0.3429118232004964,
                ],
                [
                    0.08892288781864208,
                    0.5100188592031903,
                    -0.09429426087698728,
                    -0.42480401095405235,
                ],
                [
                    0.2679667646642641,
                    0.2672694359331767,
                    -0.09856380293597387,
                    -0.35915366330498033,
                ],
            ]),
            rows([
                [0.22915390521326254, -2.4938942784579905],
                [0.690124770162812, 0.4913682607449912],
                [-1.6388571438904884, 0.06135350983817159],
                [-0.9640996635412404, 0.7572210447581504],
            ]),
        ),
        (
            rows([
                [
                    0.4562224234357534,
                    0.20420338772850646,
                    0.20441639810414272,
                    0.3086687243206393,
                ],
                [
                    0.09473336652949163,
                    -0.17340599844361584,
                    -0.21707839615101046,
                    -0.21706720705258603,
                ],
                [
                    0.3716543167506595,
                    -0.39615205792523034,
                    -0.1617748908151345,
                    -0.08714261702151574,
                ],
                [
                    0.06093154928888757,
                    0.15607284186952003,
                    -0.33883779816968224,
                    -0.46929417360271386,
                ],
            ]),
            rows([
                [-0.004414232621967487, 1.2135638252860816],
                [0.7570580592965243, 0.21565078369996044],
                [-0.3171556440173552, 0.2932336958002246],
                [-0.24333508574217566, 0.817206580492595],
            ]),
        ),
    ];
    let modes = modes.map(|(a, b)| mode(a, b, c.clone(), e.clone(), DMatrix::zeros(3, 1)));
    SwitchedPlant::new(0.5, modes.to_vec())
}

/// Two first-order channels that have nothing to do with each other, the first disturbed; one mode per
/// size of the disturbance.
pub fn two_channels(disturbances: &[f64]) -> SwitchedPlant {
    let identity = DMatrix::identity(2, 2);
    let channel = |&size: &f64| {
        let a = rows([[0.9, 0.0], [0.0, 0.8]]);
        let e = rows([[size], [0.0]]);
        mode(
            a,
            identity.clone(),
            identity.clone(),
            e,
            DMatrix::zeros(2, 1),
        )
    };
    SwitchedPlant::new(1.0, disturbances.iter().map(channel).collect())
}

/// A state that drives another; the driven one is unstable in the first mode, and the disturbance acts
/// on it alone.
pub fn half_unstable() -> SwitchedPlant {
    let driven = |pole: f64| {
        mode(
            rows([[pole, 0.1], [0.0, 0.8]]),
            rows([[0.0], [1.0]]),
            DMatrix::identity(2, 2),
            rows([[0.1], [0.0]]),
            DMatrix::zeros(2, 1),
        )
    };
    SwitchedPlant::new(0.1, vec![driven(1.05), driven(0.9)])
}

/// A plant of one to five states whose modes are variations of one another, some of them unstable; each
/// state is disturbed with a chance of one half.
pub fn sparsely_disturbed(seed: u64) -> SwitchedPlant {
    let mut random = RandomNumbers(seed.wrapping_mul(0x9E3779B97F4A7C15) + 7);
    let n = random.between(1, 5);
    let (m, p) = (random.between(1, 3), random.between(1, n.min(3)));
    let (a, b, c) = (
        random.matrix(n, n),
        random.matrix(n, m),
        random.matrix(p, n),
    );
    let e = random.matrix(n, 1).map(|value| value.max(0.0));
    let modes = random.between(1, 3);
    let variation = |_| {
        let own = &a + 0.1 * random.matrix(n, n);
        let radius = 0.75 + 0.25 * random.number();
        let scale = radius / ftc_plant::spectral_radius(&own);
        let input = &b + 0.1 * random.matrix(n, m);
        mode(
            own * scale,
            input,
            c.clone(),
            e.clone(),
            DMatrix::zeros(p, 1),
        )
    };
    SwitchedPlant::new(0.5, (0..modes).map(variation).collect())
}

/// A three-phase rectifier in amperes and volts, states (i_d, i_q, v_dc), sampled at 0.1 ms: 10 mH,
/// 0.3 ohm, 2 mF, 50 Hz, 311 V phase amplitude, 600 V on the DC side, one mode per load.
/// Linearised averaged model; inputs are the converter's modulation indices.
pub fn rectifier() -> SwitchedPlant {
    let (l, r, c, omega) = (10e-3, 0.3, 2e-3, 314.159);
    let (source, link, sample_time) = (311.0_f64, 600.0_f64, 1e-4);
    let modes = [80.0_f64, 40.0]
        .into_iter()
        .map(|load| {
            // Steady state with i_q = 0: 1.5 (source i_d - r i_d^2) = link^2 / load.
            let power = link * link / load;
            let current = (source - (source * source - 4.0 * r * power / 1.5).sqrt()) / (2.0 * r);
            let (m_d, m_q) = ((source - r * current) / link, -omega * l * current / link);
            let continuous = rows([
                [-r / l, omega, -m_d / l],
                [-omega, -r / l, -m_q / l],
                [1.5 * m_d / c, 1.5 * m_q / c, -1.0 / (load * c)],
            ]);
            let input = rows([[-link / l, 0.0], [0.0, -link / l], [1.5 * current / c, 0.0]]);
            let disturbance = rows([[0.0], [0.0], [-1.0 / c]]);
            let exponential = (sample_time * &continuous).exp();
            // Zero-order hold by the midpoint of the transition, accurate to O(Te^3).
            let hold = sample_time * (0.5 * sample_time * &continuous).exp();
            mode(
                exponential,
                &hold * input,
                rows([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
                &hold * disturbance,
                rows([[0.0], [0.0]]),
            )
        })
        .collect();
    SwitchedPlant::new(sample_time, modes)
}

/// A plant and a request in other units of states, inputs and outputs.
pub fn in_units(
    plant: &SwitchedPlant,
    spec: &ControlSpec,
    units: &Scaling,
) -> (SwitchedPlant, ControlSpec) {
    let over = |weights: &[f64], units: &mut dyn Iterator<Item = f64>| {
        weights.iter().zip(units).map(|(w, u)| w * u).collect()
    };
    let tracked = || spec.tracked.iter().map(|&output| units.outputs[output]);
    let mut changed = spec.clone();
    changed.output_weight = over(&spec.output_weight, &mut tracked());
    changed.integral_weight = over(&spec.integral_weight, &mut tracked());
    changed.input_weight = over(&spec.input_weight, &mut units.inputs.iter().copied());
    (units.apply(plant), changed)
}

/// Each guarantee in turn, with the usual weights.
pub fn usual_spec(seed: u64, dims: Dimensions) -> ControlSpec {
    let r = dims.outputs.min(dims.inputs);
    let mut spec = ControlSpec::unweighted(dims);
    spec.decay = 0.95;
    spec.lyapunov = [Lyapunov::Common, Lyapunov::Switched, Lyapunov::Dwell][seed as usize % 3];
    spec.integral_weight = vec![0.3; r];
    spec.input_weight = vec![0.1; dims.inputs];
    spec
}

/// Units of all signals, evenly spread on the logarithmic scale from 1e-6 to 1e6.
pub fn spread_units(seed: u64, dims: Dimensions) -> Scaling {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut unit = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        10f64.powf(12.0 * ((state >> 11) as f64 / (1u64 << 53) as f64) - 6.0)
    };
    let mut units = |count: usize| (0..count).map(|_| unit()).collect();
    Scaling {
        states: units(dims.states),
        inputs: units(dims.inputs),
        outputs: units(dims.outputs),
    }
}
