#!/usr/bin/env bash
# Builds the page and tests it in a headless browser. Skips with a message where the target, wasm-bindgen, node or a browser is missing.
#
#   crates/wasm/test_page.sh [PAGE.html]    with a file: tests that page and builds none
#
# CHROMIUM names the browser; PLAYWRIGHT a folder with node_modules/playwright-core, which is else installed for the test; SCREENSHOT a
# file for a picture of the page.
set -euo pipefail
page=${1:+$(realpath "$1")}
cd "$(dirname "$0")"

skip() {
    echo "browser page: skipped, $1"
    exit 0
}

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
command -v node >/dev/null || skip "there is no node"
browser=${CHROMIUM:-}
for name in chromium chromium-browser google-chrome; do
    [ -n "$browser" ] || browser=$(command -v "$name" || true)
done
[ -n "$browser" ] || skip "there is no Chromium"
if [ -z "$page" ]; then
    rustup target list --installed 2>/dev/null | grep -qx wasm32-unknown-unknown \
        || skip "the target wasm32-unknown-unknown is not installed"
    command -v wasm-bindgen >/dev/null || skip "there is no wasm-bindgen"
    page=$scratch/sabine.html
    ./build_page.sh "$page"
fi
modules=${PLAYWRIGHT:-$scratch/node}
if [ ! -d "$modules/node_modules/playwright-core" ]; then
    mkdir -p "$modules"
    npm install --silent --no-audit --no-fund --prefix "$modules" playwright-core@1 >/dev/null 2>&1 \
        || skip "playwright-core cannot be installed"
fi
NODE_MODULES=$modules/node_modules BROWSER=$browser FIXTURES=$PWD/../../fixtures SOFA=$PWD/../scene/tests/sofa \
    node tests/page.mjs "$page" "$scratch"
