//! Five rooms of the sizes that Tang et al. 2020 fitted materials in, built from their plans.

use sabine::acoustics::{Bands, Error, library_material};
use sabine::scene::{NamedMaterial, Receiver, Scene, Source, Triangle};

/// A room with a source and a receiver in it.
pub struct Room {
    /// What the paper calls it, and its size.
    pub name: &'static str,
    /// Mesh and materials: the library's, standing for what a user guesses.
    pub scene: Scene,
    /// Where the sound comes from.
    pub source: Source,
    /// Where it is heard.
    pub receiver: Receiver,
}

/// A room with vertical walls: its plan, counter-clockwise, and a flat ceiling that may slope.
struct Plan {
    name: &'static str,
    corners_m: &'static [[f64; 2]],
    /// A point of the floor that sees every corner.
    middle_m: [f64; 2],
    /// Height of the ceiling over the origin, and how much it rises per metre along x and y.
    height_m: f64,
    rise: [f64; 2],
    floor: &'static str,
    ceiling: &'static str,
    /// Library surface of the wall from each corner to the next; walls of one surface share a material.
    walls: &'static [&'static str],
    source_m: [f64; 3],
    receiver_m: [f64; 3],
}

const ROOMS: [Plan; 5] = [
    Plan {
        name: "Davis, irregular, 1100 m3",
        corners_m: &[[0.0, 0.0], [13.0, 0.0], [16.0, 7.0], [9.0, 13.0], [0.0, 11.0]],
        middle_m: [7.0, 6.0],
        height_m: 5.0,
        rise: [0.2, 0.055],
        floor: "parquet_on_concrete",
        ceiling: "plasterboard_ceiling",
        walls: &["wood_16mm", "glass_window", "plasterboard", "concrete_smooth", "wood_16mm"],
        source_m: [3.0, 3.0, 1.6],
        receiver_m: [10.0, 7.0, 1.3],
    },
    Plan {
        name: "301, 12 x 17 x 7 m",
        corners_m: &[[0.0, 0.0], [12.0, 0.0], [12.0, 17.0], [0.0, 17.0]],
        middle_m: [6.0, 8.0],
        height_m: 7.0,
        rise: [0.0, 0.0],
        floor: "seats_upholstered",
        ceiling: "acoustic_plaster",
        walls: &["wood_lining", "plasterboard", "concrete_smooth", "glass_window"],
        source_m: [6.5, 2.5, 1.6],
        receiver_m: [4.0, 11.0, 1.3],
    },
    Plan {
        name: "501, 11 x 15 x 6 m",
        corners_m: &[[0.0, 0.0], [11.0, 0.0], [11.0, 15.0], [0.0, 15.0]],
        middle_m: [5.5, 7.0],
        height_m: 6.0,
        rise: [0.0, 0.0],
        floor: "linoleum_on_concrete",
        ceiling: "ceiling_tiles",
        walls: &["brick_painted", "plaster_on_lath", "wood_lining", "glass_window"],
        source_m: [4.0, 2.0, 1.6],
        receiver_m: [7.5, 10.0, 1.3],
    },
    Plan {
        name: "620, 4 x 6 x 3 m, 11 planes",
        corners_m: &[
            [0.7, 0.0],
            [4.0, 0.0],
            [4.0, 4.8],
            [3.4, 4.8],
            [3.4, 6.0],
            [0.5, 6.0],
            [0.5, 5.2],
            [0.0, 5.2],
            [0.0, 0.7],
        ],
        middle_m: [2.0, 3.0],
        height_m: 3.0,
        rise: [0.0, 0.0],
        floor: "carpet_thin",
        ceiling: "plasterboard_ceiling",
        walls: &[
            "plasterboard",
            "rendered_brick",
            "plasterboard",
            "plasterboard",
            "glass_window",
            "plasterboard",
            "plasterboard",
            "rendered_brick",
            "wooden_door",
        ],
        source_m: [2.9, 1.2, 1.5],
        receiver_m: [1.4, 4.3, 1.3],
    },
    Plan {
        name: "750, 11 x 8 x 4 m",
        corners_m: &[[0.0, 0.0], [11.0, 0.0], [11.0, 8.0], [0.0, 8.0]],
        middle_m: [5.0, 4.0],
        height_m: 4.0,
        rise: [0.0, 0.0],
        floor: "carpet_on_felt",
        ceiling: "plasterboard_ceiling",
        walls: &["curtain_light", "wood_16mm", "rendered_brick", "double_glazing"],
        source_m: [2.0, 2.5, 1.6],
        receiver_m: [8.0, 5.5, 1.3],
    },
];

/// The five rooms, materials on the seven octaves of the paper.
pub fn rooms() -> Result<Vec<Room>, Error> {
    ROOMS.iter().map(Plan::room).collect()
}

impl Plan {
    fn room(&self) -> Result<Room, Error> {
        let count = self.corners_m.len();
        let ceiling_m = |[x, y]: [f64; 2]| self.height_m + self.rise[0] * x + self.rise[1] * y;
        let mut vertices: Vec<[f64; 3]> = self.corners_m.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        vertices.extend(self.corners_m.iter().map(|&at| [at[0], at[1], ceiling_m(at)]));
        let [x, y] = self.middle_m;
        vertices.extend([[x, y, 0.0], [x, y, ceiling_m(self.middle_m)]]);

        let mut materials: Vec<NamedMaterial> = Vec::new();
        let mut surface = |name: &'static str| -> Result<u32, Error> {
            let known = materials.iter().position(|m| m.name == name);
            let index = known.unwrap_or(materials.len());
            if known.is_none() {
                let material = library_material(name)?.material(Bands::T60)?;
                materials.push(NamedMaterial { name: name.to_owned(), material });
            }
            Ok(index as u32)
        };
        let (floor, ceiling) = (surface(self.floor)?, surface(self.ceiling)?);
        let (below, above) = (2 * count as u32, 2 * count as u32 + 1);
        let mut triangles = Vec::new();
        for (i, name) in self.walls.iter().enumerate() {
            let (a, b) = (i as u32, ((i + 1) % count) as u32);
            let (c, d) = (b + count as u32, a + count as u32);
            let wall = surface(name)?;
            triangles.extend([
                Triangle { vertices: [a, b, below], material: floor },
                Triangle { vertices: [d, above, c], material: ceiling },
                Triangle { vertices: [a, d, c], material: wall },
                Triangle { vertices: [a, c, b], material: wall },
            ]);
        }
        Ok(Room {
            name: self.name,
            scene: Scene::new(vertices, triangles, materials)?,
            source: Source::omni("source", self.source_m)?,
            receiver: Receiver::omni("receiver", self.receiver_m)?,
        })
    }
}
