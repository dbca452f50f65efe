"""The evaluation: 490 rooms of five kinds of worlds, 200 of them unaltered, one hidden effect in each of the others.

    python evaluate.py plan   --seed N                                        what there is to do
    python evaluate.py run    --seed N --out DIR --programs target/release    does it, and goes on where it was stopped
    python evaluate.py record --seed N --out DIR --record FILE.csv            a line for each room that is done
    python evaluate.py tables --record FILE.csv                               what they come to

N is the first eight hexadecimal digits of the frozen engine's commit, as a number. Needs Python 3.9 and the programs `effect_atlas`,
`polyhedral_rooms` and `sabine` of that commit; `run` also a Python with pyroomacoustics (`--python`, ../other_worlds/README.md).
"""

import argparse
import concurrent.futures
import csv
import dataclasses
import hashlib
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import threading

CATALOGUE = """transducer_response air_absorption source_directivity scattering surface_absorption background_noise coupled_volume truncation
sound_speed sampling_clock room_dimensions position_error time_zero channel_fault extra_reflector open_patch nonlinear_distortion
angle_dependent_absorption room_modes receiver_directivity channel_response surface_displacement coordinate_shift temperature_gradient
absorption_tables""".split()
OUTSIDE = ["gain_drift", "dropouts", "foreign_chirp", "grazing_absorption"]
SHAPES = ["l", "sloped_ceiling", "wedge", "furnished"]
IN_BOXES = ["position", "surface", "temperature", "latency", "gain", "wall", "tables", "swell"]
IN_POLYHEDRA = ["position", "surface", "temperature", "latency", "gain", "wall", "scattering", "response"]
# What the diagnosis calls that which pyroomacoustics_room.py plants.
NAMES = {
    "position": "position_error",
    "surface": "surface_absorption",
    "temperature": "sound_speed",
    "latency": "time_zero",
    "gain": "channel_fault",
    "wall": "surface_displacement",
    "tables": "absorption_tables",
}
# True in every box of pyroomacoustics: reflections of one sign, and white noise.
ALWAYS_THERE = {"coherent_reflections", "background_noise"}
WALL_M = 0.03
MIN_DUE = 7  # d' from which a single name is due
FIELDS = "world hidden strength seed verdict outcome answer false_names p_value d_prime processor_s".split()


def plan(seed):
    """(world, what is hidden, strength, seed) of each room, in an order by hash: whatever is done is a random part of all."""
    tasks = []
    for i in range(40):
        tasks.append(("null_lab", "none", 1, seed + i))
        tasks.append(("null_lab_positive", "none", 1, seed + 1000 + i))
        tasks.append(("null_pra", "null", 1, seed + 2000 + i))
        tasks.append(("null_poly_plain", SHAPES[i % 4], 1, seed + 3000 + i))
        tasks.append(("null_poly_nuisances", SHAPES[i % 4], 1, seed + 4000 + i))
    lab = [(s, e) for outside in (OUTSIDE, []) for s in (0.5, 1, 2) for e in CATALOGUE + outside]
    tasks += [("lab", effect, strength, seed + 10000 + n) for n, (strength, effect) in enumerate(lab)]
    tasks += [("pra", effect, 1, seed + 20000 + n) for n, effect in enumerate(8 * IN_BOXES)]
    worlds = [(e, w, s) for e in IN_POLYHEDRA for w in ("plain", "nuisances") for s in SHAPES]
    tasks += [(f"poly_{w}", f"{e}:{s}", 1, seed + 30000 + n) for n, (e, w, s) in enumerate(worlds)]
    return sorted(tasks, key=lambda task: hashlib.sha256(repr(task).encode()).hexdigest())


@dataclasses.dataclass
class Runner:
    programs: pathlib.Path
    python: str
    rays: int
    out: pathlib.Path
    stopped: threading.Event = dataclasses.field(default_factory=threading.Event)

    def do(self, number, task):
        """One room: its files are `NUMBER.json`, written when it is done, and what the programs wrote."""
        done = self.out / f"{number:03}.json"
        if self.stopped.is_set() or done.exists():
            return
        world, hidden, strength, seed = task
        record, room, answer = (self.out / f"{number:03}{end}" for end in (".csv", "_room", "_answer"))
        for left in (room, answer):
            shutil.rmtree(left, ignore_errors=True)
        record.unlink(missing_ok=True)
        rays = ["--rays", str(self.rays)]
        if world in ("pra", "null_pra"):
            script = pathlib.Path(__file__).parent.parent / "other_worlds/pyroomacoustics_room.py"
            make = [self.python, str(script), "--seed", str(seed), "--method", "images", "--effect", hidden, "--out", str(room)]
            commands = [make, [str(self.programs / "sabine"), "diagnose", "--room", str(room), *rays, "--out", str(answer)]]
        elif "poly" in world:
            planted, shape = ("nothing", hidden) if world.startswith("null") else hidden.split(":")
            nuisances = world.endswith("nuisances")
            # The program counts worlds and shapes before it leaves some out: so the room has the seed of the plan.
            first = seed - 4 * nuisances - SHAPES.index(shape)
            which = ["--planted", planted, "--shape", shape, "--nuisances", str(nuisances).lower(), "--seed", str(first)]
            commands = [[str(self.programs / "polyhedral_rooms"), *which, "--rooms", "1", *rays, "--record", str(record)]]
        else:
            which = ["--effects", hidden, "--strengths", str(strength), "--seed", str(seed)]
            which += ["--positive-reflections"] if world.endswith("positive") else []
            commands = [[str(self.programs / "effect_atlas"), *which, "--rooms", "1", *rays, "--record", str(record)]]
        processor_s, code = 0.0, 0
        with open(self.out / f"{number:03}.log", "w") as log:
            for command in commands:
                # One thread each: several rooms at once use the cores better than one room with several threads.
                process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env={**os.environ, "RAYON_NUM_THREADS": "1"})
                _, status, usage = os.wait4(process.pid, 0)
                processor_s += usage.ru_utime + usage.ru_stime
                code = os.waitstatus_to_exitcode(status)
                if code:
                    break
        if self.stopped.is_set():
            return
        if (room / "truth.json").exists() and answer.exists():
            shutil.copy(room / "truth.json", answer)
        shutil.rmtree(room, ignore_errors=True)
        line = dict(world=world, hidden=hidden, strength=strength, seed=seed, code=code, processor_s=processor_s)
        temporary = done.with_suffix(".part")
        temporary.write_text(json.dumps(line))
        temporary.rename(done)
        print(f"{number:03} {world} {hidden} {strength} {seed}: {processor_s:.0f} s" + (f", failed ({code})" if code else ""), flush=True)


def run(arguments):
    arguments.out.mkdir(parents=True, exist_ok=True)
    runner = Runner(arguments.programs, arguments.python, arguments.rays, arguments.out)
    tasks = list(enumerate(plan(arguments.seed)))[: arguments.rooms]
    with concurrent.futures.ThreadPoolExecutor(arguments.workers) as pool:
        waiting = [pool.submit(runner.do, number, task) for number, task in tasks]
        try:
            for one in concurrent.futures.as_completed(waiting):
                one.result()
        except BaseException:
            # The programs under way have heard of it, too; what they leave is done again.
            runner.stopped.set()
            pool.shutdown(cancel_futures=True)
            raise


def answer_of(found):
    """What a diagnosis.json says, in the words of the other records."""
    named = [cause["effect"] for cause in found["causes"]]
    if found["verdict"] == "ambiguous":
        named = named[:-1] + [" or ".join(found["alternatives"])]
    return " + ".join(named) if named else found["verdict"]


def is_planted(cause, truth):
    """Whether a cause is what pyroomacoustics_room.py planted, at its place."""
    effect, hidden = truth["effect"], truth["hidden"]
    if cause["effect"] != NAMES.get(effect):
        return False
    subjects = [subject for subject in [cause["subject"], *cause["other_subjects"]] if subject]
    if effect == "surface":
        return any(hidden["material"] in subject for subject in subjects)
    if effect in ("position", "gain"):
        return any(hidden["receiver"] in subject.replace("-", " ").split() for subject in subjects)
    if effect == "wall":
        axis = max(range(3), key=lambda k: abs(hidden["outward_normal"][k]))
        bounds = [*zip(*truth["floor_m"]), truth["heights_m"]][axis]
        # The truth has the wall where it is, the answer says where the mesh has it and how far outside the room it stands.
        stated = (max(bounds) if hidden["outward_normal"][axis] > 0 else min(bounds)) - hidden["offset_m"] * hidden["outward_normal"][axis]
        near = abs(abs(cause["parameters"]["offset"]["value"]) - abs(hidden["offset_m"])) < WALL_M
        return near and any(f"{'xyz'[axis]} = {stated:.2f} m" in subject.replace("-0.00", "0.00") for subject in subjects)
    return True


def judge(found, truth):
    """Outcome of a box of pyroomacoustics, and its false names."""
    wanted = truth["effect"] != "null"
    right = [cause for cause in found["causes"] if is_planted(cause, truth)]
    false = [c["effect"] for c in found["causes"] if c not in right and c["effect"] not in ALWAYS_THERE]
    there = bool(right)
    if truth["effect"] == "swell":
        # A formula of the time in the file is the statement that is due; laws that are found stand among the causes, too.
        there = any("file_time_s" in law["formula"] or "time_after" in law["formula"] for law in found["laws"])
        false = [name for name in false if not (there and name == "unknown_law")]
    if found["verdict"] == "ambiguous" and not there:
        return ("set" if NAMES.get(truth["effect"]) in found["alternatives"] else "wrong"), false
    if false:
        return ("extra" if there else "wrong"), false
    if there or not wanted:
        return "right", false
    return ("unexplained" if found["verdict"] in ("unexplained", "incomplete") else "missed"), false


def lines(seed, out):
    """A line for each room that is done."""
    for number, (world, hidden, strength, own) in enumerate(plan(seed)):
        done, record, answer = (out / f"{number:03}{end}" for end in (".json", ".csv", "_answer/diagnosis.json"))
        if not done.exists():
            continue
        line = dict(world=world, hidden=hidden, strength=strength, seed=own)
        line["processor_s"] = f"{json.loads(done.read_text())['processor_s']:.0f}"
        if record.exists():
            (row,) = csv.DictReader(record.read_text().splitlines())
            assert int(row["seed"]) == own, record
            line.update({field: row.get(field, "") for field in ("verdict", "outcome", "answer", "false_names", "p_value", "d_prime")})
            if world.startswith("null_lab"):
                true = {"coherent_reflections"} if world.endswith("positive") else set()
                named = set(row["answer"].split(" + ")) - {"adequate", "unexplained"} if row["verdict"] != "unexplained" else set()
                line["false_names"] = " ".join(sorted(named - true))
        elif answer.exists():
            found, truth = json.loads(answer.read_text()), json.loads(answer.with_name("truth.json").read_text())
            line["outcome"], false = judge(found, truth)
            left = found["lack_of_fit"]["p_value" if not found["causes"] else "p_value_explained"]
            line.update(verdict=found["verdict"], answer=answer_of(found), false_names=" ".join(false), p_value=left)
        else:
            line["outcome"] = "failed"
        yield line


def interval(hits, count):
    """Exact 95 % interval of a share (Clopper and Pearson 1934)."""

    def at_least(share, least):
        return sum(math.comb(count, k) * share**k * (1 - share) ** (count - k) for k in range(least, count + 1))

    def where(is_above):
        low, high = 0.0, 1.0
        for _ in range(50):
            middle = (low + high) / 2
            low, high = (low, middle) if is_above(middle) else (middle, high)
        return (low + high) / 2

    low = where(lambda share: at_least(share, hits) > 0.025) if hits else 0.0
    high = where(lambda share: 1 - at_least(share, hits + 1) < 0.025) if hits < count else 1.0
    return low, high


def share(what, hits):
    hits = list(hits)
    if hits:
        low, high = interval(sum(hits), len(hits))
        print(f"| {what} | {sum(hits)} of {len(hits)} ({100 * sum(hits) / len(hits):.0f} %) | {100 * low:.0f}-{100 * high:.0f} % |")


def tables(rows):
    rows = [row for row in rows if row["outcome"] != "failed"]
    is_null = lambda row: row["world"].startswith("null")
    nulls, others = [r for r in rows if is_null(r)], [r for r in rows if not is_null(r)]
    misfit = lambda row: row["verdict"] in ("incomplete", "unexplained") or row["answer"] == "unexplained"
    print("| figure | found | 95 % interval |\n|---|---|---|")
    share("unaltered rooms: a false name", (bool(r["false_names"]) for r in nulls))
    for world in sorted({r["world"] for r in nulls}):
        share(f"the same, {world[5:]}", (bool(r["false_names"]) for r in nulls if r["world"] == world))
    with_verdict = [r for r in nulls if r["verdict"]]
    share("unaltered rooms whose verdict is recorded: no false name, but a misfit", (misfit(r) and not r["false_names"] for r in with_verdict))
    right = lambda row: row["outcome"] == "right"
    lab = [r for r in others if r["world"] == "lab"]
    within = [r for r in lab if r["hidden"] not in OUTSIDE]
    d = lambda row: float(row["d_prime"] or 0)
    for low, high in ((0, 3), (3, 5), (5, MIN_DUE), (MIN_DUE, math.inf)):
        size = f"{low} to {high}" if high < math.inf else f"from {low} on"
        share(f"laboratory, right and alone, d' {size}", (right(r) for r in within if low <= d(r) < high))
    for strength in ("0.5", "1", "2"):
        share(f"laboratory, right and alone, strength {strength}", (right(r) for r in within if r["strength"] == strength))
    wrong = lambda row: row["outcome"] in ("wrong", "extra")
    share("laboratory, a wrong name or one too many", (wrong(r) for r in within))
    share("outside the catalogue: `unexplained`", (right(r) for r in lab if r["hidden"] in OUTSIDE))
    for world, words in (("pra", "boxes of pyroomacoustics"), ("poly_plain", "no boxes"), ("poly_nuisances", "no boxes, nuisances")):
        own = [r for r in others if r["world"] == world]
        share(f"{words}: right and alone", (right(r) for r in own))
        share(f"{words}: a wrong name or one too many", (wrong(r) for r in own))
    print("\n| world | hidden | rooms | right | set | extra | wrong | unexplained | missed |\n|---|---|---|---|---|---|---|---|---|")
    alike = {"unnamed": "unexplained", "part": "missed"}
    groups = {}
    for row in others:
        groups.setdefault((row["world"], row["hidden"].split(":")[0]), []).append(alike.get(row["outcome"], row["outcome"]))
    for (world, hidden), own in sorted(groups.items()):
        counts = " | ".join(str(own.count(o)) for o in ("right", "set", "extra", "wrong", "unexplained", "missed"))
        print(f"| {world} | {hidden} | {len(own)} | {counts} |")
    print("\n| world | hidden | strength | seed | answer |\n|---|---|---|---|---|")
    for row in rows:
        if not right(row) or row["false_names"] or is_null(row) and misfit(row):
            print("| {world} | {hidden} | {strength} | {seed} | {answer}{left} |".format(left=", a misfit left" if misfit(row) else "", **row))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("do", choices=["plan", "run", "record", "tables"])
    parser.add_argument("--seed", type=int)
    parser.add_argument("--out", type=pathlib.Path, help="folder of the rooms, with what each came to")
    parser.add_argument("--record", type=pathlib.Path)
    parser.add_argument("--programs", type=pathlib.Path, default=pathlib.Path("target/release"))
    parser.add_argument("--python", default=sys.executable, help="one that has pyroomacoustics")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--rooms", type=int, help="the first so many of the plan alone")
    parser.add_argument("--rays", type=int, default=3000)
    arguments = parser.parse_args()
    wanted = {"plan": ["seed"], "run": ["seed", "out"], "record": ["seed", "out", "record"], "tables": ["record"]}[arguments.do]
    if missing := [name for name in wanted if getattr(arguments, name) is None]:
        parser.error(f"{arguments.do} needs --{' --'.join(missing)}")
    if arguments.do == "plan":
        for number, task in enumerate(plan(arguments.seed)):
            print(f"{number:03}", *task)
    elif arguments.do == "run":
        run(arguments)
    elif arguments.do == "record":
        temporary = arguments.record.with_suffix(".part")
        with open(temporary, "w", newline="") as file:
            writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(lines(arguments.seed, arguments.out))
        temporary.rename(arguments.record)
    else:
        with open(arguments.record, newline="") as file:
            tables(list(csv.DictReader(file)))


if __name__ == "__main__":
    main()
