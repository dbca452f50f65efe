"""What is left over many rooms, by octave and place in the decay: what one room leaves to chance shows when all leave the same.

    python3 docs/validation/other_worlds/residuals.py /tmp/worlds/out_*/diagnosis.json

Measured over predicted energy under the named causes, mean over responses (`residuals` in diagnosis.json), and of it the mean over rooms in
dB: the first three bins, three equal parts of the rest, the last three bins. Rooms with fewer than twelve bins in an octave are left
out there. The standard library is all it needs.
"""
import json
import sys
from collections import defaultdict
from pathlib import Path
from statistics import fmean

ENDS = 3
PARTS = 3


def place(index, count):
    if index < ENDS:
        return index
    if index >= count - ENDS:
        return index - count
    return f"{(index - ENDS) * PARTS // (count - 2 * ENDS) + 1} of {PARTS}"


def main(paths):
    left = defaultdict(list)
    p_values = []
    for path in paths:
        found = json.loads(Path(path).read_text())
        p_values.append(found["lack_of_fit"]["p_value_explained"])
        by_octave = defaultdict(list)
        for bin_ in found["residuals"]:
            if bin_["response"] is None:
                by_octave[bin_["band_hz"]].append((bin_["time_s"], bin_["after_db"]))
        for octave, bins in by_octave.items():
            if len(bins) >= 12:
                for index, (_, db) in enumerate(sorted(bins)):
                    left[octave, place(index, len(bins))].append(db)
    columns = [*range(ENDS), *(f"{n + 1} of {PARTS}" for n in range(PARTS)), *range(-ENDS, 0)]
    print("| octave, Hz | " + " | ".join(f"{c if isinstance(c, str) else 'bin ' + str(c)}" for c in columns) + " |")
    print("|---" * (1 + len(columns)) + "|")
    for octave in sorted({key[0] for key in left}):
        cells = [f"{fmean(left[octave, c]):+.2f}" if left[octave, c] else "-" for c in columns]
        print(f"| {octave:g} | " + " | ".join(cells) + " |")
    below = ", ".join(f"{sum(p < level for p in p_values)} below {level:g}" for level in (0.1, 0.01, 0.001))
    print(f"\nProbability of what is left, {len(p_values)} rooms: {below}")


main(sys.argv[1:])
