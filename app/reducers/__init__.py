"""What each kind of event does to the state: one module for each module of `events`."""
