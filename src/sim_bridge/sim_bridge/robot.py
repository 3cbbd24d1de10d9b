"""The arm and hand that PyBullet's data has a model of, and for whose dimensions the tasks are laid out."""

from panda_model import load_preset

ROBOT = load_preset("panda")
HAND = ROBOT.hand
# What an opened finger takes beside a thing: its thickness, the free space that it needs and a margin [m].
BESIDE = HAND.finger_thickness + HAND.finger_slack + 0.0033
HOME_TOLERANCE = 0.02  # of each joint from `ROBOT.ready`, within which the arm is at home [rad]
