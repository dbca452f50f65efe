//! Any text as a file of laws: laws that print as themselves and have a finite value or an error, or an error.

#![no_main]

use libfuzzer_sys::fuzz_target;
use sabine_paths::laws::Law;
use serde::Deserialize;

#[derive(Deserialize)]
struct File {
    laws: Vec<Law>,
}

fuzz_target!(|text: &str| {
    // A formula alone gets further than a whole file does.
    let none = std::iter::empty::<(String, _)>();
    let alone = Law::new("law", sabine_paths::laws::LawTarget::Path, None, text, none);
    let of_file = toml::from_str::<File>(text).map_or_else(|_| Vec::new(), |file| file.laws);
    for law in of_file.into_iter().chain(alone) {
        let printed = law.printed();
        let parameters = law.parameters().map(|(name, parameter)| (name.to_owned(), parameter.clone()));
        let again = Law::new(law.id(), law.target(), law.surface(), &printed, parameters);
        // What is printed may be longer than what may be read, by its blanks.
        if let Ok(again) = again {
            assert_eq!(again.printed(), printed);
        } else {
            assert!(printed.chars().count() > 2000, "{printed}");
        }
        if let Ok((value, gradient)) = law.value_and_gradient(|_| Some(1.0)) {
            assert!(value.is_finite() && gradient.iter().all(|slope| slope.is_finite()));
        }
    }
});
