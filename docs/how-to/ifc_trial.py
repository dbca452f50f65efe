"""A building to try ifc_to_room.py on: a room of 5 m x 4 m x 2.6 m, turned by 30 degrees, in millimetres.

usage: ifc_trial.py OUT.ifc

Two walls are extruded and have layers, two are tessellated; the floor is tessellated, the ceiling extruded; the space is tessellated.
"""

import sys

import ifcopenshell
import ifcopenshell.api.aggregate
import ifcopenshell.api.context
import ifcopenshell.api.geometry
import ifcopenshell.api.material
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.unit
import numpy as np

SIZE = (5000.0, 4000.0, 2600.0)
THICK = 200.0


def box(low, high):
    corners = [(x, y, z) for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])]
    faces = [(1, 3, 4), (1, 4, 2), (5, 6, 8), (5, 8, 7), (1, 2, 6), (1, 6, 5), (3, 7, 8), (3, 8, 4), (1, 5, 7), (1, 7, 3), (2, 4, 8), (2, 8, 6)]
    return corners, faces


def main():
    model = ifcopenshell.api.project.create_file(version="IFC4")
    project = ifcopenshell.api.root.create_entity(model, ifc_class="IfcProject", name="trial")
    length = ifcopenshell.api.unit.add_si_unit(model, unit_type="LENGTHUNIT", prefix="MILLI")
    ifcopenshell.api.unit.assign_unit(model, units=[length])
    context = ifcopenshell.api.context.add_context(model, context_type="Model")
    body = ifcopenshell.api.context.add_context(
        model, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=context
    )
    site = ifcopenshell.api.root.create_entity(model, ifc_class="IfcBuildingStorey", name="storey")
    ifcopenshell.api.aggregate.assign_object(model, products=[site], relating_object=project)
    turned = np.eye(4)
    turned[:2, :2] = [[np.cos(np.pi / 6), -np.sin(np.pi / 6)], [np.sin(np.pi / 6), np.cos(np.pi / 6)]]
    turned[:3, 3] = [12.0, -3.0, 1.5]

    def element(ifc_class, name, low, high, tessellated, materials):
        made = ifcopenshell.api.root.create_entity(model, ifc_class=ifc_class, name=name)
        if tessellated:
            corners, faces = box(low, high)
            item = model.createIfcTriangulatedFaceSet(model.createIfcCartesianPointList3D(corners), None, True, faces)
            kind = "Tessellation"
        else:
            size = [h - l for l, h in zip(low, high)]
            middle = model.createIfcAxis2Placement2D(model.createIfcCartesianPoint(((low[0] + high[0]) / 2, (low[1] + high[1]) / 2)))
            profile = model.createIfcRectangleProfileDef("AREA", None, middle, size[0], size[1])
            place = model.createIfcAxis2Placement3D(model.createIfcCartesianPoint((0.0, 0.0, low[2])))
            item = model.createIfcExtrudedAreaSolid(profile, place, model.createIfcDirection((0.0, 0.0, 1.0)), size[2])
            kind = "SweptSolid"
        shape = model.createIfcShapeRepresentation(body, "Body", kind, [item])
        ifcopenshell.api.geometry.assign_representation(model, product=made, representation=shape)
        ifcopenshell.api.geometry.edit_object_placement(model, product=made, matrix=turned.copy(), is_si=True)
        if len(materials) == 1:
            one = ifcopenshell.api.material.add_material(model, name=materials[0])
            ifcopenshell.api.material.assign_material(model, products=[made], material=one)
        elif materials:
            layers = ifcopenshell.api.material.add_material_set(model, name=name, set_type="IfcMaterialLayerSet")
            for material in materials:
                one = ifcopenshell.api.material.add_material(model, name=material)
                layer = ifcopenshell.api.material.add_layer(model, layer_set=layers, material=one)
                ifcopenshell.api.material.edit_layer(model, layer=layer, attributes={"LayerThickness": THICK / len(materials)})
            usage = model.createIfcMaterialLayerSetUsage(layers, "AXIS2", "POSITIVE", low[1])
            model.createIfcRelAssociatesMaterial(ifcopenshell.guid.new(), None, None, None, [made], usage)

    x, y, z = SIZE
    t = THICK
    element("IfcSpace", "studio", (0, 0, 0), SIZE, True, [])
    # Layers are counted along y: the space lies behind the wall at y < 0, before the one at y > 4 m.
    element("IfcWall", "front", (-t, -t, 0), (x + t, 0, z), False, ["Brick", "Acoustic Plaster"])
    element("IfcWall", "back", (-t, y, 0), (x + t, y + t, z), False, ["Gypsum Board", "Brick"])
    element("IfcWall", "left", (-t, 0, 0), (0, y, z), True, ["Concrete"])
    element("IfcWall", "right", (x, 0, 0), (x + t, y, z), True, [])
    element("IfcSlab", "floor", (-t, -t, -t), (x + t, y + t, 0), True, ["Parquet"])
    element("IfcSlab", "ceiling", (-t, -t, z), (x + t, y + t, z + t), False, ["Concrete"])
    model.write(sys.argv[1])


main()
