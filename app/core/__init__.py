"""What all features share: the state, the store, the bridge to the page, cells and forms."""
