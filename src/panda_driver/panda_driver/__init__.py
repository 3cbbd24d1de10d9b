"""Driver of a Franka arm and hand by libfranka, and a test of any arm behind the same actions."""
