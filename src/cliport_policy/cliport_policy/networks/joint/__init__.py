"""Joint network: one encoder, two decoders, a rotator, and heads for the primitive and the null actions."""
