"""What `sabine diagnose` says of measured rooms, by the number of rays: the table of docs/validation/real_rooms.md.

    scratch/bin/python docs/validation/real_rooms/make_rooms.py ../shared/data out/rooms
    python3 docs/validation/real_rooms/verdicts.py target/release/sabine ../shared/data out/rooms out/verdicts

Every run leaves its folder in OUT; what is there already is not run again. The standard library is all it needs.
"""
import json
import subprocess
import sys
from pathlib import Path

RAYS = (3000, 10000, 30000)
ROOMS = [  # room, arguments, the room whose fitted materials it takes
    ("dechorate_011111", ["--hold-out", "m03,m06,m09,m12"], None),
    ("double_slope", [], None),
    ("bras_cr2", [], None),
    ("bras_cr2_other_air", [], None),
    ("bras_cr2_two", [], None),
    ("surrey_a", [], None),
    ("bbc", [], None),
    ("arni_2_again", [], "arni_2"),
    ("arni_50", [], "arni_2"),
    ("arni_2", [], "arni_50"),
]


def run(arguments, log):
    with open(log, "w") as file:
        return subprocess.run([str(a) for a in arguments], stdout=file, stderr=subprocess.STDOUT).returncode


def cause(entry):
    subject = f" ({entry['subject']})" if entry.get("subject") else ""
    return f"`{entry['effect']}`{subject} {entry['nats']:.0f}"


def answer(folder):
    """The verdict; causes with their nats, a set at the end; what is left by chance; decays at positions left out."""
    path = folder / "diagnosis.json"
    if not path.exists():
        return "no answer"
    found = json.loads(path.read_text())
    names = [cause(entry) for entry in found["causes"]]
    others = [f"`{effect}`" for effect in found["alternatives"] if effect != found["causes"][-1]["effect"]]
    if others:
        names[-1] += " or " + " or ".join(others)
    text = f"{found['verdict']}{': ' + '; '.join(names) if names else ''}"
    text += f". p {found['lack_of_fit']['p_value_explained']:.0e}"
    held_out = found["held_out"]
    if held_out:
        text += ", decays {:.2f} / {:.2f} / {:.2f} dB".format(*held_out["db_rmse"])
    return text


def main(sabine, data, rooms, out):
    out.mkdir(parents=True, exist_ok=True)
    print("| room | materials | " + " | ".join(f"{rays} rays" for rays in RAYS) + " |")
    print("|---" * (2 + len(RAYS)) + "|")
    for name, arguments, calibrated in ROOMS:
        room = next(folder for folder in (rooms / name, data / "rooms" / name) if folder.exists())
        if calibrated:
            fitted = out / f"fit_{calibrated}"
            if not (fitted / "materials.toml").exists():
                run([sabine, "fit", "--room", rooms / calibrated, "--responses", "--out", fitted], out / f"fit_{calibrated}.txt")
            arguments = arguments + ["--materials", fitted / "materials.toml"]
        answers = []
        for rays in RAYS:
            folder = out / f"{name}_{calibrated or 'stated'}_{rays}"
            if not (folder / "diagnosis.json").exists():
                run([sabine, "diagnose", "--room", room, "--rays", rays, "--out", folder, *arguments], folder.with_suffix(".txt"))
            answers.append(answer(folder))
        print(f"| {name} | {'as fitted in ' + calibrated if calibrated else 'stated'} | " + " | ".join(answers) + " |", flush=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:5]))
