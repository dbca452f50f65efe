"""Makes listening_test.csv (ratings as webMUSHRA writes them) and listening_test.json (what they amount to).

The ratings are drawn, with a seed; no person gave them. The numbers are those of scipy, statsmodels and pingouin:

    python -m venv venv && venv/bin/pip install numpy pandas scipy statsmodels pingouin
    venv/bin/python listening_test.py

Made with scipy 1.17.1, statsmodels 0.15.0, pingouin 0.7.0.
"""

import csv
import itertools
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pingouin as pg
from scipy import stats
from statsmodels.stats.anova import AnovaRM
from statsmodels.stats.multitest import multipletests

HERE = Path(__file__).parent
STIMULI = {"reference": 100, "low_anchor": 25, "mid_anchor": 55, "t60": 62, "t60_eq": 74}
SPREAD = {"reference": 3, "low_anchor": 15, "mid_anchor": 10, "t60": 6, "t60_eq": 16}
ITEMS = ["guest", "reader", "talker"]
ASSESSORS = 14
TESTED = ["mid_anchor", "t60", "t60_eq"]


def draw():
    rng = np.random.default_rng(1534)
    rows = []
    for assessor in range(ASSESSORS):
        habit = rng.normal(0, 9)
        for item in ITEMS:
            for stimulus, centre in STIMULI.items():
                score = centre + (0 if stimulus == "reference" else habit) + rng.normal(0, SPREAD[stimulus])
                score = int(np.clip(round(score), 0, 100))
                if stimulus == "reference":
                    score = max(score, 90)
                rows.append([f"a{assessor:02}", item, stimulus, score])
    table = pd.DataFrame(rows, columns=["assessor", "item", "stimulus", "score"])

    def put(assessor, item, stimulus, score):
        place = (table.assessor == assessor) & (table["item"] == item) & (table.stimulus == stimulus)
        table.loc[place, "score"] = score

    # One who does not find the reference, one who takes the mid-range anchor for it, and one at the very limit (90) who stays.
    put("a03", "guest", "reference", 89)
    put("a08", "talker", "mid_anchor", 91)
    put("a05", "reader", "reference", 90)
    put("a05", "reader", "mid_anchor", 90)
    return table


def write_ratings(table):
    """As service/write.php of webMUSHRA with one question, `assessor`."""
    with open(HERE / "listening_test.csv", "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(
            ["session_test_id", "assessor", "trial_id", "rating_stimulus", "rating_score", "rating_time", "rating_comment"]
        )
        for i, row in enumerate(table.itertuples()):
            comment = 'said "echo",\nthen nothing' if i == 7 else ""
            out.writerow(["sabine", row.assessor, row.item, row.stimulus, row.score, 1000 + i, comment])


def screened(table):
    excluded = []
    for assessor, own in table.groupby("assessor"):
        low = (own[own.stimulus == "reference"].score < 90).mean() > 0.15
        high = (own[own.stimulus == "mid_anchor"].score > 90).mean() > 0.15
        if low or high:
            excluded.append(assessor)
    return table[~table.assessor.isin(excluded)], excluded


def tests(table, subject):
    means = table[table.stimulus.isin(TESTED)].groupby([subject, "stimulus"], as_index=False).score.mean()
    fitted = AnovaRM(means, "score", subject, within=["stimulus"]).fit().anova_table.iloc[0]
    wide = means.pivot(index=subject, columns="stimulus", values="score")[TESTED]
    corrected = pg.rm_anova(data=means, dv="score", within="stimulus", subject=subject, correction=True).iloc[0]
    p_gg = [corrected[c] for c in corrected.index if c.lower().replace("-", "_") in ("p_gg_corr", "p_gg_correction")][0]
    pairs = []
    for first, second in itertools.combinations(TESTED, 2):
        result = stats.ttest_rel(wide[first], wide[second])
        interval = result.confidence_interval(0.95)
        pairs.append(
            {
                "first": first,
                "second": second,
                "difference": float((wide[first] - wide[second]).mean()),
                "interval_95": [float(interval.low), float(interval.high)],
                "t": float(result.statistic),
                "degrees": float(result.df),
                "p": float(result.pvalue),
            }
        )
    for pair, p in zip(pairs, multipletests([pair["p"] for pair in pairs], method="bonferroni")[1]):
        pair["p_bonferroni"] = float(p)
    return {
        "anova": {
            "subjects": len(wide),
            "f": float(fitted["F Value"]),
            "degrees": [float(fitted["Num DF"]), float(fitted["Den DF"])],
            "p": float(fitted["Pr > F"]),
            "epsilon": float(pg.epsilon(wide, correction="gg")),
            "p_greenhouse_geisser": float(p_gg),
        },
        "pairs": pairs,
    }


def main():
    table = draw()
    write_ratings(table)
    kept, excluded = screened(table)
    quartiles = {
        name: {
            "count": int(own.score.size),
            "mean": float(own.score.mean()),
            "lower_quartile": float(np.quantile(own.score, 0.25)),
            "median": float(np.median(own.score)),
            "upper_quartile": float(np.quantile(own.score, 0.75)),
        }
        for name, own in kept.groupby("stimulus")
    }
    kept = kept.assign(trial=kept.assessor + "/" + kept["item"])
    golden = {
        "excluded": excluded,
        "ratings": quartiles,
        "assessor": tests(kept, "assessor"),
        "trial": tests(kept, "trial"),
    }
    (HERE / "listening_test.json").write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
