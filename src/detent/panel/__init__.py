"""The operator panel in the browser: a process of its own that attaches to the channel of a live axis."""
