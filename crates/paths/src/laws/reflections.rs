//! Laws of reflections: tables by angle, summed along chains.

use crate::conditions::Conditions;
use crate::laws::bound::BoundLaw;
use crate::laws::error::{LawError, LawFault, Place};
use crate::laws::formula::Op;
use crate::laws::gain::{check_gain, nepers};
use crate::laws::target::LawTarget;
use crate::laws::variable::Variable;
use crate::path_set::{ANGLES, PathSet, angle_cosine};
use crate::reweighting::Lanes;
use sabine_acoustics::{Bands, Error, LocalReaction, Material, OutOfRange};

/// What laws do to the logarithm of the energy at each meeting with a surface.
pub(crate) struct ReflectionTables {
    /// `[material][band][angle]`, empty for materials without a law; as a last angle, what needs none.
    tables: Vec<Vec<Vec<f64>>>,
    /// Whether some law asks for an angle that follows from the departure of each path.
    along_axes: bool,
}

impl ReflectionTables {
    /// The tables of the laws of reflections and of walls that react locally; `None` where there are none.
    pub fn new(conditions: &Conditions<'_>, paths: &PathSet, bands: Bands) -> Result<Option<Self>, Error> {
        let mut tables = vec![Vec::new(); paths.materials()];
        let (mut along_axes, mut any) = (false, false);
        if let Some((share, materials)) = conditions.local_reaction {
            OutOfRange::check("locally reacting share", share, -1.0, 2.0, "between -1 and 2")?;
            let own = paths.check_materials(materials)?;
            if own != bands {
                return Err(Error::BandMismatch { left: bands, right: own });
            }
            for (material, table) in tables.iter_mut().enumerate() {
                let (unknown, axes) = paths.untold_angles(material);
                if unknown {
                    return Err(Error::AngleNotRecorded { material });
                }
                along_axes |= axes;
                *table = reacting_locally(&materials[material], share);
            }
            any = true;
        }
        for bound in conditions.laws.iter().flat_map(|laws| laws.of(LawTarget::Reflection)) {
            let Some(surface) = bound.surface.filter(|&surface| surface < paths.materials()) else {
                let name = bound.law.surface().unwrap_or_default().to_owned();
                let fault = LawFault::UnknownSurface { name, nearest: None };
                return Err(bound.law.error(None, fault).into());
            };
            if bound.asks_for_angle() {
                let (unknown, axes) = paths.untold_angles(surface);
                if unknown {
                    let (variable, why) =
                        ("cos_incidence", "the tracer did not record at which angle paths meet this surface");
                    return Err(bound.law.error(None, LawFault::NotKnown { variable, why }).into());
                }
                along_axes |= axes;
            }
            any = true;
            let table = &mut tables[surface];
            if table.is_empty() {
                *table = vec![vec![0.0; ANGLES + 1]; bands.len()];
            }
            add(bound, bands, table)?;
        }
        Ok(any.then_some(Self { tables, along_axes }))
    }

    /// Steps of each event at each angle, `[event * 256 + angle]`, from those of each event, `material * 2 + scattered`.
    pub fn steps(&self, steps: &[Lanes], first_band: usize) -> Vec<Lanes> {
        let tables: Vec<Vec<Lanes>> = self.tables.iter().map(|table| lanes(table, first_band)).collect();
        let step = |event: usize, angle: usize| {
            let law = tables[event / 2].get(angle.min(ANGLES)).copied().unwrap_or_default();
            std::array::from_fn(|i| steps[event][i] + law[i])
        };
        (0..steps.len())
            .flat_map(|event| (0..256).map(move |angle| step(event, angle)).collect::<Vec<_>>())
            .collect()
    }

    /// What the laws add to each path, beside what they add along its chains.
    pub fn along_axes(&self, paths: &PathSet, first_band: usize) -> Option<Vec<Lanes>> {
        self.along_axes.then(|| {
            let tables: Vec<Vec<Lanes>> = self.tables.iter().map(|table| lanes(table, first_band)).collect();
            paths.sums_along_axes(&tables)
        })
    }
}

/// A table by angle in the bands from one on.
fn lanes(table: &[Vec<f64>], first_band: usize) -> Vec<Lanes> {
    if table.is_empty() {
        return Vec::new();
    }
    let at = |angle: usize, lane: usize| table.get(first_band + lane).map_or(0.0, |row| row[angle]);
    (0..=ANGLES).map(|angle| std::array::from_fn(|lane| at(angle, lane) as f32)).collect()
}

/// What a wall that reacts locally by a share adds to the logarithm of what it reflects, `[band][angle]`; nothing at an angle that nobody knows,
/// as no path has it.
fn reacting_locally(material: &Material, share: f64) -> Vec<Vec<f64>> {
    let of_band = |absorption: &f64| {
        let wall = LocalReaction::new(*absorption);
        (0..ANGLES).map(|angle| share * wall.log_change(angle_cosine(angle))).chain([0.0]).collect()
    };
    material.absorption().values().iter().map(of_band).collect()
}

/// Adds the natural logarithm of the energy factor of a law at all angles in all bands.
fn add(bound: &BoundLaw, bands: Bands, table: &mut [Vec<f64>]) -> Result<(), LawError> {
    let asks = bound.asks_for_angle();
    for (band, row) in table.iter_mut().enumerate() {
        let hz = bands.nominal_hz(band);
        let place = Place { path: None, band_hz: Some(hz) };
        for (angle, sum) in row.iter_mut().enumerate() {
            // What asks for the angle never meets the last place, which stands for an angle that nobody knows.
            let cosine = angle_cosine(angle.min(ANGLES - 1));
            let variable = |op: Op| if op == Op::Variable(Variable::Frequency) { hz } else { cosine };
            if asks && angle == ANGLES {
                continue;
            }
            let db = bound.value(place, variable)?;
            check_gain(&bound.law, db, place)?;
            *sum += nepers(db);
        }
    }
    Ok(())
}
