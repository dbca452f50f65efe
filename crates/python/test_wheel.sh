#!/usr/bin/env bash
# Builds the wheel, installs it into a new virtual environment and runs the tests there. Skips with a message where there is no Python, or
# where maturin and numpy cannot be installed.
#
#   crates/python/test_wheel.sh             the wheel, as the nightly run does it
#   crates/python/test_wheel.sh FOLDER      builds it with optimisation for users, and leaves it there
#   crates/python/test_wheel.sh --module    the module without a wheel, from what the tests of the workspace have compiled, as the gate does it
set -euo pipefail
only_module=
if [ "${1:-}" = --module ]; then
    only_module=yes
    shift
fi
folder=${1:+$(realpath -m "$1")}
cd "$(dirname "$0")"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/../../target}"
most_bytes=15000000

skip() {
    echo "python wheel: skipped, $1"
    exit 0
}

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
command -v python3 >/dev/null || skip "there is no python3"
python3 -c 'import sys; sys.exit(sys.version_info < (3, 9))' || skip "python3 is older than 3.9"
python3 -m venv "$scratch/env" 2>/dev/null || skip "python3 has no venv"
python=$scratch/env/bin/python
install() {
    "$python" -m pip install --quiet --disable-pip-version-check "$@"
}
tests=$PWD/tests
run_tests() {
    # From elsewhere: what is tested is what was installed.
    cd "$scratch"
    "$python" -I -W error -m unittest discover --start-directory "$tests"
}

if [ -n "$only_module" ]; then
    install 'numpy>=1.22' || skip "numpy cannot be installed"
    # With an example, dependencies have the features that they have for tests: nothing but the module is compiled.
    cargo build --quiet --locked --workspace --lib --example log_mel
    module=$CARGO_TARGET_DIR/debug/lib_sabine.so
    [ "$(uname)" != Darwin ] || module=${module%.so}.dylib
    [ -f "$module" ] || skip "no module for this system"
    site=$("$python" -c 'import sysconfig; print(sysconfig.get_path("platlib"))')
    cp -r python/sabine "$site/"
    cp "$module" "$site/sabine/_sabine.abi3.so"
    run_tests
    exit
fi
install 'maturin>=1.7,<2' 'numpy>=1.22' || skip "maturin and numpy cannot be installed"

# The profile of the tests is optimised, and quick to build after them.
profile=dev
wheels=$scratch/wheels
if [ -n "$folder" ]; then
    profile=release
    wheels=$folder
fi
"$scratch/env/bin/maturin" build --quiet --locked --strip --profile "$profile" --out "$wheels"

wheel=$(ls -t "$wheels"/sabine_py-*-abi3-*.whl | head -n 1)
bytes=$(wc -c < "$wheel")
echo "$(basename "$wheel"): $bytes bytes"
[ "$bytes" -lt "$most_bytes" ] || { echo "the wheel is larger than $most_bytes bytes"; exit 1; }

install --no-index --no-deps "$wheel"
run_tests
