"""Jinja templates, one folder a controller."""
