//! How much of the sound a box lets past itself: the ways around it, each as around a thin screen.
//!
//! Source: Z. Maekawa, Noise reduction by screens, Applied Acoustics 1, 1968; U. J. Kurze and G. S. Anderson, Sound attenuation by barriers,
//! Applied Acoustics 4, 1971 (eq. 14: 5 + 20 lg (√(2πN) / tanh √(2πN)) dB with Fresnel's number N = 2δ/λ); energies of several ways add.

use crate::extend::standing_box::Solid;

/// No screen is seen to take more, in dB (Maekawa 1968).
pub(crate) const MOST_DB: f64 = 24.0;

/// Attenuation of a screen around which the way is longer by δ, in dB.
fn screen_db(longer_m: f64, wave_length_m: f64) -> f64 {
    let x = (std::f64::consts::TAU * 2.0 * longer_m.max(0.0) / wave_length_m).sqrt();
    // x / tanh x goes to one.
    let ratio = if x < 1e-3 { 1.0 } else { x / x.tanh() };
    (5.0 + 20.0 * ratio.log10()).min(MOST_DB)
}

/// By how much a box attenuates the straight way between two places, in dB; nothing where it goes past.
pub(crate) fn attenuation_db(solid: &Solid, from: [f64; 3], to: [f64; 3], wave_length_m: f64) -> f64 {
    let Some([enters, leaves]) = solid.crossed(from, to) else { return 0.0 };
    // An end in the box itself, which is where the box cannot stand.
    if enters <= 0.0 || leaves >= 1.0 {
        return MOST_DB;
    }
    let (a, b) = (solid.local(from), solid.local(to));
    let around = [over_m(solid, a, b), beside_m(solid, a, b, 1.0), beside_m(solid, a, b, -1.0)];
    let straight = distance(a, b);
    let past: f64 =
        around.iter().map(|way| 10f64.powf(-0.1 * screen_db(way - straight, wave_length_m))).sum();
    (-10.0 * past.log10()).clamp(0.0, MOST_DB)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// The way over the upper face, in the upright plane of the straight one: a rope pulled tight over both edges.
fn over_m(solid: &Solid, a: [f64; 3], b: [f64; 3]) -> f64 {
    let flat = (b[0] - a[0]).hypot(b[1] - a[1]);
    // Where the plan of the way enters and leaves that of the box, as shares of it.
    let (mut enters, mut leaves) = (0.0f64, 1.0f64);
    for k in 0..2 {
        let way = b[k] - a[k];
        if way.abs() > 1e-12 {
            let ends = [(-solid.half[k] - a[k]) / way, (solid.half[k] - a[k]) / way];
            enters = enters.max(ends[0].min(ends[1]));
            leaves = leaves.min(ends[0].max(ends[1]));
        }
    }
    let edges = [enters, leaves].map(|share| [share.clamp(0.0, 1.0) * flat, solid.height]);
    tight_m([0.0, a[2]], &edges, [flat, b[2]])
}

/// The way around the sides, to the left (1) or right (-1) of the straight one in plan; heights change evenly along it.
fn beside_m(solid: &Solid, a: [f64; 3], b: [f64; 3], side: f64) -> f64 {
    let flat = (b[0] - a[0]).hypot(b[1] - a[1]);
    if flat < 1e-9 {
        return f64::INFINITY;
    }
    let along = [(b[0] - a[0]) / flat, (b[1] - a[1]) / flat];
    let mut beyond: Vec<[f64; 2]> = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .into_iter()
        .map(|[u, v]| {
            let from = [u * solid.half[0] - a[0], v * solid.half[1] - a[1]];
            let beside = side * (along[0] * from[1] - along[1] * from[0]);
            [along[0] * from[0] + along[1] * from[1], beside]
        })
        .filter(|[_, beside]| *beside > 0.0)
        .collect();
    beyond.sort_by(|p, q| p[0].total_cmp(&q[0]));
    let plan = tight_m([0.0; 2], &beyond, [flat, 0.0]);
    plan.hypot(b[2] - a[2])
}

/// Length of a rope from one point to another that is pulled tight over points between (sorted by their first coordinate).
fn tight_m(from: [f64; 2], over: &[[f64; 2]], to: [f64; 2]) -> f64 {
    let mut hull = vec![from];
    for &next in over.iter().chain([&to]) {
        while hull.len() > 1 {
            let ([a, b], [c, d]) = (hull[hull.len() - 2], hull[hull.len() - 1]);
            // The last point lies on or below the way past it.
            if (c - a) * (next[1] - b) - (d - b) * (next[0] - a) < 0.0 {
                break;
            }
            hull.pop();
        }
        hull.push(next);
    }
    hull.windows(2).map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extend::standing_box::StandingBox;

    #[test]
    fn a_screen_attenuates_as_the_chart_says() {
        // Maekawa's chart: 5 dB at the edge of the shadow, 13 dB at N = 1, 20 lg √(2πN) + 5 far in it, 24 dB at most.
        assert!((screen_db(0.0, 0.12) - 5.0).abs() < 1e-9);
        assert!((screen_db(0.06, 0.12) - 13.1).abs() < 0.2, "{}", screen_db(0.06, 0.12));
        assert!((screen_db(0.3, 0.12) - 20.0).abs() < 0.1, "{}", screen_db(0.3, 0.12));
        assert!((screen_db(30.0, 0.12) - MOST_DB).abs() < 1e-9);
    }

    /// The shortest way around against one found by trying points of the edges.
    #[test]
    fn ways_around_are_the_shortest_over_the_edges() {
        let one = StandingBox::new([0.0; 3], [2.0, 0.6, 1.0], 0.0, 0.1);
        let solid = Solid::of(&one);
        let (from, to) = ([-0.4, -1.5, 0.6], [0.3, 1.9, 0.8]);
        let straight = distance(from, to);
        // Over both upper edges along the length: points of each edge, one by one.
        let mut best = f64::INFINITY;
        for i in 0..=400 {
            for j in 0..=400 {
                let [x, y] = [i, j].map(|n| -1.0 + f64::from(n) / 200.0);
                let (p, q) = ([x, -0.3, 1.0], [y, 0.3, 1.0]);
                best = best.min(distance(from, p) + distance(p, q) + distance(q, to));
            }
        }
        // The plane of the straight way misses the shortest by millimetres.
        let over = over_m(&solid, from, to);
        assert!(over >= best - 1e-6 && over - best < 5e-3, "{over} {best}");
        // Around the ends: over two upright edges.
        let upright = |x: f64| {
            let mut best = f64::INFINITY;
            for i in 0..=200 {
                for j in 0..=200 {
                    let [z, w] = [i, j].map(|n| f64::from(n) / 200.0);
                    let (p, q) = ([x, -0.3, z], [x, 0.3, w]);
                    best = best.min(distance(from, p) + distance(p, q) + distance(q, to));
                }
            }
            best
        };
        // Left of a way along y is the smaller x.
        for (side, x) in [(1.0, -1.0), (-1.0, 1.0)] {
            let found = beside_m(&solid, from, to, side);
            assert!((found - upright(x)).abs() < 1e-3, "{found} {}", upright(x));
        }
        let past = attenuation_db(&solid, from, to, 0.12);
        let least = [over, beside_m(&solid, from, to, 1.0), beside_m(&solid, from, to, -1.0)]
            .map(|way| screen_db(way - straight, 0.12))
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        assert!(past <= least && past > least - 4.8, "{past} {least}");
        // What goes past the box is not touched; what grazes its edge is 5 dB less.
        assert_eq!(attenuation_db(&solid, [-0.4, -1.5, 1.3], [0.3, 1.9, 1.4], 0.12), 0.0);
        let grazing = attenuation_db(&solid, [0.0, -2.0, 0.999], [0.0, 2.0, 0.999], 0.12);
        assert!((4.0..6.5).contains(&grazing), "{grazing}");
    }
}
