//! What may change without tracing again.

use crate::laws::BoundLaws;
use sabine_acoustics::{Air, Bands, Directivity, Error, Material, Orientation};

/// All that paths leave open: surfaces, air, and how source and receiver are turned and what they favour.
///
/// ```
/// use sabine_acoustics::{Air, Bands, Directivity, Material, Orientation};
/// use sabine_paths::Conditions;
/// let walls = [Material::uniform(Bands::T60, 0.1, 0.2)?];
/// let (air, voice) = (Air::default(), Directivity::first_order(Directivity::SUBCARDIOID)?);
/// let facing = Orientation::towards([0.0, 1.0, 0.0])?;
/// let conditions = Conditions::new(&walls, &air).with_source(&voice, facing);
/// assert!(conditions.receiver.is_none()); // hears all directions alike
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Conditions<'a> {
    /// A material for each that the paths know, in the same order.
    pub materials: &'a [Material],
    /// The air: speed of sound, and attenuation unless another air is named for it.
    pub air: &'a Air,
    /// The air that attenuates, where what is known of it was found apart from the speed of sound; `None` is [`Conditions::air`].
    pub attenuation: Option<&'a Air>,
    /// How the source radiates and where it faces; `None` is omnidirectional.
    pub source: Option<(&'a Directivity, Orientation)>,
    /// How the receiver hears and where it faces; `None` is omnidirectional.
    pub receiver: Option<(&'a Directivity, Orientation)>,
    /// Formulas that change what paths carry and when they arrive.
    pub laws: Option<&'a BoundLaws>,
    /// By which share walls react locally, and the materials whose absorption at random incidence gives their impedances; `None` is absorption
    /// that is the same at all angles.
    pub local_reaction: Option<(f64, &'a [Material])>,
}

impl<'a> Conditions<'a> {
    /// Omnidirectional source and receiver between these surfaces.
    pub fn new(materials: &'a [Material], air: &'a Air) -> Self {
        Self {
            materials,
            air,
            attenuation: None,
            source: None,
            receiver: None,
            laws: None,
            local_reaction: None,
        }
    }

    /// The same between other surfaces.
    #[must_use]
    pub fn with_materials(self, materials: &'a [Material]) -> Self {
        Self { materials, ..self }
    }

    /// The same with sound attenuated as by another air; the speed of sound stays.
    #[must_use]
    pub fn with_attenuation(self, air: &'a Air) -> Self {
        Self { attenuation: Some(air), ..self }
    }

    /// The same with a directional source. Energies are then relative to the direct sound on its axis at 1 m.
    #[must_use]
    pub fn with_source(self, directivity: &'a Directivity, orientation: Orientation) -> Self {
        Self { source: Some((directivity, orientation)), ..self }
    }

    /// The same with a directional receiver, of gain 1 on its axis.
    #[must_use]
    pub fn with_receiver(self, directivity: &'a Directivity, orientation: Orientation) -> Self {
        Self { receiver: Some((directivity, orientation)), ..self }
    }

    /// The same under laws, bound for this source and receiver.
    #[must_use]
    pub fn with_laws(self, laws: &'a BoundLaws) -> Self {
        Self { laws: Some(laws), ..self }
    }

    /// The same with walls that react locally by a share, so that they absorb by the angle at which sound meets them: the logarithm of what a
    /// wall reflects lies so far between that of its absorption, the same at all angles (0), and that of the real impedance which absorbs
    /// as much of sound from all directions as the wall's material among these (1; [`LocalReaction`](sabine_acoustics::LocalReaction)). The
    /// materials are named on their own: where absorption is varied, impedances stay.
    ///
    /// Energies ask for the angles: a tracer that does not record them ([`Incidence::Unknown`](crate::Incidence::Unknown)) is an error then.
    #[must_use]
    pub fn with_local_reaction(self, share: f64, materials: &'a [Material]) -> Self {
        Self { local_reaction: Some((share, materials)), ..self }
    }

    /// That directivities, if they have bands, have those of the materials.
    pub(crate) fn check_bands(&self, bands: Bands) -> Result<(), Error> {
        for (directivity, _) in [self.source, self.receiver].into_iter().flatten() {
            if let Some(own) = directivity.bands().filter(|&own| own != bands) {
                return Err(Error::BandMismatch { left: bands, right: own });
            }
        }
        Ok(())
    }
}
