"""What a person looks at after a run: one HTML page, and figures as files."""
