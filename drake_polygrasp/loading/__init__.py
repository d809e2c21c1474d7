"""From model files or a live plant to the object to grasp: where Drake reads.

`object_model` is the entry for files. `model_source` finds a model and all files it refers to,
before Drake may read them (`model_document`, `mesh_file`); `parsed_model` has Drake read them;
`shapes` turns collision geometry into triangles; `model_statements` tells what the file states from
what Drake assumed where it states nothing. `plant_object` and `plant_obstacles` are the entries for
a plant in its user's diagram (`live_plant`); `body_object` is what files and plants share.
"""
