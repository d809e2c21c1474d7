"""Beyond the paper: a search for contacts of greater epsilon on the same faces.

This room does not import the paper: the pipeline passes in what the search needs of it.

| file | what it holds |
|---|---|
| effort.py | how long is searched |
| sample_points.py | points on regions, to look for contacts among |
| face_support.py | h(w) as a function of where contacts lie on their faces |
| set_cover.py | the three of many points that reach highest in all directions |
| triples.py | the best triples of sample points, however many there are |
| every_set.py | triples of sample points on each of many sets of faces |
| set_bounds.py | bounds of epsilon over all contacts on a set of faces |
| local_improvement.py | contacts that move within their regions while epsilon rises |
| selection.py | which triples are improved, and in what order they are preferred |
| reach.py | what a hand reaches: postures whose tips nearly fit a triple of contacts |
| reachable.py | triples of sample points that a hand reaches |
| fingertip_room.py | the parts of regions where fingertips have room |
"""
