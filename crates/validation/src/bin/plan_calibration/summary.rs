//! What a record amounts to.

use crate::Trial;
use std::collections::BTreeMap;

/// Prints slope and regret.
pub fn print(trials: &[Trial]) {
    let mut rooms: BTreeMap<u64, Vec<&Trial>> = BTreeMap::new();
    for trial in trials {
        rooms.entry(trial.seed).or_default().push(trial);
    }
    let rooms: Vec<Vec<&Trial>> = rooms.into_values().collect();
    println!("{} measurements of {} rooms", trials.len(), rooms.len());
    if rooms.len() < 2 {
        return;
    }
    let [slope, low, high] = slope(&rooms);
    println!("realised over expected nats: {slope:.2} ({low:.2} to {high:.2}, 90 %, rooms drawn again)");
    let mean = |of: fn(&Trial) -> f64| trials.iter().map(of).sum::<f64>() / trials.len() as f64;
    println!(
        "mean expected {:.2}, mean realised {:.2}",
        mean(|t| t.expected_nats),
        mean(|t| t.realised_nats)
    );
    let (mut planned, mut random) = (Vec::new(), Vec::new());
    for room in &rooms {
        let best = room.iter().map(|t| t.realised_nats).fold(f64::NEG_INFINITY, f64::max);
        let Some(chosen) = room.iter().max_by(|a, b| a.expected_nats.total_cmp(&b.expected_nats)) else {
            continue;
        };
        if best <= 0.0 {
            continue;
        }
        let of_all = room.iter().map(|t| t.realised_nats).sum::<f64>() / room.len() as f64;
        planned.push(1.0 - chosen.realised_nats / best);
        random.push(1.0 - of_all / best);
    }
    println!(
        "regret, median over {} rooms: the place recommended {:.0} %, a random one {:.0} %",
        planned.len(),
        100.0 * median(&mut planned),
        100.0 * median(&mut random)
    );
    let mut contests: BTreeMap<(&str, &str), [f64; 3]> = BTreeMap::new();
    for t in trials {
        let sums = contests.entry((&t.hidden, &t.rival)).or_default();
        sums[0] += 1.0;
        sums[1] += t.expected_nats;
        sums[2] += t.realised_nats;
    }
    println!(
        "| hidden | taken for | measurements | expected, mean | realised, mean |\n|---|---|---|---|---|"
    );
    for ((hidden, rival), [count, expected, realised]) in contests {
        println!("| {hidden} | {rival} | {count:.0} | {:.2} | {:.2} |", expected / count, realised / count);
    }
}

/// Slope through the origin, and its 90 % interval from rooms drawn again with replacement: places of one room are no independent units.
fn slope(rooms: &[Vec<&Trial>]) -> [f64; 3] {
    use rand::{Rng, SeedableRng, rngs::SmallRng};
    let of = |some: &[&Vec<&Trial>]| {
        let all = || some.iter().flat_map(|room| room.iter());
        let products: f64 = all().map(|t| t.expected_nats * t.realised_nats).sum();
        products / all().map(|t| t.expected_nats.powi(2)).sum::<f64>()
    };
    let mut random = SmallRng::seed_from_u64(1);
    let mut drawn: Vec<f64> = (0..2000)
        .map(|_| {
            let again: Vec<&Vec<&Trial>> =
                rooms.iter().map(|_| &rooms[random.random_range(0..rooms.len())]).collect();
            of(&again)
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    [of(&rooms.iter().collect::<Vec<_>>()), drawn[100], drawn[1899]]
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
