"""Draws the level of a sound at the left ear, and what changed when: docs/img/bevy_walls.png and clap_hall.png.

    cargo run -p sabine-with-bevy
    scratch/bin/python docs/img/draw_heard.py out/with_bevy/heard.wav docs/img/bevy_walls.png \\
        "0 brick all around" "4 carpet on the floor" "8 and plaster and a curtain"                   # numpy, scipy, matplotlib
    cargo test -p sabine-clap-plugin --test it what_the_page_draws -- --ignored
    scratch/bin/python docs/img/draw_heard.py out/with_clap/heard.wav docs/img/clap_hall.png \\
        "0 wet off" "4 wet -14 dB" "8 wet 0 dB"
"""
import sys

import matplotlib
import numpy as np
from scipy.io import wavfile

matplotlib.use("Agg")
import matplotlib.pyplot as plt

WINDOW_S = 0.02


def main(heard, picture, *changes):
    rate_hz, samples = wavfile.read(heard)
    left = samples[:, 0].astype(float)
    window = round(WINDOW_S * rate_hz)
    energy = (left[: len(left) // window * window].reshape(-1, window) ** 2).mean(axis=1)
    level_db = 10 * np.log10(np.maximum(energy, 1e-12) / energy.max())
    figure, axis = plt.subplots(figsize=(8, 3), dpi=110)
    axis.plot(WINDOW_S * np.arange(len(level_db)), level_db, color="#2b5f8a", linewidth=1.2)
    for change in changes:
        begin, text = change.split(" ", 1)
        begin_s = float(begin)
        axis.axvline(begin_s, color="#b8860b", linewidth=1)
        axis.text(begin_s + 0.1, 2, text, color="#7a5a08", fontsize=10)
    axis.set(xlim=(0, 12), ylim=(-40, 8), xlabel="time (s)", ylabel="level at the left ear (dB)")
    axis.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
