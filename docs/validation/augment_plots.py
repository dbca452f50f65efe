"""Distribution of the labels before and after augmentation, as SVG, from the manifest of a data set.

usage: augment_plots.py DATASET_DIR OUT_DIR
"Before" is the test partition (measured responses as they are), "after" the training partition.
"""

import json
import sys


def histogram(label, columns, hertz, unit, path, share=0.999):
    """Small multiples: one panel an octave; outline = measured responses, filled = training set."""
    width, height, left, top, gap = 150, 110, 40, 46, 14
    parts = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {} {}" font-family="sans-serif" font-size="11">'.format(
            left + len(columns) * (width + gap), top + height + 46
        ),
        "<style>text{fill:#333}.b{fill:none;stroke:#c2410c;stroke-width:1.5}.a{fill:#60a5fa;fill-opacity:.55}"
        ".x{stroke:#999}@media(prefers-color-scheme:dark){text{fill:#ddd}.b{stroke:#fb923c}.x{stroke:#777}}</style>",
        f'<text x="{left}" y="16" font-size="13" font-weight="bold">{label}</text>',
        f'<rect class="a" x="{left}" y="24" width="12" height="10"/><text x="{left + 16}" y="33">training set</text>',
        f'<path class="b" d="M{left + 100} 29h14"/><text x="{left + 120}" y="33">measured responses of the test rooms</text>',
    ]
    for i, ((after, before), hz) in enumerate(zip(columns, hertz)):
        x0, base = left + i * (width + gap), top + height
        bins, first, step = len(after["histogram"]), after["first_edge"], after["bin_width"]
        bars = [h / max(1, after["count"]) for h in after["histogram"]]
        lines = [h / max(1, before["count"]) for h in (before["histogram"] or [0] * bins)]
        # The panel ends where hardly anything is left.
        lines = [min(v, 2.2 * max(bars)) for v in lines]
        most = max(bars + lines) or 1
        w = width / bins
        for k, v in enumerate(bars):
            h = v / most * height
            parts.append(f'<rect class="a" x="{x0 + k * w:.1f}" y="{base - h:.1f}" width="{w:.1f}" height="{h:.1f}"/>')
        d = f"M{x0} {base}" + "".join(
            f"V{base - v / most * height:.1f}H{x0 + (k + 1) * w:.1f}" for k, v in enumerate(lines)
        )
        parts.append(f'<path class="b" d="{d}V{base}"/><path class="x" d="M{x0} {base}h{width}"/>')
        parts.append(f'<text x="{x0 + width / 2}" y="{base + 30}" text-anchor="middle">{hz:g} Hz</text>')
        for k in (0, bins // 2, bins):
            anchor = "start" if k == 0 else "end" if k == bins else "middle"
            parts.append(f'<text x="{x0 + k * w:.1f}" y="{base + 13}" text-anchor="{anchor}" font-size="9">{first + k * step:.1f}</text>')
    parts.append(f'<text x="{left - 4}" y="{top + height + 30}" text-anchor="end">{unit}</text></svg>')
    open(path, "w").write("\n".join(parts) + "\n")


def main():
    manifest = json.load(open(sys.argv[1] + "/manifest.json"))
    after, before = manifest["statistics"]["train"], manifest["statistics"]["test"]
    out = sys.argv[2]
    for key, name, hertz, unit in [
        ("t60_s", "Reverberation time", manifest["t60_bands_hz"], "s"),
        ("eq_db", "Equalisation re 1 kHz", manifest["eq_bands_hz"], "dB"),
    ]:
        histogram(name, list(zip(after[key], before[key])), hertz, unit, f"{out}/augment_{key}.svg")


main()
