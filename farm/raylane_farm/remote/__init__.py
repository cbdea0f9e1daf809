"""What runs on the workers; the client sends this folder to them as source.

It imports nothing but the standard library and Dask, and works in any Python from 3.9 on, so that
workers need `distributed` and `raylane`, nothing else.
"""
