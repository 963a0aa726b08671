"""Lists of moves: the job, its run and its page, for every axis that makes them."""
