"""What an identification leaves: an axis file, a job that shows the rest."""
