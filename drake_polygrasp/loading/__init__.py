"""Loads the object to grasp, with Drake, from model files or from a plant.

| file | what it holds |
|---|---|
| object_model.py | loads the object from a model file: `load_object` |
| examples.py | the models that come with the package: `example_models` |
| mesh_object.py | makes the object from arrays of vertices and triangles: `object_from_mesh` |
| plant_object.py | makes the object from a body of the user's plant: `object_from_plant` |
| plant_obstacles.py | the other bodies of that plant as obstacles: `obstacles_from_plant` |
| surroundings.py | the other bodies of a scene as Drake's shapes, for checks in our own plants |
| live_plant.py | finds a body in the user's plant and checks its context |
| body_object.py | what files and plants share: makes the object from collision geometry |
| rigid_group.py | the links that welds make one rigid body, and those on its joints |
| shapes.py | converts Drake's collision shapes to triangles and curved solids |
| scale.py | the scale of an OBJ model, and warnings of lengths that are unlikely in metres |
| model_source.py | finds all files that a model refers to, and their digest |
| packages.py | finds the packages that URIs name |
| model_document.py | reads one document of a model, XML or directives |
| xml_reader.py | reads XML as Drake does |
| mesh_file.py | checks a mesh file before Drake reads it |
| obj_file.py | reads and writes Wavefront OBJ files |
| gltf_file.py | checks a glTF file, and finds its buffer files |
| numbers.py | converts the words of a file to arrays of numbers |
| collision_mesh.py | the true surface of a Mesh or Convex shape, repaired where Drake misreads it |
| model_in_plant.py | adds a model file to the user's plant: `add_model` |
| parsed_model.py | parses a model file with Drake, and chooses the body to grasp |
| drake_messages.py | the warnings and errors that Drake logs, shortened for users |
| model_checks.py | refuses impossible sizes and masses, and xacro |
| model_statements.py | which masses and friction coefficients the files state |
| model_instances.py | finds where documents state each model instance |
| mjcf_statements.py | the bodies, geoms and defaults of an MJCF file |
| unread_friction.py | friction that files state in elements that Drake does not read |
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
