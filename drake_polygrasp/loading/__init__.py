"""From model files or a live plant to the object to grasp: where Drake reads.

| file | what it holds |
|---|---|
| object_model.py | the entry for files: `load_object` |
| plant_object.py | the entry for a body of a plant in its user's diagram |
| plant_obstacles.py | the other bodies of that plant as obstacles |
| surroundings.py | the other bodies of a scene, for checks in plants of our own |
| live_plant.py | what a context says of a plant's scene, or what is missing to ask |
| body_object.py | what files and plants share: a body's collision geometry as the object to grasp |
| rigid_group.py | links that a model fixes to one another, as one rigid body |
| shapes.py | Drake's collision shapes as triangles and curved solids |
| scale.py | the scale of an OBJ model, and lengths that look like no metres |
| model_source.py | all files that a model refers to, and their digest, before Drake reads them |
| packages.py | the packages that URIs name |
| model_document.py | reads one document of a model, XML or directives |
| xml_reader.py | reads XML as Drake does |
| mesh_file.py | what must be true of a mesh file before Drake reads it |
| obj_file.py | vertices and faces of a Wavefront OBJ file |
| gltf_file.py | what must be true of a glTF file, and the files it is made of |
| numbers.py | arrays of the numbers that are written in a file |
| collision_mesh.py | the surface that a Mesh or Convex shape stands for |
| model_in_plant.py | adds a model file to a plant of the user's: `add_model` |
| parsed_model.py | has Drake read a model file |
| drake_messages.py | the warnings and errors that Drake logs, shortened for users |
| model_checks.py | refuses impossible sizes and masses |
| model_statements.py | tells what files state from what Drake assumes |
| model_instances.py | where documents state each model instance |
| mjcf_statements.py | the bodies, geoms and defaults of an MJCF file |
| unread_friction.py | friction that files state and Drake does not read |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drake_polygrasp import lazy_names

if TYPE_CHECKING:
    from drake_polygrasp.loading.model_in_plant import add_model

__all__ = [
    "add_model",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "model_in_plant": ("add_model",),
    },
)
