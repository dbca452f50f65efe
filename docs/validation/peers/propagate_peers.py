"""Rays and paths per second of Sabine and of its peers, in one run. Prints the tables of docs/validation/propagate.md.

    cargo bench -p sabine-propagate --bench against_peers --no-run     # build first: compiling disturbs the clock
    pip install numpy embreex pyroomacoustics misuka
    python docs/validation/peers/propagate_peers.py

embreex is a binding to Embree 4 and pyroomacoustics a C++ tracer; misuka (PolyForm Noncommercial) traces through Embree 3.
misuka compiles through LLVM and needs a newer one than 15 (DRJIT_LIBLLVM_PATH names the library).
One thread each, unless said otherwise; medians of five after one to warm up. A peer that is not installed is left out.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "RAYON_NUM_THREADS": "1"}
os.environ.update(ONE_THREAD)

import numpy as np  # noqa: E402  (after the number of threads is set)

ROOT = Path(__file__).resolve().parents[3]
SIZE_M, SOURCE_M, RECEIVER_M = [10.0, 7.0, 3.0], [2.0, 3.0, 1.5], [7.0, 4.0, 1.6]
ABSORPTION, RAYS, DURATION_S = 0.1, 10_000, 1.5
OCTAVES_HZ = [62.5, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0]


def median_s(work):
    def once():
        start = time.perf_counter()
        work()
        return time.perf_counter() - start

    once()
    return statistics.median(once() for _ in range(5))


def ours(folder):
    command = ["cargo", "bench", "-q", "-p", "sabine-propagate", "--bench", "against_peers", "--", folder]
    printed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [json.loads(line) for line in printed.splitlines() if line.startswith("{")]


def embree(folder, scene):
    """Closest hits per second and their mean distance: the same triangles and rays, in single precision."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    rays = np.fromfile(Path(folder, "rays.f32"), np.float32).reshape(-1, 6)
    vertices = np.fromfile(Path(folder, f"{scene}.vertices.f32"), np.float32).reshape(-1, 3)
    triangles = np.fromfile(Path(folder, f"{scene}.triangles.u32"), np.uint32).reshape(-1, 3)
    world = rtcore_scene.EmbreeScene()
    TriangleMesh(world, vertices, triangles.astype(np.int32))
    origins, directions = np.ascontiguousarray(rays[:, :3]), np.ascontiguousarray(rays[:, 3:])
    hits = world.run(origins, directions, query="INTERSECT", output=True)
    # Without output=True the binding returns the triangle alone; both fill in the normal.
    seconds = median_s(lambda: world.run(origins, directions, query="INTERSECT"))
    return len(rays) / seconds, float(np.mean(hits["tfar"], dtype=np.float64))


def pyroomacoustics(scattering):
    """Rays per second over eight octaves."""
    import pyroomacoustics as pra

    pra.constants.set("num_threads", 1)
    coefficients = {"coeffs": [ABSORPTION] * 8, "center_freqs": OCTAVES_HZ}
    scattered = {"coeffs": [max(scattering, 1e-9)] * 8, "center_freqs": OCTAVES_HZ}
    material = pra.Material(energy_absorption=coefficients, scattering=scattered)

    def trace():
        room = pra.ShoeBox(
            SIZE_M, fs=32_000, materials=material, max_order=3, ray_tracing=True, air_absorption=True
        )
        room.set_ray_tracing(n_rays=RAYS, time_thres=DURATION_S, energy_thres=1e-12, receiver_radius=0.5)
        room.add_source(SOURCE_M)
        room.add_microphone(RECEIVER_M)
        room.image_source_model()
        room.ray_tracing()

    return RAYS / median_s(trace)


def misuka(scattering):
    """Paths per second over eight octaves, in the compiled variant."""
    import misuka as mi

    mi.set_variant("llvm_ad_acoustic")
    import drjit as dr

    dr.set_thread_count(1)
    spectrum = lambda value: {"type": "spectrum", "value": [(f, value) for f in OCTAVES_HZ]}  # noqa: E731
    centre, half = [s / 2 for s in SIZE_M], [s / 2 for s in SIZE_M]
    place = mi.ScalarTransform4f
    scene = mi.load_dict(
        {
            "type": "scene",
            "walls": {
                "type": "cube",
                "flip_normals": True,
                "to_world": place().translate(centre).scale(half),
                "bsdf": {
                    "type": "acousticbsdf",
                    "absorption": spectrum(ABSORPTION),
                    "scattering": spectrum(max(scattering, 1e-6)),  # it refuses 0
                },
            },
            "source": {
                "type": "sphere",
                "center": SOURCE_M,
                "radius": 0.25,
                "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 1.0}},
            },
            "receiver": {
                "type": "microphone",
                "to_world": place().translate(RECEIVER_M),
                "film": {
                    "type": "tape",
                    "frequencies": ", ".join(map(str, OCTAVES_HZ)),
                    "time_bins": 1500,
                    "rfilter": {"type": "box"},
                },
            },
            "integrator": {
                "type": "acoustic_path",
                "max_time": DURATION_S,
                "speed_of_sound": 343.0,
                "max_depth": -1,
                "max_energy_loss": -1.0,
            },
        }
    )
    samples = RAYS
    count = iter(range(1000))

    def trace():
        image = mi.render(scene, spp=samples, seed=next(count))
        dr.eval(image)
        dr.sync_thread()

    # Each octave is a row of the film, and each row gets its own samples.
    return samples * len(OCTAVES_HZ) / median_s(trace)


def attempt(name, *arguments):
    """What a peer returns, in a process of its own: one that aborts, or is absent, leaves a gap in the table."""
    command = [sys.executable, __file__, name, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        print(f"{name}: exit status {done.returncode}: {last}", file=sys.stderr)
        return None
    return json.loads(done.stdout.splitlines()[-1])


def number(value, digits=0):
    return "-" if value is None else f"{value:,.{digits}f}"


def main():
    with tempfile.TemporaryDirectory() as folder:
        lines = ours(folder)
        print("| triangles | Sabine (M/s) | parry3d (M/s) | Embree (M/s) | Sabine / parry3d | share of Embree |")
        print("|---|---|---|---|---|---|")
        for line in (line for line in lines if line["what"] == "hits"):
            found = attempt("embree", folder, line["scene"])
            limit, share = None, None
            if found:
                limit, mean_m = found
                assert abs(mean_m / line["mean_m"] - 1.0) < 1e-3, "Embree sees another scene"
                limit, share = limit / 1e6, 100 * line["sabine"] / limit
            print(
                f"| {line['scene'].replace('_', ', ')} | {line['sabine'] / 1e6:.2f} | {line['parry3d'] / 1e6:.2f} "
                f"| {number(limit, 2)} | {line['sabine'] / line['parry3d']:.2f} | {number(share)} % |"
            )
    print()
    print("| triangles | scattering | rays/s, 1 thread | 2 threads | before the rays (s) |")
    print("|---|---|---|---|---|")
    paths = [line for line in lines if line["what"] == "paths"]
    for one, two in zip(paths[::2], paths[1::2]):
        print(
            f"| {one['triangles']:,} | {one['scattering']} | {one['rays_per_s']:,} | {two['rays_per_s']:,} "
            f"| {one['before_s']:.3f} |"
        )
    print()
    print("| box of 12 triangles, 8 octaves, 1 thread | scattering 0 | scattering 0.3 |")
    print("|---|---|---|")
    box = {line["scattering"]: line["rays_per_s"] for line in paths if (line["triangles"], line["threads"]) == (12, 1)}
    print(f"| Sabine, rays/s | {number(box[0])} | {number(box[0.3])} |")
    for name, unit in [("pyroomacoustics", "rays/s"), ("misuka", "paths/s")]:
        specular, scattered = attempt(name, 0.0), attempt(name, 0.3)
        print(f"| {name}, {unit} | {number(specular)} | {number(scattered)} |")


if __name__ == "__main__":
    if sys.argv[1:2] == ["embree"]:
        print(json.dumps(embree(*sys.argv[2:])))
    elif len(sys.argv) == 3:
        print(json.dumps({"pyroomacoustics": pyroomacoustics, "misuka": misuka}[sys.argv[1]](float(sys.argv[2]))))
    else:
        main()
