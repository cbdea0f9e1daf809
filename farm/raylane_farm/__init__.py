"""Spreads Raylane's pictures over the workers of a Dask cluster."""

__version__ = "0.1.0"
