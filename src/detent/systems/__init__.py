"""One module per method: the whole axis wired as its block diagram."""
