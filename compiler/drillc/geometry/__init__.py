"""Shapes, meshes, distances and collisions. Knows nothing of the language or of controllers."""
