"""blender --python blender_picture.py -- GLB PNG: imports the file, says what came of it, and renders it once."""
import sys

import numpy

if not hasattr(numpy, "bool"):  # the importer of Debian 12's Blender 3.4 asks for a name that its numpy no longer has
    numpy.bool = bool
import bpy
from mathutils import Vector

source, picture = sys.argv[sys.argv.index("--") + 1 :][:2]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=source)
meshes = [o for o in bpy.data.objects if o.type == "MESH"]
images = [tuple(i.size) for i in bpy.data.images]
print("imported", sum(len(o.data.polygons) for o in meshes), "polygons,", images)
assert meshes and images and all(side > 0 for size in images for side in size)

corners = [o.matrix_world @ Vector(c) for o in meshes for c in o.bound_box]
low, high = (Vector([limit(p[k] for p in corners) for k in range(3)]) for limit in (min, max))
centre, radius = (low + high) / 2, (high - low).length / 2
towards = Vector((0.5, -1, 0.4)).normalized()
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.location = centre + towards * radius * 3.2
camera.rotation_euler = (-towards).to_track_quat("-Z", "Y").to_euler()
camera.data.clip_start, camera.data.clip_end = radius * 0.01, radius * 10
scene = bpy.context.scene
scene.collection.objects.link(camera)
scene.camera = camera
scene.world = bpy.data.worlds.new("white")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs[0].default_value = (1, 1, 1, 1)
scene.render.engine = "CYCLES"
scene.cycles.samples, scene.cycles.use_denoising = 4, False
scene.render.resolution_x = scene.render.resolution_y = 192
scene.render.filepath = picture
bpy.ops.render.render(write_still=True)
