"""Pick and place with a Panda: kinematics, grasp, planning, trajectories and the executor node."""
