"""Grasp files in the formats of other programs, one file a format.

| file | what it holds |
|---|---|
| directives.py | model directives of Drake: `export_directives`, `contact_poses` |
"""
