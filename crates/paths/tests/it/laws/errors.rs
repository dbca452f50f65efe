//! What is wrong with a law is said with its name and the column of its formula.

use sabine_acoustics::{Air, Bands, Material};
use sabine_paths::laws::{BoundLaws, Law, LawError, LawFault, LawParameter, LawSite, LawTarget};
use sabine_scene::{Receiver, Scene, Source};

fn parameter(unit: &str) -> LawParameter {
    LawParameter::new(1.0, [0.0, 2.0], unit)
}

fn path_law(formula: &str) -> Result<Law, LawError> {
    let parameters = [("a", parameter("dB")), ("l0", parameter("m")), ("n", parameter("1"))];
    let used = parameters.into_iter().filter(|(name, _)| {
        formula.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').any(|word| word == *name)
    });
    Law::new("mine", LawTarget::Path, None, formula, used)
}

#[test]
fn formulas_that_cannot_be_read_say_where() {
    for (formula, column, words) in [
        ("", 1, "a number, a name, `-` or `(` is expected, not the end"),
        ("a +", 4, "not the end"),
        ("a + + a", 5, "not `+`"),
        ("a * lenght_m", 5, "the nearest name is `length_m`"),
        ("a * zzzzzzzzzz", 5, "neither a variable nor a parameter of this law"),
        ("a * sinh(n)", 5, "there is no function `sinh`"),
        ("a * system(1)", 5, "there is no function `system`"),
        ("a * (1 + n", 11, "`)` or an operator is expected, not the end"),
        ("a)", 2, "not `)`"),
        ("a * min(n)", 5, "`min` takes 2 arguments, not 1"),
        ("a * exp(n, n)", 5, "`exp` takes 1 arguments, not 2"),
        ("a * exp n", 9, "`(` is expected"),
        ("a ; a", 3, "no formula has the character ';'"),
        ("a * é", 5, "no formula has the character 'é'"),
        ("a * 1.2.3", 5, "`1.2.3` is no finite number"),
        ("a * 1e999", 5, "`1e999` is no finite number"),
        ("a * 2 n", 7, "an operator or the end is expected"),
        ("a * hits()", 10, "the name of a material"),
        ("a * source", 11, "`(` and the name of a source"),
        ("a * receiver(r(1))", 14, "the name of a receiver"),
        ("a * hits", 9, "`(` and the name of a material"),
        ("a * cos_incidence", 5, "a law of `path` has no variable `cos_incidence`"),
        ("a * level_db", 5, "has no variable `level_db`"),
    ] {
        let error = path_law(formula).expect_err(formula);
        assert_eq!((error.law.as_str(), error.column), ("mine", Some(column)), "{formula}: {error}");
        assert!(error.to_string().contains(words), "{formula}: {error}");
    }
}

#[test]
fn units_that_do_not_go_together_say_where() {
    for (formula, column, words) in [
        ("a * length_m", 3, "a law of `path` gives dB; this formula gives dB m"),
        ("n", 1, "gives a pure number"),
        ("a + length_m", 3, "dB and m do not go together"),
        ("a * exp(length_m)", 5, "exp needs a pure number, not m: divide by a parameter of the same unit"),
        ("a * ln(length_m / l0 * l0)", 5, "ln needs a pure number"),
        ("a * cos(length_m)", 5, "cos needs a pure number"),
        ("a * 2^length_m", 6, "an exponent needs a pure number"),
        ("a * (length_m / l0)^n * l0^n", 27, "a power of m needs a number written out"),
        ("a * length_m^0.3 / l0^0.3", 13, "a power of m"),
        ("a * above(length_m, n)", 5, "m and a pure number do not go together"),
        ("a * min(length_m, time_s)", 5, "m and s do not go together"),
        ("a * resonance(frequency_hz, n, n)", 5, "s^-1 and a pure number"),
    ] {
        let error = path_law(formula).expect_err(formula);
        assert_eq!(error.column, Some(column), "{formula}: {error}");
        assert!(error.to_string().contains(words), "{formula}: {error}");
    }
    for formula in [
        "a * exp(-length_m / l0)",
        "a * sqrt(length_m / l0)",
        "a * sqrt(length_m) / sqrt(l0)",
        "a * length_m^(1) / l0",
        "a * frequency_hz * time_s",
        "max(0, a * n)",
        "0",
        "a * cos(departure_azimuth_deg) * cos(n)",
    ] {
        path_law(formula).unwrap_or_else(|error| panic!("{formula}: {error}"));
    }
}

#[test]
fn a_million_brackets_are_one_error() {
    let million = 1_000_000;
    for formula in [
        "(".repeat(million),
        "-".repeat(million),
        "exp(".repeat(million),
        "2^".repeat(million),
        format!("a{}", "+a".repeat(million)),
        "(".repeat(100),
        "-".repeat(100),
        "2^".repeat(100),
        format!("{}n{}", "exp(".repeat(100), ")".repeat(100)),
    ] {
        let error = path_law(&formula).unwrap_err();
        let long = formula.len() > 2000;
        let expected = if long { LawFault::TooLong { max: 2000 } } else { LawFault::TooDeep { max: 64 } };
        assert_eq!(error.fault, expected, "{error}");
    }
    let unit = "(".repeat(million);
    let error = Law::new("l", LawTarget::Path, None, "a", [("a", parameter(&unit))]).unwrap_err();
    assert!(matches!(error.fault, LawFault::UnknownUnit { .. }));
    // As long as may be, it is read, checked and printed.
    let longest = format!("a{}", "+a".repeat(999));
    assert_eq!(path_law(&longest).unwrap().value(|_| None).unwrap(), 1000.0);
    assert_eq!(path_law(&longest).unwrap().printed().matches('a').count(), 1000);
}

#[test]
fn parameters_have_names_units_and_intervals() {
    let law =
        |name: &str, parameter| Law::new("l", LawTarget::Path, None, name, [(name.to_owned(), parameter)]);
    let range = |value, low, high| LawParameter::new(value, [low, high], "dB");
    assert!(law("a", range(1.0, 1.0, 1.0)).is_ok());
    for (parameter, words) in [
        (range(3.0, 0.0, 2.0), "parameters.a: 3 lies outside its interval from 0 to 2"),
        (range(f64::NAN, 0.0, 2.0), "lies outside"),
        (range(1.0, 2.0, 0.0), "low not above high"),
        (range(1.0, f64::NEG_INFINITY, 2.0), "must be finite"),
        (range(1.0, 0.0, f64::NAN), "must be finite"),
        (LawParameter::new(1.0, [0.0, 2.0], "furlong"), "`furlong` is no unit"),
    ] {
        let error = law("a", parameter).unwrap_err();
        assert_eq!(error.column, None);
        assert!(error.to_string().contains(words), "{error}");
    }
    for name in ["length_m", "exp", "hits", "source", "receiver", "1a", "a b", "", "ä"] {
        assert!(
            matches!(law(name, range(1.0, 0.0, 2.0)).unwrap_err().fault, LawFault::BadParameterName(_)),
            "{name}"
        );
    }
    let unused = Law::new("l", LawTarget::Path, None, "a", [("a", parameter("dB")), ("b", parameter("dB"))]);
    assert_eq!(unused.unwrap_err().fault, LawFault::UnusedParameter("b".to_owned()));
    assert!(path_law("a").unwrap().with_values(&[2.5]).is_err());
    assert_eq!(path_law("a").unwrap().with_values(&[1.5]).unwrap().value(|_| None).unwrap(), 1.5);
}

#[test]
fn surfaces_and_targets_go_together() {
    let law = |target, surface| Law::new("l", target, surface, "0", Vec::<(String, LawParameter)>::new());
    assert_eq!(law(LawTarget::Reflection, None).unwrap_err().fault, LawFault::NoSurface);
    assert_eq!(
        law(LawTarget::Path, Some("floor")).unwrap_err().fault,
        LawFault::SurfaceNotWanted(LawTarget::Path)
    );
    for id in ["", "a b", "x/../y", &"x".repeat(65)] {
        let error = Law::new(id, LawTarget::Path, None, "0", Vec::<(String, LawParameter)>::new());
        assert_eq!(error.unwrap_err().fault, LawFault::BadIdentifier, "{id}");
    }
}

#[test]
fn names_of_ends_are_those_of_the_room() {
    let bind = |formula: &str, site: &LawSite| BoundLaws::new(&[path_law(formula).unwrap()], site);
    // Nobody said which there are.
    assert!(bind("a * receiver(mic)", &site()).is_ok());
    let receivers = ["r", "left ear"].map(|id| Receiver::omni(id, [2.0; 3]).unwrap());
    let among = site().among(&[Source::omni("s", [1.0; 3]).unwrap()], &receivers);
    for formula in ["a * receiver(r)", "a * receiver( left ear )", "a * source(s)"] {
        assert!(bind(formula, &among).is_ok(), "{formula}");
    }
    let error = bind("a + a * receiver(left eat)", &among).unwrap_err();
    assert_eq!(error.column, Some(9));
    assert!(error.to_string().contains("no receiver `left eat`; the nearest name is `left ear`"), "{error}");
    let error = bind("a * source(r)", &among).unwrap_err();
    assert!(error.to_string().contains("the room has no source `r`"), "{error}");
    for (name, value) in [("receiver(r)", Some(1.0)), ("receiver(s)", Some(0.0)), ("source(s)", Some(1.0))] {
        assert_eq!(among.variable(name), value, "{name}");
    }
    assert_eq!((among.variable("hits(floor)"), among.variable("receiver(r")), (None, None));
}

fn site() -> LawSite {
    let bands = Bands::octaves(1000.0, 1000.0).unwrap();
    let wall = Material::uniform(bands, 0.1, 0.1).unwrap();
    // Materials of a box are named after its faces.
    let scene = Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(|_| wall.clone())).unwrap();
    let (source, receiver) = (Source::omni("s", [1.0; 3]).unwrap(), Receiver::omni("r", [2.0; 3]).unwrap());
    LawSite::new(&scene, &source, &receiver, &Air::default())
}

#[test]
fn what_a_room_does_not_know_is_an_error() {
    for (formula, column, words) in [
        ("a * hits(flor)", 5, "the mesh has no material `flor`; the nearest name is `floor`"),
        (
            "a * mean_height_m / l0",
            5,
            "`mean_height_m` is not known: traced paths do not record their heights",
        ),
        ("a * departure_cos", 5, "the source has no axis"),
        ("a * arrival_cos", 5, "the receiver has no axis"),
        ("a * recording_order", 5, "nobody said in which order"),
        ("a / (n - n)", 3, "division by zero"),
        ("a * ln(-n)", 5, "ln gives no finite number"),
        ("a * exp(1000 * n)", 5, "exp gives no finite number"),
        ("a * 10^(400 * n)", 7, "^ gives no finite number"),
        ("a * sqrt(-n)", 5, "sqrt gives no finite number"),
    ] {
        let error = BoundLaws::new(&[path_law(formula).unwrap()], &site()).expect_err(formula);
        assert_eq!(error.column, Some(column), "{formula}: {error}");
        assert!(error.to_string().contains(words), "{formula}: {error}");
    }
    let none = || Vec::<(String, LawParameter)>::new();
    let on = |surface: &str| Law::new("l", LawTarget::Reflection, Some(surface), "0", none()).unwrap();
    let fault = |law: Law| BoundLaws::new(&[law], &site()).unwrap_err().fault;
    assert!(matches!(fault(on("carpet")), LawFault::UnknownSurface { .. }));
    assert!(matches!(fault(on("floor@z0")), LawFault::NotKnown { variable: "material@plane", .. }));
    assert!(BoundLaws::new(&[on("floor")], &site()).is_ok());
    let twice = BoundLaws::new(&[on("floor"), on("ceiling")], &site()).unwrap_err();
    assert_eq!(twice.fault, LawFault::Twice);
    let many: Vec<Law> =
        (0..33).map(|i| Law::new(format!("l{i}"), LawTarget::Path, None, "0", none()).unwrap()).collect();
    assert_eq!(BoundLaws::new(&many, &site()).unwrap_err().fault, LawFault::TooMany { max: 32 });
}
