"""Every reader of what comes from outside, held against damaged inputs: a result or detent's own error, in time."""
