"""The page on which a person demonstrates: draw a box, click a rotation, watch the arm do it."""
