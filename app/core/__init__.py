"""Shared parts of all features: the state, the store, the bridge to the page, cells, forms."""
