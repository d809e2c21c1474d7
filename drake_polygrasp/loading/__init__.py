"""From model files to the object to grasp: the end of the package where Drake reads.

`object_model` is the entry. `model_source` finds a model and all files it refers to, before Drake
may read them (`model_document`, `mesh_file`); `parsed_model` has Drake read them; `shapes` turns
collision geometry into triangles; `model_statements` tells what the file states from what Drake
assumed where it states nothing.
"""
