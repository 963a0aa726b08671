"""The supervisor's choices: print jobs read, and each line given a direction, a speed and its turning points."""
