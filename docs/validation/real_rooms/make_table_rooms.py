"""Rooms of BRAS CR2, CR3 and CR4 with their tables of parameters, in the form that `sabine fit` reads.

    python3 make_table_rooms.py SHARED_DATA OUT [--tables-only]

With --tables-only rooms have no responses, so that `sabine diagnose` takes the tables.

Nothing of the data is part of the project. The octaves of 62.5 Hz and 8 kHz are left out: their filters were open-ended when the
tables were made.
"""

import csv
import pathlib
import shutil
import sys

LEFT_OUT = {"62.5", "8000"}


def make(data, out, room, tables_only):
    source = data / "rooms" / f"bras_{room}"
    folder = out / room
    folder.mkdir(parents=True)
    shutil.copy(source / "room.obj", folder)
    text = (source / "room.toml").read_text()
    if tables_only:
        text = text.split("[[responses]]")[0]
    elif (source / "ir").is_dir():
        shutil.copytree(source / "ir", folder / "ir")
    (folder / "room.toml").write_text(text.rstrip() + '\n\n[[parameters]]\nfile = "parameters.csv"\n')
    with open(data / "rooms_more" / "bras_parameters" / f"{room}.csv", newline="") as table:
        rows = list(csv.reader(table))
    with open(folder / "parameters.csv", "w", newline="") as table:
        csv.writer(table).writerows(row for row in rows if row[1] not in LEFT_OUT)


if __name__ == "__main__":
    data, out = map(pathlib.Path, sys.argv[1:3])
    for name in ("cr2", "cr3", "cr4"):
        make(data, out, name, "--tables-only" in sys.argv[3:])
