//! draft
#![allow(clippy::unwrap_used)]
use sabine_testkit::{Hidden, LabConfig, Laboratory};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let mut c = sabine_diagnose::DiagnoseConfig::default();
    let folder = tempfile::tempdir().unwrap();
    let mut hold = vec![];
    let room = if a[1].contains('/') { if let Some(h) = a.get(2) { hold = h.split(',').map(String::from).collect() }; sabine_acoustics::MeasuredRoom::read(&a[1]).unwrap() } else {
        let seed: u64 = a[2].parse().unwrap();
        let lab = Laboratory::new(LabConfig { seed, ..LabConfig::default() }).unwrap();
        let strength: f64 = a.get(3).map_or(1.0, |s| s.parse().unwrap());
        let hidden: Vec<Hidden> = if a[1] == "null" { vec![] } else { a[1].split('+').map(|id| Hidden::random(id, strength, &lab, seed).unwrap()).collect() };
        println!("{hidden:?}");
        lab.write(&hidden, &folder.path().join("room"), None).unwrap()
    };
    if let Ok(r) = std::env::var("RAYS") { c.rays = r.parse().unwrap(); }
    match sabine_diagnose::Diagnoser::new(c).unwrap().diagnose(&room, &hold, &()) {
        Ok(d) => {
            println!("== {:?} {} {} p {:.3} -> {:.3} free {:.1} -> {:.1}", &a[1..], d.verdict, d.causes.iter().map(|c| c.effect.clone() + &c.subject.as_ref().map_or(String::new(), |s| format!("({s})"))).collect::<Vec<_>>().join("+"), d.lack_of_fit.p_value, d.lack_of_fit.p_value_explained, d.lack_of_fit.discrepancy_nats, d.lack_of_fit.discrepancy_nats_explained);
            for c in &d.causes {
                println!("  {} p {:.3} nats {:.1} gain {:?}", c.effect, c.probability, c.nats, c.held_out_gain.as_ref().map(|g| [g.nats_per_bin, g.low, g.high, g.db_rmse_before, g.db_rmse_after].map(|x| (x*1e4).round()/1e4)));
                for p in &c.parameters { println!("     {} {:.3} [{:.3}, {:.3}] {}", p.name, p.value, p.low, p.high, p.unit); }
            }
            println!("  alt {:?} {:?} notes {:?}", d.alternatives, d.would_decide, d.notes);
            println!("  top {:?}", d.candidates.iter().take(5).map(|c| format!("{} {:.1}/{:.1?}", c.effect, c.nats, c.nats_beside_causes)).collect::<Vec<_>>());
            println!("  disp {:.2?} held {:?}", d.lack_of_fit.dispersion, d.held_out.as_ref().map(|h| (h.db_rmse, h.t20_jnd, h.c50_jnd, h.nats_per_bin)));
            println!("  iso {:?}", d.isolability.iter().take(3).map(|i| format!("{:?} {:.2}", i.effects, i.cosine)).collect::<Vec<_>>());
            println!("  {:?}", d.seconds);
        }
        Err(e) => println!("{e}"),
    }
}
