//! A scene made ready for many traces.

use crate::cuboid::{Cuboid, ImageSource};
use crate::edge_diffraction::DiffractingEdges;
use crate::event_mixture::EventProbabilities;
use crate::guide::{Guide, GuidedScene};
use crate::mesh_scene::MeshScene;
use crate::patches::Patches;
use crate::weight_window::{KeptEnergy, MAX_BANDS, PilotScene, WeightWindow, ln_kept};
use crate::{Error, MeshReport, TracerConfig};
use sabine_scene::{NamedMaterial, Scene};
use std::fmt;

/// Side of the patches on which rays meet, as a share of the radius of the spheres: about as blurred.
const PATCH_SIDE: f64 = 0.7;

/// What a tracer needs to know of a scene, whatever the places of source and receiver: made once by
/// [`PathTracer::prepare`](crate::PathTracer::prepare), used by
/// [`PathTracer::trace_prepared`](crate::PathTracer::trace_prepared) as often as wanted.
pub struct PreparedScene {
    pub(crate) mesh: MeshScene,
    pub(crate) patches: Patches,
    pub(crate) probabilities: EventProbabilities,
    pub(crate) edges: Option<DiffractingEdges>,
    /// The cuboid that the mesh is, if it is one.
    pub(crate) cuboid: Option<Cuboid>,
    pub(crate) materials: usize,
    /// The materials, which say what images of a cuboid matter.
    pub(crate) named: Vec<NamedMaterial>,
    pub(crate) surface_m2: f64,
    /// Share of the reflections that scatter, over the surfaces and bands.
    pub(crate) mean_scattering: f64,
    /// What the weight window knows of the materials.
    pub(crate) ln_kept: KeptEnergy,
    bands: usize,
}

impl PreparedScene {
    pub(crate) fn new(scene: &Scene, config: &TracerConfig) -> Result<Self, Error> {
        let mesh = if config.merge_coplanar { MeshScene::merged(scene)? } else { MeshScene::new(scene)? };
        let patch_side_m = PATCH_SIDE * config.receiver_radius_m;
        let probabilities = EventProbabilities::new(scene.materials().iter().map(|m| &m.material));
        let (mut surface_m2, mut scattering_m2) = (0.0, 0.0);
        for surface in &mesh.surfaces.triangles {
            surface_m2 += surface.area_m2;
            scattering_m2 += surface.area_m2 * probabilities.mean_scattering(surface.material);
        }
        Ok(Self {
            patches: Patches::new(&mesh.surfaces, patch_side_m),
            edges: config.diffraction.then(|| DiffractingEdges::find(scene, &mesh)),
            cuboid: Cuboid::find(&mesh.surfaces),
            probabilities,
            ln_kept: ln_kept(scene.materials().iter().map(|m| &m.material)),
            bands: scene.materials().first().map_or(1, |m| m.material.bands().len()).clamp(1, MAX_BANDS),
            materials: scene.materials().len(),
            named: scene.materials().to_vec(),
            surface_m2,
            mean_scattering: scattering_m2 / surface_m2,
            mesh,
        })
    }

    /// What rays from a point carry on average.
    pub(crate) fn weight_window(
        &self,
        from: [f64; 3],
        max_length_m: f64,
        rays: usize,
        seed: u64,
    ) -> WeightWindow {
        let scattering = |material| self.probabilities.mean_scattering(material);
        let (mesh, ln_kept, bands) = (&self.mesh, &self.ln_kept, self.bands);
        let scene = PilotScene { mesh, ln_kept, bands, scattering: &scattering };
        WeightWindow::pilot(scene, from, max_length_m, rays, seed)
    }

    /// Directions in which sound stays for long, for each class of octaves.
    pub(crate) fn guides(
        &self,
        window: &WeightWindow,
        from: [f64; 3],
        max_length_m: f64,
        seed: u64,
    ) -> Vec<Option<Guide>> {
        let (mesh, ln_kept, bands) = (&self.mesh, &self.ln_kept, self.bands);
        let scene = GuidedScene { mesh, ln_kept, bands, probabilities: &self.probabilities };
        Guide::learn(scene, &window.late_loss_per_m(), from, max_length_m, seed)
    }

    /// The material (index) of each of the six faces, where the mesh is a cuboid: six whole faces at right angles, each of one material, and
    /// nothing else.
    pub fn cuboid_faces(&self) -> Option<[u32; 6]> {
        self.cuboid.as_ref().map(|cuboid| cuboid.materials)
    }

    /// Shows every image source of a cuboid that is no farther away than `max_length_m`, in a fixed order, the source itself among them
    /// (Allen and Berkley, JASA 65, 1979); none where the mesh is no cuboid. Their number grows with the third power of the length:
    /// 4/3 pi `max_length_m`^3 over the room's volume.
    pub fn for_each_image(
        &self,
        source_m: [f64; 3],
        receiver_m: [f64; 3],
        max_length_m: f64,
        visit: impl FnMut(&ImageSource),
    ) {
        if let Some(cuboid) = &self.cuboid {
            cuboid.for_each_image(source_m, receiver_m, max_length_m, visit);
        }
    }

    /// Looks for holes through which sound from this point escapes. `scene` must be the one that was prepared.
    ///
    /// # Errors
    /// [`Error::Leaking`] if more than one ray in a thousand escapes.
    pub fn check_leaks(&self, scene: &Scene, source_m: [f64; 3]) -> Result<(), Error> {
        // The edges are looked at only to tell where the holes are.
        if MeshReport::holds(&self.mesh, source_m) {
            return Ok(());
        }
        MeshReport::new(scene, &self.mesh, source_m)?.check()
    }
}

impl fmt::Debug for PreparedScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PreparedScene").field("surface_m2", &self.surface_m2).finish_non_exhaustive()
    }
}
