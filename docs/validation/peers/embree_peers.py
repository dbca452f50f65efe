"""Closest hits per second of Sabine and of Embree 4 by its native interface, default and robust. Prints a table of
docs/validation/propagate.md.

    cargo bench -p sabine-propagate --bench against_peers --no-run     # build first: compiling disturbs the clock
    pip install embreex                                                # for the library inside; a C compiler is needed, too
    python docs/validation/peers/embree_peers.py [ROUNDS]

The same 262,144 rays and triangles, one ray at a time on one thread, Embree's in single precision. Each engine has its turn in each of
ROUNDS rounds (5); the table shows medians of the rounds' medians of seven, in time on the processor.
"""

import importlib.metadata
import importlib.util
import json
import platform
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
MODES = {"default": "0", "robust": "4"}


def compiled(folder):
    """The C program, bound to the library that comes with embreex."""
    package = Path(importlib.util.find_spec("embreex").origin).parent
    libraries = package.parent / "embreex.libs"
    library = next(libraries.glob("libembree4*"))
    program = Path(folder, "embree_hits")
    command = ["cc", "-O2", "-o", program, HERE / "embree_hits.c", library, f"-Wl,-rpath,{libraries}"]
    subprocess.run(command, check=True)
    return program


def ours(folder):
    command = ["cargo", "bench", "-q", "-p", "sabine-propagate", "--bench", "against_peers", "--", folder, "hits"]
    printed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [json.loads(line) for line in printed.splitlines() if line.startswith("{")]


def main():
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    rates, lost = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        program = compiled(folder)
        for _ in range(rounds):
            for line in ours(folder):
                scene = line["scene"]
                rates.setdefault((scene, "sabine"), []).append(line["sabine"])
                for mode, flags in MODES.items():
                    command = [program, folder, scene, "rays.f32", flags, "7"]
                    done = subprocess.run(command, check=True, capture_output=True, text=True)
                    hits = json.loads(done.stdout)
                    assert abs(hits["mean_m"] / line["mean_m"] - 1.0) < 1e-3, "Embree sees another scene"
                    rates.setdefault((scene, mode), []).append(hits["per_s"])
                    lost[scene, mode] = hits["lost"]
    print(f"embreex {importlib.metadata.version('embreex')}, {platform.machine()}, {rounds} rounds")
    print("| triangles | Sabine (M/s) | Embree (M/s), rays lost | Embree robust (M/s), rays lost | share of robust |")
    print("|---|---|---|---|---|")
    for scene in dict.fromkeys(scene for scene, _ in rates):
        rate = {who: statistics.median(rates[scene, who]) / 1e6 for who in ["sabine", *MODES]}
        print(
            f"| {scene.replace('_', ', ')} | {rate['sabine']:.2f} | {rate['default']:.2f}, {lost[scene, 'default']} "
            f"| {rate['robust']:.2f}, {lost[scene, 'robust']} | {100 * rate['sabine'] / rate['robust']:.0f} % |"
        )


if __name__ == "__main__":
    main()
