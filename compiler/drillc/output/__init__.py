"""From a Program to files: posts, staged templates, names, numbers, writing."""
