"""Distribution of the labels before and after augmentation, as SVG, from the manifest of a data set.

usage: augment_plots.py DATASET_DIR OUT_DIR
"Before" is the test partition (measured responses as they are), "after" the training partition.
"""

import json
import sys


def histogram(label, columns, hertz, unit, ticks, goal, path):
    """Small multiples, one panel an octave: filled = training set, outline = measured responses, each of area one.

    The panel is as high as the training set needs; an outline that is higher is cut with an arrow and its height in words.
    `goal` is the range to be covered evenly, drawn as a bar below the axis.
    """
    width, height, left, top, gap = 150, 110, 12, 64, 16
    total = left + len(columns) * (width + gap)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {total} {top + height + 46}" '
        'font-family="sans-serif" font-size="11">',
        # The style of crates/cli/src/chart.rs: Okabe and Ito's colours on paper that turns dark.
        "<style>text{fill:#222;font-family:system-ui,sans-serif}.b{fill:none;stroke:#D55E00;stroke-width:1.5}.a{fill:#56B4E9}"
        ".g{stroke:#009E73;stroke-width:3}.x{stroke:#888}.paper{fill:#fff}"
        "@media(prefers-color-scheme:dark){.paper{fill:#161616}text{fill:#e4e4e4}.b{stroke:#ff8a3c}.a{fill:#0072B2}.x{stroke:#777}}</style>",
        '<rect class="paper" width="100%" height="100%"/>',
        f'<text x="{left}" y="16" font-size="13" font-weight="bold">{label}</text>',
        f'<rect class="a" x="{left}" y="24" width="12" height="10"/><text x="{left + 16}" y="33">training set</text>',
        f'<path class="b" d="M{left + 100} 29h14"/><text x="{left + 120}" y="33">measured responses of the test rooms, as they are</text>',
    ]
    if goal:
        parts.append(f'<path class="g" d="M{left + 440} 29h14"/><text x="{left + 460}" y="33">{goal[0]:g} to {goal[1]:g} {unit}</text>')
    for i, ((after, before), hz) in enumerate(zip(columns, hertz)):
        x0, base = left + i * (width + gap), top + height
        bins, first, step = len(after["histogram"]), after["first_edge"], after["bin_width"]
        bars = [h / max(1, after["count"]) for h in after["histogram"]]
        lines = [h / max(1, before["count"]) for h in (before["histogram"] or [0] * bins)]
        most = 1.25 * max(bars) or 1
        w = width / bins
        at = lambda value: x0 + (value - first) / step * w
        for k, v in enumerate(bars):
            h = v / most * height
            parts.append(f'<rect class="a" x="{x0 + k * w:.1f}" y="{base - h:.1f}" width="{w:.1f}" height="{h:.1f}"/>')
        d = f"M{x0} {base}" + "".join(
            f"V{base - min(v / most, 1.0) * height:.1f}H{x0 + (k + 1) * w:.1f}" for k, v in enumerate(lines)
        )
        parts.append(f'<path class="b" d="{d}V{base}"/><path class="x" d="M{x0} {base}h{width}"/>')
        if max(lines) > most:
            k = lines.index(max(lines))
            x = min(max(x0 + (k + 0.5) * w, x0 + 20), x0 + width - 20)
            parts.append(f'<text x="{x:.1f}" y="{top - 5}" text-anchor="middle" font-size="9">up to {100 * max(lines):.0f} %</text>')
        if goal:
            parts.append(f'<path class="g" d="M{at(goal[0]):.1f} {base + 3}H{at(goal[1]):.1f}"/>')
        for k, tick in enumerate(ticks):
            # Values beyond the last edge are counted in the last bin.
            text = f"{tick:g}" + ("+" if k + 1 == len(ticks) and abs(tick - first - step * bins) < step else "")
            parts.append(f'<path class="x" d="M{at(tick):.1f} {base}v4"/>')
            parts.append(f'<text x="{at(tick):.1f}" y="{base + 16}" text-anchor="middle" font-size="10">{text}</text>')
        parts.append(f'<text x="{x0 + width / 2}" y="{base + 34}" text-anchor="middle">{unit}, octave at {hz:g} Hz</text>')
    parts.append("</svg>")
    open(path, "w").write("\n".join(parts) + "\n")


def main():
    manifest = json.load(open(sys.argv[1] + "/manifest.json"))
    after, before = manifest["statistics"]["train"], manifest["statistics"]["test"]
    out = sys.argv[2]
    for key, name, hertz, unit, ticks, goal in [
        ("t60_s", "Reverberation time", manifest["t60_bands_hz"], "s", [0, 0.5, 1, 1.5, 2, 2.5], (0.1, 1.5)),
        ("eq_db", "Equalisation re 1 kHz", manifest["eq_bands_hz"], "dB", [-30, -15, 0, 15, 30], None),
    ]:
        histogram(name, list(zip(after[key], before[key])), hertz, unit, ticks, goal, f"{out}/augment_{key}.svg")


main()
