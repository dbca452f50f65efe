//! A short soak: memory stays flat over calls, and a leak would be seen.

use std::process::{Command, Output};

fn soak(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_soak")).args(arguments).output().unwrap()
}

#[test]
fn twenty_matches_hold_no_more_memory_than_ten() {
    let output = soak(&["--calls", "20", "--rays", "200", "--limit-mib", "4"]);
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{printed}{}", String::from_utf8_lossy(&output.stderr));
    assert!(printed.contains("20 calls") && printed.trim_end().ends_with("flat"), "{printed}");
}

#[test]
#[ignore = "nightly: half a minute of the processor, to see that the test above can fail"]
fn a_megabyte_kept_by_each_match_is_seen() {
    let output = soak(&["--calls", "20", "--rays", "200", "--limit-mib", "4", "--leak-kib", "1024"]);
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(!output.status.success() && printed.contains("it grows"), "{printed}");
}
