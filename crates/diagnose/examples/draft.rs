//! draft
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let room = sabine_acoustics::MeasuredRoom::read(&a[1]).unwrap();
    let mut c = sabine_diagnose::DiagnoseConfig::default();
    if let Some(r) = a.get(2) { c.rays = r.parse().unwrap(); }
    if let Err(e) = sabine_diagnose::draft(&room, &c) { eprintln!("{e}"); }
}
