//! Materials that scatter more or less than stated.

use sabine_acoustics::{Bands, Error, Material, PerBand};

/// A material that scatters more (of what it reflects specularly) or less (of what it scatters).
pub(crate) fn scattering_more(material: &Material, extra: f64) -> Result<Material, Error> {
    let bands: Bands = material.bands();
    let changed = PerBand::from_fn(bands, |b| {
        let s = material.scattering().values()[b];
        (if extra >= 0.0 { s + (1.0 - s) * extra } else { s * (1.0 + extra) }).clamp(0.0, 1.0)
    });
    Material::new(material.absorption().clone(), changed)
}
