"""Pure functions, numpy in and numpy out: rotations, posture, portal. No language, no files."""
