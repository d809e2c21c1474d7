"""The paper: Prado & Suárez, Heuristic Grasp Planning with Three Frictional Contacts.

| section | what it does | file | entry | test |
|---|---|---|---|---|
| 4.1, 4.2 | faces that oppose each other by orientation | orientation.py | opposes, pair_opposes | test_orientation.py |
| 4.1 | parallel or not, n_bs | orientation.py | classify | test_orientation.py |
| 4.1, 4.2 | faces that face each other by position | position.py | region_rl, strip_rs, parallel_faces_meet, two_faces_meet | test_position.py |
| 5 | plane Pi_p of three faces | grasp_plane.py | nonparallel_planes, parallel_directions | test_grasp_plane.py |
| 5 | plane Pi_p of two faces | two_faces.py | choices, two_face_planes | test_grasp_plane.py |
| 4.1, 5, 6 | strips, and hulls within them | strips.py | strips_meet, hulls_in_strips | test_position.py |
| 6 | segments a_i and region P | region_p.py | cut_nonparallel, cut_parallel, cut_two_faces | test_region_p.py |
| 6 | quality Q, eq. 5-10 | quality.py | q_positions, q_orientation, q_directions | test_quality.py |
| 7 | contact points | contact_points.py | nonparallel_contacts, opposed_contacts | test_contact_points.py |
| 4-7 | the flow chart | planner.py | plan_sets | test_reference_planner.py |
| 4-7 | what becomes of a set | outcome.py | REASONS, SetPlan | test_reference_planner.py |
| beyond | which steps, and which grasps they start from | variants.py | Steps, improved_triples | test_improvement.py |
| beyond | how long is searched | effort.py | FULL, QUICK | test_pipeline.py |
| beyond | points on faces | sample_points.py | sample_points | test_search.py |
| beyond | triples of them, however many | search.py | best_triples | test_search.py |
| beyond | three that reach highest in all directions | set_cover.py | cover | test_search.py |
| beyond | contacts that move while epsilon rises | improvement.py | improved | test_improvement.py |
| beyond | how far W reaches, nearly, at a few microseconds a grasp | epsilon_estimate.py | epsilon_estimates | test_improvement.py |
| beyond | h(w) as a function of places on faces | face_support.py | face_twists | test_search.py |
| beyond | how near to the best grasp there is | optimum.py | bound_optimum | test_gap.py |
| beyond | what bounds epsilon while contacts move | cell_bounds.py | bounded | test_gap.py |
| beyond | where fingertips have room | tip_room.py | with_tip_room | test_search.py |

Section 2 (faces, edges) is geometry/polyhedron.py; Section 3 (force closure) is
certification/ and wrench.py, because Proposition 1 as printed is not a test. Everything here is
numpy and shapely on batches of sets; each file says where it departs from the text and why.
"""  # noqa: E501 - a table
