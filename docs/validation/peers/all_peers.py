#!/usr/bin/env python3
"""Sabine and its peers on the same work, in one run on one machine: speed, error and memory. Prints docs/validation/peers.md's tables.

    cargo build --release -p sabine-cli -p sabine-features -p sabine-eqfilter -p sabine-estimator --bins --bench against_peers
    pip install numpy scipy librosa soundfile pyrato pyroomacoustics misuka acoustic-spaces onnx onnxruntime safetensors
    python docs/validation/peers/all_peers.py [log_mel] [fir] [network] [decay] [box] [fit]

Every program runs in a process of its own, on one thread, in turn, three rounds of each (one of `fit`); times are the best of the rounds
and of the processor where said. Memory is the largest resident set of the process: with Python and its libraries where the program is
one. The scripts beside this one do the same work with more repetitions and more detail; their code is used here.
misuka (PolyForm Noncommercial) compiles through LLVM and needs a newer one than 15 (DRJIT_LIBLLVM_PATH names the library).
A program that is not installed leaves a gap. PROFILE=debug takes a development build of Sabine instead, and says so.
"""

import concurrent.futures
import importlib.metadata
import json
import multiprocessing
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "RAYON_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
os.environ.update(ONE_THREAD)
HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / os.environ.get("PROFILE", "release")
ROUNDS = 3
PACKAGES = ["numpy", "scipy", "librosa", "onnxruntime", "pyrato", "pyroomacoustics", "misuka", "acoustic-spaces"]
sys.path.insert(0, str(HERE))


def bench(word):
    """Sabine's bench program of one crate: its file holds the name of its source, for messages."""
    found = [p for p in TARGET.glob("deps/against_peers-*") if p.suffix == "" and word.encode() in p.read_bytes()]
    if not found:
        raise SystemExit("build first: see the top of this file")
    return str(max(found, key=os.path.getmtime))


def milliseconds(work, repeats):
    """Best of so many."""
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        spent.append(1e3 * (time.perf_counter() - start))
    return min(spent)


# Log-mel of four seconds at 16 kHz: 32 bands, 499 frames.


def log_mel_librosa(_):
    import librosa
    import numpy as np

    n = np.arange(64000, dtype=np.int64)
    samples = ((n * n % 7919) / 7919.0 - 0.5).astype(np.float32)

    def work():
        power = librosa.feature.melspectrogram(
            y=samples, sr=16000, n_fft=256, hop_length=128, center=False, n_mels=32, fmin=0, fmax=8000)
        return librosa.power_to_db(power, ref=1.0, amin=1e-10, top_db=None)

    return {"ms": milliseconds(work, 60)}


def log_mel_numpy(_):
    """Without librosa's import its memory is that of numpy and scipy; the mel matrix's values do not matter for the time."""
    import numpy as np
    import scipy.fft
    import scipy.signal

    n = np.arange(64000, dtype=np.int64)
    samples = ((n * n % 7919) / 7919.0 - 0.5).astype(np.float32)
    window = scipy.signal.get_window("hann", 256).astype(np.float32)
    frames = np.lib.stride_tricks.sliding_window_view(samples, 256)[::128]
    windowed, power, squares = np.empty((499, 256), "f4"), np.empty((499, 129), "f4"), np.empty((499, 129), "f4")
    mel = np.random.default_rng(1).random((129, 32)).astype("f4")

    def work():
        np.multiply(frames, window, out=windowed)
        spectrum = scipy.fft.rfft(windowed, axis=1, overwrite_x=True)
        np.multiply(spectrum.real, spectrum.real, out=power)
        np.multiply(spectrum.imag, spectrum.imag, out=squares)
        np.add(power, squares, out=power)
        levels = power @ mel
        np.maximum(levels, 1e-10, out=levels)
        np.log10(levels, out=levels)
        levels *= 10

    return {"ms": milliseconds(work, 200)}


# FIR of 1025 taps at 16 kHz from seven octave gains.


def worst_octave_db(filters):
    import eqfilter_peers as fir
    import numpy as np

    return max(np.abs(fir.octave_gains_db(t) - g).max() for t, g in zip(filters, fir.gain_sets()))


def fir_firwin2(kind):
    import eqfilter_peers as fir

    design = {"linear": fir.by_linear, "log": fir.by_log}[kind]
    sets = iter(list(fir.gain_sets()) * 2)
    spent = milliseconds(lambda: design(next(sets)), 200)
    return {"ms": spent, "error": worst_octave_db([design(g) for g in fir.gain_sets()])}


# The released network, one window of four seconds.


def network_onnxruntime(folder):
    import numpy as np
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(str(Path(folder, "room.onnx")), options, providers=["CPUExecutionProvider"])
    inputs = np.load(Path(folder, "inputs.npy"))
    one = np.ascontiguousarray(inputs[:1])
    spent = milliseconds(lambda: session.run(None, {"input": one}), 400)
    np.save(Path(folder, "theirs.npy"), session.run(None, {"input": inputs})[0])
    return {"ms": spent}


# T60 of noisy decays.


def decay_pyrato(folder):
    import decay_peers
    import soundfile

    wavs = sorted(Path(folder).glob("*.wav"))
    found = [decay_peers.by_pyrato(soundfile.read(f)[0]) for f in wavs]
    return {"ms": 1e3 * sorted(s for _, s in found)[len(found) // 2], "t60_s": [t for t, _ in found]}


# The box: room to reverberation time.


def octave_t30(response, rate):
    """T30 by octave of a pressure response: Butterworth filters, energies in bins, the same line as everybody's."""
    import optimize_peers as box
    import scipy.signal

    found, step = [], int(rate * box.BIN_S)
    for centre in box.OCTAVES_HZ[1:]:
        edges = [centre / 2**0.5, min(centre * 2**0.5, 0.499 * rate)]
        band = scipy.signal.sosfilt(scipy.signal.butter(4, edges, "bandpass", fs=rate, output="sos"), response)
        bins = len(band) // step
        found.append(box.decay_time((band[: bins * step] ** 2).reshape(bins, step).sum(axis=1), -5, -35))
    return found


def box_sabine(folder):
    """Not in a Python process: its memory is that of the program."""
    import optimize_peers as box

    x, y, z = box.SIZE_M
    corners = [(i, j, k) for k in (0, z) for j in (0, y) for i in (0, x)]
    quads = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    obj = "".join(f"v {a} {b} {c}\n" for a, b, c in corners) + "usemtl wall\n"
    Path(folder, "room.obj").write_text(obj + "".join(f"f {a} {b} {c}\nf {a} {c} {d}\n" for a, b, c, d in quads))
    place = lambda at: [float(c) for c in at]  # noqa: E731
    Path(folder, "room.toml").write_text(
        '[room]\nmesh = "room.obj"\n[air]\ntemperature_c = 20.0\nrelative_humidity_percent = 50.0\npressure_kpa = 101.325\n'
        f"[bands]\ncentres_hz = {box.OCTAVES_HZ[1:].tolist()}\n[materials.wall]\nabsorption = {box.ONE[0][1:].tolist()}\n"
        f"scattering = {[box.SCATTERING] * 7}\n[[sources]]\nid = 's'\nposition_m = {place(box.SOURCE_M)}\n"
        f"[[receivers]]\nid = 'r'\nposition_m = {place(box.RECEIVERS_M[0])}\n")
    out = Path(folder, "parameters.json")
    command = [TARGET / "sabine", "trace", "--room", folder, "--rays", "10000", "--threads", "1", "--json", out]
    done = spent(command)
    return done and ({"t30_s": json.loads(out.read_text())["t30_s"][-7:]}, done[1], done[2])


def box_pyroomacoustics(_):
    import optimize_peers as box
    import pyroomacoustics as pra

    pra.constants.set("num_threads", 1)
    octaves = box.OCTAVES_HZ[1:].tolist()
    absorbed = {"coeffs": box.ONE[0][1:].tolist(), "center_freqs": octaves}
    scattered = {"coeffs": [box.SCATTERING] * 7, "center_freqs": octaves}
    room = pra.ShoeBox(box.SIZE_M, fs=32_000, materials=pra.Material(energy_absorption=absorbed, scattering=scattered),
                       max_order=3, ray_tracing=True, air_absorption=True, temperature=20.0, humidity=50.0)
    room.set_ray_tracing(n_rays=10_000, time_thres=box.DURATION_S, energy_thres=1e-12, receiver_radius=0.5)
    room.add_source(box.SOURCE_M)
    room.add_microphone(box.RECEIVERS_M[0])
    room.compute_rir()
    response = room.rir[0][0][: int(32_000 * box.DURATION_S)]
    return {"t30_s": octave_t30(response, 32_000)}


def box_misuka(_):
    import misuka as mi
    import numpy as np
    import optimize_peers as box

    mi.set_variant("llvm_ad_acoustic")
    import drjit as dr

    dr.set_thread_count(1)
    spectrum = lambda values: {"type": "spectrum", "value": list(zip(box.OCTAVES_HZ.tolist(), values))}  # noqa: E731
    half = [s / 2 for s in box.SIZE_M]
    bins = int(box.DURATION_S / 1e-2)
    scene = mi.load_dict({
        "type": "scene",
        "walls": {"type": "cube", "flip_normals": True, "to_world": mi.ScalarTransform4f().translate(half).scale(half),
                  "bsdf": {"type": "acousticbsdf", "absorption": spectrum(box.ONE[0]), "scattering": spectrum([box.SCATTERING] * 8)}},
        "source": {"type": "sphere", "center": box.SOURCE_M, "radius": 0.25,
                   "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 1.0}}},
        "receiver": {"type": "microphone", "to_world": mi.ScalarTransform4f().translate(box.RECEIVERS_M[0]),
                     "film": {"type": "tape", "frequencies": ", ".join(map(str, box.OCTAVES_HZ)), "time_bins": bins,
                              "rfilter": {"type": "box"}}},
        "integrator": {"type": "acoustic_path", "max_time": box.DURATION_S, "speed_of_sound": box.SPEED_M_S, "max_depth": -1,
                       "max_energy_loss": -1.0},
    })
    # It knows no air: its energies are given the air's share afterwards.
    energy = np.array(mi.render(scene, spp=10_000, seed=1)).reshape(bins, 8)
    metres = (np.arange(bins) + 0.5) * 1e-2 * box.SPEED_M_S
    energy = energy * np.exp(-np.outer(metres, box.air_per_m()))
    box.BIN_S = 1e-2
    return {"t30_s": [box.decay_time(e, -5, -35) for e in energy.T[1:]]}


def box_acoustic_spaces(folder):
    import optimize_peers as box
    from acoustic_spaces import Room, simulate

    scene = {
        "name": "box",
        "geometry": {"floor_plan": [[0, 0], [box.SIZE_M[0], 0], box.SIZE_M[:2], [0, box.SIZE_M[1]]], "height": box.SIZE_M[2]},
        "materials": {"wall": {"absorption": box.ONE[0].tolist(), "scattering": box.SCATTERING}},
        "assignments": {"walls": "wall", "floor": "wall", "ceiling": "wall"},
        "sources": [{"name": "s", "position": box.SOURCE_M}],
        "listeners": [{"name": "r", "position": box.RECEIVERS_M[0]}],
        "simulation": {"early": {"method": "ray_tracing", "max_order": 3}, "late": {"method": "stochastic_ray_tracing"},
                       "ir_length_s": box.DURATION_S},
        "outputs": ["mono"],
    }
    Path(folder, "scene.json").write_text(json.dumps(scene))  # JSON is YAML
    result = simulate(Room.from_yaml(Path(folder, "scene.json")), threads=1)
    return {"t30_s": [float(t) for t in result[("s", "r")].parameters().t30[-7:]]}


WORKERS = {f.__name__: f for f in (log_mel_librosa, log_mel_numpy, fir_firwin2, network_onnxruntime, decay_pyrato,
                                   box_pyroomacoustics, box_misuka, box_acoustic_spaces)}


# A process counts what the one that starts it holds as its own: programs are started by one that is forked before anything is loaded.
LAUNCHER = concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("fork"))


def spent(command):
    return LAUNCHER.submit(launched, list(map(str, command))).result()


def launched(command):
    """Output of a process, its processor time in seconds and largest resident set in MiB, its children's included."""
    with tempfile.TemporaryFile("w+") as errors:
        try:
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True)
        except FileNotFoundError:
            print(f"{command[0]} is missing: build first, see the top of this file", file=sys.stderr)
            return None
        out = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        errors.seek(0)
        last = (errors.read().strip().splitlines() or ["no message"])[-1]
    if process.returncode != 0:
        print(f"{command}: exit status {process.returncode}: {last}", file=sys.stderr)
        return None
    return out, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def worker(name, argument="-"):
    done = spent([sys.executable, __file__, "--worker", name, argument])
    if done is None:
        return None
    out, seconds, mib = done
    return json.loads(out.splitlines()[-1]), seconds, mib


def best(rounds, of):
    values = [of(r) for r in rounds if r is not None]
    return min(values) if values else None


def text(value, form):
    return "-" if value is None else form.format(value)


def ratio(value, sabine, digits=1):
    return "-" if None in (value, sabine) else f"{value / sabine:.{digits}f}"


def table(head, rows):
    print(f"\n| {' | '.join(head)} |\n|{'---|' * len(head)}")
    for row in rows:
        print(f"| {' | '.join(row)} |")
    sys.stdout.flush()


def log_mel(_):
    program = bench("features/benches/against_peers")
    jobs = {"Sabine": lambda: spent([program]), "librosa": lambda: worker("log_mel_librosa"),
            "numpy + scipy.fft": lambda: worker("log_mel_numpy")}
    rounds = {name: [] for name in jobs}
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            rounds[name].append(job())
    ms = {name: best(r, lambda d: float(d[0].split()[1]) if isinstance(d[0], str) else d[0]["ms"]) for name, r in rounds.items()}
    memory = {name: best(r, lambda d: d[2]) for name, r in rounds.items()}
    table(["log-mel of 4 s", "ms", "times Sabine", "MiB"],
          [[n, text(ms[n], "{:.3f}"), ratio(ms[n], ms["Sabine"]), text(memory[n], "{:.0f}")] for n in jobs])


def fir(_):
    import struct

    import numpy as np

    program = bench("eqfilter/benches/against_peers")
    jobs = {"Sabine": lambda: spent([program]), "scipy firwin2, as it comes": lambda: worker("fir_firwin2", "linear"),
            "scipy firwin2, 128 points": lambda: worker("fir_firwin2", "log")}
    rounds = {name: [] for name in jobs}
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            rounds[name].append(job())
    raw = subprocess.run([program, "--taps"], capture_output=True, check=True).stdout
    ours = np.array(struct.unpack(f"<{len(raw) // 4}f", raw)).reshape(-1, 1025)
    rows, first = [], None
    for name, found in rounds.items():
        sabine = name == "Sabine"
        ms = best(found, lambda d: float(d[0].splitlines()[0].split()[1]) if isinstance(d[0], str) else d[0]["ms"])
        error = worst_octave_db(ours) if sabine else best(found, lambda d: d[0]["error"])
        first = ms if sabine else first
        rows.append([name, text(ms, "{:.3f}"), ratio(ms, first), text(error, "{:.2f}"),
                     text(best(found, lambda d: d[2]), "{:.0f}")])
    table(["FIR of 1025 taps from octave gains", "ms", "times Sabine", "worst octave (dB)", "MiB"], rows)


def network(folder):
    import numpy as np

    graph = ("import estimator_peers as e, numpy as np, sys; from pathlib import Path; f = Path(sys.argv[1]); "
             "(f / 'room.onnx').write_bytes(e.graph()); "
             "np.save(f / 'inputs.npy', np.random.default_rng(1).standard_normal((64, 1, e.MELS, e.FRAMES)).astype('f4'))")
    subprocess.run([sys.executable, "-c", graph, folder], check=True, env={**os.environ, "PYTHONPATH": str(HERE)})
    np.load(Path(folder, "inputs.npy")).tofile(Path(folder, "inputs.f32"))
    weights = ROOT / "crates/estimator/weights/room.safetensors"
    program = bench("estimator_peers")
    jobs = {"Sabine": lambda: spent([program, "infer", weights, Path(folder, "inputs.f32"), Path(folder, "ours.f32")]),
            "ONNX Runtime": lambda: worker("network_onnxruntime", folder)}
    rounds = {name: [] for name in jobs}
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            rounds[name].append(job())

    def ms(done):
        if not isinstance(done[0], str):
            return done[0]["ms"]
        return next(float(line.split()[1]) for line in done[0].splitlines() if line.startswith("one "))

    difference = None
    if rounds["ONNX Runtime"][-1]:
        theirs = np.load(Path(folder, "theirs.npy"))
        difference = np.abs(np.fromfile(Path(folder, "ours.f32"), "f4").reshape(theirs.shape) - theirs).max()
    times = {name: best(r, ms) for name, r in rounds.items()}
    table(["network, one window of 4 s", "ms", "times Sabine", "largest difference of outputs", "MiB"],
          [[n, text(times[n], "{:.3f}"), ratio(times[n], times["Sabine"], 2),
            "-" if n == "Sabine" else text(difference, "{:.0e}"), text(best(rounds[n], lambda d: d[2]), "{:.0f}")] for n in jobs])


def decay(folder):
    import numpy as np
    import soundfile

    truths = []
    for t60_s in (0.2, 0.5, 1.0, 2.0):
        for seed in range(4):
            random = np.random.default_rng([seed, int(1000 * t60_s)])
            n = int(48_000 * (1.5 * t60_s + 0.5))
            envelope = 10 ** (-3.0 * np.arange(n) / 48_000 / t60_s)
            samples = 0.1 * (envelope * random.standard_normal(n) + 10**-2.25 * random.standard_normal(n))
            soundfile.write(Path(folder, f"{t60_s}_{seed}.wav"), samples, 48_000, subtype="FLOAT")
            truths.append(t60_s)
    wavs, result = sorted(Path(folder).glob("*.wav")), Path(folder, "ours.json")
    program = TARGET / "sabine"

    def sabine():
        done = spent([program, "measure", *wavs, "--json", result])
        if done is None:
            return None
        entries = json.loads(result.read_text())
        seconds = sorted(e["seconds"]["full_band"] for e in entries)
        return {"ms": 1e3 * seconds[len(seconds) // 2], "t60_s": [e["full_band"]["t60_s"] for e in entries]}, done[1], done[2]

    jobs = {"Sabine": sabine, "pyrato (Chu, Lundeby, T30)": lambda: worker("decay_pyrato", folder)}
    rounds = {name: [] for name in jobs}
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            rounds[name].append(job())
    rows, first = [], None
    for name, found in rounds.items():
        ms = best(found, lambda d: d[0]["ms"])
        first = ms if name == "Sabine" else first
        if found[-1] is None:
            rows.append([name, "-", "-", "-", "-", "-"])
            continue
        values = found[-1][0]["t60_s"]
        errors = [abs(v / t - 1) for v, t in zip(values, truths) if v is not None and np.isfinite(v)]
        rows.append([name, f"{ms:.2f}", ratio(ms, first), f"{100 * np.mean(errors):.2f}", f"{len(errors)} of {len(values)}",
                     text(best(found, lambda d: d[2]), "{:.0f}")])
    table(["T60, full band, SNR 45 dB", "ms", "times Sabine", "mean error (%)", "answered", "MiB"], rows)


def box(folder):
    import numpy as np
    import optimize_peers as room

    truth = [room.energies(room.particles(room.RECEIVERS_M[0], seed), room.ONE) for seed in (0, 900)]
    t30 = [np.array(room.parameters(e, 0.01)[0])[1:] for e in truth]
    jobs = {"Sabine, 10,000 rays": lambda: box_sabine(folder),
            "pyroomacoustics, 10,000 rays": lambda: worker("box_pyroomacoustics"),
            "misuka, 10,000 samples an octave": lambda: worker("box_misuka"),
            "acoustic-spaces, its defaults": lambda: worker("box_acoustic_spaces", folder)}
    rounds = {name: [] for name in jobs}
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            rounds[name].append(job())
    rows, first = [], None
    for name, found in rounds.items():
        seconds = best(found, lambda d: d[1])
        first = seconds if name.startswith("Sabine") else first
        error = found[-1] and 100 * np.mean(np.abs(np.array(found[-1][0]["t30_s"]) / np.mean(t30, axis=0) - 1))
        rows.append([name, text(seconds, "{:.1f}"), ratio(seconds, first), text(error, "{:.2f}"),
                     text(best(found, lambda d: d[2]), "{:.0f}")])
    apart = 100 * np.mean(np.abs(t30[0] / t30[1] - 1))
    rows.append(["the particles against themselves, another seed", "-", "-", f"{apart:.2f}", "-"])
    table(["box of 7 x 5 x 3 m, to T30", "s of the processor", "times Sabine", "T30 error (%)", "MiB"], rows)


def fit(_):
    done = subprocess.run([sys.executable, HERE / "optimize_peers.py", "one"], capture_output=True, text=True)
    print(f"\n{done.stdout.strip()}")
    if done.returncode:
        print((done.stderr.strip().splitlines() or ["no message"])[-1], file=sys.stderr)


def version(package):
    try:
        return f"{package} {importlib.metadata.version(package)}"
    except importlib.metadata.PackageNotFoundError:
        return f"{package} absent"


def main():
    LAUNCHER.submit(os.getpid).result()
    revision = subprocess.run(["git", "-C", ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip()
    print(f"Sabine {revision}; {', '.join(map(version, PACKAGES))}; Python {platform.python_version()}.")
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} at the start, Sabine from {TARGET.name}.")
    sections = {f.__name__: f for f in (log_mel, fir, network, decay, box, fit)}
    for name in sys.argv[1:] or sections:
        with tempfile.TemporaryDirectory() as folder:
            sections[name](folder)
    print(f"\nLoad {os.getloadavg()[0]:.1f} at the end.")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        print(json.dumps(WORKERS[sys.argv[2]](sys.argv[3])))
    else:
        main()
