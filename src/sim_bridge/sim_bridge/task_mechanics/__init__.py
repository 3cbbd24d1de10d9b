"""What tasks are made of: goals and their score, free places, room for the hand, and ways to hold things."""
