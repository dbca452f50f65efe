"""Makes the mesh of a room for Sabine from a space of an IFC file: triangles in metres, named by the material behind each.

usage: ifc_to_room.py BUILDING.ifc                     lists the spaces, storey by storey
       ifc_to_room.py BUILDING.ifc SPACE OUT.obj       SPACE is a name or a GlobalId

Needs ifcopenshell (LGPL, PyPI), which makes triangles of every kind of geometry that IFC knows, tessellated or not. A piece of the
space's surface is named by the element that a ray from its middle meets first within REACH_M: its material (of layers the one next to
the space, as the file states their order), else its class. What meets nothing but another space is called `opening`, what meets
nothing at all `unnamed`. Only triangles behind which names differ are cut.
"""

import collections
import os
import sys

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.element
import ifcopenshell.util.placement
import ifcopenshell.util.unit
import numpy as np

REACH_M = 0.5
# Where materials meet, triangles are cut into pieces with edges no longer than this.
PIECE_M = 0.25
# Openings, limits in open air, furniture, pipes and lamps: no walls.
PASSED_OVER = ("IfcFeatureElement", "IfcVirtualElement", "IfcFurnishingElement", "IfcDistributionElement")


def settings():
    made = ifcopenshell.geom.settings()
    made.set("use-world-coords", True)
    # Faces of a space are often not oriented consistently.
    made.set("reorient-shells", True)
    return made


def material_of(element, **options):
    """The material of an element, else of what it is a part of."""
    while element is not None:
        found = ifcopenshell.util.element.get_material(element, **options)
        if found is not None:
            return found
        element = ifcopenshell.util.element.get_aggregate(element)
    return None


def materials_of(element):
    """Names of an element's materials, in the order of its layers."""
    material = material_of(element, should_skip_usage=True)
    if material is None:
        return []
    if material.is_a("IfcMaterialLayerSet"):
        return [layer.Material.Name for layer in material.MaterialLayers if layer.Material]
    parts = {"IfcMaterialConstituentSet": "MaterialConstituents", "IfcMaterialProfileSet": "MaterialProfiles"}
    if material.is_a() in parts:
        return [part.Material.Name for part in getattr(material, parts[material.is_a()]) or [] if part.Material]
    if material.is_a("IfcMaterialList"):
        return [one.Name for one in material.Materials]
    return [material.Name]


def triangles(shape):
    """(triangle, corner, axis), in metres, outward."""
    vertices = np.array(shape.geometry.verts).reshape(-1, 3)
    return vertices[np.array(shape.geometry.faces, dtype=int).reshape(-1, 3)]


def unmatched_edges(corners):
    """Edges that no second triangle runs along the other way: of holes, and where triangles are not oriented consistently."""
    count = collections.Counter()
    for triangle in np.round(corners, 4):
        a, b, c = map(tuple, triangle)
        for edge in ((a, b), (b, c), (c, a)):
            count[edge] += 1
            count[edge[::-1]] -= 1
    return sum(abs(n) for n in count.values()) // 2


def named_pieces(corners, name_at):
    """A triangle, its longest edge halved again and again where a half has another name than the other: names and triangles."""
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1)
    if lengths.max() <= PIECE_M:
        return [(name_at(corners.mean(axis=0)), corners)]
    a, b, c = np.roll(corners, -int(lengths.argmax()), axis=0)
    middle = (a + b) / 2
    found = named_pieces(np.array((a, middle, c)), name_at) + named_pieces(np.array((middle, b, c)), name_at)
    return [(found[0][0], corners)] if len({name for name, _ in found}) == 1 else found


def first_hit(corners, origin, direction):
    """Distance to the first triangle met within REACH_M (Moeller and Trumbore, Journal of Graphics Tools 2, 1997)."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, e2)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        inverse = 1.0 / np.einsum("ij,ij->i", e1, p)
        t = origin - corners[:, 0]
        u = np.einsum("ij,ij->i", t, p) * inverse
        q = np.cross(t, e1)
        v = q @ direction * inverse
        distance = np.einsum("ij,ij->i", e2, q) * inverse
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (distance >= -0.01) & (distance <= REACH_M)
    return distance[hit].min() if hit.any() else np.inf


def name_of(element, towards):
    """The material of an element that the space sees, looking in this direction."""
    names = materials_of(element)
    if not names:
        return element.is_a().removeprefix("Ifc").lower()
    usage = material_of(element, should_skip_usage=False)
    if len(names) > 1 and usage.is_a("IfcMaterialLayerSetUsage"):
        axis = {"AXIS1": 0, "AXIS2": 1, "AXIS3": 2}[usage.LayerSetDirection]
        placement = ifcopenshell.util.placement.get_local_placement(element.ObjectPlacement)
        along = placement[:3, axis] @ towards * (-1.0 if usage.DirectionSense == "NEGATIVE" else 1.0)
        return names[0] if along > 0 else names[-1]
    return names[0]


def name_behind(place, normal, elements, spaces):
    """The name of what a ray from here meets first."""
    ends = np.array((place, place + REACH_M * normal))
    low, high = ends.min(0) - 0.01, ends.max(0) + 0.01

    def first_of(products):
        near = [one for one in products if (one[2] <= high).all() and (one[3] >= low).all()]
        hits = [(first_hit(corners, place, normal), n) for n, (_, corners, _, _) in enumerate(near)]
        distance, n = min(hits, default=(np.inf, 0))
        return near[n][0] if np.isfinite(distance) else None

    element = first_of(elements)
    if element is not None:
        return "_".join(name_of(element, normal).split()).lower() or "unnamed"
    return "opening" if first_of(spaces) is not None else "unnamed"


def surroundings(building, space, low, high):
    """Elements and other spaces that reach into the box around the space, with their triangles and their own boxes."""
    products = [
        product
        for product in building.by_type("IfcElement") + building.by_type("IfcSpace")
        if product != space and product.Representation is not None and not any(map(product.is_a, PASSED_OVER))
    ]
    near, made = [], set()
    shapes = ifcopenshell.geom.iterator(settings(), building, os.cpu_count() or 1, include=products) if products else ()
    for shape in shapes:
        made.add(shape.id)
        corners = triangles(shape)
        box = (corners.min((0, 1)), corners.max((0, 1))) if len(corners) else ()
        if box and (box[0] <= high).all() and (box[1] >= low).all():
            near.append((building.by_id(shape.id), corners, *box))
    for product in products:
        if product.id() not in made:
            print(f"left out: {product.is_a()} {product.GlobalId}: no triangles can be made of its geometry", file=sys.stderr)
    near.sort(key=lambda one: one[0].id())
    return [one for one in near if not one[0].is_a("IfcSpace")], [one for one in near if one[0].is_a("IfcSpace")]


def convert(building, space, out):
    try:
        inner = triangles(ifcopenshell.geom.create_shape(settings(), space))
    except RuntimeError as error:
        sys.exit(f"{sys.argv[1]}: the space {sys.argv[2]}: no triangles can be made of its geometry: {error}")
    if not len(inner):
        sys.exit(f"{sys.argv[1]}: the space {sys.argv[2]} has no surface")
    unmatched = unmatched_edges(inner)
    if unmatched:
        print(f"the space is not closed, or its faces are not oriented consistently, at {unmatched} edges: do not trust volume and names", file=sys.stderr)
    local = inner - inner[0, 0]
    volume = np.einsum("ij,ij->i", local[:, 0], np.cross(local[:, 1], local[:, 2])).sum() / 6
    if volume < 0:
        inner, volume = inner[:, ::-1], -volume
    elements, spaces = surroundings(building, space, inner.min((0, 1)) - REACH_M, inner.max((0, 1)) + REACH_M)
    by_name = {}
    for triangle in inner:
        normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        if not np.linalg.norm(normal) > 0:
            continue
        normal /= np.linalg.norm(normal)
        for name, piece in named_pieces(triangle, lambda place: name_behind(place, normal, elements, spaces)):
            by_name.setdefault(name, []).append(piece)
    write(out, f"{space.Name or space.GlobalId}: {volume:.3f} m3", by_name)
    for name in sorted(by_name):
        corners = np.array(by_name[name])
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        print(f"{name}: {areas.sum():.3f} m2, {len(corners)} triangles")
    print(f"volume: {volume:.3f} m3")
    scale = ifcopenshell.util.unit.calculate_unit_scale(building, "VOLUMEUNIT")
    for quantities in ifcopenshell.util.element.get_psets(space, qtos_only=True).values():
        for name in quantities.keys() & {"NetVolume", "GrossVolume"}:
            print(f"{name} as the file states it: {quantities[name] * scale:.3f} m3")


def write(out, remark, by_name):
    draft = f"{out}.{os.getpid()}.tmp"
    with open(draft, "w", encoding="utf-8") as file:
        print(f"# {remark}", file=file)
        count = 0
        for name in sorted(by_name):
            print(f"usemtl {name}", file=file)
            for corners in by_name[name]:
                for corner in corners:
                    print("v {:.6f} {:.6f} {:.6f}".format(*corner), file=file)
                print(f"f {count + 1} {count + 2} {count + 3}", file=file)
                count += 3
    os.replace(draft, out)


def main():
    if len(sys.argv) not in (2, 4):
        sys.exit(__doc__)
    try:
        building = ifcopenshell.open(sys.argv[1])
        spaces = building.by_type("IfcSpace")
    except (OSError, RuntimeError, ifcopenshell.Error) as error:
        sys.exit(f"{sys.argv[1]}: {error}")
    if not spaces:
        sys.exit(f"{sys.argv[1]}: the file has no IfcSpace: export the building with its rooms")
    if len(sys.argv) == 2:
        for space in spaces:
            above = ifcopenshell.util.element.get_aggregate(space)
            storey = (above.Name or above.GlobalId) if above else "-"
            print(space.GlobalId, storey, space.Name or "", space.LongName or "", sep="\t")
        return
    found = [space for space in spaces if sys.argv[2] in (space.Name, space.LongName, space.GlobalId)]
    if len(found) != 1:
        sys.exit(f"{sys.argv[1]}: {len(found)} spaces are called {sys.argv[2]}; without a name the spaces are listed")
    if found[0].Representation is None:
        sys.exit(f"{sys.argv[1]}: the space {sys.argv[2]} has no geometry")
    convert(building, found[0], sys.argv[3])


if __name__ == "__main__":
    main()
