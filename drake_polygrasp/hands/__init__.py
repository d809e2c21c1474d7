"""Hands: what a hand is, what it reaches, and postures in which it holds an object.

| file | what it holds |
|---|---|
| description.py | reads and writes the YAML file of a hand |
| model.py | loads a hand: `load_hand` |
| hand.py | the hand as a value, with forward kinematics |
| in_plant.py | adds a hand to a plant and finds its elements there |
| couplings.py | which joints are independent, and how the others follow them |
| library.py | random postures of a hand, and what its tips reach in them |
| check.py | what a hand can do, and what may keep it from grasping: `check_hand` |
| tip_fit.py | how well the sphere of a fingertip fits its geometry |
| scene.py | hand, object and what is around it in one scratch plant: `HandScene` |
| starts.py | postures of the library, moved onto contacts by Kabsch's fit |
| posture.py | postures that touch contacts, by inverse kinematics: `find_posture` |
| measured_posture.py | how well a posture touches the contacts, and what it is clear of |
| torque.py | joint torques that squeeze and hold: `holding_torque` |
| squeeze.py | how hard a hand squeezes, beside what errors ask for |
| margin.py | how far a hand's grasp is from its bounds |
| approach.py | how fingers open, and a straight way to the object: `find_pregrasp` |
| hand_search.py | all of these for many candidates, breadth-first: `HandSearch` |
"""
