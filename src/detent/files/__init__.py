"""What a text file of detent says: places, problems, fields, units."""
