"""Reads emitted programs back, runs them as their controllers would, and proves them."""
