"""Does it hold in Drake? The grasp in a MultibodyPlant, side by side with the mathematics.

| file | what it holds |
|---|---|
| certify_in_plant.py | five verdicts on a grasp, of mathematics and of Drake: `certify_in_plant` |
| scratch_plant.py | plants of our own with the object and three fingertips |
| drake_calls.py | Drake's refusals as answers |
| surface_distance.py | signed distances to a body's own collision geometry |
| contact_geometry.py | whether fingertips touch the object where the grasp says |
| clearance.py | whether fingertips penetrate links on joints or the user's scene |
| statics.py | Drake's contact forces under gravity along each axis |
| simulation.py | fingertips that hold the object through time |
| grasp_forces.py | a grasp as a system of a diagram: `GraspForces` |
"""
