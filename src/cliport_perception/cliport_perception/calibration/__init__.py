"""The calibration of a fixed camera against the arm: boards, sightings, solvers, files and the live procedure."""
