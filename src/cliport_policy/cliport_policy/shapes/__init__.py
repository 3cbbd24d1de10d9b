"""Named shapes: what a sentence calls one, and which things on the table have its outline."""
