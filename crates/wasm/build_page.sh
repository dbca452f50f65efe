#!/usr/bin/env bash
# Makes the page: one HTML file that holds everything, opens from a disk and asks the network for nothing.
#
#   crates/wasm/build_page.sh FILE.html
#
# Needs the target wasm32-unknown-unknown and the command wasm-bindgen in the version of Cargo.lock. wasm-opt would take off 3 %.
set -euo pipefail
out=$(realpath -m "${1:?the name of the file to write}")
cd "$(dirname "$0")"
root=$PWD/../..
target=${CARGO_TARGET_DIR:-$root/target}
limit_bytes=3000000

version=$(sed -n '/^name = "wasm-bindgen"$/{n;s/version = "\(.*\)"/\1/p}' "$root/Cargo.lock")
found=$(wasm-bindgen --version 2>/dev/null || echo none)
[ "$found" = "wasm-bindgen $version" ] || {
    echo "wasm-bindgen $version is needed, found: $found (cargo install wasm-bindgen-cli --version $version)" >&2
    exit 1
}
cargo build --quiet --locked --profile page --target wasm32-unknown-unknown --package sabine-wasm

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
wasm-bindgen --target no-modules --no-typescript --remove-name-section --out-dir "$scratch" \
    "$target/wasm32-unknown-unknown/page/sabine_wasm.wasm"
module=$scratch/sabine_wasm_bg.wasm
cat "$scratch/sabine_wasm.js" page/worker.js > "$scratch/worker.js"
gzip -9 --no-name --stdout "$module" | base64 --wrap 0 > "$scratch/module"

# A mark in the page, alone between comment signs, is replaced by a file.
awk -v dir="$scratch" '
    function put(file,   line) { while ((getline line < file) > 0) print line; close(file) }
    {
        if (!match($0, /\/\*(STYLE|WORKER|MODULE|PAGE)\*\//)) { print; next }
        mark = substr($0, RSTART + 2, RLENGTH - 4)
        printf "%s", substr($0, 1, RSTART - 1)
        rest = substr($0, RSTART + RLENGTH)
        if (mark == "STYLE") put("page/style.css")
        if (mark == "WORKER") put(dir "/worker.js")
        if (mark == "MODULE") put(dir "/module")
        if (mark == "PAGE") put("page/page.js")
        print rest
    }' page/index.html > "$scratch/page.html"
mkdir -p "$(dirname "$out")"
mv "$scratch/page.html" "$out"
bytes=$(wc -c < "$out")
echo "$out: $bytes bytes (module: $(wc -c < "$module") bytes before compression)"
[ "$bytes" -lt "$limit_bytes" ] || { echo "the page is larger than $limit_bytes bytes" >&2; exit 1; }
