//! Values, printing and derivatives of random formulas, against an evaluation that shares no code with the crate.

use proptest::prelude::*;
use sabine_paths::laws::{Law, LawParameter, LawTarget};

/// A formula of this test: its own tree, text and arithmetic.
#[derive(Clone, Debug)]
enum Tree {
    Number(f64),
    Parameter(usize),
    Variable(usize),
    One(&'static str, Box<Tree>),
    Two(&'static str, Box<Tree>, Box<Tree>),
    Resonance(Box<[Tree; 3]>),
}

const PARAMETERS: [&str; 3] = ["b", "c", "d"];
const VARIABLES: [&str; 6] = [
    "reflections",
    "scatterings",
    "departure_cos",
    "arrival_cos",
    "hits(rough plaster)",
    "receiver(mic-2 b)",
];

impl Tree {
    fn value(&self, parameters: &[f64], variables: &[f64]) -> f64 {
        match self {
            Self::Number(x) => *x,
            Self::Parameter(i) => parameters[*i],
            Self::Variable(i) => variables[*i],
            Self::One(name, a) => {
                let a = a.value(parameters, variables);
                match *name {
                    "-" => 0.0 - a,
                    "sqrt" => a.sqrt(),
                    "ln" => a.ln(),
                    "exp" => a.exp(),
                    "abs" => {
                        if a > 0.0 {
                            a
                        } else {
                            -a
                        }
                    }
                    "cos" => a.cos(),
                    _ => a.sin(),
                }
            }
            Self::Two(name, a, b) => {
                let (a, b) = (a.value(parameters, variables), b.value(parameters, variables));
                match *name {
                    "+" => a + b,
                    "-" => a - b,
                    "*" => a * b,
                    "/" => a / b,
                    "^" => a.powf(b),
                    "min" => {
                        if b < a {
                            b
                        } else {
                            a
                        }
                    }
                    "max" => {
                        if b > a {
                            b
                        } else {
                            a
                        }
                    }
                    "above" => {
                        if a < b {
                            0.0
                        } else {
                            1.0
                        }
                    }
                    _ => {
                        if a < b {
                            1.0
                        } else {
                            0.0
                        }
                    }
                }
            }
            Self::Resonance(of) => {
                let [f, f0, q] = [0, 1, 2].map(|i| of[i].value(parameters, variables));
                let ratio = f / f0 - f0 / f;
                if ratio.is_finite() { 1.0 / (1.0 + q.powi(2) * ratio.powi(2)) } else { f64::NAN }
            }
        }
    }

    /// With every bracket there can be.
    fn text(&self) -> String {
        match self {
            Self::Number(x) => format!("{x}"),
            Self::Parameter(i) => PARAMETERS[*i].to_owned(),
            Self::Variable(i) => VARIABLES[*i].to_owned(),
            Self::One("-", a) => format!("(-{})", a.text()),
            Self::One(name, a) => format!("{name}({})", a.text()),
            Self::Two(name, a, b) if name.len() == 1 => format!("({} {name} {})", a.text(), b.text()),
            Self::Two(name, a, b) => format!("{name}({},{})", a.text(), b.text()),
            Self::Resonance(of) => format!("resonance({},{},{})", of[0].text(), of[1].text(), of[2].text()),
        }
    }
}

fn trees() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        (0.1f64..5.0).prop_map(Tree::Number),
        Just(Tree::Number(2.0)),
        (0..PARAMETERS.len()).prop_map(Tree::Parameter),
        (0..VARIABLES.len()).prop_map(Tree::Variable),
    ];
    leaf.prop_recursive(5, 24, 3, |inner| {
        let one = prop::sample::select(vec!["-", "sqrt", "ln", "exp", "abs", "cos", "sin"]);
        let two = prop::sample::select(vec!["+", "-", "*", "/", "^", "min", "max", "above", "below"]);
        prop_oneof![
            1 => (one, inner.clone()).prop_map(|(name, a)| Tree::One(name, Box::new(a))),
            4 => (two, inner.clone(), inner.clone()).prop_map(|(n, a, b)| Tree::Two(n, Box::new(a), Box::new(b))),
            1 => [inner.clone(), inner.clone(), inner].prop_map(|of| Tree::Resonance(Box::new(of))),
        ]
    })
}

/// A law of the tree: `a`, in dB, times the tree, and all parameters in use.
fn law(text: &str, parameters: &[f64]) -> Law {
    let wide = |value: f64| LawParameter::new(value, [-1e9, 1e9], "1");
    let named = PARAMETERS.iter().zip(parameters).map(|(name, &value)| (*name, wide(value)));
    let a = LawParameter::new(2.0, [0.0, 3.0], "dB");
    Law::new("l", LawTarget::Path, None, text, named.chain([("a", a)]))
        .unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn all_in_use(tree: &Tree) -> String {
    format!("a * ({} + 0*b + 0*c + 0*d)", tree.text())
}

fn ask(variables: &[f64]) -> impl Fn(&str) -> Option<f64> {
    move |name| VARIABLES.iter().position(|known| *known == name).map(|i| variables[i])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn a_formula_has_the_value_of_its_tree_and_prints_as_itself(
        tree in trees(),
        parameters in prop::array::uniform3(0.2f64..3.0),
        variables in prop::array::uniform6(0.1f64..4.0),
    ) {
        let expected = 2.0 * tree.value(&parameters, &variables);
        let law = law(&all_in_use(&tree), &parameters);
        let found = law.value(ask(&variables));
        if let Ok(found) = &found {
            // Digits that cancel in the tree are lost in both.
            prop_assert!((found - expected).abs() <= 1e-6 * (1.0 + expected.abs()) || expected.abs() > 1e12,
                "{}: {found} for {expected}", law.formula());
        } else {
            // An intermediate value that is not finite may hide in a finite result; a finite tree of finite parts never fails.
            prop_assert!(!all_finite(&tree, &parameters, &variables), "{}: {found:?}", law.formula());
        }
        let again = crate::laws::formulas::law(&law.printed(), &parameters);
        prop_assert_eq!(again.printed(), law.printed());
        match (again.value(ask(&variables)), found) {
            (Ok(again), Ok(found)) => prop_assert_eq!(again.to_bits(), found.to_bits(), "{} and {}", law.printed(), law.formula()),
            (again, found) => prop_assert_eq!(again.is_ok(), found.is_ok()),
        }
    }

    #[test]
    fn derivatives_are_those_of_central_differences(
        tree in trees(),
        parameters in prop::array::uniform3(0.2f64..3.0),
        variables in prop::array::uniform6(0.1f64..4.0),
    ) {
        prop_assume!(all_finite(&tree, &parameters, &variables));
        let law = law(&all_in_use(&tree), &parameters);
        let Ok((value, gradient)) = law.value_and_gradient(ask(&variables)) else { return Ok(()) };
        // The first parameter is the factor.
        prop_assert!((gradient[0] - tree.value(&parameters, &variables)).abs() <= 1e-6 * (1.0 + value.abs()) || value.abs() > 1e12);
        for (k, _) in PARAMETERS.iter().enumerate() {
            let h = 1e-5;
            let at = |times: f64| {
                let mut moved = parameters;
                moved[k] += times * h;
                2.0 * tree.value(&moved, &variables)
            };
            let (wide, narrow) = ((at(1.0) - at(-1.0)) / (2.0 * h), (at(0.5) - at(-0.5)) / h);
            let aside = [(at(0.5) - at(0.0)) / (0.5 * h), (at(0.0) - at(-0.5)) / (0.5 * h)];
            // Only where the difference itself converges: no kink, no step, no rounding of great numbers.
            let tolerance = 1e-4 * (1.0 + narrow.abs());
            let smooth = (wide - narrow).abs() < 0.1 * tolerance && (aside[0] - aside[1]).abs() < 10.0 * tolerance;
            if smooth && value.abs() < 1e5 {
                prop_assert!((gradient[k + 1] - narrow).abs() < tolerance, "{}: {} for {narrow}", law.formula(), gradient[k + 1]);
            }
        }
    }
}

fn all_finite(tree: &Tree, parameters: &[f64], variables: &[f64]) -> bool {
    let parts = match tree {
        Tree::One(_, a) => vec![a.as_ref()],
        Tree::Two(_, a, b) => vec![a.as_ref(), b.as_ref()],
        Tree::Resonance(of) => of.iter().collect(),
        _ => Vec::new(),
    };
    tree.value(parameters, variables).is_finite()
        && parts.into_iter().all(|part| all_finite(part, parameters, variables))
}

/// Precedence and signs by hand: what the text says, not what a tree of ours prints.
#[test]
fn operators_bind_as_in_the_textbook() {
    for (text, expected) in [
        ("1 + 2 * 3", 7.0),
        ("2 * 3 + 1", 7.0),
        ("8 - 3 - 2", 3.0),
        ("8 / 4 / 2", 1.0),
        ("8 / (4 / 2)", 4.0),
        ("2 ^ 3 ^ 2", 512.0),
        ("(2 ^ 3) ^ 2", 64.0),
        ("-2 ^ 2", -4.0),
        ("(-2) ^ 2", 4.0),
        ("2 ^ -1", 0.5),
        ("2 * -3", -6.0),
        ("--3", 3.0),
        ("1e3 + 2.5E-1", 1000.25),
        (".5", 0.5),
        ("above(2, 2) + 10 * below(2, 2)", 1.0),
        ("max(1, 3) - min(1, 3)", 2.0),
        ("resonance(2, 2, 7)", 1.0),
        ("resonance(4, 2, 2)", 0.1),
        ("cos(0) + sin(0)", 1.0),
    ] {
        let a = LawParameter::new(1.0, [0.0, 2.0], "dB");
        let law = Law::new("l", LawTarget::Path, None, &format!("a * ({text})"), [("a", a)]).unwrap();
        let found = law.value(|_| None).unwrap();
        assert!((found - expected).abs() < 1e-12, "{text}: {found} for {expected}");
        let again = Law::new(
            "l",
            LawTarget::Path,
            None,
            &law.printed(),
            law.parameters().map(|(n, p)| (n, p.clone())),
        );
        assert_eq!(again.unwrap().value(|_| None).unwrap(), found, "{}", law.printed());
    }
}

#[test]
fn units_of_parameters_and_degrees_are_converted() {
    let law = |target, formula: &str, parameters: Vec<(&str, f64, &str)>| {
        Law::new(
            "l",
            target,
            None,
            formula,
            parameters.into_iter().map(|(name, value, unit)| {
                (name.to_owned(), LawParameter::new(value, [value - 1.0, value + 1.0], unit))
            }),
        )
        .unwrap_or_else(|e| panic!("{formula}: {e}"))
    };
    let value = |law: &Law| {
        law.value_and_gradient(|name| match name {
            "length_m" => Some(250.0),
            "frequency_hz" => Some(4000.0),
            "departure_azimuth_deg" => Some(90.0),
            "time_s" => Some(0.5),
            _ => None,
        })
        .unwrap()
    };
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
    let (found, slope) = value(&law(LawTarget::Path, "a * length_m", vec![("a", -4.0, "dB/km")]));
    near(found, -1.0);
    near(slope[0], 0.25);
    near(value(&law(LawTarget::Path, "a * frequency_hz * time_s", vec![("a", 0.001, "dB")])).0, 2.0);
    near(
        value(&law(LawTarget::Path, "a * (frequency_hz / f)^2", vec![("a", 1.0, "dB"), ("f", 2.0, "kHz")])).0,
        4.0,
    );
    near(
        value(&law(
            LawTarget::Path,
            "a * cos(departure_azimuth_deg - p)",
            vec![("a", 2.0, "dB"), ("p", 30.0, "deg")],
        ))
        .0,
        1.0,
    );
    // A delay is in milliseconds, whatever the units of its parts.
    let (found, slope) = value(&law(LawTarget::Delay, "a * length_m", vec![("a", 2.0, "us/m")]));
    near(found, 0.5);
    near(slope[0], 0.25);
}

/// Texts of the grammar's own words in any order.
fn soups() -> impl Strategy<Value = String> {
    let words = vec![
        "a",
        "b",
        "length_m",
        "frequency_hz",
        "hits(",
        "hits(wall)",
        "exp(",
        "min(",
        "resonance(",
        "(",
        ")",
        ")",
        ",",
        "+",
        "-",
        "*",
        "/",
        "^",
        "1",
        "2e",
        "2e-",
        ".",
        "0",
        "1e308",
        " ",
        "é",
        "above(",
        "departure_azimuth_deg",
        "cos(",
    ];
    prop::collection::vec(prop::sample::select(words), 0..40).prop_map(|words| words.concat())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// What the fuzz target `laws` asks of arbitrary texts.
    #[test]
    fn any_text_is_a_law_that_prints_as_itself_or_an_error_with_a_column(
        text in prop_oneof![soups(), any::<String>(), soups().prop_map(|soup| format!("a*({soup})+a"))],
    ) {
        let parameters = || [("a", LawParameter::new(1.0, [0.0, 2.0], "dB"))];
        match Law::new("l", LawTarget::Path, None, &text, parameters()) {
            Ok(law) => {
                let again = Law::new("l", LawTarget::Path, None, &law.printed(), parameters()).unwrap();
                prop_assert_eq!(again.printed(), law.printed());
                if let Ok((value, gradient)) = law.value_and_gradient(|_| Some(1.0)) {
                    prop_assert!(value.is_finite() && gradient.iter().all(|slope| slope.is_finite()));
                }
            }
            Err(error) => {
                let unused = matches!(error.fault, sabine_paths::laws::LawFault::UnusedParameter(_));
                let within = error.column.is_some_and(|column| column >= 1 && column <= text.chars().count() + 1);
                prop_assert!(unused || within, "{error}: {text}");
            }
        }
    }
}

/// A parameter is the amplitude if doubling it doubles the law, whatever else stands in it.
#[test]
fn the_amplitude_is_what_the_whole_law_is_proportional_to() {
    let of = |formula: &str| {
        let parameters = ["a", "k"].into_iter().filter(|name| formula.contains(name));
        let parameters = parameters.map(|name| (name, LawParameter::new(2.0, [0.0, 9.0], "dB")));
        let law = Law::new("l", LawTarget::Path, None, formula, parameters).unwrap();
        let amplitude = law.amplitude().map(str::to_owned);
        if let Some(name) = &amplitude {
            let values: Vec<f64> =
                law.parameters().map(|(own, p)| if own == name { 4.0 } else { p.value }).collect();
            let at = |law: &Law| law.value(|_| Some(0.7)).unwrap();
            let (once, twice) = (at(&law), at(&law.with_values(&values).unwrap()));
            assert!((twice - 2.0 * once).abs() < 1e-12 && once != 0.0, "{formula}: {once} {twice}");
        }
        amplitude
    };
    for formula in ["-a * reflections", "a / 2 + a * reflections", "scatterings * (a - 3 * a)"] {
        assert_eq!(of(formula).as_deref(), Some("a"), "{formula}");
    }
    // Of two the first by name; proportional to the second alone.
    assert_eq!(of("k * (1 + (a / k) * 0) * a / k").as_deref(), None);
    assert_eq!(of("k * exp(-a / k) + 0 * a").as_deref(), None);
    assert_eq!(of("k * cos(a / a)").as_deref(), Some("k"));
    for formula in ["a + 1 * k", "abs(a)", "max(a, k)", "a ^ 1", "a * a / a", "k * k / a"] {
        assert_eq!(of(formula), None, "{formula}");
    }
}

#[test]
fn a_law_times_a_number_has_that_number_as_a_parameter() {
    let parameters =
        [("a", LawParameter::new(2.0, [0.0, 3.0], "dB")), ("b", LawParameter::new(1.0, [0.0, 2.0], "dB"))];
    let law = Law::new("l", LawTarget::Path, None, "a * reflections + b", parameters)
        .unwrap()
        .with_words("Louder.");
    assert_eq!(law.amplitude(), None);
    let twice = law.times("strength", LawParameter::new(2.0, [-3.0, 3.0], "1")).unwrap();
    assert_eq!((twice.amplitude(), twice.words(), twice.id()), (Some("strength"), "Louder.", "l"));
    let at = |law: &Law| law.value(|_| Some(5.0)).unwrap();
    assert_eq!((at(&law), at(&twice)), (11.0, 22.0));
    let taken = law.times("a", LawParameter::new(2.0, [-3.0, 3.0], "1")).unwrap_err();
    assert!(taken.to_string().contains("parameters.a"), "{taken}");
}
