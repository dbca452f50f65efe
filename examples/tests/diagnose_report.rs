//! The pages and words of the example `diagnose`, whose own tests a program cannot run.
#![allow(clippy::unwrap_used)] // a panic is how a test fails
#![allow(dead_code)] // the program uses what these tests do not

#[path = "../diagnose/bars.rs"]
mod bars;
#[path = "../diagnose/findings.rs"]
mod findings;
#[path = "../diagnose/held_out.rs"]
mod held_out;
#[path = "../diagnose/look_alikes.rs"]
mod look_alikes;
#[path = "../diagnose/report.rs"]
mod report;
#[path = "../diagnose/report_tests.rs"]
mod report_tests;
#[path = "../diagnose/residual_map.rs"]
mod residual_map;
#[path = "../diagnose/words.rs"]
mod words;
