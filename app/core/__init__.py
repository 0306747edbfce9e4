"""Shared infrastructure: the state, the store, the bridge to the page, cells, forms."""
