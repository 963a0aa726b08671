"""Every reader of what comes from outside, compared with damaged inputs: a result or detent's own error, in time."""
