"""Parts that tasks are made of: goals and their score, free places, clearance for the hand, and ways to hold things."""
