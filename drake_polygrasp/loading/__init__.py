"""From model files or a live plant to the object to grasp: where Drake reads.

`object_model` is the entry for files. `model_source` finds a model and all files it refers to,
before Drake may read them (`packages`, `model_document`, `xml_reader`, `mesh_file`,
`model_checks`); `parsed_model` has Drake read them; `shapes` turns collision geometry into
triangles;
`model_statements` tells what the file states from what Drake assumed where it states nothing
(`model_instances`, `mjcf_statements`, `unread_friction`). `plant_object` and `plant_obstacles` are
the entries for a plant in its user's diagram (`live_plant`); `body_object` is what files and plants
share.
"""
