"""Time on one thread until the late decay is known to 0.5 dB, of Sabine and of its peers, in one run. Prints the table of docs/validation/propagate.md.

    cargo bench -p sabine-propagate --bench against_peers --no-run     # build first: compiling disturbs the clock
    pip install numpy pyroomacoustics misuka acoustic-spaces
    python docs/validation/peers/time_to_accuracy.py [FOLDER OF A MEASURED ROOM]

Every program traces the same room many times, each time with another seed. The energy still to come at 500 Hz, where the curve has fallen by 10,
20 and 30 dB, scatters between seeds; its variance falls with the number of rays, so that the time to a standard deviation of 0.5 dB (the worst of
the three) is the median time of a run times (scatter / 0.5 dB)^2. 24 seeds (eight at least) know a variance to 30 %. A decay's bias is not in it: it is
printed beside, as the fall from 10 to 30 dB against Sabine's.

misuka (PolyForm Noncommercial) compiles through LLVM and needs a newer one than 15 (DRJIT_LIBLLVM_PATH names the library). acoustic-spaces reads
floor plans, so that it has the box alone. A peer that is not installed is left out.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[threads] = "1"

import numpy as np  # noqa: E402  (after the number of threads is set)

ROOT = Path(__file__).resolve().parents[3]
BOX_M = [10.0, 7.0, 3.0]
ABSORPTION, DURATION_S, BIN_S, SEEDS = 0.1, 3.0, 0.01, 24
FEWEST_SEEDS, ENOUGH_S, TOO_LONG_S = 8, 60.0, 240.0
OCTAVES_HZ = [62.5, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0]
OCTAVE_500_HZ = 3
WANTED_DB = 0.5
FALLEN_DB = [10, 20, 30]


def sabine(folder, measured):
    command = ["cargo", "bench", "-q", "-p", "sabine-propagate", "--bench", "against_peers", "--", folder, "decays"]
    if measured:
        command.append(str(Path(measured).resolve()))
    printed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [json.loads(line) for line in printed.splitlines() if line.startswith("{")]


def mesh(folder, room):
    lines = [line.split() for line in Path(folder, f"{room['room']}.obj").read_text().splitlines()]
    vertices = np.array([line[1:] for line in lines if line[0] == "v"], float)
    triangles = np.array([line[1:] for line in lines if line[0] == "f"], int) - 1
    return vertices, triangles


def timed(rays, one):
    """Seconds and energies of a trace with each seed, after one to warm up; slow programs are content with fewer seeds."""
    one(SEEDS)
    seconds, bins = [], []
    for seed in range(SEEDS):
        if seed >= FEWEST_SEEDS and sum(seconds) > ENOUGH_S:
            break
        start = time.perf_counter()
        found = one(seed)
        seconds.append(time.perf_counter() - start)
        bins.append(np.asarray(found, float).tolist())
    return {"rays": rays, "seconds": seconds, "bins": bins}


def pyroomacoustics(folder, room):
    import pyroomacoustics as pra

    pra.constants.set("num_threads", 1)
    scattering, (source, receiver) = max(room["scattering"], 1e-9), room["places_m"]
    octaves = len(OCTAVES_HZ)
    # It traces one direction after the other through all triangles.
    rays = 10_000 if room["triangles"] < 1000 else 100
    is_box = room["triangles"] == 12
    vertices, triangles = mesh(folder, room)
    grid = pra.room.fibonacci_spherical_sampling

    def turned(random):
        axes, _ = np.linalg.qr(random.normal(size=(3, 3)))
        return lambda count: axes @ grid(count)

    def one(seed):
        # Its directions are the same in every run: each seed turns them.
        pra.libroom.set_rng_seed(seed + 1)
        pra.room.fibonacci_spherical_sampling = turned(np.random.default_rng(seed))
        if is_box:
            material = pra.Material(
                energy_absorption={"coeffs": [ABSORPTION] * octaves, "center_freqs": OCTAVES_HZ},
                scattering={"coeffs": [scattering] * octaves, "center_freqs": OCTAVES_HZ},
            )
            hall = pra.ShoeBox(BOX_M, fs=32_000, materials=material, max_order=3, ray_tracing=True, air_absorption=True)
        else:
            # Normals point outwards here, and inwards in the file.
            walls = [
                pra.wall_factory(vertices[t[::-1]].T, [ABSORPTION] * octaves, [scattering] * octaves) for t in triangles
            ]
            hall = pra.Room(walls, fs=32_000, max_order=0, ray_tracing=True, air_absorption=True)
        hall.set_ray_tracing(
            n_rays=rays, time_thres=DURATION_S, energy_thres=1e-12, receiver_radius=0.5, hist_bin_size=BIN_S
        )
        hall.add_source(source)
        hall.add_microphone(receiver)
        hall.image_source_model()
        hall.ray_tracing()
        # Its octaves begin at 125 Hz.
        return np.asarray(hall.rt_histograms[0][0][0])[list(hall.octave_bands.centers).index(500.0)]

    return timed(rays, one)


def misuka(folder, room):
    import misuka as mi

    mi.set_variant("llvm_ad_acoustic")
    import drjit as dr

    dr.set_thread_count(1)
    source, receiver = room["places_m"]
    spectrum = lambda value: {"type": "spectrum", "value": [(f, value) for f in OCTAVES_HZ]}  # noqa: E731
    bins = round(DURATION_S / BIN_S)
    scene = mi.load_dict(
        {
            "type": "scene",
            "walls": {
                "type": "obj",
                "filename": str(Path(folder, f"{room['room']}.obj")),
                "face_normals": True,
                "bsdf": {
                    "type": "twosided",
                    "bsdf": {
                        "type": "acousticbsdf",
                        "absorption": spectrum(ABSORPTION),
                        "scattering": spectrum(max(room["scattering"], 1e-6)),  # it refuses 0
                    },
                },
            },
            "source": {
                "type": "sphere",
                "center": source,
                "radius": 0.25,
                "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 1.0}},
            },
            "receiver": {
                "type": "microphone",
                "to_world": mi.ScalarTransform4f().translate(receiver),
                "film": {
                    "type": "tape",
                    "frequencies": ", ".join(map(str, OCTAVES_HZ)),
                    "time_bins": bins,
                    "rfilter": {"type": "box"},
                },
            },
            "integrator": {
                "type": "acoustic_path",
                "max_time": DURATION_S,
                "speed_of_sound": room["speed_m_s"],
                "max_depth": -1,
                "max_energy_loss": -1.0,
            },
        }
    )
    rays = 10_000

    def one(seed):
        # Each octave is a row of the film, and each row gets its own samples.
        image = mi.render(scene, spp=rays, seed=seed)
        dr.eval(image)
        dr.sync_thread()
        return np.array(image).reshape(bins, len(OCTAVES_HZ))[:, OCTAVE_500_HZ]

    return timed(rays, one)


def acoustic_spaces(folder, room):
    from acoustic_spaces import Room, simulate

    if room["triangles"] != 12:
        raise ValueError("it reads floor plans")
    source, receiver = room["places_m"]
    rays = 5_000
    corners = [[0, 0], [BOX_M[0], 0], BOX_M[:2], [0, BOX_M[1]]]

    def one(seed):
        scene = {
            "name": "box",
            "geometry": {"floor_plan": corners, "height": BOX_M[2]},
            "materials": {"wall": {"absorption": [ABSORPTION] * 8, "scattering": room["scattering"]}},
            "assignments": {"walls": "wall", "floor": "wall", "ceiling": "wall"},
            "sources": [{"name": "s", "position": source}],
            "listeners": [{"name": "r", "position": receiver}],
            "simulation": {
                "early": {"method": "ray_tracing", "max_order": 3},
                "late": {"method": "stochastic_ray_tracing", "rays": rays},
                "ir_length_s": DURATION_S,
                "seed": seed,
            },
            "outputs": ["mono"],
        }
        Path(folder, "scene.json").write_text(json.dumps(scene))  # JSON is YAML
        response = simulate(Room.from_yaml(Path(folder, "scene.json")), threads=1)[("s", "r")]
        together = round(BIN_S / response.time_step)
        late = response.late[OCTAVE_500_HZ]
        whole = len(late) // together * together
        return late[:whole].reshape(-1, together).sum(axis=1)

    return timed(rays, one)


PEERS = {f.__name__: f for f in (pyroomacoustics, misuka, acoustic_spaces)}


def attempt(name, folder, room):
    """What a peer returns, in a process of its own: one that aborts, or is absent, leaves a gap in the table."""
    command = [sys.executable, __file__, name, folder]
    try:
        done = subprocess.run(command, input=json.dumps(room), capture_output=True, text=True, timeout=TOO_LONG_S)
    except subprocess.TimeoutExpired:
        print(f"{name}, {room['room']}: not done after {TOO_LONG_S:.0f} s", file=sys.stderr)
        return None
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        print(f"{name}, {room['room']}: exit status {done.returncode}: {last}", file=sys.stderr)
        return None
    return json.loads(done.stdout.splitlines()[-1])


def still_to_come(bins):
    return np.cumsum(np.asarray(bins)[:, ::-1], axis=1)[:, ::-1]


def figures(found, places):
    """Median time of a run, scatter in dB at the worst place, time to 0.5 dB, and the fall of the mean curve from the first place to the last."""
    tails = still_to_come(found["bins"])[:, places]
    mean = tails.mean(axis=0)
    scatter_db = float(np.max(10 / np.log(10) * tails.std(axis=0, ddof=1) / mean))
    seconds = statistics.median(found["seconds"])
    return seconds, scatter_db, seconds * (scatter_db / WANTED_DB) ** 2, float(10 * np.log10(mean[0] / mean[-1]))


def main():
    measured = sys.argv[1] if len(sys.argv) > 1 else None
    print("| room, triangles | program | seeds | rays | s a run | scatter (dB) | s to 0.5 dB | times Sabine | fall, 10 to 30 dB |")
    print("|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for room in sabine(folder, measured):
            curve = still_to_come(room["bins"]).mean(axis=0)
            places = [int(np.argmax(10 * np.log10(curve / curve[0]) < -db)) for db in FALLEN_DB]
            told = {key: value for key, value in room.items() if key not in ("seconds", "bins")}
            ours = figures(room, places)
            rows = [("Sabine", room, ours)]
            for name in PEERS:
                found = attempt(name, folder, told)
                if found:
                    rows.append((name.replace("_", "-"), found, figures(found, places)))
            for name, found, (seconds, scatter_db, needed_s, fall_db) in rows:
                print(
                    f"| {room['room']}, scattering {room['scattering']:g}, {room['triangles']:,} | {name} "
                    f"| {len(found['seconds'])} | {found['rays']:,} | {seconds:.2f} "
                    f"| {scatter_db:.2f} | {needed_s:.3g} | {needed_s / ours[2]:.1f} | {fall_db:.1f} dB |",
                    flush=True,
                )


if __name__ == "__main__":
    if sys.argv[1:2] and sys.argv[1] in PEERS:
        print(json.dumps(PEERS[sys.argv[1]](sys.argv[2], json.load(sys.stdin))))
    else:
        main()
