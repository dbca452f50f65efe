//! The programs behind the tables of `docs/validation`: how often hidden effects are found, how well materials are fitted, what is
//! rendered from speech in real rooms, whether memory stays flat. Not published; run them with `cargo run --release -p sabine-validation --bin NAME`.
