"""Recordings: reading, cleaning, what is guessed and what is found."""
