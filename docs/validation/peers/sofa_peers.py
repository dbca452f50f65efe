#!/usr/bin/env python3
"""SOFA files of `sabine export` read by Python's sofar, netCDF4 and h5py, and files of sofar read by `sabine import`.

    cargo build -p sabine-cli
    python3 docs/validation/peers/sofa_peers.py [SABINE]

Needs Python 3.11, sofar 1.3, netCDF4 1.7.2, h5py, soundfile, numpy. A room of the golden files of `crates/scene/tests/sofa` is made,
exported in both conventions, read by each program and compared sample by sample; then what sofar writes again goes back.
"""
import os
import subprocess
import sys
import tempfile
import tomllib

import h5py
import netCDF4
import numpy as np
import sofar
import soundfile

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..")
SABINE = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "target/debug/sabine")
GOLDEN = os.path.join(ROOT, "crates/scene/tests/sofa")


def sabine(*arguments):
    subprocess.run([SABINE, *arguments], check=True, stdout=subprocess.DEVNULL)


def room(folder):
    with open(os.path.join(folder, "room.toml"), "rb") as file:
        table = tomllib.load(file)
    return table, [soundfile.read(os.path.join(folder, r["file"]), dtype="float64")[0] for r in table["responses"]]


def positions(table, response):
    place = {kind: {p["id"]: p["position_m"] for p in table[kind]} for kind in ("sources", "receivers")}
    return place["sources"][response["source"]], place["receivers"][response["receiver"]]


def main():
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        path = lambda name: os.path.join(folder, name)
        for golden, flags, size in (("pairs.sofa", ["--cut"], []), ("grid.sofa", ["--grid"], ["--size", "5x4x3"])):
            first, file, again, second = path(golden + "_1"), path(golden), path("again_" + golden), path(golden + "_2")
            sabine("import", os.path.join(GOLDEN, golden), *size, "--out", first)
            sabine("export", "--room", first, *flags, "--out", file)
            table, sounds = room(first)
            length = min(len(sound) for sound in sounds)
            expected = [sound[:length] for sound in sounds]
            read = sofar.read_sofa(file, verify=True)  # raises where the standard is not met
            ir = np.asarray(read.Data_IR)
            if ir.ndim == 4:
                found = [ir[0, r, :, e] for r in range(ir.shape[1]) for e in range(ir.shape[3])]
                places = [(read.EmitterPosition[e, :, 0], read.ReceiverPosition[r, :, 0]) for r in range(ir.shape[1]) for e in range(ir.shape[3])]
            else:
                found = list(ir[:, 0, :])
                places = list(zip(read.SourcePosition, read.ListenerPosition))
            samples = max(np.abs(a - b).max() for a, b in zip(found, expected, strict=True))
            metres = max(np.abs(np.array(positions(table, r)) - np.array(p)).max() for r, p in zip(table["responses"], places, strict=True))
            with netCDF4.Dataset(file) as nc:
                dimensions = nc.variables["Data.IR"].dimensions
                samples = max(samples, np.abs(nc.variables["Data.IR"][:] - ir).max())
            with h5py.File(file) as h5:
                scales = [h5["Data.IR"].dims[k][0].name.lstrip("/") for k in range(ir.ndim)]
                samples = max(samples, np.abs(h5["Data.IR"][...] - ir).max())
            assert scales == list(dimensions), (scales, dimensions)
            sofar.write_sofa(again, read)
            sabine("import", again, "--size", "6x5x3", "--out", second)
            back = max(np.abs(a - b).max() for a, b in zip(room(second)[1], expected, strict=True))
            rows.append((read.GLOBAL_SOFAConventions, len(expected), "".join(dimensions), samples, metres, back))
    print(f"sofar {sofar.__version__}, netCDF4 {netCDF4.__version__}, h5py {h5py.__version__}\n")
    print("| convention | responses | dimensions of Data.IR | samples, largest difference | positions (m) | samples there and back |\n|---|---|---|---|---|---|")
    for name, count, dimensions, samples, metres, back in rows:
        print(f"| {name} | {count} | {dimensions} | {samples:g} | {metres:g} | {back:g} |")


if __name__ == "__main__":
    main()
