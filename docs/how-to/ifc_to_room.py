"""Makes the mesh of a room for Sabine from a space of an IFC file: triangles in metres, named by the material behind each.

usage: ifc_to_room.py BUILDING.ifc                     lists the spaces
       ifc_to_room.py BUILDING.ifc SPACE OUT.obj       SPACE is a name or a GlobalId

Needs ifcopenshell (LGPL, PyPI), which makes triangles of every kind of geometry that IFC knows, tessellated or not. A triangle of the
space is named by the element that a ray from its middle meets first within REACH_M: its material (of layers the one next to the
space), else its class. What meets nothing is called `unnamed`.
"""

import os
import sys

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.element
import ifcopenshell.util.placement
import numpy as np

REACH_M = 0.5


def settings():
    made = ifcopenshell.geom.settings()
    made.set("use-world-coords", True)
    return made


def materials_of(element):
    """Names of an element's materials, in the order of its layers."""
    material = ifcopenshell.util.element.get_material(element, should_skip_usage=True)
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
    return vertices[np.array(shape.geometry.faces).reshape(-1, 3)]


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
    usage = ifcopenshell.util.element.get_material(element, should_skip_usage=False)
    if len(names) > 1 and usage is not None and usage.is_a("IfcMaterialLayerSetUsage"):
        axis = {"AXIS1": 0, "AXIS2": 1, "AXIS3": 2}[usage.LayerSetDirection]
        placement = ifcopenshell.util.placement.get_local_placement(element.ObjectPlacement)
        along = placement[:3, axis] @ towards * (-1.0 if usage.DirectionSense == "NEGATIVE" else 1.0)
        return names[0] if along > 0 else names[-1]
    return names[0]


def convert(building, space, out):
    made = settings()
    inner = triangles(ifcopenshell.geom.create_shape(made, space))
    around = []
    for element in building.by_type("IfcElement"):
        if element.is_a("IfcOpeningElement") or element.Representation is None:
            continue
        try:
            around.append((element, triangles(ifcopenshell.geom.create_shape(made, element))))
        except RuntimeError as error:
            print(f"left out: {element.is_a()} {element.GlobalId}: {error}", file=sys.stderr)
    volume = np.einsum("ij,ij->i", inner[:, 0], np.cross(inner[:, 1], inner[:, 2])).sum() / 6
    if volume < 0:
        inner, volume = inner[:, ::-1], -volume
    by_name = {}
    for corners in inner:
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        if not np.linalg.norm(normal) > 0:
            continue
        normal /= np.linalg.norm(normal)
        middle = corners.mean(axis=0)
        hits = [(first_hit(shape, middle, normal), n) for n, (_, shape) in enumerate(around)]
        distance, nearest = min(hits, default=(np.inf, 0))
        name = name_of(around[nearest][0], normal) if np.isfinite(distance) else "unnamed"
        by_name.setdefault("_".join(name.split()).lower(), []).append(corners)
    draft = f"{out}.{os.getpid()}.tmp"
    with open(draft, "w", encoding="utf-8") as file:
        print(f"# {space.Name or space.GlobalId}: {volume:.3f} m3", file=file)
        count = 0
        for name in sorted(by_name):
            print(f"usemtl {name}", file=file)
            for corners in by_name[name]:
                for corner in corners:
                    print("v {:.6f} {:.6f} {:.6f}".format(*corner), file=file)
                print(f"f {count + 1} {count + 2} {count + 3}", file=file)
                count += 3
    os.replace(draft, out)
    for name in sorted(by_name):
        corners = np.array(by_name[name])
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        print(f"{name}: {areas.sum():.3f} m2, {len(corners)} triangles")
    print(f"volume: {volume:.3f} m3")


def main():
    if len(sys.argv) not in (2, 4):
        sys.exit(__doc__)
    building = ifcopenshell.open(sys.argv[1])
    spaces = building.by_type("IfcSpace")
    if len(sys.argv) == 2:
        for space in spaces:
            print(space.GlobalId, space.Name or "", space.LongName or "")
        return
    found = [space for space in spaces if sys.argv[2] in (space.Name, space.LongName, space.GlobalId)]
    if len(found) != 1:
        sys.exit(f"{sys.argv[1]}: {len(found)} spaces are called {sys.argv[2]}; without a name the spaces are listed")
    if found[0].Representation is None:
        sys.exit(f"{sys.argv[1]}: the space {sys.argv[2]} has no geometry")
    convert(building, found[0], sys.argv[3])


if __name__ == "__main__":
    main()
